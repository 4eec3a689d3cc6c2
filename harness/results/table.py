"""The results of a folder as pandas DataFrames: :func:`tidy`, one row per point and frame; :func:`samples`, one row per
sample.

>>> from shadowbench.harness.results import tidy
>>> table = tidy("results/nvidia-h200/frame_time")
>>> table.pivot_table(index="scene", columns="label", values="total_ms")

pandas is imported when a table is made, not when this module is: most commands need none.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..arrays import F64, I64
from ..frame.registry import label_of
from ..frame.schedule.passes import BUILD_PARTS, PARTS
from ..texts import scalar
from . import costs
from .record import Frame, Record
from .schema import folders_with_records, newest_as, place_name, settings_text

if TYPE_CHECKING:
    from pandas import DataFrame, Series

PART_COLUMNS = {part: part.replace(" ", "_") for part in PARTS}
"""The names of a frame's parts in the names of columns: ``light build`` is ``light_build_ms``."""

BACKWARDS = 0.05  # a part below minus this share of its frame shows that the times of passes contradict each other

COUNTS = (  # columns of whole numbers: `Int64`, `<NA>` where not known
    "triangles vertices invalid_triangles frame_count width height pixels lights targets rounds frames_left_out frame "
    "samples regrown memory_bytes peak_rss_bytes shadow_rays mirrored_rays pixels_scored true_errors reference_errors "
    "pass_count build_count"
).split()

NUMBERS = (  # columns of numbers: `float64`, `NaN` where not known
    "light_distance light_turns compile_s first_frame_s total_ms q1_ms q3_ms iqr_ms wall_ms submitted_ms "
    "build_ms trace_ms light_build_ms shadow_ms build_iqr_ms trace_iqr_ms light_build_iqr_ms shadow_iqr_ms "
    "excused_share flip started"
).split() + [*costs.NUMBERS, *costs.LATENCIES]

TEXTS = (  # columns of text: "" where not known, never missing
    "key folder run experiment scene scene_title stand_in scene_sha256 source source_file source_sha256 left_out "
    "method method_title label settings built known_inexact method_sha256 device device_name preset status reason "
    "view light_label moved environment unscored check flip_missing stopped_by"
).split() + [*costs.MISSING]


def tidy(folder: Path | str) -> DataFrame:
    """The results of a folder, or of the folders in it where it has no records itself: one row per point and measured frame;
    a point without one has one row, with its reason. docs/results-table.md says what each column is.

    Of several records of one table entry the one asked for last counts (:func:`.results.schema.newest`);
    ``table.attrs["older"]`` is the number of the others. Raises :class:`~.errors.UserError` where there are none.
    """
    folder = Path(folder)
    places, rows, older = folders_with_records(folder), list[dict[str, Any]](), 0
    for place in places[:1] if places[0] == folder else places:
        name = place_name(place, folder)
        before = "" if place == folder else f"{name}/"
        found, more = newest_as(place, partial(_rows, folder=name))
        rows += ({**row, "key": before + row["key"]} for own in found for row in own)
        older += more
    table = _typed(rows)
    table.attrs["older"] = older
    return table


def table_of(records: Iterable[Record], folder: str = "") -> DataFrame:
    """The rows of records, as :func:`tidy` describes them."""
    return _typed([row for record in records for row in _rows(record, folder)])


def _typed(rows: list[dict[str, Any]]) -> DataFrame:
    """Rows as a table whose declared columns have their types."""
    import pandas as pd

    table = pd.DataFrame(rows)
    for names, kind, missing in ((COUNTS, "Int64", None), (NUMBERS, "float64", np.nan), (TEXTS, "object", "")):
        kinds = {name: table[name].astype(kind) if name in table else missing for name in names}
        table = table.assign(**kinds)
    table[TEXTS] = table[TEXTS].fillna("")
    return table.copy()  # in one piece


def samples(folder: Path | str) -> DataFrame:
    """Every sample of a folder's results, in long form, tens of bytes for each: docs/results-table.md says the columns."""
    import pandas as pd

    series = [one for found in newest_as(folder, _series)[0] for one in found]
    lengths = np.array([len(one.ms) for one in series], dtype=np.int64)
    empty = [np.zeros(0)]

    def repeated(values: list[Any]) -> Any:
        return pd.Categorical(values, dict.fromkeys(values)).repeat(lengths)

    return pd.DataFrame(
        {
            "key": repeated([one.key for one in series]),
            "frame": np.repeat(np.array([one.frame for one in series], dtype=np.int64), lengths),
            "round": np.concatenate([one.rounds for one in series] or empty).astype(np.int64),
            "part": repeated([one.part for one in series]),
            "pass": repeated([one.name for one in series]),
            "sample": np.concatenate([np.arange(n) for n in lengths] or empty).astype(np.int64),
            "ms": np.concatenate([one.ms for one in series] or empty),
        }
    )


class _Samples(NamedTuple):
    """The samples of one pass, or of whole frames. ``rounds``, ``ms``: [sample]."""

    key: str
    frame: int
    part: str
    name: str
    rounds: I64
    ms: F64


def _series(record: Record) -> list[_Samples]:
    found = []
    for frame in record.measured:
        lines = [("frame", "", frame.round, frame.total_ms), ("wall", "", frame.round, frame.wall_ms)]
        lines += [(step.part, step.name, frame.stage_round, step.ms) for step in frame.passes if step.ms]
        for part, name, rounds, ms in lines:
            numbers = np.array(rounds, dtype=np.int64)
            found.append(_Samples(record.key, frame.frame, part, name, numbers, np.array(ms, dtype=np.float64)))
    return found


def stage_ms(table: DataFrame, part: str, pattern: str = "") -> Series:
    """Milliseconds of the passes of a part whose names match ``pattern`` (a regular expression), row by row."""
    found = table.filter(regex=rf"^pass\.{part}\..*(?:{pattern})").sum(axis=1)
    return found.where(table["build_ms"].notna())


def _rows(record: Record, folder: str) -> list[dict[str, Any]]:
    point = _point(record, folder)
    pixels = point["pixels"]
    rows = [(frame, _times(frame)) for frame in record.measured]
    return [
        {**point, **row, **costs.costs_of(frame, pixels, row["shadow_rays"]), **_score(frame)} for frame, row in rows
    ] or [point]


def _point(record: Record, folder: str) -> dict[str, Any]:
    """The columns that all frames of a point share."""
    scene, method, point = record.scene, record.method, record.point
    lighting, source = scene.get("lighting") or {}, scene.get("source") or {}
    parameters = method.get("parameters") or {}
    values = {**(method.get("settings") or {}), **parameters.get("build", {}), **parameters.get("trace", {})}
    asked = {k: v for k, v in point.items() if isinstance(v, str | int | float)}
    runs = dict.fromkeys(one["run"] for one in record.rounds or () if "run" in one)
    return {
        "key": record.key, "folder": folder, "run": "+".join(runs) or record.environment,
        "experiment": record.experiment, "preset": point.get("preset"), "scene": scene["name"],
        "scene_title": scene.get("title") or scene["name"], "stand_in": scene.get("stand_in"),
        "scene_sha256": scene.get("arrays_sha256"), "source": source.get("kind"), "source_file": source.get("file"),
        "source_sha256": source.get("sha256"), "left_out": source.get("left_out"),
        "triangles": scene.get("triangles"), "vertices": scene.get("vertices"),
        "invalid_triangles": scene.get("invalid_triangles") or 0, "frame_count": scene.get("frame_count"),
        "method": method["name"], "method_title": method.get("title") or method["name"], "label": label_of(method),
        "settings": settings_text(method.get("settings")), "built": settings_text(method.get("built")),
        "known_inexact": method.get("known_inexact"), "method_sha256": method.get("source_sha256"),
        "device": method["device"], "device_name": method.get("device_name"), "width": point["width"],
        "height": point["height"], "pixels": point["width"] * point["height"], "view": scene.get("view") or "",
        "light_label": lighting.get("label", ""), "lights": len(scene.get("lights") or ()),
        "targets": sum(light.get("samples", 1) for light in scene.get("lights") or ()),
        "light_distance": lighting.get("distance") or None, "light_turns": lighting.get("turns") or None,
        "moved": lighting.get("moved"), "status": record.status, "reason": record.reason,
        **costs.latencies(record.measured),
        "rounds": len({number for frame in record.measured for number in frame.round}),
        "frames_left_out": len(record.frames_left_out or ()), "compile_s": record.compile_s,
        "first_frame_s": record.first_frame_s, "peak_rss_bytes": record.peak_rss_bytes,
        "environment": record.environment, "stopped_by": record.stopped_by,
        "unscored": "" if record.measured else "not measured",
        **{f"set.{name}": scalar(value) for name, value in values.items()},
        **{f"light.{name}": scalar(value) for name, value in lighting.items() if name != "label"},
        **{f"point.{name}": value for name, value in asked.items()},
    }  # fmt: skip


def _median(samples: list[float] | None) -> float:
    return float(np.median(samples)) if samples else np.nan


def _times(frame: Frame) -> dict[str, Any]:
    low, middle, high = np.percentile(frame.total_ms, [25, 50, 75])
    total, rounds = np.asarray(frame.total_ms), np.asarray(frame.round)
    row: dict[str, Any] = {
        "frame": frame.frame, "total_ms": float(middle), "q1_ms": float(low), "q3_ms": float(high),
        "iqr_ms": float(high - low), "wall_ms": float(np.median(frame.wall_ms)),
        "submitted_ms": _median(frame.submitted_ms), "samples": len(frame.total_ms),
        "memory_bytes": frame.memory_bytes, "regrown": frame.regrown, "pass_count": len(frame.passes),
        "build_count": sum(step.part in BUILD_PARTS for step in frame.passes), "shadow_rays": _shadow_rays(frame),
        "started": max(frame.started, default=0.0),
    }  # fmt: skip
    row |= {f"round.{n}": float(np.median(total[rounds == n])) for n in dict.fromkeys(frame.round)}
    steps = [step for step in frame.passes if step.ms]
    medians = {step.name: float(np.median(step.ms)) for step in steps}
    counters = {f"counter.{name}": value for name, value in (frame.counters or {}).items()}
    parts = {column: [step for step in steps if step.part == part] for part, column in PART_COLUMNS.items()}
    sums = {column: float(sum(medians[step.name] for step in own)) for column, own in parts.items()}
    untimed = bool(frame.passes) and not steps
    if untimed or min(sums.values()) < -BACKWARDS * middle:
        unknown = (f"{column}_{kind}" for column in parts for kind in ("ms", "iqr_ms"))
        return row | dict.fromkeys(unknown, math.nan) | counters
    row |= {f"pass.{step.part}.{step.name}": medians[step.name] for step in steps}
    for column, own in parts.items():
        row[f"{column}_ms"] = sums[column]
        row[f"{column}_iqr_ms"] = _range(np.sum([step.ms for step in own], axis=0)) if own else 0.0
    return row | counters


def _range(values: Sequence[float] | Any) -> float:
    return float(np.subtract(*np.percentile(values, [75, 25])))


def _score(frame: Frame) -> dict[str, Any]:
    """The score of a frame: true errors, or why there is no such number (then it is missing, never 0)."""
    row: dict[str, Any] = {"flip": frame.flip, "flip_missing": frame.flip_missing}
    score = frame.score
    if score is None:
        return {**row, "unscored": frame.unscored or "not judged", "pixels_scored": 0}
    row |= {f"primary.{name}": value for name, value in vars(score.primary).items()}
    for light in score.shadow:
        for name, value in vars(light).items():
            if name != "light":
                row[f"shadow.{name}"] = row.get(f"shadow.{name}", 0) + value
    return {
        **row, "unscored": "", "mirrored_rays": sum(bounce.rays for bounce in score.bounces),
        "true_errors": score.true_errors, "excused_share": score.excused_share, "check": score.check,
        "pixels_scored": score.primary.pixels,
        "reference_errors": score.reference_errors.true_errors if score.reference_errors else 0,
    }  # fmt: skip


def _shadow_rays(frame: Frame) -> int | None:
    """The number of shadow rays of a frame. Old records do not have it, but the number that was judged."""
    if frame.shadow_rays is not None or not frame.score:
        return frame.shadow_rays
    return sum(light.scored for light in frame.score.shadow)
