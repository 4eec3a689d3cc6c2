"""Table 1: scenes down, methods across, the paper's own columns beside them. CSV, markdown, terminal, a bar chart.

A pure function of the records in a folder; nothing is timed or scored here.
"""

from __future__ import annotations

import csv
import textwrap
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from ...harness.report import bars, gallery, style, tidy
from ...harness.report import paper_table1 as paper
from ...harness.report.sheet import Cell, Sheet, error_text, sheet

PIPE_WIDTH = 160
"""Columns at least where the output is not a terminal: a file can be scrolled."""

HEAD_WIDTH = 18
"""Columns after which a method's label is broken."""


def draw(folder: Path | str, quiet: bool = False) -> list[Path]:
    """Draw Table 1 from a folder's records, print it unless ``quiet``, and return the files written.

    table1.csv  tidy: one row a point, then the paper's printed entries
    table1.md   what the terminal shows, and stage by stage detail
    table1.svg  stacked bars of each scene
    gallery.png the pictures of ``folder/images``, where there are any
    """
    folder = Path(folder)
    records, older = tidy.newest(folder)
    rows = tidy.rows(records)
    made = sheet(rows)
    if older:
        others = f"{older} older record{'s' * (older != 1)}"
        note = f"Not shown: {others} of these points, or of other scenes of the same names."
        made = replace(made, notes=(*made.notes, note))
    files = [write_csv(rows, folder / "table1.csv"), write_markdown(made, rows, folder / "table1.md")]
    files += bars.draw(rows, folder / "table1.svg")
    files += gallery.draw(folder, list(dict.fromkeys(r["scene"] for r in rows)), made.title)
    if not quiet:
        show(made)
    return files


def write_csv(rows: Sequence[dict[str, Any]], path: Path) -> Path:
    """The tidy table: one row a point of this run, then the paper's entries, marked in the column ``origin``."""
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, tidy.COLUMNS, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        for row in [*rows, *tidy.paper_rows(scenes)]:
            writer.writerow({key: _plain(row.get(key)) for key in tidy.COLUMNS})
    return path


def _plain(value: Any) -> Any:
    return f"{value:.6g}" if isinstance(value, float) else "" if value is None else value


def write_markdown(made: Sheet, rows: Sequence[dict[str, Any]], path: Path) -> Path:
    """The table with the paper's columns at its right, the notes, and the stages of every point."""
    titles = ["scene", *made.columns, *(f"*{c.title}*" for c in paper.COLUMNS)]
    lines = [f"# {made.title}", "", f"Columns in italics: {paper.LABEL}, as printed.", ""]
    lines += [_md_row(titles), _md_row(["---"] * len(titles))]
    for line in made.lines:
        cells = [_md_cell(cell) for cell in line.cells]
        head = f"**{line.title}**<br>{line.facts}".replace("\n", "<br>")
        lines.append(_md_row([head, *cells, *map(_md_text, line.printed)]))
    lines += ["", *(f"- {_md_text(note)}" for note in made.notes)]
    lines += ["", f"The paper's columns ({paper.LABEL}):", ""]
    lines += [f"- *{c.title}*: {_md_text(c.source)}." for c in paper.COLUMNS]
    lines += [f"- {_md_text(note)}" for note in paper.FOOTNOTES]
    lines += ["", "## Stage by stage", "", "Medians in ms; ± is half the interquartile range of repeats.", ""]
    lines += _stages(rows)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _md_text(text: str) -> str:
    """Text in which markdown sees no emphasis."""
    return text.replace("*", "\\*").replace("_", "\\_")


def _md_row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(text.replace("|", "\\|") for text in cells) + " |"


def _md_cell(cell: Cell) -> str:
    lines = list(cell.lines)
    if cell.best and len(lines) > 1:
        lines[1] = f"**{lines[1]}**"
    return "<br>".join(lines)


def _stages(rows: Sequence[dict[str, Any]]) -> list[str]:
    head = [
        "scene",
        "method",
        "build",
        "trace",
        "light build",
        "shadow",
        "whole frame",
        "between rounds",
        "error",
    ]
    head += ["primary Mrays/s", "shadow Mrays/s", "memory MB"]
    lines = [_md_row(head), _md_row(["---"] * 2 + ["---:"] * 6 + ["---"] + ["---:"] * 3)]
    for row in rows:
        if row["status"] != "ok" or row.get("total_ms") is None:
            continue
        parts = [_spread(row, p) for p in ("build", "trace", "light_build", "shadow")]
        lines.append(
            _md_row(
                [
                    row["scene"],
                    row["label"],
                    *parts,
                    _spread(row, "total"),
                    style.number(row["between_ms"]),
                    error_text(row),
                    style.number(row["primary_mrays_per_s"]),
                    style.number(row["shadow_mrays_per_s"]),
                    style.megabytes(row["memory_bytes"]),
                ]
            )
        )
    return lines


def _spread(row: dict[str, Any], part: str) -> str:
    spread = row["iqr_ms"] if part == "total" else row[f"{part}_iqr_ms"]
    if not row[f"{part}_ms"]:
        return "-"
    return f"{style.number(row[f'{part}_ms'])} ± {style.number(spread / 2)}"


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
