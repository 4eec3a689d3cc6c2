"""The events of a point, from which its record is made, and the journal that keeps them, one JSON line each. The
classes are the schema of what a worker replies. A reply is checked when it arrives, because a method is somebody else's
code and gives some of its values; a journal is checked when it is opened.
"""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Required, TypedDict

from ..files import canonical, read_regular, require_storable
from ..judge.verdict import Count, Score
from ..typed_json import checked
from .record import Costs, Ms, PassTimes

Seconds = Annotated[float, 0.0]
Bytes = Annotated[float, 0.0]


class _Step(TypedDict):
    name: str
    part: str
    reads: list[str]
    writes: list[str]
    effect: str | None


class _Planned(TypedDict):
    """The method as it was planned. ``built``: the method's own facts about its structure."""

    built: dict[str, Any]
    replayed: bool
    passes: list[_Step]


class _Counted(TypedDict):
    frame: Count
    counters: dict[str, Annotated[float, 0.0]]


class Prepared(TypedDict):
    """A point was compiled and warmed up."""

    compile_s: Seconds
    first_frame_s: Seconds
    baseline_rss_bytes: Bytes
    frames: list[_Counted]
    frames_left_out: list[int]
    method: _Planned


class _Sampled(TypedDict, total=False):
    """What a round found of a frame: the fields of :class:`.record.Frame`."""

    frame: Required[Count]
    started: Required[float]
    total_ms: Required[list[Ms]]
    wall_ms: Required[list[Ms]]
    passes: Required[list[PassTimes]]
    stopped_by: Required[str]
    regrown: Required[Count]
    memory_bytes: Required[Bytes]
    memory_source: Required[str]
    submitted_ms: Ms
    costs: Costs


class _Built(TypedDict):
    built: dict[str, Any]


class Sampled(TypedDict):
    """One round of samples of every frame."""

    started: float
    spent_s: Seconds
    method: _Built
    frames: list[_Sampled]
    peak_rss_bytes: Bytes


class Round(Sampled):
    """The same, with its number."""

    round: Count


class _Graded(TypedDict, total=False):
    frame: Required[Count]
    score: Required[Score | None]
    unscored: Required[str | None]
    shadow_rays: Count
    flip: Annotated[float, 0.0] | None
    flip_missing: str | None


class Finished(TypedDict):
    """The answers were scored."""

    frames: list[_Graded]


EVENTS: dict[str, type] = {"prepared": Prepared, "round": Round, "finished": Finished}
"""The schema of each event, by name."""


class _Event(TypedDict):
    event: str


class Journal:
    """The events of an unfinished point: one JSON object per line, written to disk before :meth:`append` returns. An
    incomplete last line, left by a crash, is removed when the journal is opened again, and so is all from the first
    event on that does not have the type that ``schema`` gives for its name (others may have any).
    """

    def __init__(self, path: Path, schema: Mapping[str, type] = MappingProxyType({})):
        self.path = path
        self.schema = schema
        self.events: list[dict[str, Any]] = []
        if path.exists():
            self._recover()

    def _recover(self) -> None:
        whole = 0
        for line in read_regular(self.path).splitlines(keepends=True):
            try:
                event = checked(_Event, json.loads(line) if line.endswith(b"\n") else None)
                checked(self.schema.get(event["event"], _Event), event)
                require_storable(event)
            except (ValueError, RecursionError, OverflowError):
                break
            self.events.append(event)
            whole += len(line)
        if whole != self.path.stat().st_size:
            os.truncate(self.path, whole)

    def append(self, event: dict[str, Any]) -> None:
        """Add an event. Raises OSError where it cannot be written; the journal is then as it was."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        line = (canonical(event) + "\n").encode()
        before = self.path.stat().st_size if self.path.exists() else 0
        try:
            with open(self.path, "ab") as file:
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
        except OSError:
            if self.path.exists():
                os.truncate(self.path, before)
            raise
        self.events.append(event)

    def rounds(self) -> dict[int, dict[str, Any]]:
        """The rounds that are complete, by number."""
        return {event["round"]: event for event in self.events if event["event"] == "round"}

    def first(self, kind: str) -> dict[str, Any] | None:
        return next((event for event in self.events if event["event"] == kind), None)

    def remove(self) -> None:
        """Delete the journal after its record is written."""
        self.path.unlink(missing_ok=True)
