"""Packets of primary rays through the uniform grid, slice by slice: Wald, Ize, Kensler, Knoll and Parker 2006.

A packet is a square of pixels. Its frustum is taken along the axis of the grid that its rays follow most. In each slice of
cells across that axis the frustum covers a rectangle; the triangles in its cells are tested against the whole packet, each
once (mailboxing). The packet ends when every ray has a hit in front of the next slice.

Everything is in grid coordinates (:mod:`..grids.grid`). What a packet covers is padded by :data:`SPREAD`: directions are
rounded sums, so that a direction within a packet may lie outside those of its corners by that much.
"""

import warp as wp

from ...harness.frame.alpha import Alpha
from ...harness.frame.effects.specialise import effects
from ...harness.frame.geometry import Camera, Mesh
from ..common.axes import longest_axis
from ..common.reads import corners_at, direction_at
from ..exact.triangle import spare_bits, to_float64
from ..gpu.entries import entry
from ..grids.cells import Cells
from ..grids.grid import Grid, cell_index, cell_of, to_grid
from ..streams.camera.pixels import Candidate, edge_planes, inverse_depth, is_outside, sign_bound, test_pixel_or_queue
from ..streams.queues import Queue

SPREAD = wp.constant(wp.float64(2.0**-20))
"""Directions are sums of two float32 vectors, rounded: off by 2^-24 of their largest part, three times."""

LEAST_SHARE = wp.constant(wp.float64(0.1))
"""Least step along the axis of a ray of a coherent packet, as a share of the middle ray's step."""

AHEAD = wp.constant(wp.float64(1.0 + 2.0**-20))
"""A hit that is nearer by this factor than the end of a slice ends a ray."""


@wp.struct
class Frustum:
    """The rays of a packet in grid coordinates.

    axis      the axis that they follow most    forward   whether it grows along them
    low, high least and greatest steps along the next axis and the one after, for one step along ``axis``, padded
    coherent  whether all rays go the same way along ``axis``, none much more slowly than the middle one
    """

    axis: wp.int32
    forward: wp.bool
    low: wp.vec2d
    high: wp.vec2d
    coherent: wp.bool


@wp.func
def across(v: wp.vec3d, axis: wp.int32) -> wp.vec2d:
    return wp.vec2d(v[(axis + 1) % 3], v[(axis + 2) % 3])


@wp.func
def cell_at(res: wp.vec3i, axis: wp.int32, slice: wp.int32, u: wp.int32, v: wp.int32) -> wp.int32:
    """The cell in a slice across ``axis``; u and v: cells along the next axis and the one after."""
    at = wp.vec3i()
    at[axis] = slice
    at[(axis + 1) % 3] = u
    at[(axis + 2) % 3] = v
    return cell_index(res, at[0], at[1], at[2])


@wp.func
def cells_within(res: wp.int32, low: wp.float64, high: wp.float64, slack: wp.float64) -> wp.vec2i:
    """First and last cell of an axis that an interval reaches, with the slack; (0, -1) beside the grid."""
    n = wp.float64(res)
    if not (high + slack >= wp.float64(0.0) and low - slack <= n):
        return wp.vec2i(0, -1)
    return wp.vec2i(cell_of(low - slack, res), cell_of(high + slack, res))


@wp.func
def frustum_of(grid: Grid, camera: Camera, box: wp.vec4i) -> Frustum:
    f = Frustum()
    middle = wp.cw_mul(to_float64(direction_at(camera, (box[0] + box[2]) // 2, (box[1] + box[3]) // 2)), grid.scale)
    f.axis = longest_axis(wp.abs(middle))
    f.forward = middle[f.axis] > wp.float64(0.0)
    f.low = wp.vec2d(wp.float64(wp.inf), wp.float64(wp.inf))
    f.high = wp.vec2d(-wp.float64(wp.inf), -wp.float64(wp.inf))
    f.coherent = True
    for k in range(4):
        x = box[0]
        y = box[1]
        if k % 2 == 1:
            x = box[2]
        if k // 2 == 1:
            y = box[3]
        d = wp.cw_mul(to_float64(direction_at(camera, x, y)), grid.scale)
        along = d[f.axis]
        if not f.forward:
            along = -along
        if along > LEAST_SHARE * wp.abs(middle[f.axis]):
            r = across(d, f.axis) / along
            pad = SPREAD * (wp.float64(1.0) + wp.max(wp.abs(r[0]), wp.abs(r[1])))
            f.low = wp.min(f.low, wp.vec2d(r[0] - pad, r[1] - pad))
            f.high = wp.max(f.high, wp.vec2d(r[0] + pad, r[1] + pad))
        else:
            f.coherent = False
    return f


@wp.func
def packet_box(packet: wp.int32, side: wp.int32, camera: Camera) -> wp.vec4i:
    """First column and row, last column and row of a packet's pixels."""
    per_row = (camera.width + side - 1) // side
    x = packet % per_row * side
    y = packet // per_row * side
    return wp.vec4i(x, y, wp.min(x + side, camera.width) - 1, wp.min(y + side, camera.height) - 1)


@wp.func
def least_inverse(word: wp.uint64, spare: wp.int32) -> wp.float64:
    """A lower bound of 1 / t of a stored hit; 0 without one."""
    return wp.cast((word >> wp.uint64(24 - spare)) << wp.uint64(23 - spare), wp.float64)


@wp.func
def trace_packet(
    stamp: wp.int32,
    holes: wp.bool,
    box: wp.vec4i,
    f: Frustum,
    grid: Grid,
    cells: Cells,
    camera: Camera,
    mesh: Mesh,
    alpha: Alpha,
    stamps: wp.array(dtype=wp.int32),
    nearest: wp.array(dtype=wp.uint64),
    queue: Queue,
    tests: wp.array(dtype=wp.int64),
):
    """Trace the pixels of a box.

    stamp  a number of the packet's own, for ``stamps``    holes  whether triangles have holes
    """
    o = entry(camera.eye, 0)
    g = to_grid(grid, to_float64(o))
    gu = across(g, f.axis)
    bound = sign_bound(camera.tangents)
    spare = spare_bits(mesh.triangles.shape[0])
    res = grid.res
    u_axis = (f.axis + 1) % 3
    v_axis = (f.axis + 2) % 3
    last = res[f.axis]
    eye = g[f.axis]
    if not f.forward:
        eye = wp.float64(last) - eye
    # Slices are counted along the frustum; ``eye`` is where it starts.
    k = wp.int32(0)
    if eye > wp.float64(0.0):
        k = wp.int32(wp.min(wp.floor(eye), wp.float64(last)))
    finished = wp.int32(0)
    wide = box[2] - box[0] + 1
    number = wide * (box[3] - box[1] + 1)
    while k < last and finished < number:
        a = wp.max(wp.float64(k) - eye, wp.float64(0.0))
        b = wp.float64(k + 1) - eye
        us = cells_within(
            res[u_axis],
            gu[0] + wp.min(a * f.low[0], b * f.low[0]),
            gu[0] + wp.max(a * f.high[0], b * f.high[0]),
            grid.slack,
        )
        vs = cells_within(
            res[v_axis],
            gu[1] + wp.min(a * f.low[1], b * f.low[1]),
            gu[1] + wp.max(a * f.high[1], b * f.high[1]),
            grid.slack,
        )
        if us[1] >= us[0] and vs[1] >= vs[0]:
            slice = k
            if not f.forward:
                slice = last - 1 - k
            for v in range(vs[0], vs[1] + 1):
                for u in range(us[0], us[1] + 1):
                    cell = cell_at(res, f.axis, slice, u, v)
                    for m in range(entry(cells.lists.begin, cell), entry(cells.lists.end, cell)):
                        i = entry(cells.lists.values, m)
                        if entry(stamps, i) != stamp:
                            stamps[i] = stamp
                            corners = corners_at(mesh, i)
                            planes = edge_planes(o, corners)
                            if not is_outside(planes, bound, camera, box):
                                candidate = Candidate()
                                candidate.i = i
                                candidate.planes = planes
                                candidate.bound = bound
                                candidate.sure = bound
                                candidate.m = inverse_depth(o, corners)
                                candidate.spare = spare
                                if holes:
                                    if alpha.masked[i] != wp.uint8(0):
                                        candidate.sure = wp.INF
                                for y in range(box[1], box[3] + 1):
                                    for x in range(box[0], box[2] + 1):
                                        pixel = y * camera.width + x
                                        test_pixel_or_queue(
                                            nearest, queue, pixel, candidate, direction_at(camera, x, y)
                                        )
                                tests[0] = tests[0] + wp.int64(number)
        # Rays are finished in order: hits get nearer and slices farther, so that one that is finished stays so.
        going = wp.bool(True)
        while going and finished < number:
            x = box[0] + finished % wide
            y = box[1] + finished // wide
            d = wp.cw_mul(to_float64(direction_at(camera, x, y)), grid.scale)
            inverse = least_inverse(entry(nearest, y * camera.width + x), spare)
            # t of the far plane of the slice, in lengths of the direction: b / |d|; a hit is before it if 1 / t > |d| / b.
            if inverse * (b - grid.slack) > AHEAD * wp.abs(d[f.axis]):
                finished += 1
            else:
                going = False
        k += 1


@wp.kernel(enable_backward=False)
def packet_kernel(
    side: wp.int32,
    cells: Cells,
    camera: Camera,
    mesh: Mesh,
    alpha: Alpha,
    stamps: wp.array(dtype=wp.int32),
    nearest: wp.array(dtype=wp.uint64),
    queue: Queue,
    tests: wp.array(dtype=wp.int64),
):
    """One packet of ``side`` x ``side`` pixels per thread; a packet that is not coherent is traced ray by ray.

    stamps  int32 [triangles]: the packet that a triangle was last tested in    tests  int64 [1]: pairs tested
    """
    packet = wp.tid()
    grid = cells.grid[0]
    box = packet_box(packet, side, camera)
    holes = wp.bool(False)
    if wp.static(effects.alpha):
        holes = True
    whole = frustum_of(grid, camera, box)
    wide = box[2] - box[0] + 1
    number = wp.where(whole.coherent, 1, wide * (box[3] - box[1] + 1))
    for k in range(number):  # of a single call, because every call is compiled into the kernel
        part = box
        f = whole
        stamp = packet + 1
        if not whole.coherent:
            x = box[0] + k % wide
            y = box[1] + k // wide
            part = wp.vec4i(x, y, x, y)
            f = frustum_of(grid, camera, part)
            stamp = -1 - (y * camera.width + x)
        trace_packet(stamp, holes, part, f, grid, cells, camera, mesh, alpha, stamps, nearest, queue, tests)
