"""What stands in each cell of Table 1, and the notes below it. Markdown and terminal are made from the same.

A time never stands without its error: a cell of a measured point has both, or the word "unscored".
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ...harness.report import compare, document, style
from ...harness.report import paper_table1 as paper

if TYPE_CHECKING:
    from pandas import DataFrame, Series


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


def with_columns(table: DataFrame) -> DataFrame:
    """The points with the column of the table that each stands in, and whether its answers are right.

    column  its label, what was set by hand, and device or size where there are several
    right   measured, and every answer right
    """
    parts = [table["label"], table["settings"].where(table["settings"] != "-", "")]
    if table["device"].nunique() > 1:
        parts.append(table["device"])
    if table["pixels"].nunique() > 1:
        parts.append(table["width"].astype(str) + "x" + table["height"].astype(str))
    column = [", ".join(filter(None, texts)) for texts in zip(*parts, strict=True)]
    measured = table["total_ms"].notna() & (table["status"] == "ok")
    return table.assign(column=column, right=measured & (table["error"] == style.OK))


def cell(row: dict[str, Any], number: int = 0, best: bool = False) -> Cell:
    """The entry of a point; ``number`` is that of the note with the reason why it was not measured."""
    if row["status"] != "ok" or row["total_ms"] != row["total_ms"]:
        return Cell((row["status"] + f" [{number}]" * bool(number),), bad=row["status"] != "skipped")
    lines = (
        f"{style.number(row['build_ms'])} / {style.number(row['trace_ms'])}",
        f"{style.number(row['total_ms'])} {row['error']}",
        f"{style.number(row['frame_mrays_per_s'])} Mrays/s",
        f"{style.megabytes(row['memory_bytes'])} MB",
    )
    return Cell(lines, best, bad=row["error"].startswith(style.WRONG))


def sheet(table: DataFrame) -> Sheet:
    """The table of points (:func:`.report.document.read`), scenes down and methods across, in their order."""
    table = with_columns(table)
    order = {method: place for place, method in enumerate(style.colours(table["method"]))}
    pairs = table.assign(rank=table["method"].map(order)).sort_values(["rank", "column"])
    columns = tuple(pairs["column"].unique())
    lines, reasons = [], []
    for (scene, _), own in table.groupby(["scene", "scene_title"], sort=False):
        # Means over different frames, and times of different runs, are not held against each other.
        done = own[own["total_ms"].notna()]
        alike = done["frame_numbers"].nunique() == 1 and done["run"].nunique() == 1
        right = own.loc[own["right"], "total_ms"] if alike else own["total_ms"][:0]
        cells = dict.fromkeys(columns, Cell(("-",)))
        for row in own.to_dict("records"):
            if row["status"] != "ok" or row["total_ms"] != row["total_ms"]:
                told = f"{row['status']}: {row['reason'] or 'no reason given'}"
                reasons.append(f"{row['scene_title']}, {row['column']}: {told}")
            best = len(right) > 1 and row["right"] and row["total_ms"] == right.min()
            cells[row["column"]] = cell(row, len(reasons), best)
        triangles, frames = own["triangles"].iloc[0], own["frames"].max()
        facts = f"{triangles:,} triangles" if triangles == triangles else "triangles unknown"
        facts += f"\n{frames} frames" * bool(frames > 1)
        lines.append(Line(own["title"].iloc[0], facts, tuple(cells.values()), paper.cells(scene)))
    not_measured = [f"[{i}] {reason}" for i, reason in enumerate(reasons, 1)]
    notes = [*how_to_read(table), *compare.apart(table.assign(label=table["column"])), *not_measured,
             *document.never_hit_notes(table), *error_notes(table), *built_notes(table)]  # fmt: skip
    return Sheet(heading(table), columns, tuple(lines), tuple(notes))


def heading(table: DataFrame) -> str:
    """Devices, sizes and presets."""
    sizes = sorted(set(table["width"].astype(str) + "x" + table["height"].astype(str)))
    names = sorted(set(table["device_name"].where(table["device_name"] != "", table["device"])))
    presets = sorted(set(table["preset"]) - {""})
    return f"Table 1 on {', '.join(names)}: {', '.join(sizes)}" + (
        f", preset {', '.join(presets)}" if presets else ""
    )


def at(row: Series) -> str:
    """Scene and label of a point."""
    return f"({row['scene']}, {row['label']})"


def how_to_read(table: DataFrame) -> list[str]:
    """What an entry says, and how far to trust its digits."""
    notes = [
        "Each entry: build / trace of primary rays in ms; then the whole frame with shadows in ms and its error; "
        "then primary and shadow rays over the whole frame; then memory of structures and work buffers.",
        f"{style.OK} no wrong answer; {style.WRONG} wrong pixels and visibility bits, over all frames measured; "
        f"{style.UNSCORED}: there was no exact reference, so nothing is known of the answers.",
    ]
    if set(table["width"]) | set(table["height"]) != set(paper.SIZE):
        notes.append(
            f"At this image size the times are not to be held against the paper's columns ({paper.LABEL}): "
            "run with --preset paper for that."
        )
    done = table[table["total_ms"].notna()]
    if len(done):
        share, gap = done["iqr_ms"] / done["total_ms"], done["stage_gap"].abs().fillna(0.0)
        fewest = done["samples"].min()
        notes.append(
            f"Medians of at least {fewest} repeat{'s' if fewest != 1 else ''}; where a scene moves, the mean of its frames' "
            f"medians. Interquartile range of repeats, over the frame time: median {share.median():.1%}, at most "
            f"{share.max():.1%}. {between_rounds(done)}"
        )
        notes.append(
            "The whole frame is measured apart from its parts; their sum differs from it by "
            f"{gap.median():.1%} (median), {gap.max():.1%} at most {at(done.loc[gap.idxmax()])}."
        )
    short = done[done["frames_left_out"] > 0]
    if len(short):
        told = (short["scene"] + ", " + short["column"] + " (" + short["frames"].astype(str) + " of "
                + (short["frames"] + short["frames_left_out"]).astype(str) + ")")  # fmt: skip
        notes.append(
            f"Frames left out, beyond the point's budget: {'; '.join(told)}. Where methods were measured at different "
            "frames of a scene, their times are means over different frames and none is marked best."
        )
    return notes


def between_rounds(done: DataFrame) -> str:
    """How far the medians of rounds lie apart, at most; of points with one round that is not known."""
    several = done[done["rounds"] > 1]
    if several.empty:
        return "Between rounds: not known of one round."
    share = several["between_ms"] / several["total_ms"]
    return f"Between rounds: {share.max():.1%} at most {at(several.loc[share.idxmax()])}."


def error_notes(table: DataFrame) -> list[str]:
    """What was excused, what the reference got wrong, why answers are unscored, and what grew."""
    notes = []
    excused = table[table["excused_share"] > 0]
    if len(excused):
        most = excused.loc[excused["excused_share"].idxmax()]
        notes.append(
            f"Excused as too close to an edge to decide in float32: at most {most['excused_share']:.4%} of the pixels "
            f"{at(most)}; above 0.1 % the check fails."
        )
    wrong = table.groupby("scene_title", sort=False)["reference_errors"].max()
    listed = ", ".join(f"{title} {n:,}" for title, n in wrong[wrong > 0].items())
    if listed:
        notes.append(
            f"The reference (Embree, robust) was itself wrong, and overruled, at these many answers: {listed}."
        )
    unscored = sorted(set(table.loc[table["status"] == "ok", "unscored"]) - {""})
    notes += [f"Unscored: {reason}." for reason in unscored]
    grown = table[table["regrown"] > 0]
    if len(grown):
        told = "; ".join(grown["scene"] + ", " + grown["label"])
        notes.append(f"Capacities grew, and the frame was repeated, before timing: {told}.")
    return notes


def built_notes(table: DataFrame) -> list[str]:
    """What each column really built, what declares itself inexact, and what stands in for what."""
    notes = []
    for column, own in table.sort_values("column").groupby("column"):
        built = sorted(set(own["built"]) - {"-"})
        notes += [f"{column}: {'; or '.join(built)}."] * bool(built)
        inexact = sorted(set(own["known_inexact"]) - {""})
        notes += [f"{column} declares itself inexact: {reason}." for reason in inexact]
    stand_ins = table[table["stand_in"] != ""].drop_duplicates("scene_title")
    return [
        *notes,
        *(f"{title}: {text}." for title, text in stand_ins[["scene_title", "stand_in"]].to_numpy()),
    ]
