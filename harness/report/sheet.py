"""Table 1 as text: what stands in each cell, and the notes below. Markdown and terminal are made from the same.

A time never stands without its error: a cell of a measured point has both, or the word "unscored".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..scene.facts import never_hit
from . import paper_table1 as paper
from . import style


@dataclass(frozen=True)
class Cell:
    """Lines of text of one entry. ``best``: the fastest whole frame of its row without a true error."""

    lines: tuple[str, ...]
    best: bool = False
    bad: bool = False


@dataclass(frozen=True)
class Line:
    """One scene: its title, its facts, an entry a method, and the paper's entries as printed."""

    title: str
    facts: str
    cells: tuple[Cell, ...]
    printed: tuple[str, ...]


@dataclass(frozen=True)
class Sheet:
    """The whole table. ``columns`` are the methods' labels; the paper's columns are always the same five."""

    title: str
    columns: tuple[str, ...]
    lines: tuple[Line, ...]
    notes: tuple[str, ...] = field(default=())


def error_text(row: dict[str, Any]) -> str:
    """The error that goes with a row's times: a tick, how many are wrong, or unscored."""
    wrong = row.get("true_errors")
    if wrong:
        return f"{style.WRONG} {wrong:,} wrong"
    if wrong is None:
        return style.UNSCORED
    if row.get("check") == "failed":
        return f"{style.WRONG} {row['excused_share']:.2%} excused"
    return style.OK


def cell(row: dict[str, Any] | None, number: int | None = None, best: bool = False) -> Cell:
    """The entry of a point; ``number`` is that of the note with the reason why it was not measured."""
    if row is None:
        return Cell(("-",))
    if row["status"] != "ok" or row.get("total_ms") is None:
        return Cell((row["status"] + (f" [{number}]" if number else ""),), bad=row["status"] != "skipped")
    lines = (
        f"{style.number(row['build_ms'])} / {style.number(row['trace_ms'])}",
        f"{style.number(row['total_ms'])} {error_text(row)}",
        f"{style.number(row.get('frame_mrays_per_s'))} Mrays/s",
        f"{style.megabytes(row['memory_bytes'])} MB",
    )
    return Cell(lines, best, bad=error_text(row).startswith(style.WRONG))


def sheet(rows: Sequence[dict[str, Any]]) -> Sheet:
    """The table of tidy rows (see :mod:`.report.tidy`), scenes down and methods across, in the rows' order."""
    scenes = list(dict.fromkeys((row["scene"], row["scene_title"]) for row in rows))
    columns = column_names(rows)
    reasons: list[str] = []
    lines = []
    for scene, title in scenes:
        own = {column_name(r, rows): r for r in rows if (r["scene"], r["scene_title"]) == (scene, title)}
        # Means over different frames are not held against each other.
        alike = len({r.get("frame_numbers") for r in own.values() if r.get("total_ms") is not None}) == 1
        right = [r["total_ms"] for r in own.values() if _faultless(r)] if alike else []
        cells = []
        for column in columns:
            row = own.get(column)
            number = None
            if row is not None and (row["status"] != "ok" or row.get("total_ms") is None):
                reasons.append(
                    f"{row['scene_title']}, {column}: {row['status']}: {row['reason'] or 'no reason given'}"
                )
                number = len(reasons)
            best = row is not None and _faultless(row) and len(right) > 1 and row["total_ms"] == min(right)
            cells.append(cell(row, number, best))
        first = next(iter(own.values()))
        triangles = first.get("triangles")
        facts = f"{triangles:,} triangles" if triangles else "triangles unknown"
        frames = max((r.get("frames") or 0 for r in own.values()), default=0)
        facts += f"\n{frames} frames" if frames > 1 else ""
        lines.append(Line(title_of(first), facts, tuple(cells), paper.cells(scene)))
    notes = [
        *_how_to_read(rows),
        *_left_out(rows),
        *_not_measured(reasons),
        *never_hit_notes(rows),
        *_errors(rows),
        *_built(rows),
        *_stand_ins(rows),
    ]
    return Sheet(_heading(rows), columns, tuple(lines), tuple(notes))


def title_of(row: dict[str, Any]) -> str:
    title = row["scene_title"]
    return f"{title} (stand-in)" if row.get("stand_in") and "stand-in" not in title else title


def _faultless(row: dict[str, Any]) -> bool:
    return row["status"] == "ok" and row.get("total_ms") is not None and error_text(row) == style.OK


def column_name(row: dict[str, Any], rows: Sequence[dict[str, Any]]) -> str:
    """The column a row belongs to: its label, what was set by hand, and device or size where there are several."""
    parts = [row["label"]]
    if row.get("settings") not in (None, "-"):
        parts.append(row["settings"])
    if len({r["device"] for r in rows}) > 1:
        parts.append(row["device"])
    if len({(r["width"], r["height"]) for r in rows}) > 1:
        parts.append(f"{row['width']}x{row['height']}")
    return ", ".join(parts)


def column_names(rows: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    order = list(style.colours(row["method"] for row in rows))
    pairs = {(order.index(row["method"]), column_name(row, rows)) for row in rows}
    return tuple(column for _, column in sorted(pairs))


def _heading(rows: Sequence[dict[str, Any]]) -> str:
    sizes = sorted({f"{r['width']}x{r['height']}" for r in rows})
    names = sorted({r["device_name"] or r["device"] for r in rows})
    presets = sorted({r["preset"] for r in rows if r["preset"]})
    return f"Table 1 on {', '.join(names)}: {', '.join(sizes)}" + (
        f", preset {', '.join(presets)}" if presets else ""
    )


def _how_to_read(rows: Sequence[dict[str, Any]]) -> list[str]:
    notes = [
        "Each entry: build / trace of primary rays in ms; then the whole frame with shadows in ms and its error; "
        "then primary and shadow rays over the whole frame; then memory of structures and work buffers.",
        f"{style.OK} no wrong answer; {style.WRONG} wrong pixels and shadow bits, over all frames measured; "
        f"{style.UNSCORED}: no truth was to be had, so nothing is known of the answers.",
    ]
    if {(r["width"], r["height"]) for r in rows} != {paper.SIZE}:
        notes.append(
            f"At this image size the times are not to be held against the paper's columns ({paper.LABEL}): "
            "run with --preset paper for that."
        )
    measured = [r for r in rows if r.get("total_ms")]
    if measured:
        spread = [r["iqr_ms"] / r["total_ms"] for r in measured]
        fewest = min(r["samples"] for r in measured)
        notes.append(
            f"Medians of at least {fewest} repeat{'s' * (fewest != 1)}; where a scene moves, the mean of its "
            f"frames' medians. Interquartile range of repeats: {np.median(spread):.1%} in the middle, "
            f"{max(spread):.1%} at most. {between_rounds(measured)}"
        )
        gap = max(measured, key=lambda r: abs(r["stage_gap"] or 0.0))
        notes.append(
            "The whole frame is measured apart from its parts; their sum differs from it by "
            f"{np.median([abs(r['stage_gap'] or 0.0) for r in measured]):.1%} in the middle, "
            f"{abs(gap['stage_gap'] or 0.0):.1%} at most ({gap['scene']}, {gap['label']})."
        )
    return notes


def _left_out(rows: Sequence[dict[str, Any]]) -> list[str]:
    short = [
        f"{r['scene']}, {column_name(r, rows)} ({r['frames']} of {r['frames'] + r['frames_left_out']})"
        for r in rows
        if r.get("frames_left_out") and r.get("frames")
    ]
    if not short:
        return []
    return [
        f"Frames left out, as the point's budget would not pay for them: {'; '.join(short)}. Where methods were "
        "measured at different frames of a scene, their times are means over different frames and none is marked best."
    ]


def _not_measured(reasons: list[str]) -> list[str]:
    return [f"[{i + 1}] {reason}" for i, reason in enumerate(reasons)]


def _errors(rows: Sequence[dict[str, Any]]) -> list[str]:
    notes = []
    excused = [r for r in rows if r.get("excused_share")]
    if excused:
        most = max(excused, key=lambda r: r["excused_share"])
        notes.append(
            f"Excused as too close to an edge to tell in float32: at most {most['excused_share']:.4%} of the pixels "
            f"({most['scene']}, {most['label']}); above 0.1 % the check fails."
        )
    reference: dict[str, int] = {}
    for r in rows:
        if r.get("reference_errors"):
            reference[r["scene_title"]] = max(reference.get(r["scene_title"], 0), r["reference_errors"])
    if reference:
        listed = ", ".join(f"{scene} {n:,}" for scene, n in reference.items())
        notes.append(
            f"The reference (Embree, robust) was itself wrong, and overruled, at these many answers: {listed}."
        )
    unscored = sorted({r["unscored"] for r in rows if r.get("unscored") and r["status"] == "ok"})
    notes += [f"Unscored: {reason}." for reason in unscored]
    grown = [f"{r['scene']}, {r['label']}" for r in rows if r.get("regrown")]
    if grown:
        notes.append(f"Capacities grew, and the frame was repeated, before timing: {'; '.join(grown)}.")
    return notes


def never_hit_notes(rows: Sequence[dict[str, Any]]) -> list[str]:
    """What `verify` says of triangles that nothing can hit: right answers there are misses."""
    told = {}
    for r in rows:
        total = r.get("triangles") or 0
        text = never_hit(total, total - r.get("invalid_triangles", 0))
        if text:
            told[title_of(r)] = f"{title_of(r)}: {text}."
    return list(told.values())


def _built(rows: Sequence[dict[str, Any]]) -> list[str]:
    notes = []
    for column in column_names(rows):
        texts = sorted(
            {r["built"] for r in rows if column_name(r, rows) == column and r["built"] not in (None, "-")}
        )
        if texts:
            notes.append(f"{column}: {'; or '.join(texts)}.")
        inexact = sorted(
            {r["known_inexact"] for r in rows if column_name(r, rows) == column and r.get("known_inexact")}
        )
        notes += [f"{column} declares itself inexact: {reason}." for reason in inexact]
    return notes


def _stand_ins(rows: Sequence[dict[str, Any]]) -> list[str]:
    known = {r["scene_title"]: r["stand_in"] for r in rows if r.get("stand_in")}
    return [f"{title}: {text}." for title, text in known.items()]


def between_rounds(rows: Sequence[dict[str, Any]]) -> str:
    """How far the medians of rounds lie apart, at most; of points with one round that is not known."""
    several = [r for r in rows if r["rounds"] > 1]
    if not several:
        return "Between rounds: not known of one round."
    worst = max(several, key=lambda r: r["between_ms"] / r["total_ms"])
    share = worst["between_ms"] / worst["total_ms"]
    return f"Between rounds: {share:.1%} at most ({worst['scene']}, {worst['label']})."
