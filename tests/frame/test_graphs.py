"""Priorities of captured graphs: what nothing waits for fills what other passes leave idle."""

from __future__ import annotations

import ctypes
from contextlib import nullcontext
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import warp as wp
from shadowbench.harness.frame.schedule import graphs
from shadowbench.harness.frame.schedule.capture import capture_passes
from shadowbench.harness.frame.schedule.passes import Hints, Pass


def made(name: str, reads: tuple[str, ...], writes: tuple[str, ...], launch: Any, **more: Any) -> Pass:
    return Pass(name, "trace", reads, writes, launch, **more)


class Captured:
    """What a capture without a GPU launches: of each pass its stream, that stream's priority, and what it has waited for."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, passes: list[Pass]):
        self.open, self.last = [self], dict[Any, str]()
        self.waits: list[tuple[str, Any]] = []
        self.seen: dict[str, tuple[Any, int, tuple[str, ...]]] = {}
        monkeypatch.setattr(wp, "Stream", lambda device, priority: Stream(self, priority))
        monkeypatch.setattr(wp, "ScopedStream", lambda stream: stream)
        monkeypatch.setattr(wp, "ScopedCapture", lambda: nullcontext(SimpleNamespace(graph=None)))
        monkeypatch.setattr(wp, "wait_event", lambda event: self.waits.append((event, self.open[-1])))
        monkeypatch.setattr(graphs, "keep_priorities", lambda graph: False)
        for work in passes:
            object.__setattr__(work, "launch", partial(self.launch, work.name))
        capture_passes(passes, "cpu")
        assert len(self.seen) == len(passes)

    def launch(self, name: str) -> None:
        stream = self.open[-1]
        self.seen[name] = stream, stream.priority, tuple(event for event, waiting in self.waits if waiting is stream)
        self.last[stream] = name


class Stream:
    def __init__(self, captured: Captured, priority: int):
        self.captured, self.priority = captured, priority

    def record_event(self) -> str:
        return self.captured.last.get(self, "")

    def __enter__(self) -> Stream:
        self.captured.open.append(self)
        return self

    def __exit__(self, *given: Any) -> None:
        self.captured.open.pop()


def test_passes_that_nothing_waits_for_are_idle(monkeypatch):
    passes = [
        made("words", (), ("words",), None),
        made("one", ("words",), ("bits",), None, hints=Hints(parallel=(0,)), adds=True),
        made("two", ("words",), ("bits",), None, hints=Hints(parallel=(1,)), adds=True),
        made("sorting", ("words",), ("cells",), None, hints=Hints(overlap=True)),
        made("answers", ("words",), ("answers",), None, hints=Hints(overlap=True, yields=True)),
        made("aim", (), ("aim",), None, hints=Hints(early=True)),
        made("last", ("bits", "cells", "aim"), ("colour",), None),
    ]
    priorities = {name: priority for name, (_, priority, _) in Captured(monkeypatch, passes).seen.items()}
    idle = {"answers", "aim"}
    assert priorities == {work.name: graphs.IDLE if work.name in idle else graphs.URGENT for work in passes}


def test_a_stream_waits_once_for_what_runs_early(monkeypatch):
    """Early passes of two branches run on streams of their own. What depends on one waits for it, and for no other."""
    passes = [
        made("words", (), ("words",), None),
        *(made(f"aim {i}", (), (f"aim/{i}",), None, hints=Hints(early=True, parallel=(i,))) for i in range(2)),
        *(
            made(f"{name} {i}", ("words", f"aim/{i}", *reads), (f"{name}/{i}",), None, hints=Hints(parallel=(i,)))
            for i in range(2)
            for name, reads in (("place", ()), ("sort", (f"place/{i}",)), ("test", (f"sort/{i}",)))
        ),
        made("last", ("test/0", "test/1", "aim/0"), ("colour",), None),
    ]
    captured = Captured(monkeypatch, passes)
    stream, waited = ({name: one[k] for name, one in captured.seen.items()} for k in (0, 2))
    main = stream["words"]
    assert (waited["words"], len({stream["aim 0"], stream["aim 1"], main})) == ((), 3)
    for i in range(2):
        assert [waited[f"{name} {i}"] for name in ("place", "sort", "test")] == [(f"aim {i}",)] * 3
    assert stream["last"] is main
    assert {"test 0", "test 1", "aim 0"} <= set(waited["last"])
    assert {event for event, waiting in captured.waits if waiting is main} >= {"aim 0", "aim 1"}, (
        "a stream is never joined"
    )


def test_without_the_driver_warp_makes_the_graph(monkeypatch):
    def missing(name: str) -> None:
        raise OSError(f"{name}: not found")

    monkeypatch.setattr(ctypes, "CDLL", missing)
    graph = SimpleNamespace(graph=None, graph_exec=None)
    assert not graphs.keep_priorities(graph)
    assert graph.graph_exec is None


@wp.kernel(enable_backward=False)
def add_kernel(amount: wp.int32, numbers: wp.array(dtype=wp.int32)):
    numbers[wp.tid()] = numbers[wp.tid()] + amount


@pytest.mark.skipif(not wp.is_cuda_available(), reason="no CUDA device on this machine")
def test_a_graph_with_priorities_does_the_same_work():
    device = "cuda:0"
    numbers, others = (wp.zeros(1000, dtype=wp.int32, device=device) for _ in range(2))

    def add(amount: int, to: wp.array) -> Any:
        return lambda: wp.launch(add_kernel, dim=1000, inputs=[amount], outputs=[to], device=device)

    passes = [
        made("one", (), ("a",), add(1, numbers)),
        made("overlapping", ("a",), ("b",), add(5, others), hints=Hints(overlap=True, yields=True)),
        made("two", ("a",), ("c",), add(2, numbers)),
    ]
    graph: Any = capture_passes(passes, device)
    assert graph.graph_exec is not None, "the driver made no graph with priorities"
    for _ in range(3):
        wp.capture_launch(graph)
    np.testing.assert_array_equal(numbers.numpy(), 9)
    np.testing.assert_array_equal(others.numpy(), 15)
