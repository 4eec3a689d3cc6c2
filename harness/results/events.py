"""The events of a point, from which its record is made: what a worker replies, as the journal keeps it.

The classes are the schema. A reply is checked when it arrives, because a method is somebody else's code and gives some of
its values; a journal is checked when it is opened.
"""

from typing import Annotated, Any, Required, TypedDict

from ..judge.counts import Count, Score
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
    submitted_ms: list[Ms]
    row_ms: list[Ms]
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
