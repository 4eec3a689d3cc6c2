"""The content of the page for a folder of results, from its tidy tables: points, frames, ratios, environments,
notices.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import shadowbench

from ...results.folder import read_environment
from ...results.table import PART_COLUMNS
from ...results.throttled import disturbances
from ...scene.overrides import Lighting
from ...texts import numbered
from .. import compare, document, numbers, ranking, style
from .. import paper_table1 as paper
from ..dataframe import DataFrame, Series, pd
from ..document import Source

POINT = (  # columns of a point on the page, besides `TEXTS`
    "folder experiment preset run machine scene title stand_in triangles frame_count scene_sha256 "
    "source_file source_sha256 method kind method_title label settings built known_inexact method_sha256 "
    "device device_name width height pixels light_label light_distance lights lit moved status reason "
    "rounds frames frames_left_out samples total_ms q1_ms q3_ms wrong_per_frame memory_bytes shadow_rays "
    "pixels_scored reference_errors true_errors unscored environment started stopped_by key error best "
    "earlier passes counters"
).split()

FRAME = "point frame total_ms q1_ms q3_ms samples true_errors error memory_bytes".split()
"""Columns of a measured frame on the page; ``point`` is the row of its point."""

PARTS = {name: (part, "") for part, name in PART_COLUMNS.items()}
MB = 1e6
TEXTS = {  # numbers that the page shows as `report.numbers` writes them, in columns "text.NAME": column, spread, form
    **{f"{name}_ms": (f"{name}_ms", f"{name}_spread", numbers.TIME) for name in PARTS},
    **{name: (name, "", numbers.TIME) for name in "spread q1_ms q3_ms between_ms wall_ms submitted_ms compile_s".split()},
    **{f"{name}_mrays_per_s": (f"{name}_mrays_per_s", "rate", "") for name in ("primary", "shadow", "frame")},
    "memory_bytes": ("memory_mb", "", ""), "wrong_per_frame": ("wrong_per_frame", "", numbers.COUNT),
    **{name: (name, "", "") for name in "flip p95_ms p99_ms pair_ms energy_mj idle_w sah_cost expected_tests".split()},
    **{name: (name, "", "") for name in "bytes_per_ray primary_tests shadow_tests".split()},
}  # fmt: skip

DIGITS = 6  # significant digits of a measured number: finer than any spread
MOST_BASES = 8  # up to so many columns each can be the base of ratios; else the first one of each method


def gather(title: str, sources: Sequence[Source], order: Sequence[str] = ()) -> dict[str, Any]:
    """Everything but pictures and claims. ``order``: of experiments, the most interesting first; others follow by name."""
    place = {name: number for number, name in enumerate(order)}
    sources = sorted(sources, key=lambda one: (place.get(one.frames["experiment"].iloc[0], len(place)), one.name))
    versions = pd.concat([one.frames[["method", "method_sha256", "started"]].dropna() for one in sources])
    last = dict(versions.sort_values("started", kind="stable").groupby("method")["method_sha256"].last())
    facts = environments(sources)
    shown = [detailed(source, last, facts) for source in sources]
    frames, ratios, first = [], [], 0
    for source, own in zip(sources, shown, strict=True):
        place_of = {key: first + number for number, key in enumerate(own["key"])}
        frames.append(frames_of(source.frames, place_of))
        ratios.append(ratios_of(source.frames, own, place_of))
        first += len(own)
    every = pd.concat(shown, ignore_index=True)
    return {
        "title": title,
        "version": shadowbench.__version__,
        "finding": ranking.headline(ranking.ranked(sources[0].frames)),
        "folders": [described(*pair) for pair in zip(sources, shown, strict=True)],
        "points": columns(every.reindex(columns=[*POINT, *(name for name in every if name.startswith("text."))])),
        "frames": columns(pd.concat(frames, ignore_index=True)),
        "ratios": columns(pd.concat(ratios, ignore_index=True)),
        "environments": facts,
        "marks": list(numbers.MEANINGS.items()),
        "paper": {
            "label": paper.LABEL,
            "columns": [[title, title, source] for title, source in paper.COLUMNS.items()],
            "rows": {scene: list(row.cells) for scene, row in paper.ROWS.items()},
            "footnotes": list(paper.FOOTNOTES),
        },
        "colours": style.colours(every["method"]),
    }


def detailed(source: Source, last: dict[str, str], facts: dict[str, Any]) -> DataFrame:
    """The points of a folder with more columns: their machine and kind, what the experiment changed of the lights (``lit``),
    whether a record is of an earlier version of its method than another in the results, :func:`.ranking.best`, the times of
    its passes, its counters, and the texts of its numbers.
    """
    own = document.named(source.frames)
    own = document.with_passes(own, source.path, PARTS) if len(document.measured(own)) else own
    machine = own["environment"].map({name: machine_of(one) for name, one in facts.items()}).astype(object)
    usual = asdict(Lighting())
    lit = [
        ", ".join(
            f"{name} {value:g}" if isinstance(value, float) else f"{name} {value}"
            for name, value in one.items()
            if name not in ("label", "moved") and value != usual.get(name)
        )
        for one in known(own, "light.")
    ]
    own = own.assign(
        title=own["title"].str.replace(r", \d+x\d+$", "", regex=True),  # the page shows the size beside it
        machine=machine.fillna(own["device_name"]), kind=own["method"].map(style.kind), lit=lit,
        best=ranking.best(source.frames, own),
        earlier=[bool(sha) and last.get(name, sha) != sha for name, sha in own[["method", "method_sha256"]].to_numpy()],
        passes=[{n: numbers.carried(ms, 0.0, numbers.TIME) for n, ms in one.items()} for one in known(own, "pass.")],
        counters=known(own, "counter."), memory_mb=own["memory_bytes"].astype("float64") / MB,
    )  # fmt: skip
    return with_texts(own)


def with_texts(table: DataFrame) -> DataFrame:
    """The rows with their numbers as they are shown: see :data:`TEXTS`."""
    share = table["spread"] / table["total_ms"]  # a rate is as sure as the time that it is made with
    made = {"text.total_ms": table["ms"]}
    for name, (column, spread, form) in TEXTS.items():
        if column in table:
            values = table[column].astype("float64")
            around = values * share if spread == "rate" else table[spread] if spread in table else values * 0.0
            made[f"text.{name}"] = numbers.carry(values, around, form)
    return table.assign(**made)


def machine_of(facts: dict[str, Any]) -> str:
    """What a machine is called: its GPUs or, where it has none, its processor."""
    cards = dict.fromkeys(card.get("name", "unknown GPU") for card in facts.get("gpus") or ())
    return " and ".join(cards) or (facts.get("cpu") or {}).get("model") or "unknown machine"


def known(table: DataFrame, beginning: str) -> list[dict[str, Any]]:
    """For each row the columns with this beginning that it has a value of."""
    names = [name for name in table if name.startswith(beginning)]
    values = table[names].astype("object").where(table[names].notna(), math.nan).to_numpy()
    short = [name.removeprefix(beginning) for name in names]
    return [{n: v for n, v in zip(short, row, strict=True) if v == v} for row in values.tolist()]


def frames_of(table: DataFrame, place: dict[str, int]) -> DataFrame:
    """The measured frames of points that have several, with the row of their point."""
    several = table[table.groupby("key")["frame"].transform("count") > 1]
    found = several[several["frame"].notna()]
    rows = found[["true_errors", "check", "excused_share"]].to_dict("records")
    around = compare.spread(found.assign(between_ms=0.0))
    found = found.assign(
        point=found["key"].map(place), error=list(map(numbers.check_text, rows)), spread=around,
        ms=numbers.carry(found["total_ms"], around, numbers.TIME), memory_mb=found["memory_bytes"].astype("float64") / MB,
    )  # fmt: skip
    found = with_texts(found)
    return found.reindex(columns=[*FRAME, *(name for name in found if name.startswith("text."))])


def ratios_of(table: DataFrame, points: DataFrame, place: dict[str, int]) -> DataFrame:
    """Frame time over that of each base, one row per pair that may be compared (:func:`.report.compare.ratios`)."""
    slim = compare.slim(table)
    labels = list(dict.fromkeys(points["label"]))
    if len(labels) > MOST_BASES:
        labels = list(points.drop_duplicates("method")["label"])
    made = []
    for label in labels if len(set(points["label"])) > 1 else ():
        found = compare.ratios(slim, slim["label"] == label).reset_index()
        found = found[found["ratio"].notna()]
        ends = {name: numbers.carry(found[name], found[name] * 0.0) for name in ("low", "high")}
        found = found.assign(text=numbers.carry(found["ratio"], found["spread"]), **ends)
        made.append(found.assign(point=found["key"].map(place), base=label, folder=points["folder"].iloc[0]))
    wanted = ["folder", "base", "point", "ratio", "text", "low", "high", "frames"]
    return pd.concat(made)[wanted] if made else pd.DataFrame(columns=wanted)


def described(source: Source, points: DataFrame) -> dict[str, Any]:
    """The texts of the page about a folder: its experiment, its finding, and what a reader must know of its numbers."""
    experiments = list(dict.fromkeys(points["experiment"]))
    title, finding = written(source.path, experiments)
    busy, older = disturbances(source.path), source.frames.attrs.get("older", 0)
    versions = points[points["method_sha256"] != ""].groupby("method")["method_sha256"].nunique()
    notices = [
        f"Records of {n} versions of {method} are in this folder." for method, n in versions[versions > 1].items()
    ]
    notices += [f"Not shown: {numbered(older, 'older record')} of the same entries."] * bool(older)
    notices += document.not_measured(points)[:12]
    return {
        "name": source.name, "experiment": " and ".join(experiments), "title": title, "finding": finding,
        "where": document.where(points), "answers": document.errors(points),
        "valid": [f"{busy}."] * bool(busy) + document.validity(points), "notices": notices,
    }  # fmt: skip


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


def environments(sources: Sequence[Source]) -> dict[str, Any]:
    """The facts of each environment, by its name."""
    return {
        path.stem: shortened(facts)
        for source in sources
        for path in sorted((source.path / "environments").glob("*.json"))
        if (facts := read_environment(source.path, path.stem)) is not None
    }


def columns(table: DataFrame) -> dict[str, Any]:
    """Each column by name: ``{"d": distinct texts, "i": their numbers}`` for texts, else a list; null: not known."""
    return {"rows": len(table), "columns": {str(name): column(table[name]) for name in table}}


def column(values: Series) -> Any:
    """One column: see :func:`columns`. Tuples, lists and dictionaries stay as they are."""
    known = values.dropna()
    if len(known) and all(isinstance(value, str) for value in known):
        distinct = list(dict.fromkeys(known))
        place = {text: number for number, text in enumerate(distinct)}
        return {"d": distinct, "i": [place.get(value) for value in values]}
    return [shortened(value) for value in values.astype(object)]


def shortened(value: Any) -> Any:
    """A value as JSON holds it: a number with :data:`DIGITS` digits, whole ones whole, None where it is not known."""
    if isinstance(value, dict):
        return {str(key): shortened(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [shortened(one) for one in value]
    if value is None or isinstance(value, str | bool | np.bool_):
        return bool(value) if isinstance(value, np.bool_) else value
    if isinstance(value, int | np.integer):
        return int(value)
    try:
        number = float(value)
    except (TypeError, ValueError):
        return None  # pandas' <NA>
    if not math.isfinite(number):
        return None
    short = float(f"{number:.{DIGITS}g}")
    return int(number) if number == int(number) and abs(number) < 1e15 else short
