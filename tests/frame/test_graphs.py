"""Priorities of captured graphs: what nothing waits for fills what other passes leave idle."""

from __future__ import annotations

import ctypes
from contextlib import nullcontext
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


def fake_capture(monkeypatch: pytest.MonkeyPatch, kind: type, wait: Any) -> None:
    """Capture without a GPU, on streams of a ``kind``; ``wait`` is called in place of ``wp.wait_event``."""
    monkeypatch.setattr(wp, "Stream", kind)
    monkeypatch.setattr(wp, "ScopedStream", lambda stream: stream)
    monkeypatch.setattr(wp, "ScopedCapture", lambda: nullcontext(SimpleNamespace(graph=None)))
    monkeypatch.setattr(wp, "wait_event", wait)
    monkeypatch.setattr(graphs, "keep_priorities", lambda graph: False)


def test_passes_that_nothing_waits_for_are_idle(monkeypatch):
    open_now: list[int] = []
    seen: dict[str, int] = {}

    class Stream:
        def __init__(self, device: Any, priority: int):
            self.priority = priority

        def record_event(self) -> None: ...

        def __enter__(self) -> Stream:
            open_now.append(self.priority)
            return self

        def __exit__(self, *given: Any) -> None:
            open_now.pop()

    fake_capture(monkeypatch, Stream, lambda event: None)
    passes = [
        made("words", (), ("words",), None),
        made("one", ("words",), ("bits",), None, hints=Hints(parallel=(0,)), adds=True),
        made("two", ("words",), ("bits",), None, hints=Hints(parallel=(1,)), adds=True),
        made("sorting", ("words",), ("cells",), None, hints=Hints(overlap=True)),
        made("answers", ("words",), ("answers",), None, hints=Hints(overlap=True, yields=True)),
        made("aim", (), ("aim",), None, hints=Hints(early=True)),
        made("last", ("bits", "cells", "aim"), ("colour",), None),
    ]
    for work in passes:
        object.__setattr__(work, "launch", lambda name=work.name: seen.setdefault(name, open_now[-1]))
    capture_passes(passes, "cpu")
    idle = {name for name, priority in seen.items() if priority == graphs.IDLE}
    assert idle == {"answers", "aim"}
    assert {priority for name, priority in seen.items() if name not in idle} == {graphs.URGENT}
    assert len(seen) == len(passes)


def test_a_stream_waits_once_for_what_runs_early(monkeypatch):
    """Early passes of two branches run on streams of their own. What depends on one waits for it, and for no other."""
    streams = ["main"]
    waits: list[tuple[str, str]] = []
    last = {"": ""}

    class Stream:
        def __init__(self, device: Any, priority: int):
            self.name = f"stream {len(last)}"
            last[self.name] = ""

        def record_event(self) -> str:
            return last[self.name]

        def __enter__(self) -> Stream:
            streams.append(self.name)
            return self

        def __exit__(self, *given: Any) -> None:
            streams.pop()

    fake_capture(monkeypatch, Stream, lambda event: waits.append((event, streams[-1])))
    ran: dict[str, tuple[str, tuple[str, ...]]] = {}
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

    def launch(name: str) -> None:
        ran[name] = streams[-1], tuple(event for event, stream in waits if stream == streams[-1])
        last[streams[-1]] = name

    for work in passes:
        object.__setattr__(work, "launch", lambda name=work.name: launch(name))
    capture_passes(passes, "cpu")
    assert len(ran) == len(passes)
    main = ran["words"][0]
    assert ran["words"][1] == ()
    assert len({ran[f"aim {i}"][0] for i in range(2)} | {main}) == 3
    for i in range(2):
        assert [ran[f"{name} {i}"][1] for name in ("place", "sort", "test")] == [(f"aim {i}",)] * 3
    assert ran["last"][0] == main
    assert {"test 0", "test 1", "aim 0"} <= set(ran["last"][1])
    assert {event for event, stream in waits if stream == main} >= {"aim 0", "aim 1"}, "a stream is never joined"


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
