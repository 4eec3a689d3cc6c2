"""The console and the tables of the commands. Width: the terminal or the variable COLUMNS, else 80 columns."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import TYPE_CHECKING

from ..judge.verdict import MEANINGS, Verdict

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table


def make_console() -> Console:
    from rich.console import Console

    return Console(markup=False, highlight=False)


def print_lines(console: Console, *lines: str) -> None:
    """Print lines of text: wrapped at words in a terminal or if COLUMNS is set, not wrapped in a file or a pipe."""
    wrapped = console.is_terminal or "COLUMNS" in os.environ
    for line in lines:
        console.print(line, soft_wrap=not wrapped)


def print_legend(console: Console, kinds: Iterable[Verdict], *more: str) -> None:
    """Print the meaning of each class on its own line."""
    shown = set(kinds)
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
