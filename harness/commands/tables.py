"""The console and the tables of commands: as wide as the terminal or the variable COLUMNS, else 80 columns."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table


def make_console() -> Console:
    from rich.console import Console

    return Console(markup=False, highlight=False)


def make_table(*names: str, numbers: tuple[str, ...] = ()) -> Table:
    """An empty table: columns of text, which are folded where there is no room, then columns of numbers."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in names:
        table.add_column(name, overflow="fold", vertical="bottom")
    for name in numbers:
        table.add_column(name, justify="right", no_wrap=True)
    return table
