"""What the figures of single experiments share: a row a point with its settings, lights and counters; CSV; text.

Rows are :mod:`.report.tidy`'s, with more columns. Everything is computed from a folder's records.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from ..results.statistics import part_ms
from . import style, tidy
from .picture import inked_png_bytes, png_bytes
from .sheet import error_text, never_hit_notes, title_of

Row = dict[str, Any]


def rows(folder: Path | str) -> list[Row]:
    """One row a point of a folder, in the order of tables. See :func:`row`."""
    records, _ = tidy.newest(folder)
    by_key = {record["key"]: record for record in records}
    return [row(by_key[r["key"]]) for r in tidy.rows(records)]


def row(record: dict[str, Any]) -> Row:
    """A tidy row and more.

    record         the record itself, for what is told a frame or a pass
    set            the settings and every other parameter of the method, as values by name
    light_label, light_count, light_distance, light_turns   how the experiment placed the lights
    counters       mean over the frames of every work counter
    """
    lighting = record["scene"].get("lighting") or {}
    parameters = record["method"].get("parameters") or {}
    known = {**parameters.get("build", {}), **parameters.get("trace", {})}
    return {
        **tidy.row(record),
        "record": record,
        "set": {**(record["method"].get("settings") or {}), **known},
        "light_label": lighting.get("label", ""),
        "light_count": len(record["scene"].get("lights") or ()),
        "light_distance": lighting.get("distance") or None,
        "light_turns": lighting.get("turns") or None,
        "counters": counters(record),
    }


def counters(record: dict[str, Any]) -> dict[str, float]:
    """Mean over a record's frames of each work counter; the frames that were counted count."""
    names = dict.fromkeys(name for frame in record["frames"] for name in frame.get("counters") or {})
    return {
        name: float(
            np.mean([f["counters"][name] for f in record["frames"] if name in (f.get("counters") or {})])
        )
        for name in names
    }


def pass_ms(record: dict[str, Any], part: str, pattern: str = "") -> float | None:
    """Milliseconds of the passes of a part whose names hold ``pattern`` (a regular expression); mean over frames."""
    frames = [frame for frame in record["frames"] if frame["total_ms"]]
    if not frames:
        return None
    wanted = [
        {**f, "passes": [p for p in f["passes"] if re.search(pattern, p["name"])]} for f in frames
    ]  # fmt: skip
    return float(np.mean([part_ms(frame, part) for frame in wanted]))


def measured(made: Iterable[Row]) -> list[Row]:
    """Those rows that have a time."""
    return [r for r in made if r["status"] == "ok" and r.get("total_ms") is not None]


def write_csv(made: Sequence[dict[str, Any]], path: Path, columns: Sequence[str]) -> Path:
    """The rows as CSV; a number has six digits, what is not known is empty."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        for r in made:
            writer.writerow({key: plain(r.get(key)) for key in columns})
    return path


def plain(value: Any) -> Any:
    """A value as it stands in a CSV."""
    return f"{value:.6g}" if isinstance(value, float) else "" if value is None else value


COMMON = (
    "scene scene_title stand_in triangles method label settings device device_name width height preset status reason "
    "light_label light_count light_distance build_ms trace_ms light_build_ms shadow_ms total_ms iqr_ms between_ms "
    "frames samples true_errors unscored environment key"
).split()
"""Columns that every CSV of an experiment begins with."""


def where(made: Sequence[Row]) -> str:
    """Size and device of rows, as a phrase: "256x256 on AMD EPYC"."""
    sizes = dict.fromkeys(f"{r['width']}x{r['height']}" for r in made)
    devices = dict.fromkeys(str(r["device_name"]) for r in made)
    return f"{' and '.join(sizes)} on {' and '.join(devices)}"


def effort(made: Sequence[Row]) -> str:
    """How long the points were sampled, where they say so, as a sentence."""
    asked = dict.fromkeys(
        (r["record"]["point"].get("rounds"), r["record"]["point"].get("budget_s")) for r in made
    )
    told = [
        f"{rounds} round{'s' * (rounds > 1)}, at most {budget:g} s of samples a point"
        for rounds, budget in asked
        if rounds and budget
    ]
    return f"{' and '.join(told)}." if told else ""


def not_measured(made: Sequence[Row], apart: Collection[str] = ()) -> list[str]:
    """One line for every point without a time, and one for every group of points of which some have no record.

    A run that was stopped leaves no trace of what it did not come to: it is told by what others have. ``apart``: labels
    of lightings that have points of their own, which say nothing of others' and of which others say nothing.
    """
    done = {r["key"] for r in measured(made)}
    lines = [
        f"{title_of(r)}, {name(r)}: {r['status']}: {r['reason'] or 'no reason given'}"
        for r in made
        if r["key"] not in done
    ]
    labels = dict.fromkeys(r["label"] for r in made)
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for r in made:
        groups.setdefault((r["scene"], r["light_label"], r["width"], r["height"]), []).append(r)
    for group in groups.values():
        there = {r["label"] for r in group}
        missing = [label for label in labels if label not in there]
        if missing and group[0]["light_label"] not in apart:
            first = group[0]
            lights = f", {first['light_label']}" if first["light_label"] else ""
            lines.append(f"{title_of(first)}{lights}: no record of {', '.join(missing)}")
    return lines


def of_frames(r: Row, frames: Iterable[int]) -> Row:
    """The row of some of its frames."""
    wanted = set(frames)
    if set(r["frame_numbers"]) == wanted:
        return r
    record = r["record"]
    fewer = row({**record, "frames": [f for f in record["frames"] if f["frame"] in wanted]})
    return {**fewer, "run": r["run"]} if "run" in r else fewer


def name(r: Row) -> str:
    """Label of a point, with its lights where the experiment placed them."""
    return f"{r['label']}, {r['light_label']}" if r["light_label"] else r["label"]


def errors(made: Sequence[Row]) -> str:
    """What is known of the answers behind the times: a sentence."""
    bad = [f"{title_of(r)}, {name(r)}: {error_text(r)}" for r in measured(made) if error_text(r) != style.OK]
    bad += [text for text in never_hit_notes(made) if "warning" in text]
    if not bad:
        return "Every answer behind these times was found right."
    if len(bad) > 6:
        bad = [*bad[:6], f"and {len(bad) - 6} more (see the CSV)"]
    return "Answers: " + "; ".join(bad) + "."


def report(
    folder: Path, experiment: str, title: str, sentences: Sequence[str], files: Sequence[Path], made: Sequence[Row],
    quiet: bool, apart: Collection[str] = (),
) -> list[Path]:  # fmt: skip
    """Write ``EXPERIMENT.md`` with what was found, print it unless ``quiet``; return every file written.

    ``apart``: see :func:`not_measured`.
    """
    lines = [f"# {title}", "", *(f"{sentence}\n" for sentence in sentences)]
    lines += [" ".join(x for x in (f"{where(made)}.", effort(made), errors(made)) if x), ""] if made else []
    missing = not_measured(made, apart)
    if missing:
        lines += ["Not measured:", "", *(f"- {line}" for line in missing), ""]
    path = folder / f"{experiment}.md"
    shown = [file.name for file in files if file.suffix in (".svg", ".png")]
    shown += [name for name in linked(path) if name not in shown]
    lines += [f"![{Path(name).stem}]({name})" for name in shown]
    path.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")
    if not quiet:
        print(title)
        for sentence in [*sentences, *(["Not measured: " + "; ".join(missing)] if missing else [])]:
            print(f"  {sentence}")
    return [*files, path]


def linked(path: Path) -> list[str]:
    """Pictures that a report shows and that are still there: kept where what they were drawn from is not."""
    if not path.is_file():
        return []
    names = re.findall(r"^!\[[^\]]*\]\(([^)/]+)\)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    return [name for name in names if (path.parent / name).is_file()]


def save(figure: Any, path: Path, colours: int = 0, inks: Sequence[str] = ()) -> Path:
    """Write a figure without a date in it: the same records give the same bytes.

    ``colours``: of a picture with few, keep no more than so many, for a quarter of its bytes; 0: all. ``inks``: of a
    grey picture keep these colours, that mean something, and greys.
    """
    figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)
    if colours or inks:
        with Image.open(path) as whole:
            picture = np.asarray(whole.convert("RGB"))
        path.write_bytes(inked_png_bytes(picture, inks) if inks else png_bytes(picture, colours))
    return path


def sheet_style() -> dict[str, Any]:
    """Matplotlib settings of line plots: grid both ways."""
    return {**style.axes_style(), "axes.grid.axis": "both", "lines.linewidth": 1.1, "lines.markersize": 3.5}


MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
"""One a line, beside its colour: a grey print keeps them apart."""


def in_order(values: Iterable[Any], key: Callable[[Any], Any] | None = None) -> list[Any]:
    """Distinct values, sorted."""
    return sorted(set(values), key=key)
