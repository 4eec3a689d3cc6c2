"""Shadow rays: triangles rasterised conservatively over a light's map and tested against the hit points in its lists.

Where a triangle may lie on the map is found as in ``ray_grids`` (:mod:`..streams.cube.footprint`), with a pad for what
float32 does to its corners. A hit point is tested against the planes of the frustum behind the triangle
(:mod:`..streams.occlusion.planes`); what float32 leaves undecided is queued for float64.
"""

import warp as wp

from ...harness.frame.alpha import Alpha
from ...harness.frame.effects.specialise import effects
from ...harness.frame.geometry import Mesh
from ..common.reads import corners_at
from ..gpu.bits import lowest_bit, without_lowest_bit
from ..gpu.entries import entry, set_entry
from ..streams.cube.cells import RayCells
from ..streams.cube.farthest import all_rays_end_before, nearest_depth
from ..streams.cube.footprint import (
    Sides,
    cells_of_row,
    corners_on,
    depth_slack,
    extent_with_rays,
    flat_box,
    in_cube_space,
    leaves_out,
    on_bins,
)
from ..streams.cube.lights import Light, cube_of_light, position_of
from ..streams.cube.rectangle import cells_of, faces_of, last_row
from ..streams.occlusion.groups import sides_on_face
from ..streams.occlusion.planes import Occluder, bound_of, occluder_of, occludes_none, set_planes
from ..streams.occlusion.ray_test import ShadowBits
from ..streams.queues import Queue, Share, triangle_of
from .lists import test_list, test_texels, texel_index
from .tiles import (
    GROUP,
    TILE_SHIFT,
    TILE_SIZE,
    TILE_TEXELS,
    held_chunks,
    held_items,
    held_large,
    is_in,
    item_tile,
    queue_groups,
    queue_large,
    queue_tile,
    queued_box,
    queued_face,
    queued_tile,
    queued_triangle,
    tile_box,
)


@wp.func
def is_empty(farthest: wp.array(dtype=wp.int32), face: wp.int32, tile: wp.vec2i, along: wp.int32) -> wp.bool:
    """Whether no hit point lies in a tile; ``along``: texels along a face."""
    return entry(farthest, (face * (along >> TILE_SHIFT) + tile[1]) * (along >> TILE_SHIFT) + tile[0]) == 0


@wp.func
def store_planes(records: wp.array2d(dtype=wp.vec4f), occluder: Occluder):
    """Store the planes of a queued triangle, four words per plane."""
    set_entry(records, occluder.i, 0, occluder.e0)
    set_entry(records, occluder.i, 1, occluder.e1)
    set_entry(records, occluder.i, 2, occluder.e2)
    set_entry(records, occluder.i, 3, occluder.plane)


@wp.func
def stored_planes(records: wp.array2d(dtype=wp.vec4f), occluder: Occluder) -> Occluder:
    """An occluder with the planes that :func:`store_planes` stored."""
    o = occluder
    o.e0 = entry(records, occluder.i, 0)
    o.e1 = entry(records, occluder.i, 1)
    o.e2 = entry(records, occluder.i, 2)
    o.plane = entry(records, occluder.i, 3)
    return o


@wp.func
def stored_sides(queue: Queue, place: wp.int32) -> Sides:
    """The lines that bound a queued triangle on its face."""
    sides = Sides()
    sides.line0 = entry(queue.groups, place, 0)
    sides.line1 = entry(queue.groups, place, 1)
    sides.line2 = entry(queue.groups, place, 2)
    return sides


@wp.func
def ends_of_row(sides: Sides, work: wp.vec4i, y: wp.int32, along: wp.int32, cells: RayCells) -> wp.vec2i:
    """First and last texel of a row that a queued triangle may cover; ``along``: texels along a face."""
    whole = queued_box(work)
    return cells_of_row(sides, queued_face(work), y, whole[0], whole[2], along, cells)


@wp.func
def covers_some(sides: Sides, work: wp.vec4i, box: wp.vec4i, along: wp.int32, cells: RayCells) -> wp.bool:
    """Whether a queued triangle may cover a texel of a box within its own."""
    y = wp.int32(box[1])
    found = wp.bool(False)
    while y <= box[3] and not found:
        ends = ends_of_row(sides, work, y, along, cells)
        found = ends[0] <= box[2] and ends[1] >= box[0] and ends[0] <= ends[1]
        y += 1
    return found


# 64 registers: a thread waits for memory longer than it computes, so more threads at a time are faster.
@wp.kernel(enable_backward=False, grid_stride=False, cuda_max_registers=64)
def raster_kernel(
    share: Share,
    inline_cells: wp.int32,
    inline_rays: wp.int32,
    light: Light,
    cells: RayCells,
    head: wp.array(dtype=wp.int32),
    mesh: Mesh,
    alpha: Alpha,
    bits: ShadowBits,
    queue: Queue,
):
    """One thread per triangle: on a face where it is small it is tested, where it is larger it is queued."""
    i = triangle_of(wp.tid(), share)
    if i >= share.triangles:
        return
    # Loaded together, without a branch between: an invalid triangle has corners too, but no face.
    row = last_row(cells.table)
    faces = wp.where(entry(mesh.valid, i) != wp.uint8(0), faces_of(row), wp.uint32(0))
    corners = corners_at(mesh, i)
    cube = cube_of_light(light)
    along = cells_of(row)
    q = in_cube_space(corners, cube)
    extent = extent_with_rays(cube, corners, row)
    slack = depth_slack(extent, cube)
    occluder = Occluder()
    occluder.i = i
    occluder.bound = bound_of(row, corners)
    occluder.sure = occluder.bound
    if wp.static(effects.alpha):
        if alpha.masked[i] != wp.uint8(0):
            occluder.sure = wp.INF
    # Small triangles are tested after the loop, by all lanes at once whatever their faces. Few triangles are small on
    # two faces: the second is queued.
    here = wp.int32(-1)
    box_here = wp.vec4i()
    several = without_lowest_bit(faces) != wp.uint32(0)
    while faces != wp.uint32(0):
        face = lowest_bit(faces)
        faces = without_lowest_bit(faces)
        f = corners_on(q, face)
        if not leaves_out(several, f, slack):
            flat = on_bins(f, extent, entry(cells.table, face))
            box = flat_box(flat, face, along, cells)
            least = nearest_depth(f, slack)
            if box[2] >= box[0] and not all_rays_end_before(least, cells.farthest, face, box, along):
                if here < 0 and (box[2] - box[0] + 1) * (box[3] - box[1] + 1) <= inline_cells:
                    here = face
                    box_here = box
                else:
                    queue_large(queue, i, face, box, occluder.bound)
    if here >= 0:
        # Corners are read again: held until here, they would take the registers of the loop.
        planes = set_planes(occluder, position_of(light), corners_at(mesh, i), False)
        if not test_texels(bits, queue, cells, head, along, here, box_here, planes, inline_rays):
            # Pairs that were tested are tested again with the rest: bits stay set, and few pairs are undecided.
            queue_large(queue, i, here, box_here, planes.bound)


@wp.kernel(enable_backward=False, grid_stride=False)
def setup_kernel(threads: wp.int32, light: Light, cells: RayCells, mesh: Mesh, queue: Queue):
    """One thread per queued triangle: its planes, the lines that bound it on its face, and the groups of its tiles."""
    place = wp.tid()
    stop = held_large(queue)
    cube = cube_of_light(light)
    row = last_row(cells.table)
    position = position_of(light)
    while place < stop:
        work = entry(queue.large, place)
        face = queued_face(work)
        i = queued_triangle(work)
        corners = corners_at(mesh, i)
        planes = occluder_of(i, False, position, corners, row, True)
        if not occludes_none(planes):
            # On two faces the planes are the same.
            store_planes(queue.records, planes)
            r = entry(cells.table, face)
            extent = extent_with_rays(cube, corners, row)
            f = corners_on(in_cube_space(corners, cube), face)
            sides = sides_on_face(on_bins(f, extent, r), position, cube, face, corners, r)
            set_entry(queue.groups, place, 0, sides.line0)
            set_entry(queue.groups, place, 1, sides.line1)
            set_entry(queue.groups, place, 2, sides.line2)
            slack = depth_slack(extent, cube)
            queue_groups(queue, place, queued_box(work), nearest_depth(f, slack))
        place += threads


@wp.kernel(enable_backward=False, grid_stride=False)
def split_kernel(threads: wp.int32, lanes: wp.int32, cells: RayCells, queue: Queue):
    """Tiles of larger triangles, ``lanes`` threads per item. Tiles without hit points, with nearer hit points than the
    triangle only, and those that it does not cover are left out."""
    item = wp.tid() // lanes
    stop = held_items(queue)
    along = cells_of(last_row(cells.table))
    while item < stop:
        group = entry(queue.items, item)
        item += threads // lanes
        if group[0] < queue.large.shape[0]:
            work = entry(queue.large, group[0])
            face = queued_face(work)
            least = wp.cast(group[2], wp.float32)
            k = wp.tid() % lanes
            while k < GROUP:
                tile = item_tile(work, group[1] + k)
                k += lanes
                if tile[0] >= 0:
                    box = tile_box(work, tile)
                    if not is_empty(cells.farthest, face, tile, along):
                        if not all_rays_end_before(least, cells.farthest, face, box, along):
                            if covers_some(stored_sides(queue, group[0]), work, box, along, cells):
                                queue_tile(queue, group[0], tile)


@wp.kernel(enable_backward=False, grid_stride=False)
def tile_kernel(
    threads: wp.int32,
    lanes: wp.int32,
    cells: RayCells,
    head: wp.array(dtype=wp.int32),
    alpha: Alpha,
    bits: ShadowBits,
    queue: Queue,
):
    """Hit points in the texels of queued tiles, ``lanes`` threads per tile."""
    at = wp.tid() // lanes
    stop = held_chunks(queue)
    along = cells_of(last_row(cells.table))
    while at < stop:
        chunk = entry(queue.chunks, at)
        at += threads // lanes
        if chunk[0] < queue.large.shape[0]:
            work = entry(queue.large, chunk[0])
            face = queued_face(work)
            tile = queued_tile(chunk)
            box = tile_box(work, tile)
            sides = stored_sides(queue, chunk[0])
            occluder = Occluder()
            occluder.i = queued_triangle(work)
            occluder.bound = wp.cast(work[3], wp.float32)
            occluder.sure = occluder.bound
            if wp.static(effects.alpha):
                if alpha.masked[occluder.i] != wp.uint8(0):
                    occluder.sure = wp.INF
            occluder = stored_planes(queue.records, occluder)
            k = wp.tid() % lanes
            while k < TILE_TEXELS:
                x = (tile[0] << TILE_SHIFT) + k % TILE_SIZE
                y = (tile[1] << TILE_SHIFT) + k // TILE_SIZE
                first = entry(head, texel_index(face, x, y, along))
                k += lanes
                if first > 0 and is_in(box, x, y):
                    ends = ends_of_row(sides, work, y, along, cells)
                    if x >= ends[0] and x <= ends[1]:
                        test_list(bits, queue, cells, first, occluder)
