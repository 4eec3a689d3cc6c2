"""Progress messages on standard error: a bar with an estimate on a terminal, else plain lines."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from statistics import fmean, median
from typing import TypeVar

from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from ..report.terminal import plain_console
from ..results.record import Record
from ..texts import visible

QUIET_S = 10.0  # without a bar, a step is printed if it is of a new kind, or after so many seconds of silence


class Silent:
    """Receives progress events, prints nothing. A step: a command to a worker. ``more``: not in the estimate."""

    more = ""

    def __enter__(self) -> Silent:
        return self

    def __exit__(self, *_: object) -> None: ...

    def steps(self, count: int) -> None:
        """Set the total number of steps."""

    def doing(self, what: str, who: str = "") -> None:
        """A step begins: its kind, and what it works on."""

    def note(self, text: str) -> None:
        """A message that is printed with or without a bar; an empty text removes it."""

    def done(self, count: int = 1) -> None:
        """Steps are finished."""

    def left(self, seconds: float) -> None:
        """Set the estimated remaining time."""

    def point(self, record: Record) -> None:
        """A record was written."""


Item = TypeVar("Item")


def counted(report: Silent, what: str, items: Iterable[Item], count: int) -> Iterator[Item]:
    """The items of untimed work, one by one as steps of their own, with an estimate of the remaining time."""
    began = time.monotonic()
    report.steps(count)
    report.doing(what, f"1 of {count}")
    for place, item in enumerate(items, 1):
        report.done()
        report.left((time.monotonic() - began) / place * max(0, count - place))
        if place < count:
            report.doing(what, f"{place + 1} of {count}")
        yield item


class Bar(Silent):
    """Prints a bar on a terminal, else a line per kind of step; in both cases a line per record."""

    def __init__(self) -> None:
        self.console = plain_console(stderr=True)
        columns = (
            TextColumn("{task.description}", markup=False), BarColumn(bar_width=24), TaskProgressColumn(),
            TimeElapsedColumn(), TextColumn("{task.fields[left]}", markup=False),
        )  # fmt: skip
        self.bar = Progress(*columns, console=self.console, transient=True, disable=not self.console.is_terminal)
        self.task = self.bar.add_task("starting", total=None, left="")
        self.started = time.monotonic()
        self.said, self.last = self.started, ""
        self.end: float | None = None

    def __enter__(self) -> Bar:
        self.bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.bar.stop()

    def steps(self, count: int) -> None:
        self.end = None  # the earlier estimate was for other steps
        self.bar.update(self.task, total=count, completed=0)

    def doing(self, what: str, who: str = "") -> None:
        text = f"{what} ({who})" if who else what
        self.bar.update(self.task, description=visible(text)[:60], left=self._left())
        if not self.console.is_terminal and (what != self.last or time.monotonic() - self.said > QUIET_S):
            self._line(text)
        self.last = what

    def note(self, text: str) -> None:
        if text:
            self._line(text)

    def done(self, count: int = 1) -> None:
        self.bar.advance(self.task, count)

    def left(self, seconds: float) -> None:
        self.end = time.monotonic() + seconds

    def point(self, record: Record) -> None:
        times = [median(frame.total_ms) for frame in record.frames if frame.total_ms]
        mean = fmean(times) if times else 0.0
        result = f"{mean:{',.0f' if mean >= 100 else '.3g'}} ms per frame" if times else "no time"
        result = result + self._short(record) if record.status == "ok" else record.status
        light = (record.scene.get("lighting") or {}).get("label", "")
        what = ", ".join(filter(None, (record.scene["name"], light, record.method["label"])))
        self._line(": ".join(filter(None, (what, result, record.reason))))

    def _short(self, record: Record) -> str:
        """A text if the budget ended before all rounds."""
        taken, asked = len(record.rounds or ()), record.point.get("rounds") or 0
        if not 0 < taken < asked:
            return ""
        return f", {taken} of {asked} rounds: the budget of {record.point.get('budget_s', 0):g} s was spent"

    def _left(self) -> str:
        if self.end is None:
            return ""
        left = max(0.0, self.end - time.monotonic())
        text = f"about {left:.0f} s left" if left < 100 else f"about {left / 60:.0f} min left"
        return f"{text}, {self.more}" if self.more else text

    def _line(self, text: str) -> None:
        self.said = time.monotonic()
        if not self.console.is_terminal:
            left = self._left()
            text = f"[{self.said - self.started:4.0f} s{left and ', ' + left}] {text}"
        self.console.print(text, markup=False, highlight=False, soft_wrap=True)
