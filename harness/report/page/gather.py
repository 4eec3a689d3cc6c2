"""The content of the page for a folder of results, from its tidy tables: points, frames, ratios, environments,
notices."""

from __future__ import annotations

import re
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...results.folder import read_json
from .. import compare, document, style
from .. import paper_table1 as paper
from .columns import columns, shortened

if TYPE_CHECKING:
    from pandas import DataFrame

POINT = (
    "folder experiment preset run scene title stand_in triangles vertices invalid_triangles frame_count "
    "scene_sha256 source_file source_sha256 method method_title label settings built known_inexact method_sha256 "
    "device device_name width height pixels light_label light_distance light_turns lights moved status reason "
    "rounds frames frame_numbers frames_left_out samples total_ms q1_ms q3_ms iqr_ms between_ms spread wall_ms "
    "build_ms trace_ms light_build_ms shadow_ms build_iqr_ms trace_iqr_ms light_build_iqr_ms shadow_iqr_ms "
    "memory_bytes peak_rss_bytes compile_s first_frame_s regrown pass_count build_count shadow_rays true_errors "
    "wrong_per_frame unscored check excused_share pixels_scored reference_errors flip primary_mrays_per_s "
    "shadow_mrays_per_s frame_mrays_per_s environment started stopped_by key error earlier round_ms passes "
    "counters"
).split()
"""Columns of a point on the page."""

FRAME = (
    "point frame total_ms q1_ms q3_ms samples build_ms trace_ms light_build_ms shadow_ms true_errors error "
    "memory_bytes"
).split()
"""Columns of a measured frame on the page; ``point`` is the row of its point."""

BULKY = ("pass.", "counter.", "set.", "light.", "point.", "round.", "primary.", "shadow.")
"""Prefixes of columns that no ratio needs."""

MOST_BASES = 8
"""Columns of a table up to which each of them can be the base of ratios; else the first one of each method can."""


def gather(
    title: str, places: Sequence[Path], tables: Sequence[DataFrame], points: Sequence[DataFrame]
) -> dict[str, Any]:
    """Everything but pictures and claims.

    places  the folders
    tables  the frames of each (:func:`.report.document.frames`)
    points  the points of each (:func:`.report.document.named`)
    """
    import pandas as pd

    last = newest_versions(
        pd.concat([t[["method", "method_sha256", "started"]] for t in tables], ignore_index=True)
    )
    shown, frames, ratios, about = [], [], [], []
    first = 0
    for place, table, found in zip(places, tables, points, strict=True):
        own = detailed(found, last)
        place_of = {key: first + number for number, key in enumerate(own["key"])}
        shown.append(own)
        frames.append(frames_of(table, place_of))
        ratios.append(ratios_of(table, own, place_of))
        about.append(described(place, table, own))
        first += len(own)
    every = pd.concat(shown, ignore_index=True)
    return {
        "title": title,
        "version": installed(),
        "folders": about,
        "points": columns(every.reindex(columns=POINT)),
        "frames": columns(pd.concat(frames, ignore_index=True)),
        "ratios": columns(pd.concat(ratios, ignore_index=True)),
        "environments": environments(places),
        "paper": {
            "label": paper.LABEL,
            "columns": [[title, title, source] for title, source in paper.COLUMNS.items()],
            "rows": {scene: list(row.cells) for scene, row in paper.ROWS.items()},
            "footnotes": list(paper.FOOTNOTES),
        },
        "colours": style.colours(every["method"]),
        "scenes": list(dict.fromkeys(every["title"])),
    }


def newest_versions(table: DataFrame) -> dict[str, str]:
    """The version of each method that was measured last."""
    ordered = table[table["started"].notna()].sort_values("started", kind="stable")
    return dict(ordered.groupby("method")["method_sha256"].last())


def detailed(own: DataFrame, last: dict[str, str]) -> DataFrame:
    """The points of a folder with more columns: whether a record is of an earlier version
    of its method than another in the results, the times of its rounds, the times of its passes, and its counters.
    """
    rounds = sorted((c for c in own if c.startswith("round.")), key=lambda c: int(c.split(".")[1]))
    return own.assign(
        title=own["title"].str.replace(r", \d+x\d+$", "", regex=True),  # the page shows the size beside it
        earlier=[bool(sha) and last.get(name, sha) != sha for name, sha in own[["method", "method_sha256"]].to_numpy()],
        round_ms=[[ms for ms in row if ms == ms] for row in own[rounds].astype("float64").to_numpy().tolist()],
        passes=known(own, "pass."),
        counters=known(own, "counter."),
    )  # fmt: skip


def known(table: DataFrame, beginning: str) -> list[dict[str, float]]:
    """For each row the columns with this beginning that it has a value of."""
    names = [name for name in table if name.startswith(beginning)]
    values = table[names].astype("float64").to_numpy()
    short = [name.removeprefix(beginning) for name in names]
    return [{n: v for n, v in zip(short, row, strict=True) if v == v} for row in values.tolist()]


def frames_of(table: DataFrame, place: dict[str, int]) -> DataFrame:
    """The measured frames of points that have several, with the row of their point."""
    several = table[table.groupby("key")["frame"].transform("count") > 1]
    found = several[several["frame"].notna()]
    errors = [
        document.check_text(row)
        for row in found[["true_errors", "check", "excused_share"]].to_dict("records")
    ]
    return found.assign(point=found["key"].map(place), error=errors).reindex(columns=FRAME)


def ratios_of(table: DataFrame, points: DataFrame, place: dict[str, int]) -> DataFrame:
    """Frame time over that of each base, one row per pair that may be compared (:func:`.report.compare.ratios`)."""
    import pandas as pd

    slim = table[[name for name in table if not name.startswith(BULKY) or name == "pass_count"]]
    labels = list(dict.fromkeys(points["label"]))
    if len(labels) > MOST_BASES:
        labels = list(points.drop_duplicates("method")["label"])
    made = []
    for label in labels if len(set(points["label"])) > 1 else ():
        found = compare.ratios(slim, slim["label"] == label).reset_index()
        found = found[found["ratio"].notna()]
        made.append(found.assign(point=found["key"].map(place), base=label, folder=points["folder"].iloc[0]))
    wanted = ["folder", "base", "point", "ratio", "low", "high", "frames"]
    return pd.concat(made)[wanted] if made else pd.DataFrame(columns=wanted)


def described(place: Path, table: DataFrame, points: DataFrame) -> dict[str, Any]:
    """The texts of the page about a folder: its experiment, its finding, notices."""
    experiments = list(dict.fromkeys(points["experiment"]))
    title, finding = written(place, experiments)
    notices = [*compare.apart(points), *document.not_measured(points)[:12]] if len(points) else []
    notices += document.left_out(points)
    older = table.attrs.get("older", 0)
    if older:
        notices.insert(0, f"{older} older records of the same entries are in the folder and are not shown.")
    versions = points[points["method_sha256"] != ""].groupby("method")["method_sha256"].nunique()
    for method in versions[versions > 1].index:
        notices.insert(0, f"Records of {versions[method]} versions of {method} are in this folder.")
    effort = document.effort(document.measured(points))
    return {
        "name": points["folder"].iloc[0],
        "experiment": " and ".join(experiments),
        "title": title,
        "finding": finding,
        "where": document.where(points),
        "effort": effort,
        "answers": document.errors(points),
        "notices": notices,
    }


def written(place: Path, experiments: Sequence[str]) -> tuple[str, str]:
    """Title and finding as the folder's report has them; "" where there is none."""
    for name in experiments:
        path = place / f"{name}.md"
        if path.is_file():
            lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
            title = next((line[2:] for line in lines if line.startswith("# ")), name)
            text = next((line for line in lines if line and not re.match(r"[#|!\-<`>]", line)), "")
            return title, text
    return " and ".join(experiments), ""


def environments(places: Sequence[Path]) -> dict[str, Any]:
    """The facts of each environment, by its name."""
    found = {}
    for place in places:
        for path in sorted((place / "environments").glob("*.json")):
            facts = read_json(path)
            if facts is not None:
                found[path.stem] = shortened(facts)
    return found


def installed() -> str:
    """The version of this program; "" where it is not installed."""
    for name in ("shadowbench-rt", "shadowbench"):
        try:
            return version(name)
        except PackageNotFoundError:
            continue
    return ""
