"""From frames to points: the means over frames that tables show. Spreads are never taken over frames."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from ..files import plain
from . import costs
from .record import Record
from .table import PART_COLUMNS, table_of

if TYPE_CHECKING:
    from pandas import DataFrame, Series

PER_FRAME = (
    "total_ms q1_ms q3_ms iqr_ms wall_ms submitted_ms build_ms trace_ms light_build_ms shadow_ms "
    "build_iqr_ms trace_iqr_ms light_build_iqr_ms shadow_iqr_ms flip"
).split() + costs.NUMBERS
SERIES = ("pass.", "counter.", "primary.", "shadow.", "round.")
GREATEST = ["memory_bytes", "regrown", "excused_share", "started"]
RAYS = ["shadow_rays", "mirrored_rays"]
SUMS = ["pixels_scored", "reference_errors"]


def points(table: DataFrame) -> DataFrame:
    """One row per point of a tidy table, in its order: the columns of :func:`.results.table.tidy`, over the point's
    frames.

    Times, counters, classes and FLIP are means over the frames, as an animation's time is the sum over its frames.
    docs/results-table.md says how the other columns are joined, and which come in addition.
    """
    import pandas as pd

    groups = table.groupby("key", sort=False)
    means = [c for c in table if c in PER_FRAME or c.startswith(SERIES)]
    apart = {*means, *GREATEST, *SUMS, "key", "frame", "samples", "check", *RAYS, "true_errors", "unscored"}
    found = pd.concat(
        [
            groups[[c for c in table if c not in apart]].first(),
            groups[means].mean(),
            groups[GREATEST].max(),
            groups[SUMS].sum(),
            groups["samples"].min().fillna(0),
            _checks(table),
            groups[RAYS].mean().astype("float64").where(groups[RAYS].count().eq(groups.size(), axis=0)),
            groups["frame"].count().astype("Int64").rename("frames"),
            _frame_numbers(table),
            *_errors(table),
        ],
        axis=1,
    ).copy()  # in one piece: hundreds of columns came from a handful of tables
    rounds = [c for c in table if c.startswith("round.")]
    # A round that did not measure every frame has no time of the point.
    times = found[rounds].where(groups[rounds].count().eq(found["frames"], axis=0))
    between = (times.max(axis=1) - times.min(axis=1)).fillna(0.0).where(found["frames"] > 0)
    parts = sum(found[f"{column}_ms"] for column in PART_COLUMNS.values())
    rays = {
        "primary": found["pixels"].where(_traces(found, "trace"), 0),
        "shadow": found["shadow_rays"].where(_traces(found, "shadow"), 0),
    }
    rays["frame"] = rays["primary"] + rays["shadow"]
    ms = {"primary": found["trace_ms"], "shadow": found["shadow_ms"], "frame": found["total_ms"]}
    rates = {
        f"{name}_mrays_per_s": rays[name].astype("float64").where(rays[name] > 0) / ms[name].where(ms[name] > 0) / 1e3
        for name in ms
    }
    derived = {
        "between_ms": between, "stage_gap": (parts - ms["frame"]) / ms["frame"].where(ms["frame"] != 0),
        "wrong_per_frame": found["true_errors"].astype("float64") / found["frames"].astype("float64"), **rates,
    }  # fmt: skip
    return pd.concat([found, pd.DataFrame(derived)], axis=1).reset_index()


def _traces(found: DataFrame, part: str) -> Series:
    """Whether the frames of a point trace rays in a part: all that are rebuilt, and others that have a pass of the part."""
    passes = found[[name for name in found if name.startswith(f"pass.{part}.")]]
    return (found["moved"] == "") | passes.notna().any(axis=1)


def _checks(table: DataFrame) -> Series:
    """The check of each point: "failed" if that of a frame did, "" if no frame has one."""
    own = table[["key", "check"]]
    groups = own.assign(failed=own["check"] == "failed", known=own["check"]).groupby("key", sort=False)
    return groups["known"].max().mask(groups["failed"].any(), "failed").rename("check")


def _frame_numbers(table: DataFrame) -> Series:
    """The numbers of the measured frames of each point, as a tuple."""
    import pandas as pd

    numbers: dict[str, tuple[int, ...]] = dict.fromkeys(table["key"], ())
    measured = table[table["frame"].notna()]
    for key, frame in zip(measured["key"], measured["frame"], strict=True):
        numbers[key] += (frame,)
    return pd.Series(numbers, dtype="object", name="frame_numbers").rename_axis("key")


def _errors(table: DataFrame) -> list[Series]:
    """Errors count even if other frames were not judged; "no errors" needs all frames."""
    groups = table.groupby("key", sort=False)
    frames, known, wrong = groups["frame"].count(), groups["true_errors"].count(), groups["true_errors"].sum()
    all_of_them = (known == frames) & (known > 0)
    reason = table["unscored"].where(table["unscored"] != "").groupby(table["key"], sort=False).first().fillna("")
    counted = known.astype(str) + " of " + frames.astype(str) + " frames scored: " + reason
    return [
        wrong.where((wrong > 0) | all_of_them).rename("true_errors"),
        reason.where((known == 0) | all_of_them, counted).rename("unscored"),
    ]


def point_rows(records: Iterable[Record]) -> list[dict[str, Any]]:
    """:func:`points` of records as JSON can hold them: None where something is not known."""
    found = points(table_of(records))
    known = found[[c for c in found if "." not in c]].astype("object")
    return [plain(row) for row in known.where(known.notna(), None).to_dict("records")]
