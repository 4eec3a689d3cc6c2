"""Shadow rays: the irregular z-buffer of a light, and triangles rasterised conservatively over it.

The map's texels hold lists of hit points (Johnson et al. 2005; Wyman, Hoetzlein and Lefohn 2015). A texel holds the head
of a linked list; the pixel of a hit point is its place in memory. The map lies on the faces of a cube around the light
(:mod:`..streams.cube.cells`).

Where a triangle may lie on the map is found as in ``ray_grids`` (:mod:`..streams.cube.footprint`), with a pad for what
float32 does to its corners. A hit point is tested against the planes of the frustum behind the triangle
(:mod:`..streams.occlusion.planes`); what float32 leaves undecided is queued for float64.
"""

import warp as wp

from ...harness.frame.alpha import Alpha
from ...harness.frame.geometry import Mesh
from ..common.pixels import tile_pixel
from ..common.reads import corners_at
from ..gpu.bits import lowest_bit, without_lowest_bit
from ..gpu.entries import entry, set_entry
from ..streams.camera.pixels import sure_of
from ..streams.cube import footprint
from ..streams.cube.cells import RayCells, all_rays_end_before, nearest_depth, raise_from, tile_index
from ..streams.cube.footprint import Sides, corners_on, extent_with_rays, in_cube_space, on_bins, sides_on_face
from ..streams.cube.lights import Light, cube_of_light, position_of
from ..streams.cube.rectangle import cells_in_use, cells_of, face_rectangle, faces_of, last_row, set_table
from ..streams.occlusion.planes import Occluder, ShadowBits, bound_of, occluder_of, occludes_none, test_ray
from ..streams.queues import CHUNKS, ITEMS, LARGE, Queue, Share, triangle_of
from ..streams.rays.hit_points import PrimaryHits, has_ray
from ..streams.rays.sort import cell_of
from . import raster
from .raster import GROUP, TILE_SHIFT, TILE_SIZE, TILE_TEXELS, Larger, larger_at, queue_groups, queue_large, tile_box

LEAST_DEPTH = wp.constant(1.0e-37)
"""Depth of a hit point at the light, so that a tile with hit points is never taken for an empty one."""


@wp.func
def texel_index(face: wp.int32, x: wp.int32, y: wp.int32, along: wp.int32) -> wp.int32:
    """The texels of a tile of 8 x 8 are neighbours in memory; ``along``: texels along a face."""
    return tile_index(face, x, y, along) * TILE_TEXELS + (y % TILE_SIZE) * TILE_SIZE + x % TILE_SIZE


@wp.kernel(enable_backward=False, grid_stride=False, module="unique")
def insert_kernel(
    light: wp.int32,
    hits: PrimaryHits,
    receivers: wp.array2d(dtype=wp.uint8),
    cells: RayCells,
    head: wp.array(dtype=wp.int32),
):
    """Put every hit point in the list of its texel; the farthest of each tile; the faces' rectangles (``cells.table``).

    head: 1 + the pixel of the last hit point of a texel, 0 where the list is empty. The fourth word of ``cells.point``
    becomes the bits of the next one. The order of a list depends on that of the threads; no answer does.
    """
    along = cells_in_use(cells.rectangle, cells.cells)
    set_table(wp.tid(), cells.rectangle, cells.table, along)
    camera = hits.camera
    at = tile_pixel(wp.tid(), camera.width, camera.height)
    if at[0] < 0:
        return
    pixel = at[1] * camera.width + at[0]
    if not has_ray(hits, receivers, light, pixel):
        return
    p = entry(cells.place, pixel)
    face = wp.int32(p[2])
    texel = cell_of(p, face, face_rectangle(face, cells.rectangle), along, cells)
    tile = tile_index(face, texel[0], texel[1], along)
    raise_from(entry(cells.farthest, tile), cells.farthest, tile, wp.max(p[3], LEAST_DEPTH))
    following = wp.atomic_exch(head, texel_index(face, texel[0], texel[1], along), pixel + 1)
    cells.point[pixel][3] = wp.cast(following, wp.float32)


@wp.func
def test_node(bits: ShadowBits, queue: Queue, cells: RayCells, node: wp.int32, occluder: Occluder) -> wp.int32:
    """Test a hit point of a list against a triangle; the next of the list, 0 at its end."""
    h = entry(cells.point, node - 1)
    following = wp.cast(h[3], wp.int32)
    test_ray(bits, queue, wp.vec4f(h[0], h[1], h[2], wp.cast(node - 1, wp.float32)), occluder)
    return following


@wp.func
def test_texels(
    bits: ShadowBits,
    queue: Queue,
    cells: RayCells,
    head: wp.array(dtype=wp.int32),
    along: wp.int32,
    face: wp.int32,
    box: wp.vec4i,
    occluder: Occluder,
    most: wp.int32,
) -> wp.bool:
    """Test the hit points in a small box of texels, ``most`` of them; whether those were all.

    One loop over all of them: in a loop for each texel the lanes of a warp would wait for the longest list each time.
    """
    left = wp.int32(most)
    x = wp.int32(box[0])
    y = wp.int32(box[1])
    node = wp.int32(0)
    while left >= 0 and (node > 0 or y <= box[3]):
        if node == 0:
            node = entry(head, texel_index(face, x, y, along))
            x += 1
            if x > box[2]:
                x = box[0]
                y += 1
        if node > 0:
            left -= 1
            if left >= 0:
                node = test_node(bits, queue, cells, node, occluder)
    return left >= 0


@wp.func
def store_planes(records: wp.array2d(dtype=wp.vec4f), occluder: Occluder):
    """Store the planes of a queued triangle, four words per plane."""
    set_entry(records, occluder.i, 0, occluder.e0)
    set_entry(records, occluder.i, 1, occluder.e1)
    set_entry(records, occluder.i, 2, occluder.e2)
    set_entry(records, occluder.i, 3, occluder.plane)


@wp.func
def stored_occluder(queue: Queue, large: Larger, alpha: Alpha) -> Occluder:
    """A larger triangle with the planes that :func:`store_planes` stored."""
    o = Occluder()
    o.i = large.i
    o.bound = large.bound
    o.sure = sure_of(large.i, large.bound, alpha)
    o.e0 = entry(queue.records, large.i, 0)
    o.e1 = entry(queue.records, large.i, 1)
    o.e2 = entry(queue.records, large.i, 2)
    o.plane = entry(queue.records, large.i, 3)
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
def ends_of_row(sides: Sides, large: Larger, y: wp.int32, along: wp.int32, cells: RayCells) -> wp.vec2i:
    """First and last texel of a row that a larger triangle may cover; ``along``: texels along a face."""
    return footprint.cells_of_row(sides, large.face, y, large.box[0], large.box[2], along, cells)


@wp.func
def covers_some(sides: Sides, large: Larger, box: wp.vec4i, along: wp.int32, cells: RayCells) -> wp.bool:
    """Whether a larger triangle may cover a texel of a box within its own."""
    y = wp.int32(box[1])
    found = wp.bool(False)
    while y <= box[3] and not found:
        ends = ends_of_row(sides, large, y, along, cells)
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
    slack = footprint.depth_slack(extent, cube)
    bound = bound_of(row, corners)
    # Small triangles are tested after the loop, by all lanes at once whatever their faces. Few triangles are small on
    # two faces: the second is queued.
    here = wp.int32(-1)
    box_here = wp.vec4i()
    several = without_lowest_bit(faces) != wp.uint32(0)
    while faces != wp.uint32(0):
        face = lowest_bit(faces)
        faces = without_lowest_bit(faces)
        f = corners_on(q, face)
        if not footprint.leaves_out(several, f, slack):
            flat = on_bins(f, extent, entry(cells.table, face))
            box = footprint.flat_box(flat, face, along, cells)
            least = nearest_depth(f, slack)
            if box[2] >= box[0] and not all_rays_end_before(least, cells.farthest, face, box, along):
                if here < 0 and (box[2] - box[0] + 1) * (box[3] - box[1] + 1) <= inline_cells:
                    here = face
                    box_here = box
                else:
                    queue_large(queue, i, face, box, bound)
    if here >= 0:
        # Corners are read again: held until here, they would take the registers of the loop.
        planes = occluder_of(i, bound, sure_of(i, bound, alpha), position_of(light), corners_at(mesh, i), False)
        if not test_texels(bits, queue, cells, head, along, here, box_here, planes, inline_rays):
            # Pairs that were tested are tested again with the rest: bits stay set, and few pairs are undecided.
            queue_large(queue, i, here, box_here, planes.bound)


@wp.kernel(enable_backward=False, grid_stride=False)
def setup_kernel(threads: wp.int32, light: Light, cells: RayCells, mesh: Mesh, queue: Queue):
    """One thread per queued triangle: its planes, the lines that bound it on its face, and the groups of its tiles."""
    place = wp.tid()
    stop = wp.min(queue.counts[LARGE], queue.large.shape[0])
    cube = cube_of_light(light)
    row = last_row(cells.table)
    position = position_of(light)
    while place < stop:
        large = larger_at(queue, place)
        corners = corners_at(mesh, large.i)
        bound = bound_of(row, corners)
        planes = occluder_of(large.i, bound, bound, position, corners, True)
        if not occludes_none(planes):
            # On two faces the planes are the same.
            store_planes(queue.records, planes)
            r = entry(cells.table, large.face)
            extent = extent_with_rays(cube, corners, row)
            f = corners_on(in_cube_space(corners, cube), large.face)
            sides = sides_on_face(on_bins(f, extent, r), position, cube, large.face, corners, r)
            set_entry(queue.groups, place, 0, sides.line0)
            set_entry(queue.groups, place, 1, sides.line1)
            set_entry(queue.groups, place, 2, sides.line2)
            slack = footprint.depth_slack(extent, cube)
            queue_groups(queue, place, large.box, nearest_depth(f, slack))
        place += threads


@wp.kernel(enable_backward=False, grid_stride=False)
def split_kernel(threads: wp.int32, lanes: wp.int32, cells: RayCells, queue: Queue):
    """Tiles of larger triangles, ``lanes`` threads per item. Tiles without hit points, with nearer hit points than the
    triangle only, and those that it does not cover are left out.
    """
    item = wp.tid() // lanes
    stop = wp.min(queue.counts[ITEMS], queue.items.shape[0])
    along = cells_of(last_row(cells.table))
    while item < stop:
        group = entry(queue.items, item)
        item += threads // lanes
        if group[0] < queue.large.shape[0]:
            large = larger_at(queue, group[0])
            least = wp.cast(group[2], wp.float32)
            k = wp.tid() % lanes
            while k < GROUP:
                tile = raster.item_tile(large.box, group[1] + k)
                k += lanes
                if tile[0] >= 0:
                    box = tile_box(large.box, tile)
                    # In a tile without hit points nothing is farthest.
                    if entry(cells.farthest, tile_index(large.face, box[0], box[1], along)) != 0:
                        if not all_rays_end_before(least, cells.farthest, large.face, box, along):
                            if covers_some(stored_sides(queue, group[0]), large, box, along, cells):
                                raster.queue_tile(queue, group[0], tile)


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
    stop = wp.min(queue.counts[CHUNKS], queue.chunks.shape[0])
    along = cells_of(last_row(cells.table))
    while at < stop:
        chunk = entry(queue.chunks, at)
        at += threads // lanes
        if chunk[0] < queue.large.shape[0]:
            large = larger_at(queue, chunk[0])
            tile = raster.queued_tile(chunk)
            box = tile_box(large.box, tile)
            sides = stored_sides(queue, chunk[0])
            occluder = stored_occluder(queue, large, alpha)
            k = wp.tid() % lanes
            while k < TILE_TEXELS:
                x = (tile[0] << TILE_SHIFT) + k % TILE_SIZE
                y = (tile[1] << TILE_SHIFT) + k // TILE_SIZE
                node = entry(head, texel_index(large.face, x, y, along))
                k += lanes
                if node > 0 and raster.is_in(box, x, y):
                    ends = ends_of_row(sides, large, y, along, cells)
                    if x >= ends[0] and x <= ends[1]:
                        while node > 0:
                            node = test_node(bits, queue, cells, node, occluder)
