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
    """Counts the memory of a method: bytes held by Warp's allocators on every device, and the growth of the process.

    Counting begins with :meth:`start`, before the method plans. It is paused during samples, so that methods that
    allocate inside a frame are not slowed down.
    """

    def __init__(self) -> None:
        self._resident = 0

    def start(self) -> None:
        """Reset the counters and start counting."""
        core = _core()
        core.wp_alloc_tracker_enable(1)
        core.wp_alloc_tracker_reset()
        self._resident = resident_bytes()

    def pause(self) -> None:
        """Stop counting."""
        _core().wp_alloc_tracker_enable(0)

    def peak(self) -> int:
        """Maximum number of bytes that Warp's allocators have held since :meth:`start`."""
        return int(_core().wp_alloc_tracker_get_peak_bytes())

    def growth(self, peak: int = 0) -> int:
        """Growth of the process since :meth:`start`, bytes; this includes memory not allocated through Warp.

        ``peak``: resident memory of the process at an earlier time, which counts where it is more than now.
        """
        return max(0, resident_bytes() - self._resident, peak - self._resident)


def _core() -> Any:
    from warp._src.context import runtime

    return runtime.core


def resident_bytes() -> int:
    """Resident memory of this process, bytes."""
    return int(psutil.Process().memory_info().rss)


def give_back_memory() -> None:
    """Collect garbage and, with glibc, return free memory to the system, so that later growth can be measured."""
    gc.collect()
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def reset_peak_resident() -> None:
    """Reset the peak of :func:`peak_resident_bytes` (Linux only; elsewhere it counts from the start of the process)."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def peak_resident_bytes() -> int:
    """Peak resident memory of this process, bytes.

    On Linux it is read from /proc, which can be reset, unlike the value of getrusage; psutil gives no peak on Linux.
    """
    with contextlib.suppress(OSError):
        match = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
        if match:
            return int(match.group(1)) << 10
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak << 10


def array_bytes(*holders: object) -> int:
    """Bytes of the Warp arrays among the attributes of some objects; an array with two names is counted once."""
    arrays = {id(a): a for holder in holders for a in vars(holder).values() if isinstance(a, wp.array)}
    return sum(a.capacity for a in arrays.values())
