"""Passes of every method, planned as for a GPU, without one: a captured graph forks only where it may, and in it every pass
comes after those that it depends on, for every prefix of its passes.
"""

from __future__ import annotations

from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest
import warp as wp
from helpers.effect_scenes import BEHIND, GIVEN, POINT, SPOT, all_mirrors, scene, session_or_skip
from helpers.planned_for_cuda import plan_for_cuda
from helpers.small_scenes import make_scene, soup
from shadowbench.harness.frame.registry import make_method, method_names
from shadowbench.harness.frame.schedule import graphs
from shadowbench.harness.frame.schedule.capture import capture_passes, refuse_shared
from shadowbench.harness.frame.schedule.needed import stale
from shadowbench.harness.frame.schedule.passes import Hints, Pass
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.prepared import Prepared

VARIANTS: list[tuple[str, dict[str, str]]] = [
    *((name, GIVEN.get(name, {})) for name in method_names()),
    ("bvh2", {"precision": "float32"}),
    ("bvh2", {"update": "refit"}),
    ("ray_grids", {"trial": "shares=3"}),
    ("ray_grids", {"trial": "region=triangles"}),
    ("ray_grids", {"trial": "region=triangles+overlaps=false"}),
    ("hybrid", {"shadows": "grid"}),
]
MARKING = ("ray_grids", "visibility_buffer", "bvh2", "two_level_bvh", "hybrid", "perspective_spherical")
"""Methods of which no pass on a GPU says whether a light has a receiver."""


def session_for_cuda(
    name: str, settings: dict[str, str], prepared: Prepared, monkeypatch: pytest.MonkeyPatch
) -> Session:
    """A session whose frames are planned as for a GPU. Skips what is not captured there."""
    method = make_method(name, settings)
    reason = method.applies(prepared.scene, "cuda")
    if reason or not method.capturable:
        pytest.skip(f"{name}: {reason or 'is not captured as a graph'}")
    plan_for_cuda(method, monkeypatch)
    return Session(method, prepared, 32, 32, "cpu")


SCENES: dict[str, dict[str, Any]] = {
    "points": {"lights": (POINT, POINT)},
    "spots": {"lights": (SPOT, BEHIND, POINT)},
    "facing": {"lights": (SPOT, POINT), "facing": True},
    "mirrors": {"lights": (SPOT, POINT), "mirror": all_mirrors, "bounces": 1},
}


@pytest.mark.parametrize("given", SCENES)
@pytest.mark.parametrize(("name", "settings"), VARIANTS, ids=str)
def test_concurrent_passes_share_nothing_that_one_writes(name, settings, given, monkeypatch):
    """Nor in frames in part: what they leave out, because little has moved, parted forks that must stay apart."""
    session = session_for_cuda(name, settings, scene(**SCENES[given]), monkeypatch)
    refuse_shared(session.passes)
    branched = [work for work in session.passes if work.hints.parallel]
    assert branched or name not in ("bvh2", "hybrid", "ray_grids", "visibility_buffer")
    for changed in ({"light/0"}, {"light/1"}, {"light/0", "light/1"}, {"camera"}, {"camera", "light/0"}, {"points"}):
        refuse_shared(stale(session.all_passes, changed))


class Capture:
    """What a CUDA stream refuses while it is captured: a condition, a loop, or the end, before what forked from it has
    joined; and to wait after a condition or a loop for what came before.
    """

    def __init__(self) -> None:
        self.open: set[Any] = set()
        self.launched: list[str] = []
        self.conditions = self.sections = 0

    @contextmanager
    def scoped(self, stream: Stream) -> Any:
        stream.capture = self
        self.open.add(stream)
        yield stream

    def join(self, event: tuple[Stream, int]) -> None:
        stream, section = event
        assert section == self.sections, "stream is not capturing"
        self.open.discard(stream)

    def launch(self, work: Pass) -> None:
        if work.loops:
            self.pause()
        self.launched.append(work.name)

    def condition(self, only_if: Any, on_true: Any) -> None:
        self.conditions += 1
        self.pause()
        on_true()
        self.pause()

    def pause(self) -> None:
        assert not self.open, "capturing stream has unjoined work"
        self.sections += 1


class Stream:
    capture: Capture

    def __init__(self, device: Any, priority: int):
        self.device = device

    def record_event(self) -> tuple[Stream, int]:
        return self, self.capture.sections


def capture_with(fake: Any, passes: list[Pass], patch: pytest.MonkeyPatch) -> None:
    """Capture the passes on streams that only say what they are asked for."""
    patch.setattr(wp, "Stream", Stream)
    patch.setattr(wp, "ScopedStream", fake.scoped)
    patch.setattr(graphs, "capture", lambda device: nullcontext(SimpleNamespace(graph=None)))
    patch.setattr(wp, "wait_event", fake.join)
    patch.setattr(wp, "capture_if", fake.condition)
    capture_passes(passes, "cpu")


MASKED: dict[str, dict[str, Any]] = {
    "spot first": {"lights": (SPOT, BEHIND, POINT)},
    "spot last": {"lights": (BEHIND, SPOT)},
    "facing": {"lights": (SPOT, POINT), "facing": True},
}


@pytest.mark.parametrize("given", MASKED)
@pytest.mark.parametrize(("name", "settings"), VARIANTS, ids=str)
def test_a_condition_or_a_loop_is_captured_when_all_has_joined(name, settings, given, monkeypatch):
    prepared = scene(**MASKED[given])
    session = session_for_cuda(name, settings, prepared, monkeypatch)
    capture = Capture()
    passes = [replace(work, launch=partial(capture.launch, work)) for work in session.passes]
    capture_with(capture, passes, monkeypatch)
    assert not capture.open
    assert bool(capture.conditions) == (name not in MARKING)
    assert sorted(capture.launched) == sorted(work.name for work in passes)


@pytest.mark.parametrize(("name", "settings"), VARIANTS, ids=str)
def test_a_pass_says_that_it_captures_a_loop(name, settings, monkeypatch):
    prepared = scene((POINT,))
    session = session_or_skip(name, settings, prepared, size=(32, 32))
    session.answers(prepared.moment(0, 32, 32))
    looped, capture_while = [], wp.capture_while

    def counted(condition: Any, body: Any) -> None:
        looped.append(condition)
        capture_while(condition, body)

    monkeypatch.setattr(wp, "capture_while", counted)
    for work in session.all_passes:
        looped.clear()
        work.launch()
        assert bool(looped) == work.loops, work.name
    assert any(work.loops for work in session.all_passes) == (name == "kdtree")


LIGHTS = [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0), (-3.0, 1.0, 0.5), (0.0, 6.0, 0.0), (2.0, 0.0, -4.0)]


class Recorder:
    """Streams that record what has ended before each of their passes."""

    def __init__(self) -> None:
        self.streams: list[set[str]] = [set()]
        self.before: dict[str, set[str]] = {}

    @contextmanager
    def scoped(self, stream: Any) -> Any:
        self.streams.append(set(self.streams[-1]))
        yield SimpleNamespace(record_event=lambda: frozenset(self.streams[-1]))
        self.streams.pop()

    def join(self, event: frozenset[str]) -> None:
        self.streams[-1] |= event

    def launch(self, name: str) -> None:
        self.before[name] = set(self.streams[-1])
        self.streams[-1].add(name)

    def condition(self, only_if: Any, on_true: Any) -> None:
        on_true()


def recorded(passes: list[Pass], monkeypatch: pytest.MonkeyPatch) -> dict[str, set[str]]:
    """For each pass the passes that have ended when it is launched from a captured graph."""
    recorder = Recorder()
    passes = [replace(work, launch=lambda n=work.name: recorder.launch(n)) for work in passes]
    with monkeypatch.context() as patch:
        capture_with(recorder, passes, patch)
    assert recorder.streams == [{work.name for work in passes}], "not all passes have joined at the end"
    return recorder.before


@pytest.mark.parametrize("lights", [1, 3])
@pytest.mark.parametrize(("name", "settings"), VARIANTS, ids=str)
def test_every_pass_comes_after_those_it_depends_on(name, settings, lights, monkeypatch):
    method = make_method(name, settings)
    if not method.capturable:
        pytest.skip(f"{name} is not captured as a graph")
    plan_for_cuda(method, monkeypatch)
    prepared = make_scene(*soup(7, 300), LIGHTS[:lights])
    passes = Session(method, prepared, 32, 32, "cpu").passes
    assert len({work.name for work in passes}) == len(passes)
    for end in range(1, len(passes) + 1):
        before = recorded(passes[:end], monkeypatch)
        for k, work in enumerate(passes[:end]):
            for earlier in passes[:k]:
                shared = {*work.reads, *work.writes}.intersection(earlier.writes)
                shared |= set(work.writes).intersection(earlier.reads)
                if shared and not (work.adds and earlier.adds):
                    assert earlier.name in before[work.name], f"{work.name} beside {earlier.name}: {shared}"


def made(name: str, reads: tuple[str, ...], writes: tuple[str, ...], **more: Any) -> Pass:
    return Pass(name, "trace", reads, writes, lambda: None, **more)


def test_a_pass_that_overlaps_runs_with_what_does_not_depend_on_it(monkeypatch):
    passes = [
        made("words", (), ("words",)),
        made("rays", ("words",), ("rays",), hints=Hints(parallel=(0,))),
        made("bits", ("rays",), ("bits",), hints=Hints(parallel=(0,))),
        made("answers", ("words",), ("answers",), hints=Hints(overlap=True)),
        made("colour", ("answers", "bits"), ("colour",)),
    ]
    before = recorded(passes, monkeypatch)
    assert (before["answers"], before["bits"]) == ({"words"}, {"words", "rays"})
    assert before["colour"] == {"words", "rays", "bits", "answers"}


def test_a_pass_that_overlaps_and_needs_another_keeps_nothing_else_waiting(monkeypatch):
    passes = [
        made("places", (), ("places",), hints=Hints(parallel=(0,))),
        made("offsets", ("places",), ("offsets",), hints=Hints(parallel=(0,), overlap=True)),
        made("rays", ("places", "offsets"), ("rays",), hints=Hints(parallel=(0,), overlap=True)),
        made("stream", ("places",), ("items",), hints=Hints(parallel=(0, 0))),
        made("other stream", ("places",), ("other items",), hints=Hints(parallel=(0, 1))),
        made("rows", ("rays", "items"), ("bits",), hints=Hints(parallel=(0, 0)), adds=True),
        made("other rows", ("rays", "other items"), ("bits",), hints=Hints(parallel=(0, 1)), adds=True),
    ]
    before = recorded(passes, monkeypatch)
    assert before["rays"] == {"places", "offsets"}
    assert before["stream"] == before["other stream"] == {"places"}
    assert before["rows"] == {"places", "offsets", "rays", "stream"}
    assert before["other rows"] == {"places", "offsets", "rays", "other stream"}


@pytest.mark.parametrize("overlaps", [True, False])
def test_a_light_streams_few_triangles_while_its_rays_are_sorted(overlaps, monkeypatch):
    method = make_method("ray_grids", {"trial": f"overlaps={overlaps}+shares=2"})
    plan_for_cuda(method, monkeypatch)
    prepared = make_scene(*soup(7, 300), LIGHTS[:1])
    before = recorded(Session(method, prepared, 32, 32, "cpu").passes, monkeypatch)
    sorting = {"light 0: count and scan", "light 0: scatter rays"}
    for share in (1, 2):
        stream = before[f"light 0: stream triangles, share {share} of 2"]
        assert "light 0: map rays" in stream
        assert sorting & stream == (set() if overlaps else sorting)
        assert sorting <= before[f"light 0: queued rows, share {share} of 2"]


def test_the_branches_of_a_phase_wait_for_all_of_the_one_before(monkeypatch):
    passes = [
        made("one", (), ("a",), hints=Hints(parallel=(0,))),
        made("two", (), ("b",), hints=Hints(parallel=(1,))),
        made("three", ("a", "b"), ("c",), hints=Hints(parallel=(0,), phase=1)),
        made("four", ("b",), ("d",), hints=Hints(parallel=(1,), phase=1)),
    ]
    before = recorded(passes, monkeypatch)
    assert before["two"] == set()
    assert before["three"] == before["four"] == {"one", "two"}
