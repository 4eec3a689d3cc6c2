"""Passes of every method, planned as for a GPU, fork only where a graph may: without a GPU."""

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
from shadowbench.harness.frame.registry import make_method, method_names
from shadowbench.harness.frame.schedule import graphs
from shadowbench.harness.frame.schedule.capture import capture_passes, refuse_shared
from shadowbench.harness.frame.schedule.needed import stale
from shadowbench.harness.frame.schedule.passes import Pass
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
    monkeypatch.setattr(wp, "Stream", Stream)
    monkeypatch.setattr(wp, "ScopedStream", capture.scoped)
    monkeypatch.setattr(graphs, "capture", lambda device: nullcontext(SimpleNamespace(graph=None)))
    monkeypatch.setattr(wp, "wait_event", capture.join)
    monkeypatch.setattr(wp, "capture_if", capture.condition)
    capture_passes(passes, "cpu")
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
