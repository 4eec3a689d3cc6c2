"""The spherical light grid (paper, section 4.1): triangles in tiles of azimuth and elevation and slices of distance.

Conservative throughout: the box of tiles comes from exact bounds on the sphere (:mod:`.sphere`); a tile of the box
is left out only if the cone around it lies certainly outside one of the planes through the light and an edge.
"""

from __future__ import annotations

import warp as wp

from ..common.triangle import U64, largest, to_float64, total
from .binning import INLINE_TILES, queue_rows
from .shadow_rays import distance_slice, tile_of
from .sphere import ROUNDING, TWO_PI, triangle_angles


@wp.struct
class LitTriangle:
    """Inward planes through the light and the edges (light's frame), their lengths, and whether inward is known."""

    n0: wp.vec3d
    n1: wp.vec3d
    n2: wp.vec3d
    oriented: wp.bool
    error: wp.float64


@wp.func
def holds_light(light: wp.vec3f, a: wp.vec3f, b: wp.vec3f, c: wp.vec3f) -> wp.bool:
    """Whether the light lies on the triangle's plane within rounding: then it never occludes (see ``occludes``)."""
    a64 = to_float64(a)
    ab = to_float64(b) - a64
    ac = to_float64(c) - a64
    la = to_float64(light) - a64
    return wp.abs(wp.dot(wp.cross(ab, ac), la)) <= U64 * largest(ab) * largest(ac) * wp.float64(16.0) * total(
        la
    )


@wp.kernel(enable_backward=False)
def bound_kernel(
    triangle_count: wp.int32,
    index: wp.int32,
    tiles: wp.int32,
    slices: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    frame: wp.array(dtype=wp.mat33d),
    extent: wp.array(dtype=wp.float64),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    valid: wp.array(dtype=wp.uint8),
    boxes: wp.array(dtype=wp.vec4i),
    spans: wp.array(dtype=wp.vec2i),
    rows: wp.array(dtype=wp.vec2i),
    row_count: wp.array(dtype=wp.int64),
):
    """Each triangle's box of tiles and span of slices; queue the rows of large ones."""
    i = wp.tid()
    boxes[i] = wp.vec4i(0, 0, -1, -1)
    if i >= triangle_count or valid[i] == wp.uint8(0) or not (extent[3] >= extent[0]):
        return
    face = triangles[i]
    if holds_light(lights[index], points[face[0]], points[face[1]], points[face[2]]):
        return
    light = to_float64(lights[index])
    axes = frame[0]
    a = axes * (to_float64(points[face[0]]) - light)
    b = axes * (to_float64(points[face[1]]) - light)
    c = axes * (to_float64(points[face[2]]) - light)
    # Nearest point: no nearer than the plane, nor than the nearest vertex less the longest edge.
    normal = wp.cross(b - a, c - a)
    size = wp.length(normal)
    nearest_vertex = wp.min(wp.length(a), wp.min(wp.length(b), wp.length(c)))
    longest = wp.max(wp.length(b - a), wp.max(wp.length(c - b), wp.length(a - c)))
    near = wp.max(wp.float64(0.0), nearest_vertex - longest)
    if size > wp.float64(1.0e-9) * longest * longest:
        plane = wp.abs(wp.dot(normal, a)) / size
        near = wp.max(near, plane - wp.float64(1.0e-5) * longest)
    near = near * wp.float64(1.0 - 1.0e-9)
    if near > extent[5]:
        return
    bounds = triangle_angles(a, b, c)
    pad = wp.float64(4.0) * ROUNDING
    x0 = wp.int32(tiles)
    x1 = wp.int32(-1)
    overlaps = wp.int32(0)
    for turn in range(3):
        shift = wp.float64(turn - 1) * TWO_PI
        low = bounds[0] + shift - pad
        high = bounds[1] + shift + pad
        if high >= extent[0] and low <= extent[3]:
            overlaps += 1
            x0 = tile_of(low, extent[0], extent[3], tiles)
            x1 = tile_of(high, extent[0], extent[3], tiles)
    if overlaps > 1:
        # Both ends of the rectangle: every column, and the planes through the edges sort out the middle.
        x0 = 0
        x1 = tiles - 1
    if overlaps == 0 or bounds[3] + pad < extent[1] or bounds[2] - pad > extent[4]:
        return
    y0 = tile_of(bounds[2] - pad, extent[1], extent[4], tiles)
    y1 = tile_of(bounds[3] + pad, extent[1], extent[4], tiles)
    box = wp.vec4i(x0, y0, x1, y1)
    boxes[i] = box
    far = wp.max(wp.length(a), wp.max(wp.length(b), wp.length(c))) * wp.float64(1.0 + 1.0e-9)
    spans[i] = wp.vec2i(distance_slice(near, extent, slices), distance_slice(far, extent, slices))
    if (box[2] - box[0] + 1) * (box[3] - box[1] + 1) > INLINE_TILES:
        queue_rows(i, box, rows, row_count)


@wp.func
def lit_triangle(
    light: wp.vec3f, axes: wp.mat33d, a32: wp.vec3f, b32: wp.vec3f, c32: wp.vec3f
) -> LitTriangle:
    l64 = to_float64(light)
    a = axes * (to_float64(a32) - l64)
    b = axes * (to_float64(b32) - l64)
    c = axes * (to_float64(c32) - l64)
    s = LitTriangle()
    s.n0 = wp.cross(b, c - b)
    s.n1 = wp.cross(c, a - c)
    s.n2 = wp.cross(a, b - a)
    normal = wp.cross(b - a, c - a)
    det = wp.dot(normal, a)
    reach = wp.max(largest(a), wp.max(largest(b), largest(c)))
    edge = wp.max(largest(b - a), wp.max(largest(c - b), largest(a - c)))
    s.oriented = wp.abs(det) > wp.float64(8.0) * ROUNDING * edge * edge * reach
    if det < wp.float64(0.0):
        s.n0 = -s.n0
        s.n1 = -s.n1
        s.n2 = -s.n2
    s.error = wp.float64(8.0) * ROUNDING * reach * edge
    return s


@wp.func
def cone_missed(s: LitTriangle, centre: wp.vec3d, radius: wp.float64) -> wp.bool:
    """Whether every direction within ``radius`` of the unit vector ``centre`` certainly misses the triangle."""
    return (
        wp.dot(s.n0, centre) < -(wp.length(s.n0) * radius + s.error)
        or wp.dot(s.n1, centre) < -(wp.length(s.n1) * radius + s.error)
        or wp.dot(s.n2, centre) < -(wp.length(s.n2) * radius + s.error)
    )


@wp.func
def bin_row(
    emit: wp.int32,
    i: wp.int32,
    s: LitTriangle,
    span: wp.vec2i,
    row: wp.int32,
    first: wp.int32,
    last: wp.int32,
    tiles: wp.int32,
    slices: wp.int32,
    spans_all: wp.bool,
    extent: wp.array(dtype=wp.float64),
    place: wp.int64,
    keys: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.int32),
) -> wp.int64:
    """Count (or write from ``place``) the cells of triangle i in tiles first..last of one row."""
    capacity = wp.int64(keys.shape[0] // 2)
    width = (extent[3] - extent[0]) / wp.float64(tiles)
    height = (extent[4] - extent[1]) / wp.float64(tiles)
    half = wp.float64(0.5)
    low = extent[1] + wp.float64(row) * height
    middle = low + half * height
    # A step along the meridian, then along the parallel, reaches every point of the tile.
    flattest = wp.float64(1.0)
    if low > wp.float64(0.0):
        flattest = wp.cos(low)
    elif low + height < wp.float64(0.0):
        flattest = wp.cos(low + height)
    radius = (half * height + half * width * flattest) * wp.float64(1.000001) + wp.float64(4.0) * ROUNDING
    test = s.oriented and radius < wp.float64(1.0) and last > first
    up = wp.sin(middle)
    flat = wp.cos(middle)
    slice_last = span[0]
    if spans_all:
        slice_last = span[1]
    number = wp.int64(0)
    for column in range(first, last + 1):
        missed = wp.bool(False)
        if test:
            azimuth = extent[0] + (wp.float64(column) + half) * width
            centre = wp.vec3d(flat * wp.cos(azimuth), flat * wp.sin(azimuth), up)
            missed = cone_missed(s, centre, radius)
        if not missed:
            if emit != 0:
                cell = (row * tiles + column) * slices
                for slice in range(span[0], slice_last + 1):
                    at = place + number + wp.int64(slice - span[0])
                    if at < capacity:
                        keys[wp.int32(at)] = cell + slice
                        values[wp.int32(at)] = i
            number += wp.int64(slice_last - span[0] + 1)
    return number


@wp.kernel(enable_backward=False)
def bin_triangles_kernel(
    emit: wp.int32,
    index: wp.int32,
    tiles: wp.int32,
    slices: wp.int32,
    spans_all: wp.bool,
    lights: wp.array(dtype=wp.vec3f),
    frame: wp.array(dtype=wp.mat33d),
    extent: wp.array(dtype=wp.float64),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    boxes: wp.array(dtype=wp.vec4i),
    spans: wp.array(dtype=wp.vec2i),
    count: wp.array(dtype=wp.int64),
    scan: wp.array(dtype=wp.int64),
    keys: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.int32),
):
    """Small triangles: all their tiles."""
    i = wp.tid()
    box = boxes[i]
    number = wp.int64(0)
    if box[2] >= box[0] and (box[2] - box[0] + 1) * (box[3] - box[1] + 1) <= INLINE_TILES:
        face = triangles[i]
        s = lit_triangle(lights[index], frame[0], points[face[0]], points[face[1]], points[face[2]])
        place = scan[i] - count[i]
        for row in range(box[1], box[3] + 1):
            number += bin_row(
                emit, i, s, spans[i], row, box[0], box[2], tiles, slices, spans_all, extent, place + number, keys,
                values,
            )  # fmt: skip
    if emit == 0:
        count[i] = number


@wp.kernel(enable_backward=False)
def bin_rows_kernel(
    emit: wp.int32,
    offset: wp.int32,
    index: wp.int32,
    tiles: wp.int32,
    slices: wp.int32,
    spans_all: wp.bool,
    lights: wp.array(dtype=wp.vec3f),
    frame: wp.array(dtype=wp.mat33d),
    extent: wp.array(dtype=wp.float64),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    boxes: wp.array(dtype=wp.vec4i),
    spans: wp.array(dtype=wp.vec2i),
    rows: wp.array(dtype=wp.vec2i),
    row_count: wp.array(dtype=wp.int64),
    count: wp.array(dtype=wp.int64),
    scan: wp.array(dtype=wp.int64),
    keys: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.int32),
):
    """Large triangles: one queued row of tiles a thread. ``offset`` is where rows begin in count and scan."""
    k = wp.tid()
    number = wp.int64(0)
    if wp.int64(k) < row_count[0]:
        i = rows[k][0]
        box = boxes[i]
        face = triangles[i]
        s = lit_triangle(lights[index], frame[0], points[face[0]], points[face[1]], points[face[2]])
        place = scan[offset + k] - count[offset + k]
        number = bin_row(
            emit,
            i,
            s,
            spans[i],
            rows[k][1],
            box[0],
            box[2],
            tiles,
            slices,
            spans_all,
            extent,
            place,
            keys,
            values,
        )
    if emit == 0:
        count[offset + k] = number
