"""What commands print: JSON, or tables on a console as wide as the terminal or the variable COLUMNS, else 80 columns."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from ..judge.verdict import MEANINGS, Verdict
from ..report.terminal import GAP, column_blocks, plain_console

if TYPE_CHECKING:
    from rich.table import Table

KEY = 16  # width that the first column of a table in blocks has where its texts are as long as that


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
    """A table as one or several below each other, each with the first column: lines break between words only.

    A column is never narrower than its longest word; columns that do not fit beside the others begin another table.
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
