"""The light grid (paper, section 4.1): triangles in tiles of a light's rectangles and slices of distance.

Conservative throughout: the box of tiles holds the map's exact bounds of the triangle (:mod:`.light_map`); a tile
of the box is left out only if it certainly misses the triangle (:func:`~.light_tiles.missed`), or if no shadow ray
lies in it. An item is a triangle in one rectangle: item = triangle * faces + face.
"""

from __future__ import annotations

import functools

import warp as wp

from ..common.triangle import U64, largest, to_float64, total, weld_of
from .binning import INLINE_TILES, queue_rows
from .culling import faces_away
from .light_frame import EXTENT, distance_slice, tile_of
from .light_map import BOUNDS, WRAPS, face_frame
from .light_tiles import missed, slope_bounds
from .segment_tests import segment_planes, segment_vertices
from .sphere import ROUNDING, TWO_PI


@wp.struct
class LitTriangle:
    """Corners in the frame of a face, from the light; inward planes through the light and the edges.

    ``oriented``: whether inward is known; ``error`` bounds a plane's value for a unit direction known to ``pad``
    n, height: normal turned away from the light and its product with a corner: the distance along a unit d is
    height / (n . d); ``slope`` bounds the error of n . d, negative where the distance is not known well
    """

    a: wp.vec3d
    b: wp.vec3d
    c: wp.vec3d
    n0: wp.vec3d
    n1: wp.vec3d
    n2: wp.vec3d
    oriented: wp.bool
    error: wp.float64
    n: wp.vec3d
    height: wp.float64
    slope: wp.float64


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


@wp.func
def lit_triangle(
    light: wp.vec3f,
    axes: wp.mat33d,
    face: wp.int32,
    widening: wp.float64,
    pad: wp.float64,
    a32: wp.vec3f,
    b32: wp.vec3f,
    c32: wp.vec3f,
) -> LitTriangle:
    l64 = to_float64(light)
    a = face_frame(axes * (to_float64(a32) - l64), face)
    b = face_frame(axes * (to_float64(b32) - l64), face)
    c = face_frame(axes * (to_float64(c32) - l64), face)
    middle = (a + b + c) / wp.float64(3.0)
    a += (a - middle) * widening
    b += (b - middle) * widening
    c += (c - middle) * widening
    s = LitTriangle()
    s.a = a
    s.b = b
    s.c = c
    s.n0 = wp.cross(b, c - b)
    s.n1 = wp.cross(c, a - c)
    s.n2 = wp.cross(a, b - a)
    s.n = wp.cross(b - a, c - a)
    det = wp.dot(s.n, a)
    reach = wp.max(largest(a), wp.max(largest(b), largest(c)))
    edge = wp.max(largest(b - a), wp.max(largest(c - b), largest(a - c)))
    s.oriented = wp.abs(det) > wp.float64(8.0) * ROUNDING * edge * edge * reach
    if det < wp.float64(0.0):
        s.n0 = -s.n0
        s.n1 = -s.n1
        s.n2 = -s.n2
        s.n = -s.n
    s.height = wp.abs(det)
    s.slope = wp.float64(-1.0)
    if s.height > wp.float64(8.0e4) * ROUNDING * edge * edge * reach:
        s.slope = wp.float64(8.0) * ROUNDING * edge * edge + wp.float64(2.0) * pad * largest(s.n)
    steepest = wp.max(largest(s.n0), wp.max(largest(s.n1), largest(s.n2)))
    s.error = wp.float64(8.0) * ROUNDING * reach * edge + wp.float64(2.0) * pad * steepest
    return s


@wp.func
def covered(
    low: wp.float64, high: wp.float64, first: wp.float64, last: wp.float64, tiles: wp.int32, wrap: wp.int32
) -> wp.vec2i:
    """Tiles of first..last that low..high may touch, also one turn further where it wraps; (1, 0) for none."""
    result = wp.vec2i(1, 0)
    overlaps = wp.int32(0)
    turns = wp.int32(0)
    if wrap == 1:
        turns = 1
    for turn in range(-turns, turns + 1):
        shift = wp.float64(turn) * TWO_PI
        if high + shift >= first and low + shift <= last:
            overlaps += 1
            result = wp.vec2i(
                tile_of(low + shift, first, last, tiles), tile_of(high + shift, first, last, tiles)
            )
    if overlaps > 1:
        # Both ends of the rectangle: everything, and the planes through the edges sort out the middle.
        return wp.vec2i(0, tiles - 1)
    return result


@wp.func
def no_ray_in(
    box: wp.vec4i, slice: wp.int32, side: wp.int32, tiles: wp.int32, deepest: wp.array(dtype=wp.int32)
) -> wp.bool:
    """Whether no shadow ray in a small box of tiles reaches ``slice``; large boxes are not looked at."""
    if (box[2] - box[0] + 1) * (box[3] - box[1] + 1) > INLINE_TILES:
        return False
    for row in range(box[1], box[3] + 1):
        for column in range(box[0], box[2] + 1):
            if deepest[(side * tiles + row) * tiles + column] >= slice:
                return False
    return True


@functools.cache
def make_bound_kernel(map: int) -> wp.Kernel:
    """Bounds of triangles under one light map: compiled apart, as each takes many registers."""
    bounds_of = BOUNDS[map]
    wrap = WRAPS[map]

    @wp.kernel(enable_backward=False, module="unique")
    def bound_kernel(
        triangle_count: wp.int32,
        index: wp.int32,
        faces: wp.int32,
        tiles: wp.int32,
        slices: wp.int32,
        widening: wp.float64,
        pad: wp.float64,
        distance_pad: wp.float64,
        outward: wp.float64,
        test: wp.int32,
        skip_empty: wp.bool,
        deepest: wp.array(dtype=wp.int32),
        lights: wp.array(dtype=wp.vec3f),
        frame: wp.array(dtype=wp.mat33d),
        extent: wp.array(dtype=wp.float64),
        points: wp.array(dtype=wp.vec3f),
        triangles: wp.array(dtype=wp.vec3i),
        weld: wp.array(dtype=wp.int32),
        valid: wp.array(dtype=wp.uint8),
        boxes: wp.array(dtype=wp.vec4i),
        spans: wp.array(dtype=wp.vec2i),
        records: wp.array(dtype=wp.vec4f),
        rows: wp.array(dtype=wp.vec2i),
        row_count: wp.array(dtype=wp.int64),
    ):
        """Each item's box of tiles, span of slices and record; queue the rows of large ones.

        ``pad``: a ray's direction is known to this; ``distance_pad``: its distance, relative
        """
        item = wp.tid()
        boxes[item] = wp.vec4i(0, 0, -1, -1)
        i = item // faces
        side = item % faces
        offset = side * EXTENT
        if i >= triangle_count or not (extent[offset + 3] >= extent[offset]):
            return
        if valid[i] == wp.uint8(0):
            return
        face = triangles[i]
        light = lights[index]
        a32 = points[face[0]]
        b32 = points[face[1]]
        c32 = points[face[2]]
        if holds_light(light, a32, b32, c32) or faces_away(outward, light, a32, b32, c32):
            return
        s = lit_triangle(light, frame[0], side, widening, pad, a32, b32, c32)
        # Nearest point: no nearer than the plane, nor than the nearest vertex less the longest edge.
        normal = wp.cross(s.b - s.a, s.c - s.a)
        size = wp.length(normal)
        la = wp.length(s.a)
        lb = wp.length(s.b)
        lc = wp.length(s.c)
        longest = wp.max(wp.length(s.b - s.a), wp.max(wp.length(s.c - s.b), wp.length(s.a - s.c)))
        near = wp.max(wp.float64(0.0), wp.min(la, wp.min(lb, lc)) - longest)
        if size > wp.float64(1.0e-9) * longest * longest:
            plane = wp.abs(wp.dot(normal, s.a)) / size
            near = wp.max(near, plane - wp.float64(1.0e-5) * longest)
        near = near * (wp.float64(1.0) - distance_pad)
        if near > extent[offset + 5]:
            return
        bounds = bounds_of(s.a, s.b, s.c, pad)
        if not (bounds[1] >= bounds[0]):
            return
        x = covered(bounds[0], bounds[1], extent[offset], extent[offset + 3], tiles, wp.static(wrap[0]))
        y = covered(bounds[2], bounds[3], extent[offset + 1], extent[offset + 4], tiles, wp.static(wrap[1]))
        if x[1] < x[0] or y[1] < y[0]:
            return
        box = wp.vec4i(x[0], y[0], x[1], y[1])
        first = distance_slice(near, extent, side, slices)
        if skip_empty and no_ray_in(box, first, side, tiles, deepest):
            return
        boxes[item] = box
        far = wp.max(la, wp.max(lb, lc)) * (wp.float64(1.0) + distance_pad)
        spans[item] = wp.vec2i(first, distance_slice(far, extent, side, slices))
        if (box[2] - box[0] + 1) * (box[3] - box[1] + 1) > INLINE_TILES:
            queue_rows(item, box, rows, row_count)
        r = segment_planes(light, a32, b32, c32, weld_of(weld, face))
        if test == 2:  # Moeller-Trumbore
            r = segment_vertices(light, a32, b32, c32, weld_of(weld, face))
        records[6 * i] = r.q0
        records[6 * i + 1] = r.q1
        records[6 * i + 2] = r.q2
        records[6 * i + 3] = r.q3
        records[6 * i + 4] = r.q4
        records[6 * i + 5] = r.q5

    return bound_kernel


@wp.func
def slices_in_tile(
    s: LitTriangle,
    span: wp.vec2i,
    column: wp.vec4d,
    row: wp.vec4d,
    stretch: wp.vec2d,
    extent: wp.array(dtype=wp.float64),
    side: wp.int32,
    slices: wp.int32,
) -> wp.vec2i:
    """The slices of ``span`` that the triangle may lie in within one tile, from its plane."""
    if s.slope < wp.float64(0.0) or span[0] == span[1]:
        return span
    slope = slope_bounds(column, row, s.n, stretch)
    first = span[0]
    last = span[1]
    if slope[2] > wp.float64(0.0):
        near = wp.float64(0.999) * s.height / (slope[1] + slope[2] * s.slope)
        if slope[1] > wp.float64(0.0):
            first = wp.max(first, wp.min(last, distance_slice(near, extent, side, slices)))
        if slope[0] > wp.float64(2.0) * slope[2] * s.slope:
            far = wp.float64(1.001) * s.height * slope[2] / (slope[0] - slope[2] * s.slope)
            last = wp.max(first, wp.min(last, distance_slice(far, extent, side, slices)))
    return wp.vec2i(first, last)


@wp.func
def bin_row(
    emit: wp.int32,
    item: wp.int32,
    s: LitTriangle,
    span: wp.vec2i,
    row: wp.int32,
    box: wp.vec4i,
    faces: wp.int32,
    tiles: wp.int32,
    slices: wp.int32,
    spans_all: wp.bool,
    skip_empty: wp.bool,
    extent: wp.array(dtype=wp.float64),
    columns: wp.array(dtype=wp.vec4d),
    rows: wp.array(dtype=wp.vec4d),
    stretch: wp.array(dtype=wp.vec2d),
    deepest: wp.array(dtype=wp.int32),
    masks: wp.array(dtype=wp.int32),
    inline: wp.bool,
    place: wp.int64,
    keys: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.int32),
) -> wp.int64:
    """Count (or write from ``place``) the cells of an item in one row of its box.

    The tiles of an ``inline`` item are remembered in its mask, so that they are tested only once.
    """
    capacity = wp.int64(keys.shape[0] // 2)
    side = item % faces
    test = s.oriented and (box[2] > box[0] or box[3] > box[1])
    edges = rows[side * tiles + row]
    number = wp.int64(0)
    for column in range(box[0], box[2] + 1):
        tile = (side * tiles + row) * tiles + column
        bit = (row - box[1]) * (box[2] - box[0] + 1) + column - box[0]
        out = wp.bool(False)
        if emit != 0 and inline:
            out = (masks[item] >> bit) & 1 == 0
        else:
            out = skip_empty and deepest[tile] < span[0]
            if test and not out:
                out = missed(columns[side * tiles + column], edges, stretch[side], s.n0, s.n1, s.n2, s.error)
            if inline and not out:
                masks[item] = masks[item] | (1 << bit)
        if not out:
            here = slices_in_tile(
                s, span, columns[side * tiles + column], edges, stretch[side], extent, side, slices
            )
            last = here[0]
            if spans_all:
                last = here[1]
            if skip_empty:
                last = wp.min(last, deepest[tile])
            if emit != 0:
                for slice in range(here[0], last + 1):
                    at = place + number + wp.int64(slice - here[0])
                    if at < capacity:
                        keys[wp.int32(at)] = tile * slices + slice
                        values[wp.int32(at)] = item // faces
            number += wp.int64(wp.max(0, last - here[0] + 1))
    return number


@wp.kernel(enable_backward=False)
def bin_triangles_kernel(
    emit: wp.int32,
    index: wp.int32,
    faces: wp.int32,
    tiles: wp.int32,
    slices: wp.int32,
    spans_all: wp.bool,
    skip_empty: wp.bool,
    widening: wp.float64,
    pad: wp.float64,
    lights: wp.array(dtype=wp.vec3f),
    frame: wp.array(dtype=wp.mat33d),
    extent: wp.array(dtype=wp.float64),
    columns: wp.array(dtype=wp.vec4d),
    rows_of_tiles: wp.array(dtype=wp.vec4d),
    stretch: wp.array(dtype=wp.vec2d),
    deepest: wp.array(dtype=wp.int32),
    masks: wp.array(dtype=wp.int32),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    boxes: wp.array(dtype=wp.vec4i),
    spans: wp.array(dtype=wp.vec2i),
    count: wp.array(dtype=wp.int64),
    scan: wp.array(dtype=wp.int64),
    keys: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.int32),
):
    """Small items: all their tiles."""
    item = wp.tid()
    box = boxes[item]
    number = wp.int64(0)
    if box[2] >= box[0] and (box[2] - box[0] + 1) * (box[3] - box[1] + 1) <= INLINE_TILES:
        if emit == 0:
            masks[item] = 0
        if emit == 0 or count[item] > wp.int64(0):
            span = spans[item]
            s = LitTriangle()
            s.slope = wp.float64(-1.0)
            # One tile needs no test, and tiles remembered need none again; slices still do.
            single = box[2] == box[0] and box[3] == box[1]
            if span[0] < span[1] or (emit == 0 and not single):
                face = triangles[item // faces]
                s = lit_triangle(
                    lights[index], frame[0], item % faces, widening, pad, points[face[0]], points[face[1]],
                    points[face[2]],
                )  # fmt: skip
            place = scan[item] - count[item]
            for row in range(box[1], box[3] + 1):
                number += bin_row(
                    emit, item, s, span, row, box, faces, tiles, slices, spans_all, skip_empty, extent, columns,
                    rows_of_tiles, stretch, deepest, masks, True, place + number, keys, values,
                )  # fmt: skip
    if emit == 0:
        count[item] = number


@wp.kernel(enable_backward=False)
def bin_rows_kernel(
    emit: wp.int32,
    offset: wp.int32,
    index: wp.int32,
    faces: wp.int32,
    tiles: wp.int32,
    slices: wp.int32,
    spans_all: wp.bool,
    skip_empty: wp.bool,
    widening: wp.float64,
    pad: wp.float64,
    lights: wp.array(dtype=wp.vec3f),
    frame: wp.array(dtype=wp.mat33d),
    extent: wp.array(dtype=wp.float64),
    columns: wp.array(dtype=wp.vec4d),
    rows_of_tiles: wp.array(dtype=wp.vec4d),
    stretch: wp.array(dtype=wp.vec2d),
    deepest: wp.array(dtype=wp.int32),
    masks: wp.array(dtype=wp.int32),
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
    """Large items: one queued row of tiles a thread. ``offset`` is where rows begin in count and scan."""
    k = wp.tid()
    number = wp.int64(0)
    if wp.int64(k) < row_count[0] and (emit == 0 or count[offset + k] > wp.int64(0)):
        item = rows[k][0]
        face = triangles[item // faces]
        s = lit_triangle(
            lights[index], frame[0], item % faces, widening, pad, points[face[0]], points[face[1]],
            points[face[2]],
        )  # fmt: skip
        place = scan[offset + k] - count[offset + k]
        number = bin_row(
            emit, item, s, spans[item], rows[k][1], boxes[item], faces, tiles, slices, spans_all, skip_empty,
            extent, columns, rows_of_tiles, stretch, deepest, masks, False, place, keys, values,
        )  # fmt: skip
    if emit == 0:
        count[offset + k] = number
