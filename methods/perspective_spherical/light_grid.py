"""The light grid (paper, section 4.1): triangles in tiles of a light's rectangles and slices of distance.

A tile of a triangle's box (:mod:`.light_bounds`) is left out only if it certainly misses the triangle
(:func:`~.light_tiles.missed`), or if no shadow ray lies in it.
"""

from __future__ import annotations

import warp as wp

from .binning import INLINE_TILES
from .light_bounds import LitTriangle, lit_triangle
from .light_frame import distance_slice
from .light_tiles import missed, slope_bounds


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
    pads: wp.array(dtype=wp.float64),
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
                    lights[index], frame[0], item % faces, widening, pads[0], points[face[0]], points[face[1]],
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
    pads: wp.array(dtype=wp.float64),
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
            lights[index], frame[0], item % faces, widening, pads[0], points[face[0]], points[face[1]],
            points[face[2]],
        )  # fmt: skip
        place = scan[offset + k] - count[offset + k]
        number = bin_row(
            emit, item, s, spans[item], rows[k][1], boxes[item], faces, tiles, slices, spans_all, skip_empty,
            extent, columns, rows_of_tiles, stretch, deepest, masks, False, place, keys, values,
        )  # fmt: skip
    if emit == 0:
        count[offset + k] = number
