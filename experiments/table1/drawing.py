"""Table 1: scenes down, methods across, the paper's own columns beside them. CSV, markdown, terminal, a bar chart.

Made from the records in a folder; nothing is timed or scored here.
"""

from __future__ import annotations

import textwrap
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from ...harness.report import document, gallery, panels, style
from ...harness.report import paper_table1 as paper
from .sheet import Cell, Sheet, sheet, with_columns

if TYPE_CHECKING:
    from pandas import DataFrame

PIPE_WIDTH = 160
"""Columns at least where the output is not a terminal: a file can be scrolled."""

HEAD_WIDTH = 18
"""Columns after which a method's label is broken."""

CUT = 4.0
"""A bar more than this many times longer than the next is cut off, with a mark; its number stands beside it."""

COLUMNS = (
    "origin scene scene_title stand_in source source_file source_sha256 triangles "
    "method method_title label settings built "
    "device device_name width height preset status reason "
    "build_ms trace_ms light_build_ms shadow_ms total_ms "
    "build_iqr_ms trace_iqr_ms light_build_iqr_ms shadow_iqr_ms iqr_ms between_ms stage_gap "
    "frames frames_left_out samples primary_mrays_per_s shadow_mrays_per_s frame_mrays_per_s "
    "memory_bytes peak_rss_bytes true_errors pixels_scored excused_share check reference_errors known_inexact unscored "
    "regrown compile_s first_frame_s environment key"
).split()
"""The columns of the CSV: those of a point (:func:`.results.means.points`), after ``origin``: this run or the paper."""


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Table, drawing and gallery from the records in a folder; printed too unless ``quiet``.

    table1.csv  one row a point, then the paper's printed entries
    table1.md   what the terminal shows, and part by part detail
    table1.svg  stacked bars of each scene
    gallery.png the pictures of ``folder/images``, where there are any
    """
    import pandas as pd

    frames = document.frames(folder)
    table, older = document.named(frames), frames.attrs["older"]
    made = sheet(table)
    if older:
        others = f"{older} older record{'s' if older != 1 else ''}"
        note = f"Not shown: {others} of these points, or of other scenes of the same names."
        made = replace(made, notes=(*made.notes, note))
    rows = pd.concat([table.assign(origin="this run"), paper_rows(table["scene"].unique())])
    files = [
        document.write_csv(rows, folder / "table1.csv", COLUMNS),
        markdown(made, table, folder / "table1.md"),
    ]
    if table["total_ms"].notna().any():
        files.append(bars(with_columns(table), folder / "table1.svg"))
    files += gallery.draw(folder, list(table["scene"].unique()), made.title)
    if not quiet:
        show(made)
    return files


def paper_rows(scenes: Any) -> DataFrame:
    """The paper's printed entries for these scenes, in the same columns, marked as the paper's own."""
    import pandas as pd

    rows = []
    for scene in (scene for scene in scenes if scene in paper.ROWS):
        for column, text in zip(paper.COLUMNS, paper.cells(scene), strict=True):
            values = paper.numbers(scene, column.key)
            rows.append({"origin": paper.LABEL, "scene": scene, "scene_title": paper.ROWS[scene].title,
                         "method": column.title, "label": column.source, "device_name": f"NVIDIA {paper.GPU}",
                         "width": paper.SIZE[0], "height": paper.SIZE[1], "status": "printed" if values else "n/a",
                         "reason": f"printed as {text!r}", "unscored": "the paper states no errors",
                         **{f"{name}_ms": value for name, value in values.items()}})  # fmt: skip
    return pd.DataFrame(rows)


def markdown(made: Sheet, table: DataFrame, path: Path) -> Path:
    """The table with the paper's columns at its right, the notes, and the parts of every point."""
    import pandas as pd

    titles = ["scene", *made.columns, *(f"*{c.title}*" for c in paper.COLUMNS)]
    cells = [
        [
            f"**{line.title}**<br>{line.facts}".replace("\n", "<br>"),
            *map(_md_cell, line.cells),
            *map(_md_text, line.printed),
        ]
        for line in made.lines
    ]
    lines = [f"# {made.title}", "", f"Columns in italics: {paper.LABEL}, as printed.", ""]
    lines += [*document.markdown(pd.DataFrame(cells, columns=titles)), ""]
    lines += [f"- {_md_text(note)}" for note in made.notes]
    lines += ["", f"The paper's columns ({paper.LABEL}):", ""]
    lines += [f"- *{c.title}*: {_md_text(c.source)}." for c in paper.COLUMNS]
    lines += [f"- {_md_text(note)}" for note in paper.FOOTNOTES]
    lines += ["", "## Part by part", "", "Medians in ms; ± is half the interquartile range of repeats.", ""]
    path.write_text("\n".join([*lines, *document.markdown(parts(table))]) + "\n", encoding="utf-8")
    return path


def _md_text(text: str) -> str:
    """Text in which markdown sees no emphasis."""
    return text.replace("*", "\\*").replace("_", "\\_")


def _md_cell(cell: Cell) -> str:
    lines = list(cell.lines)
    if cell.best and len(lines) > 1:
        lines[1] = f"**{lines[1]}**"
    return "<br>".join(lines)


def parts(table: DataFrame) -> DataFrame:
    """A row a measured point: the parts of its frame with their spread, its error, rates and memory."""
    import pandas as pd

    done = document.measured(table)
    made = pd.DataFrame({"scene": done["scene"], "method": done["label"]})
    for name in ("build", "trace", "light build", "shadow", "whole frame"):
        stem = name.replace(" ", "_") + "_" if name != "whole frame" else ""
        ms, iqr = done[f"{stem or 'total_'}ms"], done[f"{stem}iqr_ms"]
        made[name] = [
            f"{style.number(x)} ± {style.number(y / 2)}" if x else "-" for x, y in zip(ms, iqr, strict=True)
        ]
    made["between rounds"] = done["between_ms"].map(style.number)
    made["error"] = done["error"]
    for rays in ("primary", "shadow"):
        made[f"{rays} Mrays/s"] = done[f"{rays}_mrays_per_s"].map(style.number)
    return made.assign(**{"memory MB": done["memory_bytes"].map(style.megabytes)})


def bars(table: DataFrame, path: Path) -> Path:
    """Stacked bars: the parts of a frame by method, one panel a scene with a scale of its own."""
    scenes = [own for _, own in table.groupby(["scene", "scene_title"], sort=False)]
    counts = [len(own) for own in scenes]
    size = (style.COLUMN_WIDTH, sum(n * 0.15 + 0.5 for n in counts) + 0.55)
    colours = style.colours(table["method"])
    with panels.sheet(path, size, len(scenes), legend=4, grid="x", height_ratios=counts) as (figure, grid):
        panels.name_parts(grid[0, 0])
        for axes, own in zip(grid[:, 0], scenes, strict=True):
            whole = own[["build_ms", "trace_ms", "light_build_ms", "shadow_ms"]].sum(axis=1)
            ends = whole.combine(own["total_ms"] + own["iqr_ms"] / 2, max).fillna(0.0).sort_values()
            longest = ends.iloc[-1] or 1.0
            if len(ends) > 1 and longest > CUT * ends.iloc[-2] > 0:
                longest = 1.5 * ends.iloc[-2]
            times = own["total_ms"].map(style.number) + " " + own["error"]
            texts = list(times.where(own["total_ms"].notna(), own["status"]))
            panels.bars(axes, own, [panels.part_tints(colours[x]) for x in own["method"]], texts, longest)
            axes.set_yticks(range(len(own)), own["column"])
            axes.set_title(own["title"].iloc[0], loc="left", pad=2)
            axes.set_xlim(0, longest * 1.38)
        figure.supxlabel(
            "ms per frame. Bar: its parts, measured one by one, added up.\nBlack tick and number: the whole frame, "
            "measured apart;\nwhisker: interquartile range of repeats", fontsize=6.5,
        )  # fmt: skip
    return path


def show(made: Sheet, console: Console | None = None) -> None:
    """Print the table: methods across where the terminal is wide enough, one line a method where it is not."""
    if console is None:
        console = Console()
        if not console.is_terminal:
            console = Console(width=max(PIPE_WIDTH, _width(_wide(made), console)))
    wide = _wide(made)
    console.print(wide if _width(wide, console) <= console.width else _narrow(made))
    for note in made.notes:
        console.print(Text("- " + note), soft_wrap=False, highlight=False)
    for text in (f"The paper's numbers: {paper.LABEL}.", *paper.FOOTNOTES):
        console.print(Text("- " + text, style="dim"), highlight=False)


def _width(table: Table, console: Console) -> int:
    """Columns that a table takes when nothing in it is broken."""
    return console.measure(table, options=console.options.update(width=10_000)).maximum


def _text(cell: Cell) -> Text:
    text = Text("\n".join(cell.lines))
    if cell.bad:
        text.stylize("red")
    elif cell.best:
        text.stylize("bold green")
    return text


def _wide(made: Sheet) -> Table:
    table = Table(title=made.title, title_justify="left", show_lines=True, pad_edge=False)
    table.add_column("scene", no_wrap=True)
    for column in made.columns:
        table.add_column(Text("\n".join(textwrap.wrap(column, HEAD_WIDTH))), no_wrap=True)
    for c in paper.COLUMNS:
        table.add_column(f"{c.title}\n[dim]paper,\n{paper.GPU}[/]", no_wrap=True, style="dim")
    for line in made.lines:
        cells = [_text(cell) for cell in line.cells]
        table.add_row(Text(f"{line.title}\n{line.facts}"), *cells, *(Text(p) for p in line.printed))
    return table


def _narrow(made: Sheet) -> Table:
    table = Table(title=made.title, title_justify="left", pad_edge=False)
    table.add_column("scene, method")
    for name in ("build / trace\nms", "with shadows\nms", "\nrate, memory"):
        table.add_column(name, no_wrap=True)
    for line in made.lines:
        table.add_section()
        table.add_row(Text(line.title, style="bold"), "", "", line.facts.replace("\n", ", "))
        for column, cell in zip(made.columns, line.cells, strict=True):
            style_ = "red" if cell.bad else "bold green" if cell.best else ""
            times, rate_and_memory = cell.lines[:2], ", ".join(cell.lines[2:])
            table.add_row(
                Text(f"  {column}"), *times, *([""] * (2 - len(times))), rate_and_memory, style=style_
            )
        if set(line.printed) != {"-"}:
            for c, text in list(zip(paper.COLUMNS, line.printed, strict=True))[:-1]:
                total = line.printed[-1] if c.key == "ours" else ""
                table.add_row(Text(f"  {c.title}"), Text(text), total, f"paper, {paper.GPU}", style="dim")
    return table
