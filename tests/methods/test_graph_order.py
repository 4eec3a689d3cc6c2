"""In a captured graph, every pass comes after those that it depends on, for every method and every prefix of its passes."""

from contextlib import contextmanager, nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
import warp as wp
from helpers.planned_for_cuda import plan_for_cuda
from helpers.small_scenes import make_scene, soup
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.schedule import graphs
from shadowbench.harness.frame.schedule.capture import capture_passes
from shadowbench.harness.frame.schedule.passes import Hints, Pass
from shadowbench.harness.frame.session import Session

from .test_cuda_schedule import VARIANTS

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

    def wait(self, event: frozenset[str]) -> None:
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
        patch.setattr(wp, "Stream", lambda device, priority: None)
        patch.setattr(wp, "ScopedStream", recorder.scoped)
        patch.setattr(graphs, "capture", lambda device: nullcontext(SimpleNamespace(graph=None)))
        patch.setattr(wp, "wait_event", recorder.wait)
        patch.setattr(wp, "capture_if", recorder.condition)
        capture_passes(passes, "cpu")
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
    assert before["answers"] == {"words"}
    assert before["bits"] == {"words", "rays"}
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
