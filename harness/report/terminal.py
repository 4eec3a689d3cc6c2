"""What commands print: JSON, or tables of limited width; columns that do not fit follow in further blocks below. The
width is that of the terminal or of the variable COLUMNS; else 160 columns in a file or a pipe, which can be scrolled,
and 80 for the tables of commands.
"""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..judge.verdict import MEANINGS, Verdict
from ..texts import visible, visible_lines
from .dataframe import DataFrame
from .numbers import WRONG

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

PIPE_WIDTH = 160
KEY = 16  # width that the first column of a table in blocks has where its texts are as long as that
GAP = 2  # columns between two columns of a table
SENTENCE = 38  # width from which a column of a table is taken to hold sentences, which may be broken between words
MARKS = {"**": "bold green", "*": "dim"}  # emphasis of a whole cell in Markdown, and its style in a terminal


def plain_console(**options: Any) -> Console:
    """A console that prints text as it is, with control characters as numbers (:mod:`..texts`)."""
    from rich.console import Console

    class Plain(Console):
        def render_str(self, text: str, **how: Any) -> Text:  # type: ignore[override]
            return super().render_str(visible_lines(text), **how)

    return Plain(highlight=False, markup=False, **options)


def make_console() -> Console:
    """The console that reports are printed on."""
    wide = None if sys.stdout.isatty() or "COLUMNS" in os.environ else PIPE_WIDTH
    return plain_console(width=wide)


def print_table(body: DataFrame, heading: str = "", console: Console | None = None) -> None:
    """Print a table of texts. Columns that do not fit follow in further blocks below."""
    from rich.cells import cell_len
    from rich.table import Column, Table

    console = console or make_console()
    if heading:
        console.print(f"\n{heading}", style="italic")
    cells = body.astype(object).where(body.notna(), "-").astype(str).rename(columns=str)
    # The heading may take three lines or so.
    least = {name: max(len(name) // 3 + 1, *map(len, name.split())) for name in cells}
    widths = {name: max([n, *(cell_len(styled(cell).plain) for cell in cells[name])]) for name, n in least.items()}
    needed = {name: min(width, SENTENCE) + GAP for name, width in widths.items()}
    told = [n for n in range(1, min(3, len(widths)) + 1) if not cells.iloc[:, :n].duplicated().any()]
    keys = list(cells)[: told[0] if told else 1]
    if sum(needed[name] for name in keys) + max(needed.values()) > console.width + GAP:
        keys = keys[:1]
    # Columns of sentences share the width that the others leave.
    for names in column_blocks(needed, keys, console.width + GAP):
        fixed = {name: widths[name] if widths[name] <= SENTENCE else None for name in names}
        columns = [Column(name, width=width, overflow="fold") for name, width in fixed.items()]
        shown = Table(*columns, box=None, pad_edge=False, padding=(0, GAP, 0, 0))
        for line in cells[names].to_numpy().tolist():
            shown.add_row(*map(styled, line))
        console.print(shown)


def column_blocks(needed: Mapping[Any, int], keys: Sequence[Any], room: int) -> list[list[Any]]:
    """Columns side by side: blocks that begin with ``keys``, each as many columns as fit into ``room``, one at least."""
    blocks = [[*keys]]
    for name in list(needed)[len(keys) :]:
        if len(blocks[-1]) > len(keys) and sum(needed[n] for n in [*blocks[-1], name]) > room:
            blocks.append([*keys])
        blocks[-1].append(name)
    return blocks


def styled(cell: str) -> Text:
    """A cell as a terminal shows it: emphasis of the whole cell in its style, a cell with wrong answers in red."""
    from rich.text import Text

    cell = visible(cell).replace(r"\*", "*")
    if marked := re.fullmatch(r"(\*{1,2})(.+)\1", cell):
        return Text(marked[2], style=MARKS[marked[1]])
    return Text(cell, style="red" if WRONG in cell else "")


def tell(facts: Any, as_json: bool, show: Callable[[Any], None]) -> None:
    """Print facts as JSON, or show them to a person."""
    if as_json:
        print(json.dumps(facts, indent=1))
    else:
        show(facts)


def print_lines(*lines: str) -> None:
    """Print lines of text: wrapped at words in a terminal or if COLUMNS is set, not wrapped in a file or a pipe."""
    console = plain_console()
    wrapped = console.is_terminal or "COLUMNS" in os.environ
    for line in lines:
        console.print(line, soft_wrap=not wrapped)


def print_legend(kinds: Iterable[Verdict], *more: str) -> None:
    """Print the meaning of each class on its own line."""
    console, shown = plain_console(), set(kinds)
    for line in (*(f"{kind.label}: {MEANINGS[kind]}" for kind in MEANINGS if kind in shown), *more):
        console.print(line, style="dim")


def make_table(*names: str, numbers: tuple[str, ...] = ()) -> Table:
    """An empty table: columns of text, folded if the table is too wide, then columns of numbers."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, collapse_padding=True, header_style="bold")
    for name in names:
        table.add_column(name, overflow="fold")
    for name in numbers:
        table.add_column(name, justify="right", no_wrap=True)
    return table


def table_blocks(names: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> list[Table]:
    """A table as one or several below each other, each with the first column: lines break between words only. A column
    is never narrower than its longest word; columns that do not fit beside the others begin another table.
    """
    from rich.table import Column, Table

    cells = [[name, *(row[i] for row in rows)] for i, name in enumerate(names)]
    least = [max(len(word) for text in column for word in text.split() or [""]) for column in cells]
    most = [max(map(len, column)) for column in cells]
    least[0] = max(least[0], min(most[0], KEY))
    tables = []
    for block in column_blocks({i: least[i] + GAP for i in range(len(cells))}, [0], width):
        wide = {i: least[i] for i in block}
        for _ in range(width - sum(wide.values()) - GAP * len(block)):
            longest = max(block, key=lambda i: most[i] - wide[i])
            wide[longest] += wide[longest] < most[longest]
        columns = [Column(names[i], width=wide[i]) for i in block]
        table = Table(*columns, box=None, padding=(0, 0, 0, GAP), header_style="bold")
        for row in rows:
            table.add_row(*(row[i] for i in block))
        tables.append(table)
    return tables
