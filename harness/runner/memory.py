"""Memory of a process and of Warp's allocators."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import re
import resource
import sys
from pathlib import Path
from typing import Any

import psutil
import warp as wp


class Memory:
    """Bytes that a method holds, as Warp's allocators count them on every device, and how far the process grew.

    Count from :meth:`start` (before the method plans) with the tracker on; it is paused around the samples of
    methods that allocate inside a frame, so that it costs them nothing.
    """

    def __init__(self) -> None:
        self._resident = 0

    def start(self) -> None:
        """Forget everything and count from now."""
        core = _core()
        core.wp_alloc_tracker_enable(1)
        core.wp_alloc_tracker_reset()
        self._resident = resident_bytes()

    def pause(self) -> None:
        """Stop counting."""
        _core().wp_alloc_tracker_enable(0)

    def peak(self) -> int:
        """Most bytes that Warp's allocators held since :meth:`start`."""
        return int(_core().wp_alloc_tracker_get_peak_bytes())

    def growth(self) -> int:
        """Bytes by which the process has grown since :meth:`start`: for structures outside Warp's allocators."""
        return max(0, resident_bytes() - self._resident)


def _core() -> Any:
    from warp._src.context import runtime

    return runtime.core


def resident_bytes() -> int:
    """Bytes of this process in memory now."""
    return int(psutil.Process().memory_info().rss)


def give_back_memory() -> None:
    """Free what nothing refers to and, with glibc, return it to the system, so that the next growth can be seen."""
    gc.collect()
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def reset_peak_resident() -> None:
    """Let :func:`peak_resident_bytes` count from now (Linux; elsewhere it counts from the start of the process)."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def peak_resident_bytes() -> int:
    """Most bytes that this process had in memory.

    Linux's own number is read first: unlike getrusage's it can be reset, and psutil gives no peak on Linux.
    """
    with contextlib.suppress(OSError):
        match = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
        if match:
            return int(match.group(1)) << 10
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak << 10


def array_bytes(*holders: object) -> int:
    """Bytes of the Warp arrays among the attributes of some objects, one that has two names counted once."""
    arrays = {id(a): a for holder in holders for a in vars(holder).values() if isinstance(a, wp.array)}
    return sum(a.capacity for a in arrays.values())
