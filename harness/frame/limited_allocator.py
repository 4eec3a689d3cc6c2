"""An allocator of Warp arrays on a GPU that refuses what exceeds a limit before it is taken. Warp has no such place for
arrays on the CPU. There the memory of the process is limited (:mod:`.runner.measuring.memory`).
"""

import contextlib
from collections.abc import Iterator
from typing import Any

import warp as wp

from ..errors import CapacityRejected


class LimitedAllocator:
    """The present allocator of a GPU, for at most so many bytes at a time. Of a CPU it limits nothing.

    most  bytes of all arrays that were made :meth:`within` and still exist
    held  how many there are
    """

    def __init__(self, device: str, most: int):
        self.device, self.most, self.held = device, most, 0
        self._of: Any = wp.get_device_allocator(device)

    def __getattr__(self, name: str) -> Any:
        """What Warp asks of an allocator besides its methods, such as the kind of memory."""
        return getattr(self._of, name)

    @contextlib.contextmanager
    def within(self) -> Iterator[None]:
        """Arrays of the device that are made inside count. Raises :class:`CapacityRejected` for one that is too large."""
        on_gpu = wp.get_device(self.device).ordinal >= 0  # not ``is_cuda``: an emulated GPU has the CPU's memory
        with wp.ScopedAllocator(self.device, self) if on_gpu else contextlib.nullcontext():
            yield

    def allocate(self, size_in_bytes: int) -> int:
        """Memory of the device. Warp calls this."""
        if self.held + size_in_bytes > self.most:
            raise CapacityRejected(f"needs {self.held + size_in_bytes:,} bytes; the limit is {self.most:,}")
        place = self._of.allocate(size_in_bytes)
        self.held += size_in_bytes
        return place

    def deallocate(self, ptr: int, size_in_bytes: int) -> None:
        """Give memory back. Warp calls this when an array's life ends, also outside of :meth:`within`."""
        self.held -= size_in_bytes
        self._of.deallocate(ptr, size_in_bytes)
