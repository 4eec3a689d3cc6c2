"""Shadow rays: triangles streamed over the rays in the cells of the light's cube.

Which cells a triangle covers is computed relative to the scene's middle in float32, with a pad that covers its rounding
(:mod:`..cube.footprint`); rays are placed in float64. How a ray is tested is in :mod:`.planes`.
"""

from __future__ import annotations

import functools

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Mesh
from ...common.reads import corners_at
from ...gpu.bits import lowest_bit, without_lowest_bit
from ...gpu.entries import entry, set_entry
from ...gpu.reserve import next_number
from ..cube import footprint
from ..cube.cells import RayCells, all_rays_end_before, nearest_depth
from ..cube.footprint import corners_on, extent_with_rays, in_cube_space, on_bins, sides_on_face
from ..cube.lights import Light, cube_of_light, position_of
from ..cube.rectangle import cells_of, faces_of, last_row
from ..queues import LARGE, Queue, Share, triangle_of
from ..rays.sort import rays_in_box
from .closed import turned_away
from .planes import ShadowBits, bound_of, occluder_of, occludes_none, test_rays_of_box
from .rows import queue_rows

INLINE_ROWS = wp.constant(16)
"""A triangle over more rows of cells is queued: its thread would read them one after the other."""

MANY = wp.constant(2147483647)
"""Number of rays that stands for a box whose rays are not counted: more than are tested here."""


REGISTERS = 56
"""Registers per thread: a thread waits for memory longer than it computes, so more threads at a time are faster."""

REGISTERS_OF_FEW = 112
"""Registers per thread of the stream that stores groups of rows: there are fewer triangles than threads have room."""


@functools.cache
def make_stream_kernel(splits: bool, counts: bool = True) -> wp.Kernel:
    """One thread per triangle: few rays are tested here; more are queued. Triangles are queued
    in groups of rows (``splits``; then all that have rays), or whole for :func:`.rows.split_kernel`. Not ``counts``: all
    that rays may reach, as the farthest receivers tell, which are known before the rays lie in their cells.

    A large triangle is (triangle, face, first cell and last << 16, first row and last << 16).
    """

    registers = REGISTERS_OF_FEW if splits else REGISTERS

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=registers)
    def stream_kernel(
        share: Share,
        inline_cells: wp.int32,
        inline_rays: wp.int32,
        light: Light,
        cells: RayCells,
        mesh: Mesh,
        alpha: Alpha,
        bits: ShadowBits,
        queue: Queue,
    ):
        i = triangle_of(wp.tid(), share)
        if i >= share.triangles:
            return
        # Loaded together, without a branch between: an invalid triangle has corners too, but no face.
        row = last_row(cells.table)
        flags = entry(mesh.valid, i)
        faces = wp.where(flags != wp.uint8(0), faces_of(row), wp.uint32(0))
        corners = corners_at(mesh, i)
        if wp.static(effects.closed):
            if turned_away(flags, position_of(light), corners):
                return
        cube = cube_of_light(light)
        along = cells_of(row)
        q = in_cube_space(corners, cube)
        extent = extent_with_rays(cube, corners, row)
        slack = footprint.depth_slack(extent, cube)
        holes = wp.bool(False)
        if wp.static(effects.alpha):
            holes = alpha.masked[i] != wp.uint8(0)
        # Triangles with few rays are tested after the loop, by all lanes at once whatever their faces. Few triangles have
        # few rays on two faces: the second is queued.
        here = wp.int32(-1)
        box_here = wp.vec4i()
        several = without_lowest_bit(faces) != wp.uint32(0)
        while faces != wp.uint32(0):
            face = lowest_bit(faces)
            faces = without_lowest_bit(faces)
            r = entry(cells.table, face)
            f = corners_on(q, face)
            if not footprint.leaves_out(several, f, slack):
                flat = on_bins(f, extent, r)
                box = footprint.flat_box(flat, face, along, cells)
                number = wp.int32(0)
                least = nearest_depth(f, slack)
                if box[2] >= box[0] and not all_rays_end_before(least, cells.farthest, face, box, along):
                    number = wp.int32(MANY)
                    rows = box[3] - box[1] + 1
                    if wp.static(counts):
                        if (box[2] - box[0] + 1) * rows <= inline_cells and rows <= INLINE_ROWS:
                            number = rays_in_box(cells.offset, face, box, along)
                if number > 0:
                    inline = wp.bool(False)
                    if wp.static(not splits):
                        inline = number <= inline_rays and here < 0
                    if inline:
                        here = face
                        box_here = box
                    elif wp.static(splits):
                        position = position_of(light)
                        again = corners_at(mesh, i)
                        sides_here = sides_on_face(flat, position, cube, face, again, r)
                        bound = bound_of(row, again)
                        large = occluder_of(i, bound, bound, position, again, True)
                        if not occludes_none(large):
                            queue_rows(queue, i, face, box, sides_here, large)
                    else:
                        place = next_number(queue.counts, LARGE)
                        if place < queue.large.shape[0]:
                            work = wp.vec4i(i, face, box[0] | (box[2] << 16), box[1] | (box[3] << 16))
                            set_entry(queue.large, place, work)
        if wp.static(not splits):
            if here >= 0:
                # Corners are read again: held until here, they would take the registers of the loop.
                again_here = corners_at(mesh, i)
                bound_here = bound_of(row, again_here)
                sure = wp.where(holes, wp.INF, bound_here)
                planes_here = occluder_of(i, bound_here, sure, position_of(light), again_here, False)
                test_rays_of_box(bits, queue, cells, along, here, box_here, planes_here)

    return stream_kernel
