"""Tables for people on a line of limited width: whole columns side by side, and below one another what finds no room.

The width is that of the terminal or of the variable COLUMNS; else 160 columns in a file or a pipe, which can be scrolled.
"""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pandas import DataFrame
    from rich.console import Console
    from rich.text import Text

PIPE_WIDTH = 160
GAP = 2
"""Columns between two columns of a table."""
SENTENCE = 38
"""Columns from which a column of a table holds sentences: it may be broken between words."""
MARKS = (("**", "bold green"), ("*", "dim"))
"""Emphasis of a whole cell in Markdown, and its style in a terminal."""


def make_console() -> Console:
    """A console that prints text as it is."""
    from rich.console import Console

    wide = None if sys.stdout.isatty() or "COLUMNS" in os.environ else PIPE_WIDTH
    return Console(highlight=False, markup=False, width=wide)


def print_table(body: DataFrame, heading: str = "", console: Console | None = None) -> None:
    """Print a table of texts. What does not fit beside the columns that name its rows follows below, with those again."""
    from rich.table import Column, Table

    console = console or make_console()
    if heading:
        console.print(f"\n{heading}", style="italic")
    cells = body.astype(object).where(body.notna(), "-").astype(str)
    for names, widths in groups(cells, console.width):
        columns = [Column(str(name), width=widths[name], overflow="fold") for name in names]
        shown = Table(*columns, box=None, pad_edge=False, padding=(0, GAP, 0, 0))
        for line in cells[names].to_numpy().tolist():
            shown.add_row(*map(styled, line))
        console.print(shown)


def groups(cells: DataFrame, room: int) -> list[tuple[list[str], dict[str, int]]]:
    """The columns that stand side by side in ``room``, group by group, and how wide each column is.

    Sentences give way first. Every group begins with the columns that name the rows.
    """
    widths = {name: needed(str(name), cells[name]) for name in cells}
    sentences = [name for name, width in widths.items() if width > SENTENCE]
    spare = room - sum(width + GAP for name, width in widths.items() if name not in sentences)
    for left, name in enumerate(sentences):
        share = spare // (len(sentences) - left) - GAP
        widths[name] = min(widths[name], max(SENTENCE, min(share, room - GAP)))
        spare -= widths[name] + GAP
    keys = list(cells.columns[: naming(cells)])
    own = sum(widths[name] + GAP for name in keys)
    if own + max(widths.values()) > room:
        keys, own = keys[:1], widths[keys[0]] + GAP
    found: list[tuple[list[str], dict[str, int]]] = [(list(keys), widths)]
    used = own
    for name in cells.columns[len(keys) :]:
        if used + widths[name] > room and found[-1][0] != keys:
            found.append((list(keys), widths))
            used = own
        found[-1][0].append(name)
        used += widths[name] + GAP
    return found


def needed(name: str, column: DataFrame) -> int:
    """Columns for the cells and for the longest word of the heading, which may take three lines or so."""
    from rich.cells import cell_len

    cells = max((cell_len(styled(cell).plain) for cell in column), default=0)
    return max(cells, *(cell_len(word) for word in (*name.split(), "")), -(-len(name) // 3))


def naming(cells: DataFrame) -> int:
    """How many of the first columns tell every row from the others; one where none do."""
    counts = range(1, min(3, cells.shape[1]) + 1)
    return next((n for n in counts if not cells.iloc[:, :n].duplicated().any()), 1)


def styled(cell: str) -> Text:
    """A cell as a terminal shows it: emphasis of the whole cell in its style, a cell with wrong answers in red."""
    from rich.text import Text

    from .style import WRONG

    cell = cell.replace(r"\*", "*")
    for mark, look in MARKS:
        if cell.startswith(mark) and cell.endswith(mark) and len(cell) > 2 * len(mark):
            return Text(cell[len(mark) : -len(mark)], style=look)
    return Text(cell, style="red" if WRONG in cell else "")
