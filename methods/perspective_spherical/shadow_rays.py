"""Shadow rays in the light's space (paper, sections 4.1-4.4): map, sort to tiles, split into chunks, trace.

The light's frame is aimed at the middle of the hit points and everything in it is float64, so that a light at
1e7 scene radii still has its rays spread over all tiles. The rectangle is clamped to the rays.
"""

from __future__ import annotations

import warp as wp

from ..common.triangle import U32, largest, may_occlude, occludes, to_float32, to_float64, weld_of
from .sphere import angles

SHARE = wp.constant(128)
"""Pixels that one thread reduces before it touches the shared extent."""

EXTENT = 8
"""Length of an extent: azimuth, elevation and distance, lowest then highest, and two unused."""


@wp.kernel(enable_backward=False)
def reset_kernel(box: wp.array(dtype=wp.float64), extent: wp.array(dtype=wp.float64)):
    """Empty ranges: lows at +inf, highs at -inf."""
    i = wp.tid()
    value = wp.float64(wp.INF)
    if i >= 3:
        value = -value
    if i < 6:
        box[i] = value
        extent[i] = value


@wp.kernel(enable_backward=False)
def box_kernel(
    pixels: wp.int32,
    triangle: wp.array(dtype=wp.int32),
    hit: wp.array(dtype=wp.vec3d),
    box: wp.array(dtype=wp.float64),
):
    """Box of the hit points, low corner then high corner."""
    k = wp.tid()
    threads = (pixels + SHARE - 1) // SHARE
    low = wp.vec3d(wp.float64(wp.INF))
    high = -low
    for j in range(SHARE):
        pixel = j * threads + k
        if pixel < pixels and triangle[pixel] >= 0:
            low = wp.min(low, hit[pixel])
            high = wp.max(high, hit[pixel])
    for axis in range(3):
        if low[axis] < box[axis]:
            wp.atomic_min(box, axis, low[axis])
        if high[axis] > box[3 + axis]:
            wp.atomic_max(box, 3 + axis, high[axis])


@wp.kernel(enable_backward=False)
def aim_kernel(
    index: wp.int32,
    aimed: wp.bool,
    lights: wp.array(dtype=wp.vec3f),
    box: wp.array(dtype=wp.float64),
    frame: wp.array(dtype=wp.mat33d),
):
    """The light's axes as rows: forward to the middle of the hit points (or +x), right, up."""
    half = wp.float64(0.5)
    middle = wp.vec3d(half * (box[0] + box[3]), half * (box[1] + box[4]), half * (box[2] + box[5]))
    forward = middle - to_float64(lights[index])
    size = wp.max(wp.abs(forward[0]), wp.max(wp.abs(forward[1]), wp.abs(forward[2])))
    if not aimed or not (size > wp.float64(0.0)) or not (size < wp.float64(wp.INF)):
        forward = wp.vec3d(wp.float64(1.0), wp.float64(0.0), wp.float64(0.0))
        size = wp.float64(1.0)
    forward = wp.normalize(forward / size)
    # Any axis far from parallel to forward serves as "up"; world axes keep y up as the paper's figure does.
    up = wp.vec3d(wp.float64(0.0), wp.float64(1.0), wp.float64(0.0))
    if wp.abs(forward[1]) > wp.float64(0.8):
        up = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(1.0))
    right = wp.normalize(wp.cross(forward, up))
    up = wp.cross(right, forward)
    frame[0] = wp.matrix_from_rows(forward, right, up)


@wp.kernel(enable_backward=False)
def map_kernel(
    pixels: wp.int32,
    index: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    frame: wp.array(dtype=wp.mat33d),
    triangle: wp.array(dtype=wp.int32),
    hit: wp.array(dtype=wp.vec3d),
    place: wp.array(dtype=wp.vec3d),
    extent: wp.array(dtype=wp.float64),
):
    """(azimuth, elevation, distance) of every hit point, and their extent."""
    k = wp.tid()
    threads = (pixels + SHARE - 1) // SHARE
    low = wp.vec3d(wp.float64(wp.INF))
    high = -low
    light = to_float64(lights[index])
    axes = frame[0]
    for j in range(SHARE):
        pixel = j * threads + k
        if pixel < pixels and triangle[pixel] >= 0:
            p = angles(axes * (hit[pixel] - light))
            place[pixel] = p
            low = wp.min(low, p)
            high = wp.max(high, p)
    for axis in range(3):
        if low[axis] < extent[axis]:
            wp.atomic_min(extent, axis, low[axis])
        if high[axis] > extent[3 + axis]:
            wp.atomic_max(extent, 3 + axis, high[axis])


@wp.func
def tile_of(angle: wp.float64, low: wp.float64, high: wp.float64, tiles: wp.int32) -> wp.int32:
    """Index of the tile along one axis. Monotone, and the same function for rays and triangles."""
    if not (high > low):
        return 0
    share = (angle - low) / (high - low)
    return wp.int32(wp.clamp(share * wp.float64(tiles), wp.float64(0.0), wp.float64(tiles) - wp.float64(0.5)))


@wp.func
def distance_slice(distance: wp.float64, extent: wp.array(dtype=wp.float64), slices: wp.int32) -> wp.int32:
    """Slice between the nearest and the farthest ray; nearer triangles fall into the first."""
    return tile_of(distance, extent[2], extent[5], slices)


@wp.kernel(enable_backward=False)
def key_kernel(
    tiles: wp.int32,
    triangle: wp.array(dtype=wp.int32),
    place: wp.array(dtype=wp.vec3d),
    extent: wp.array(dtype=wp.float64),
    keys: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.int32),
    visibility: wp.array2d(dtype=wp.uint8),
    index: wp.int32,
):
    """(light tile, primary ray) pairs; a miss gets the key behind every tile. Resets the shadow bits."""
    pixel = wp.tid()
    visibility[index, pixel] = wp.uint8(0)
    values[pixel] = pixel
    if triangle[pixel] < 0:
        keys[pixel] = tiles * tiles
        return
    p = place[pixel]
    column = tile_of(p[0], extent[0], extent[3], tiles)
    row = tile_of(p[1], extent[1], extent[4], tiles)
    keys[pixel] = row * tiles + column


@wp.kernel(enable_backward=False)
def chunk_count_kernel(
    r: wp.int32,
    begin: wp.array(dtype=wp.int32),
    end: wp.array(dtype=wp.int32),
    chunks: wp.array(dtype=wp.int32),
):
    """ceil(R / r) chunks for a tile of R rays (paper, section 4.3)."""
    tile = wp.tid()
    chunks[tile] = (end[tile] - begin[tile] + r - 1) // r


@wp.kernel(enable_backward=False)
def chunk_kernel(
    r: wp.int32,
    begin: wp.array(dtype=wp.int32),
    chunks: wp.array(dtype=wp.int32),
    scan: wp.array(dtype=wp.int32),
    first: wp.array(dtype=wp.vec2i),
):
    """The tile and the first ray of every chunk, compacted: C_total of them."""
    tile = wp.tid()
    for j in range(chunks[tile]):
        first[scan[tile] - chunks[tile] + j] = wp.vec2i(tile, begin[tile] + j * r)


@wp.kernel(enable_backward=False)
def shadow_kernel(
    index: wp.int32,
    r: wp.int32,
    tiles: wp.int32,
    slices: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    eye: wp.array(dtype=wp.vec3f),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    weld: wp.array(dtype=wp.int32),
    triangle: wp.array(dtype=wp.int32),
    hit: wp.array(dtype=wp.vec3d),
    place: wp.array(dtype=wp.vec3d),
    extent: wp.array(dtype=wp.float64),
    scan: wp.array(dtype=wp.int32),
    first: wp.array(dtype=wp.vec2i),
    ray_end: wp.array(dtype=wp.int32),
    rays: wp.array(dtype=wp.int32),
    begin: wp.array(dtype=wp.int32),
    end: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.int32),
    visibility: wp.array2d(dtype=wp.uint8),
    tests: wp.array(dtype=wp.int32),
):
    """One thread a ray, r threads a chunk. Any hit; the bit is set in primary-ray order, without synchronisation."""
    k = wp.tid()
    chunk = k // r
    if chunk >= scan[tiles * tiles - 1]:
        return
    tile = first[chunk][0]
    at = first[chunk][1] + k % r
    if at >= ray_end[tile]:
        return
    pixel = rays[at]
    h64 = hit[pixel]
    h = to_float32(h64)
    h_error = U32 * largest(h) + 1.0e-37
    light = lights[index]
    own = triangle[pixel]
    origin_size = wp.float64(largest(eye[0]))
    # A triangle is listed from its nearest point on, so what lies behind the ray's own slice cannot shadow it.
    last = wp.min(distance_slice(place[pixel][2] * wp.float64(1.0 + 1.0e-9), extent, slices), slices - 1)
    number = wp.int32(0)
    shadowed = wp.bool(False)
    slice = wp.int32(0)
    while slice <= last and not shadowed:
        cell = tile * slices + slice
        j = begin[cell]
        stop = end[cell]
        while j < stop and not shadowed:
            i = values[j]
            j += 1
            if i != own:
                face = triangles[i]
                a = points[face[0]]
                b = points[face[1]]
                c = points[face[2]]
                number += 1
                if may_occlude(h, light, a, b, c, h_error):
                    shadowed = occludes(h64, light, a, b, c, weld_of(weld, face), origin_size)
        slice += 1
    if shadowed:
        visibility[index, pixel] = wp.uint8(1)
    if tests.shape[0] > 1:
        tests[pixel] = tests[pixel] + number
