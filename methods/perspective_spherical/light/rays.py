"""Shadow rays in a light's space (paper, sections 4.1 and 4.2): frame, place of each ray, rectangle, sort key.

The frame is aimed at the middle of the hit points and everything in it is float64, so that a light at 1e7 scene
radii still has its rays spread over all tiles; world axes and float32 are options, to measure what they cost.
"""

import warp as wp

from ....harness.frame.effects.receivers import hit_receives
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Hits, Mesh, ray_of
from ...common.axes import axes_along
from ...exact.triangle import largest, to_float64
from ...gpu.reserve import number_in, raise_to
from ..lists.sorting import PairSink
from .mapping import CUBE, LightSpace, ray_place
from .tile_edges import EXTENT, LightTiles, distance_slice, tile_of

FLOAT64_PAD, FLOAT32_PAD = 4.0e-14, 64 * 2.0**-24
"""Error bound of a ray's direction from the light, relative to its length."""

FINEST = wp.constant(wp.float64(FLOAT64_PAD))


@wp.struct
class LightRays:
    """Shadow rays to one light, arrays [pixels].

    receiver    uint8: which pixels have one     hit_points  vec3d: where they start
    place       vec4d: where it lies in the light's rectangles, its distance, which rectangle
    last_slice  int32: the last slice that it reaches
    """

    receiver: wp.array(dtype=wp.uint8)
    hit_points: wp.array(dtype=wp.vec3d)
    place: wp.array(dtype=wp.vec4d)
    last_slice: wp.array(dtype=wp.int32)


@wp.kernel(enable_backward=False)
def box_kernel(
    threads: wp.int32,
    marks: wp.bool,
    faces: wp.bool,
    camera: Camera,
    mesh: Mesh,
    space: LightSpace,
    spots: wp.array2d(dtype=wp.float64),
    front_facing: wp.array2d(dtype=wp.uint8),
    hits: Hits,
    rays: LightRays,
    receivers: wp.array2d(dtype=wp.uint8),
    box: wp.array(dtype=wp.float64),
):
    """Which pixels have a shadow ray, and the box of their hit points, low corner then high corner.

    ``marks``: if only some hits receive the light, the receivers are marked here; else they are marked already. ``faces``:
    only hits that face the light receive it.
    """
    k = wp.tid()
    low = wp.vec3d(wp.float64(wp.INF))
    high = -low
    index = space.index
    pixel = k
    while pixel < rays.receiver.shape[0]:
        hit = hits.triangle[pixel]
        wanted = hit >= 0
        if wp.static(effects.receivers):
            if marks:
                if wanted:
                    ray = ray_of(camera, pixel)
                    wanted = hit_receives(index, faces, ray, hit, mesh, space.lights, spots, front_facing)
                receivers[index, pixel] = wp.uint8(wanted)
            else:
                wanted = receivers[index, pixel] != wp.uint8(0)
        if wanted:
            low = wp.min(low, rays.hit_points[pixel])
            high = wp.max(high, rays.hit_points[pixel])
        rays.receiver[pixel] = wp.uint8(wanted)
        pixel += threads
    reduce_extent(low, high, k % wp.block_dim(), box)


@wp.func
def reduce_extent(low: wp.vec3d, high: wp.vec3d, lane: wp.int32, extent: wp.array(dtype=wp.float64)):
    """Lower extent[0..2] and raise extent[3..5]: one reduction per block, then at most six atomics.

    Every thread of the block must call it.
    """
    for axis in range(wp.static(3)):
        least = wp.tile_extract(wp.tile_min(wp.tile(low[axis])), 0)
        most = wp.tile_extract(wp.tile_max(wp.tile(high[axis])), 0)
        if lane == 0:
            if least < extent[axis]:
                wp.atomic_min(extent, axis, least)
            if most > extent[3 + axis]:
                wp.atomic_max(extent, 3 + axis, most)


@wp.func
def box_middle(box: wp.array(dtype=wp.float64)) -> wp.vec3d:
    half = wp.float64(0.5)
    return wp.vec3d(half * (box[0] + box[3]), half * (box[1] + box[4]), half * (box[2] + box[5]))


@wp.kernel(enable_backward=False)
def aim_kernel(centred: wp.bool, pad: wp.float64, spots: wp.array2d(dtype=wp.float64), space: LightSpace):
    """Fill ``space.axes`` and ``space.pads`` of a light.

    axes  rows: forward to the middle of the hit points, or along its spot (or +x); right; up
    pads  what a ray's direction is known to; and how far away the middle of the hit points is, where rays are given
          relative to it (``centred``): only of an aimed light without a spot, at least twice as far as the hit points
          reach; else 0
    """
    index = space.index
    space.pads[0] = pad
    space.pads[1] = wp.float64(0.0)
    middle = box_middle(space.box)
    forward = middle - to_float64(space.proxy_positions[index])
    if space.aimed and spots[index, 0] != wp.float64(0.0):
        space.axes[0] = wp.matrix_from_rows(
            wp.vec3d(spots[index, 1], spots[index, 2], spots[index, 3]),
            wp.vec3d(spots[index, 4], spots[index, 5], spots[index, 6]),
            wp.vec3d(spots[index, 7], spots[index, 8], spots[index, 9]),
        )
        return
    size = largest(forward)
    if not space.aimed or not (size > wp.float64(0.0)) or not (size < wp.float64(wp.INF)):
        forward = wp.vec3d(wp.float64(1.0), wp.float64(0.0), wp.float64(0.0))
        size = wp.float64(1.0)
    space.axes[0] = axes_along(wp.normalize(forward / size))
    if centred:
        distance = wp.length(middle - to_float64(space.proxy_positions[index]))
        box = space.box
        reach = wp.length(wp.vec3d(box[3] - box[0], box[4] - box[1], box[5] - box[2]))
        if distance >= reach:
            # Rounded are coordinates no larger than half the reach; no ray is shorter than half the distance.
            space.pads[0] = wp.max(FINEST, wp.float64(2.0) * pad * reach / distance)
            space.pads[1] = distance


@wp.kernel(enable_backward=False)
def map_kernel(threads: wp.int32, space: LightSpace, rays: LightRays, extent: wp.array(dtype=wp.float64)):
    """(two coordinates, distance, face) of every shadow ray, and their extent."""
    k = wp.tid()
    low = wp.vec3d(wp.float64(wp.INF))
    high = -low
    middle = box_middle(space.box)
    pixel = k
    while pixel < rays.receiver.shape[0]:
        if rays.receiver[pixel] != wp.uint8(0):
            p = ray_place(space, rays.hit_points[pixel], middle)
            rays.place[pixel] = p
            if space.map == CUBE:
                offset = wp.int32(p[3]) * EXTENT
                for axis in range(3):
                    if p[axis] < extent[offset + axis]:
                        wp.atomic_min(extent, offset + axis, p[axis])
                    if p[axis] > extent[offset + 3 + axis]:
                        wp.atomic_max(extent, offset + 3 + axis, p[axis])
            else:
                low = wp.min(low, wp.vec3d(p[0], p[1], p[2]))
                high = wp.max(high, wp.vec3d(p[0], p[1], p[2]))
        pixel += threads
    if space.map != CUBE:
        reduce_extent(low, high, k % wp.block_dim(), extent)


@wp.kernel(enable_backward=False, grid_stride=False)
def key_kernel(
    space: LightSpace, grid: LightTiles, rays: LightRays, pairs: PairSink, shadowed: wp.array2d(dtype=wp.uint8)
):
    """(light tile, primary ray) pairs; no shadow ray has the key behind every tile. Resets the shadow bits.

    ``grid.deepest`` is raised from -1: the last slice that a ray of the tile reaches.
    """
    pixel = wp.tid()
    shadowed[space.index, pixel] = wp.uint8(0)
    pairs.values[pixel] = pixel
    if rays.receiver[pixel] == wp.uint8(0):
        pairs.keys[pixel] = grid.faces * grid.tiles * grid.tiles
        return
    p = rays.place[pixel]
    face = wp.int32(p[3])
    offset = face * EXTENT
    column = tile_of(p[0], grid.extent[offset], grid.extent[offset + 3], grid.tiles)
    row = tile_of(p[1], grid.extent[offset + 1], grid.extent[offset + 4], grid.tiles)
    tile = (face * grid.tiles + row) * grid.tiles + column
    pairs.keys[pixel] = tile
    if pairs.counted:
        pairs.ranks[pixel] = number_in(pairs.cell_count, tile)
    # A triangle is listed from its nearest point on: what lies behind the ray's own slice cannot shadow it.
    slice = distance_slice(p[2] * (wp.float64(1.0) + space.distance_pad), grid, face)
    rays.last_slice[pixel] = slice
    raise_to(grid.deepest, tile, slice)
