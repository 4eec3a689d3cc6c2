"""A record: what became of one point, with every raw sample. Statistics are computed on reading (:mod:`.results.table`).

A record is one JSON file, made from a journal of rounds. The classes below are its schema: a field without a default
must be in the file, one with a default may be absent (an older version or another program did not write it), and a field
that is not declared is refused (:mod:`.results.schema`).
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Annotated, Any, Required, TypedDict, cast

from ..files import require_storable
from ..judge.verdict import Count, Score
from ..texts import FILE_NAME
from ..typed_json import OMITTED, checked, to_json

SCHEMA = 1  # Version of the files. Another one is refused.

STATUSES = ("ok", "skipped", "failed", "timeout", "rejected")
"""The statuses of a point. Every planned point yields exactly one record with one of these."""

FAILURES = ("failed", "timeout")  # statuses that say nothing about the method
SCORING_FAILED = "scoring failed"  # how `Frame.unscored` begins where the process that scores has failed
Ms = Annotated[float, 0.0]  # a measured time in milliseconds: finite and not negative


FileName = Annotated[str, FILE_NAME, "the name of a file"]  # a text that files of the folder are called by

Environment = Annotated[str, re.compile(f"|{FILE_NAME.pattern}"), "the name of a file"]
"""The file in ``environments/``, without its ending; "" where it is not known."""

Side = Annotated[int, 1, 99_999]  # pixels along a side of an image


class Point(TypedDict, total=False):
    """The requested measurement, with all other fields of the configuration. All of it goes into the record's key."""

    width: Required[Side]
    height: Required[Side]
    preset: str | None
    rounds: Annotated[int, 1]
    budget_s: Annotated[float, 0.0]


class LightingFacts(TypedDict, total=False):
    """The lights in place of the scene's, as far as tables show them; further ones are passed on unchanged."""

    label: str
    distance: float | None
    turns: float | None
    moved: str | None


class SourceFacts(TypedDict, total=False):
    """Where a scene's geometry came from."""

    kind: str
    file: str
    sha256: str


class LightFacts(TypedDict, total=False):
    """Facts of a light that tables read. Fields beyond them are passed on unchanged."""

    samples: Annotated[int, 1]


class SceneFacts(TypedDict, total=False):
    """Facts of a scene; old or unmade ones may lack some. Further ones are passed on unchanged."""

    name: Required[FileName]
    title: str | None
    stand_in: str | None
    triangles: Count | None
    vertices: Count | None
    invalid_triangles: Count | None
    lights: list[LightFacts] | None
    lighting: LightingFacts | None
    view: str | None
    source: SourceFacts | None
    frame_count: Count | None
    arrays_sha256: str | None


class MethodFacts(TypedDict, total=False):
    """Facts of a method as it ran; old or unmade ones may lack some. Further ones are passed on unchanged."""

    name: Required[str]
    device: Required[str]
    title: str | None
    label: str | None
    device_name: str | None
    settings: dict[str, Any] | None
    parameters: dict[str, dict[str, Any]] | None
    built: dict[str, Any] | None
    known_inexact: str | None
    source_sha256: str | None


class Clock(TypedDict, total=False):
    """The state of the machine at the end of a round: the load of the host, and what the GPU's driver says as texts."""

    load: float | None
    gpu: dict[str, Any] | None


class Round(TypedDict, total=False):
    """Facts of a round. Fields beyond these are passed on unchanged.

    run    the run that it belongs to; ``environment``: of that run
    noted  when it was written, seconds since the epoch; ``spent_s``: seconds that its samples took
    """

    round: Count
    run: str
    noted: float
    spent_s: Annotated[float, 0.0]
    environment: Environment
    clock: Clock | None


@dataclass
class PassTimes:
    """Samples of a pass, ms. On CUDA, as differences of prefix graphs, they may be negative by noise."""

    name: str
    part: str
    ms: list[float]


@dataclass
class Costs:
    """What a frame costs besides its time, measured in one round (:mod:`.runner.measuring.costs`); None: not measured.

    energy_j  joules of a frame above those of the idle card, whose power was ``idle_w``, watts
    alone_ms  milliseconds a frame of frames one after another; ``pair_ms``: of two at the same time
    missing   why there is no "energy", and no two frames "in flight"
    """

    energy_j: Annotated[float, 0.0] | None = None
    idle_w: Annotated[float, 0.0] | None = None
    alone_ms: Ms | None = None
    pair_ms: Ms | None = None
    missing: dict[str, str] = field(default_factory=dict)


@dataclass
class Frame:
    """One frame of a point: its samples, what it needed, and the judge's score of its answers.

    total_ms     samples of the whole frame on the device's clock; ``wall_ms`` on the host's; ``round``: whose they are
    submitted_ms  of frames that are no graph on a GPU, the host's time to submit one, one sample per round
    row_ms       of such frames in earlier records, whose ``total_ms`` were taken from an idle device: one of several in a
                 row, one per round; it becomes ``total_ms``
    passes       samples pass by pass, measured apart; ``stage_round``: the round of each sample of a pass
    started      when the frame's samples began, seconds since the epoch, one per round; ``stopped_by``: what ended them
    counters     work counters by name
    score        what :mod:`.judge.score` made of the answers; None: not judged, ``unscored`` says why
    hits         primary rays that hit something
    shadow_rays  number of shadow rays: one for each light and each pixel that needs one
    costs        what else it costs, one per round; None: not asked for
    flip         mean FLIP against the reference's picture; None: not computed, ``flip_missing`` says why
    """

    frame: Count
    total_ms: list[Ms]
    wall_ms: list[Ms]
    round: list[Count]
    stage_round: list[Count]
    passes: list[PassTimes]
    regrown: Count
    score: Score | None = None
    unscored: str | None = None
    started: list[float] = field(default_factory=list)
    stopped_by: list[str] = field(default_factory=list)
    memory_bytes: Count | None = None
    memory_source: str | None = field(default=None, metadata=OMITTED)
    counters: dict[str, Annotated[float, 0.0]] | None = field(default_factory=dict)
    hits: Annotated[int, 0] | None = field(default=None, metadata=OMITTED)
    shadow_rays: Annotated[int, 0] | None = field(default=None, metadata=OMITTED)
    submitted_ms: list[Ms] | None = field(default=None, metadata=OMITTED)
    row_ms: list[Ms] | None = field(default=None, metadata=OMITTED)
    flip: Annotated[float, 0.0] | None = field(default=None, metadata=OMITTED)
    flip_missing: str | None = field(default=None, metadata=OMITTED)
    costs: list[Costs] | None = field(default=None, metadata=OMITTED)

    def __post_init__(self) -> None:
        for name in ("wall_ms", "round"):
            if len(getattr(self, name)) != len(self.total_ms):
                raise ValueError(f"{name} has {len(getattr(self, name))} entries, total_ms {len(self.total_ms)}")
        if self.row_ms is not None:
            if len(self.row_ms) != len(set(self.round)):
                raise ValueError(f"row_ms has {len(self.row_ms)} entries for {len(set(self.round))} rounds")
            of_round = dict(zip(sorted(set(self.round)), self.row_ms, strict=True))
            self.total_ms, self.row_ms = [of_round[number] for number in self.round], None
        for step in self.passes:
            if len(step.ms) != len(self.stage_round):
                raise ValueError(f"{step.name} has {len(step.ms)} samples, stage_round {len(self.stage_round)}")

    @property
    def measured(self) -> bool:
        """Whether it has samples. A frame beyond the point's budget has none."""
        return bool(self.total_ms)


@dataclass
class Record:
    """The outcome of a point. ``frames_left_out``: frames beyond the budget; ``asked``: when a run last used this record
    although a later one of the same entry is in the folder, seconds since the epoch.
    """

    key: FileName
    experiment: str
    status: str
    reason: str
    point: Point
    scene: SceneFacts
    method: MethodFacts
    environment: Environment
    stopped_by: str
    frames: list[Frame]
    schema: int = SCHEMA
    compile_s: Annotated[float, 0.0] | None = None
    load_s: Annotated[float, 0.0] | None = None
    first_frame_s: Annotated[float, 0.0] | None = None
    rounds: list[Round] | None = field(default_factory=list)
    frames_left_out: list[Count] | None = field(default_factory=list)
    peak_rss_bytes: Count | None = None
    baseline_rss_bytes: Count | None = None
    asked: float | None = field(default=None, metadata=OMITTED)

    def __post_init__(self) -> None:
        if self.status not in STATUSES:
            raise ValueError(f"status {self.status!r:.30} is not one of {', '.join(STATUSES)}")
        cuda = self.method["device"].startswith("cuda")
        for frame in self.measured:
            times = [step.ms for step in frame.passes]
            # On CUDA the passes of one sample add up to a measured frame, whatever the noise of the single ones.
            lowest = [sum(one) for one in zip(*times, strict=True)] if cuda else [ms for own in times for ms in own]
            if min(lowest, default=0.0) < 0:
                what = "passes add up to" if cuda else "a pass takes"
                raise ValueError(f"frame {frame.frame}: {what} {min(lowest):g} ms, less than 0")

    @property
    def measured(self) -> list[Frame]:
        """The frames that have samples."""
        return [frame for frame in self.frames if frame.measured]

    def frame(self, number: int) -> Frame | None:
        return next((frame for frame in self.frames if frame.frame == number), None)

    @property
    def says_nothing(self) -> bool:
        """Whether it says nothing about the method, or nothing about its answers: ``--retry`` measures the point again."""
        return self.status in FAILURES or any(
            (frame.unscored or "").startswith(SCORING_FAILED) for frame in self.frames
        )

    def to_json(self) -> dict[str, Any]:
        return to_json(self)


def make_record(
    key: str, point: dict[str, Any], scene: dict[str, Any], method: dict[str, Any], environment: str,
    events: Iterable[dict[str, Any]] = (), status: str = "ok", reason: str = "",
) -> Record:  # fmt: skip
    """The record of a point from its journal. Rounds are joined in their order; no sample is dropped.

    ``environment``: where no round names its own; a later run may make the record of one that was stopped.

    Raises ValueError for an unknown status.
    """
    known = list(events)
    # The first preparation compiled; a later one, after a restart, found the kernels ready.
    prepared: dict[str, Any] = next((e for e in known if e["event"] == "prepared"), {})
    finished: dict[str, Any] = next((e for e in known if e["event"] == "finished"), {})
    rounds = sorted((e for e in known if e["event"] == "round"), key=lambda e: e["round"])
    frames = _join_rounds(rounds)
    for extra in (*prepared.get("frames", ()), *finished.get("frames", ())):
        frame = frames.setdefault(extra["frame"], _empty_frame(extra["frame"]))
        for name, value in extra.items():
            setattr(frame, name, Score.from_json(value) if name == "score" and value else value)
    last = rounds[-1] if rounds else {}
    return Record(
        key=key, experiment=point.get("experiment", ""), status=status, reason=reason, point=cast(Point, point),
        scene=cast(SceneFacts, scene),
        method=cast(MethodFacts, {**method, **prepared.get("method", {}), **last.get("method", {})}),
        environment=last.get("environment", environment), compile_s=prepared.get("compile_s"),
        load_s=scene.get("load_s"), first_frame_s=prepared.get("first_frame_s"),
        rounds=[_round(event) for event in rounds], frames=[frames[index] for index in sorted(frames)],
        frames_left_out=prepared.get("frames_left_out", []),
        peak_rss_bytes=max((one["peak_rss_bytes"] or 0 for one in rounds), default=None),
        baseline_rss_bytes=prepared.get("baseline_rss_bytes"),
        stopped_by=" and ".join(sorted({f["stopped_by"] for one in rounds for f in one["frames"]})),
    )  # fmt: skip


def as_read(record: Record) -> Record:
    """The same record, as it is read from its file. Raises ValueError, as reading would, if it cannot be."""
    require_storable(record.to_json())
    return checked(Record, record.to_json())


def _round(event: dict[str, Any]) -> Round:
    """The facts of a round, without its samples."""
    facts: Any = {name: value for name, value in event.items() if name not in ("event", "frames", "method")}
    return facts


def _empty_frame(index: int) -> Frame:
    return Frame(index, [], [], [], [], [], 0, unscored="not answered")


def _join_rounds(rounds: list[dict[str, Any]]) -> dict[int, Frame]:
    frames: dict[int, Frame] = {}
    for event in rounds:
        for part in event["frames"]:
            frame = frames.setdefault(part["frame"], _empty_frame(part["frame"]))
            frame.total_ms += part["total_ms"]
            frame.wall_ms += part["wall_ms"]
            frame.round += [event["round"]] * len(part["total_ms"])
            if "submitted_ms" in part:
                frame.submitted_ms = [*(frame.submitted_ms or ()), part["submitted_ms"]]
            frame.started.append(part["started"])
            frame.stopped_by.append(part["stopped_by"])
            frame.regrown = max(frame.regrown, part["regrown"])
            frame.memory_bytes = max(frame.memory_bytes or 0, part["memory_bytes"])
            frame.memory_source = part["memory_source"]
            if "costs" in part:
                frame.costs = [*(frame.costs or ()), Costs(**part["costs"])]
            # Passes are joined by place: a method's pass list is the same in every round of a point.
            if not frame.passes:
                frame.passes = [PassTimes(step["name"], step["part"], []) for step in part["passes"]]
            for step, new in zip(frame.passes, part["passes"], strict=True):
                step.ms += new["ms"]
            count = len(part["passes"][0]["ms"]) if part["passes"] else 0
            frame.stage_round += [event["round"]] * count
    return frames
