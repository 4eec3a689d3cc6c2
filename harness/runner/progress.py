"""What a person sees of long work: a bar with a time estimate on standard error; elsewhere plain lines."""

from __future__ import annotations

import sys
import time

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from ..results.record import Record


class Silent:
    """Says nothing."""

    def __enter__(self) -> Silent:
        return self

    def __exit__(self, *_: object) -> None: ...

    def steps(self, count: int) -> None:
        """How many steps there are in all."""

    def doing(self, text: str) -> None:
        """A step begins."""

    def note(self, text: str) -> None:
        """Something that a person should know of, also where no bar is shown."""

    def done(self, count: int = 1) -> None:
        """Steps have been done."""

    def point(self, record: Record) -> None:
        """A record was written."""


class Bar(Silent):
    """A bar on a terminal; elsewhere one line a record."""

    def __init__(self) -> None:
        self.console = Console(stderr=True)
        columns = (
            TextColumn("{task.description}", markup=False), BarColumn(bar_width=24), TaskProgressColumn(),
            TimeElapsedColumn(), TextColumn("left about"), TimeRemainingColumn(),
        )  # fmt: skip
        self.bar = Progress(
            *columns, console=self.console, transient=True, disable=not self.console.is_terminal
        )
        self.task = self.bar.add_task("starting", total=None)
        self.started = time.monotonic()
        self.count, self.at = 0, 0

    def __enter__(self) -> Bar:
        self.bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.bar.stop()

    def steps(self, count: int) -> None:
        self.count = count
        self.bar.update(self.task, total=count)

    def doing(self, text: str) -> None:
        self.bar.update(self.task, description=text[:60])

    def note(self, text: str) -> None:
        if text:
            self.console.print(text, markup=False, highlight=False, soft_wrap=True)

    def done(self, count: int = 1) -> None:
        self.at += count
        self.bar.advance(self.task, count)

    def point(self, record: Record) -> None:
        who = f"{record.scene['name']}, {record.method['label']}"
        status = record.status + (f": {record.reason}" if record.reason else "")
        if self.console.is_terminal:
            if record.status not in ("ok", "skipped"):
                self.console.print(f"{who}: {status}", markup=False, highlight=False)
            return
        spent = time.monotonic() - self.started
        share = self.at / self.count if self.count else 0
        left = f", about {spent / share - spent:.0f} s left" if share else ""
        print(f"[{spent:5.0f} s{left}] {who}: {status}", file=sys.stderr, flush=True)
