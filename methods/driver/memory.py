"""How a device of slangpy reaches the arrays of Warp: by their addresses on CUDA, as copies by Vulkan."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import warp as wp

from ...harness.errors import CapacityRejected


class Memory:
    """What both ways share: memory of the device that counts.

    held  bytes that slangpy has taken; more than ``most`` raise :class:`CapacityRejected`. ``alias``: of Warp's device
    """

    def __init__(self, device: Any, most: int, alias: str):
        self.device, self.held, self._most, self._alias = device, 0, most, alias

    def take(self, size: int) -> None:
        """Count so many bytes, before they are taken."""
        self.held += size
        if self.held > self._most:
            raise CapacityRejected(f"needs {self.held:,} bytes; the limit is {self._most:,}")

    def buffer(self, size: int, inputs: bool = False) -> Any:
        """A buffer of so many bytes. ``inputs``: that builds of acceleration structures read."""
        import slangpy

        self.take(size)
        usage = slangpy.BufferUsage
        reads = usage.shader_resource | usage.acceleration_structure_build_input if inputs else usage.shader_resource
        return self.device.create_buffer(size=size, usage=usage.unordered_access | reads)


class SharedMemory(Memory):
    """Of a device in Warp's own CUDA context: it reads and writes Warp's arrays, on Warp's stream."""

    def address(self, array: wp.array) -> int:
        """Where shaders find an array; 0 for an empty one."""
        return array.ptr or 0

    def triangles(self, count: int, vertices: int) -> int:
        """How many triangles a build takes from a buffer of ``count``."""
        return count

    def fill(self, buffer: Any, array: wp.array) -> None:
        """Copy an array to a buffer, on the device."""
        size = array.size * wp.types.type_size_in_bytes(array.dtype)
        into = wp.array(
            ptr=buffer.device_address, dtype=array.dtype, shape=array.shape, capacity=size, device=self._alias
        )
        wp.copy(into, array)

    def submit(self, encoder: Any, reads: Iterable[wp.array] = (), writes: Iterable[wp.array] = ()) -> None:
        """Submit what an encoder holds to the current stream of Warp. The host does not wait."""
        import slangpy

        stream = slangpy.NativeHandle.from_cuda_stream(wp.get_stream(self._alias).cuda_stream)
        self.device.submit_command_buffer(encoder.finish(), cuda_stream=stream)

    def wait(self) -> None:
        """Wait for slangpy, which uploads some things on a stream of its own, and for Warp."""
        self.device.wait()
        wp.synchronize_device(self._alias)


class CopiedMemory(Memory):
    """Of a device that Vulkan finds: it has copies of Warp's arrays, which are those of the CPU."""

    def __init__(self, device: Any, most: int, alias: str):
        super().__init__(device, most, alias)
        self._copies: dict[tuple[int, int], tuple[wp.array, Any]] = {}

    def _copy(self, array: wp.array) -> Any:
        where = array.ptr, array.size
        if where not in self._copies:
            self._copies[where] = array, self.buffer(array.numpy().nbytes)
        return self._copies[where][1]

    def address(self, array: wp.array) -> int:
        """Where shaders find the copy of an array; 0 for an empty one."""
        return int(self._copy(array).device_address) if array.size else 0

    def triangles(self, count: int, vertices: int) -> int:
        """How many triangles a build takes from a buffer of ``count``: by Vulkan slang-rhi builds as many as the vertices
        would make, if these are more.
        """
        return max(count, -(-vertices // 3))

    def fill(self, buffer: Any, array: wp.array) -> None:
        """Copy an array to a buffer; what is left of it is filled with the first element: of indices, points that no ray
        hits.
        """
        given = array.numpy().ravel()
        whole = np.full(buffer.size // given.itemsize, given[0], dtype=given.dtype)
        whole[: len(given)] = given
        buffer.copy_from_numpy(whole)

    def submit(self, encoder: Any, reads: Iterable[wp.array] = (), writes: Iterable[wp.array] = ()) -> None:
        """Copy what is read to the device, submit what an encoder holds, wait, and copy back what was written."""
        for array in reads:
            if array.size:
                self.fill(self._copy(array), array)
        self.device.submit_command_buffer(encoder.finish())
        self.wait()
        for array in writes:
            into = array.numpy()
            into[...] = self._copy(array).to_numpy().view(into.dtype).reshape(into.shape)

    def wait(self) -> None:
        """Wait for the device."""
        self.device.wait()
