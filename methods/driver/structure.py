"""The driver's acceleration structure over a frame's triangles, and one instance of it that rays are traced through."""

from typing import Any

import warp as wp

from ...harness.frame.frame import Frame
from ..rays.mesh_triangles import TreeTriangles
from .memory import CopiedMemory, SharedMemory


class Structure:
    """Built when it is made, from the animation's first frame; :meth:`renew` follows the frame.

    build  "fast-build", "fast-trace", "update" or "static" (:class:`..driver.Build`)
    holes  whether a hit is asked for by the any-hit shader
    memory where vertices, indices, both levels and their scratch memory are
    top    what rays are traced through
    """

    def __init__(
        self, frame: Frame, triangles: TreeTriangles, build: str, holes: bool, memory: SharedMemory | CopiedMemory
    ):
        import slangpy

        self._frame, self._triangles, self._memory = frame, triangles, memory
        self._device = device = memory.device
        self._update = build == "update"
        flags, geometry_flags = slangpy.AccelerationStructureBuildFlags, slangpy.AccelerationStructureGeometryFlags
        self._vertices = memory.buffer(12 * len(frame.points), inputs=True)
        corners = 3 * memory.triangles(triangles.count, len(frame.points))
        self._indices = memory.buffer(4 * corners, inputs=True)
        geometry = slangpy.AccelerationStructureBuildInputTriangles(
            {
                "vertex_buffers": [self._vertices],
                "vertex_format": slangpy.Format.rgb32_float,
                "vertex_count": len(frame.points),
                "vertex_stride": 12,
                "index_buffer": self._indices,
                "index_format": slangpy.IndexFormat.uint32,
                "index_count": corners,
                "flags": geometry_flags.none if holes else geometry_flags.opaque,
            }
        )
        prefer = flags.prefer_fast_build if build == "fast-build" else flags.prefer_fast_trace
        prefer |= flags.allow_update if self._update else flags.none
        modes = slangpy.AccelerationStructureBuildMode
        first, self._renewed = (
            slangpy.AccelerationStructureBuildDesc({"inputs": [geometry], "flags": prefer, "mode": mode})
            for mode in (modes.build, modes.update if self._update else modes.build)
        )
        self._bottom, self._scratch = self._level(first)
        points = triangles.at_first_frame()
        self._copy(points)
        encoder = device.create_command_encoder()
        encoder.build_acceleration_structure(desc=first, dst=self._bottom, src=None, scratch_buffer=self._scratch)
        memory.submit(encoder)

        self._instances = device.create_acceleration_structure_instance_list(1)
        self._instances.write(
            0,
            {
                "transform": slangpy.float3x4.identity(),
                "instance_id": 0,
                "instance_mask": 0xFF,
                "instance_contribution_to_hit_group_index": 0,
                "flags": slangpy.AccelerationStructureInstanceFlags.none,
                "acceleration_structure": self._bottom.handle,
            },
        )
        over = {"inputs": [self._instances.build_input_instances()], "flags": flags.prefer_fast_build}
        self._over = slangpy.AccelerationStructureBuildDesc(over)
        self.top, self._top_scratch = self._level(self._over)
        memory.wait()  # slangpy uploads the instance on a stream of its own
        encoder = device.create_command_encoder()
        self._build_top(encoder)
        memory.submit(encoder)
        memory.wait()  # the handle of the structure is final, and ``points`` may go

    def _level(self, desc: Any) -> tuple[Any, Any]:
        """An acceleration structure that fits what ``desc`` builds, and scratch memory for builds and updates."""
        sizes = self._device.get_acceleration_structure_sizes(desc)
        self._memory.take(sizes.acceleration_structure_size)
        made = self._device.create_acceleration_structure(size=sizes.acceleration_structure_size)
        return made, self._memory.buffer(max(sizes.scratch_size, sizes.update_scratch_size))

    def _copy(self, points: wp.array) -> None:
        """Copy vertices and indices to where the driver reads them."""
        self._memory.fill(self._vertices, points)
        self._memory.fill(self._indices, self._triangles.indices)

    def _build_top(self, encoder: Any) -> None:
        encoder.global_barrier()  # the level below is built
        encoder.build_acceleration_structure(desc=self._over, dst=self.top, src=None, scratch_buffer=self._top_scratch)

    def renew(self) -> None:
        """Build or update it for the vertices of the frame."""
        if self._frame.prepared.moves:  # else the flags do not change
            self._triangles.launch_indices()
        self._copy(self._frame.points)
        encoder = self._device.create_command_encoder()
        source = self._bottom if self._update else None
        encoder.build_acceleration_structure(
            desc=self._renewed, dst=self._bottom, src=source, scratch_buffer=self._scratch
        )
        self._build_top(encoder)
        self._memory.submit(encoder)
