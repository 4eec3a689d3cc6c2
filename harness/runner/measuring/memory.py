"""Memory of a process and of Warp's allocators."""

import contextlib
import ctypes
import functools
import gc
import mmap
import os
import re
import resource
import sys
from collections.abc import Iterator
from pathlib import Path

import psutil
import warp as wp

from ...errors import CapacityRejected, one_line


class Memory:
    """Counts the memory of a method: bytes held by Warp's allocators on every device, and the growth of the process.
    Counting begins with :meth:`start`, before the method plans. It is paused during samples, so that methods that
    allocate inside a frame are not slowed down.
    """

    def __init__(self) -> None:
        from warp._src.context import runtime

        self._core, self._resident = runtime.core, 0

    def start(self) -> None:
        self._core.wp_alloc_tracker_enable(1)
        self._core.wp_alloc_tracker_reset()
        self._resident = resident_bytes()

    def pause(self) -> None:
        self._core.wp_alloc_tracker_enable(0)

    def peak(self) -> int:
        """Maximum number of bytes that Warp's allocators have held since :meth:`start`."""
        return int(self._core.wp_alloc_tracker_get_peak_bytes())

    def growth(self, peak: int = 0) -> int:
        """Growth of the process since :meth:`start`, bytes; this includes memory not allocated through Warp. ``peak``:
        resident memory of the process at an earlier time, which counts where it is more than now.
        """
        return max(0, resident_bytes() - self._resident, peak - self._resident)


def resident_bytes() -> int:
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
    """Peak resident memory of this process, bytes; on Linux from /proc, which can be reset (getrusage cannot)."""
    peak = _status("VmHWM")
    if peak is not None:
        return peak
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak << 10


ALLOWED_GROWTH = 256 << 20  # bytes of a process beyond its method's memory, for compilers and compiled code

UNTOUCHED = (2 << 30) + (os.cpu_count() or 1) * (16 << 20)
"""Bytes that a process may map in addition without using them: stacks of threads, what allocators keep in reserve."""


@contextlib.contextmanager
def bounded(limit: int, own: int) -> Iterator[None]:
    """Inside, this process cannot take much more than so many further bytes: beyond them an allocation fails.

    That is ``limit`` with ``own`` bytes of the harness, :data:`ALLOWED_GROWTH` and :data:`UNTOUCHED`; less is noticed
    afterwards, by counting. It keeps a method from taking the memory of the machine. Raises :class:`CapacityRejected`
    where an allocation fails. Without effect where the system does not limit what a process maps
    (:func:`stops_allocations`).
    """
    try:
        with _data_limited(limit + own + ALLOWED_GROWTH + UNTOUCHED):
            yield
    except (MemoryError, RuntimeError) as error:
        # Warp has no class for a failed allocation. On a GPU it is the card that is full.
        if not isinstance(error, MemoryError) and not str(error).endswith("bytes on device 'cpu'"):
            raise
        raise CapacityRejected(
            f"an allocation failed beyond the limit of {limit:,} bytes ({one_line(error)})"
        ) from error


@contextlib.contextmanager
def _data_limited(more: int) -> Iterator[None]:
    """Limit the writable private memory of this process (RLIMIT_DATA) to what it has mapped and ``more`` bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = (_status("VmData") or 0) + more
    resource.setrlimit(resource.RLIMIT_DATA, (most if soft == resource.RLIM_INFINITY else min(most, soft), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))


NOT_STOPPED = (
    "this system does not stop allocations on the host: a method that needs more than --memory-limit is rejected after "
    "it has taken the memory"
)


@functools.cache
def stops_allocations() -> bool:
    """Whether :func:`bounded` has an effect on this system: tried once."""
    tried = 256 << 20
    try:
        with _data_limited(tried // 2):
            mmap.mmap(-1, tried, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS).close()
    except OSError:
        return True
    return False


def _status(field: str) -> int | None:
    """Bytes that Linux states of this process; None on other systems."""
    with contextlib.suppress(OSError):
        match = re.search(rf"{field}:\s+(\d+) kB", Path("/proc/self/status").read_text())
        if match:
            return int(match.group(1)) << 10
    return None


def array_bytes(*holders: object) -> int:
    """Bytes of the Warp arrays among the attributes of some objects; an array and its beginning are counted once."""
    arrays = (a for holder in holders for a in vars(holder).values() if isinstance(a, wp.array))
    return sum({a.ptr: a.capacity for a in sorted(arrays, key=lambda a: a.capacity)}.values())
