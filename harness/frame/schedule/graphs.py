"""Captured graphs whose passes keep the priorities of the streams that they were captured on. Warp makes graphs that
run with the priority of the stream on which they are launched. So that a pass which nothing waits for fills what the
others leave idle, and takes no room from them, the driver is asked for a graph that keeps the priorities.
"""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import warp as wp

URGENT, IDLE = -1, 0  # priorities of streams: of passes that others wait for, and of passes that fill what is left
AUTO_FREE_ON_LAUNCH, USE_NODE_PRIORITY = 1, 8  # flags of `cuGraphInstantiateWithFlags`; the first is Warp's


def stream(device: str, yields: bool = False) -> wp.Stream:
    """A stream for passes that others wait for, or that fill what these leave idle (``yields``)."""
    return wp.Stream(device, priority=IDLE if yields else URGENT)


@contextmanager
def capture(device: str) -> Iterator[Any]:
    """Capture what is launched, and make its ``graph`` keep the priorities of its streams."""
    with wp.ScopedDevice(device), wp.ScopedStream(stream(device)), wp.ScopedCapture() as captured:
        yield captured
    keep_priorities(captured.graph)


def keep_priorities(graph: Any) -> bool:
    """Whether a captured graph, not launched yet, keeps the priorities of its passes from now on. If the driver cannot do
    this, Warp makes the graph when it is launched: the same work, without priorities. The first launch uploads it.
    """
    try:
        driver = ctypes.CDLL("libcuda.so.1")
        instantiate, push, pop = (
            getattr(driver, name)
            for name in ("cuGraphInstantiateWithFlags", "cuCtxPushCurrent_v2", "cuCtxPopCurrent_v2")
        )
    except (OSError, AttributeError):
        return False
    if push(_pointer(graph.device.context)):
        return False
    made = ctypes.c_void_p()
    flags = ctypes.c_ulonglong(AUTO_FREE_ON_LAUNCH | USE_NODE_PRIORITY)
    failed = instantiate(ctypes.byref(made), _pointer(graph.graph), flags)
    pop(ctypes.byref(ctypes.c_void_p()))
    if failed:
        return False
    graph.graph_exec = made
    return True


def _pointer(value: Any) -> ctypes.c_void_p:
    return value if isinstance(value, ctypes.c_void_p) else ctypes.c_void_p(value)
