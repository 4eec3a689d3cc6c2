"""Shadow rays: triangles streamed over the rays in the cells of the light's cube.

The planes through the light and each edge are made in float64, scaled, and stored as n . p + c in float32 with a
bound on their error over the whole scene; what they cannot decide goes to ``occludes`` in float64. A set bit stays
set, so the order in which triangles arrive does not matter.
"""

from __future__ import annotations

import warp as wp

from ..common.hitpoint import plane_distance
from ..common.triangle import U32, U64, hit_point, largest, occludes, to_float64, total, weld_of
from .light_bins import CELLS, EMPTY, FACES, cell_along, cell_index, face_rectangle, on_face
from .queue import ITEMS, STRIPS, reserve

FEW_BLOCKS = wp.constant(32)
ROUNDING = wp.constant(wp.float64(1.0e-14))


@wp.struct
class Occluder:
    """Inward planes through the light and the edges, and the triangle's plane, positive on the light's side.

    Each is (n, c) with |n|_max = 1: signs of n . p + c beyond ``bound`` are certain for every hit point p.
    """

    e0: wp.vec4f
    e1: wp.vec4f
    e2: wp.vec4f
    plane: wp.vec4f
    bound: wp.float32


@wp.struct
class Setup:
    """A triangle seen from the light, float64, in the axes of the cube: corners and inward edge normals."""

    a: wp.vec3d
    b: wp.vec3d
    c: wp.vec3d
    n0: wp.vec3d
    n1: wp.vec3d
    n2: wp.vec3d
    error: wp.float64
    oriented: wp.bool


@wp.func
def setup_of(light: wp.vec3f, axes: wp.mat33d, a: wp.vec3f, b: wp.vec3f, c: wp.vec3f) -> Setup:
    l64 = to_float64(light)
    s = Setup()
    s.a = axes * (to_float64(a) - l64)
    s.b = axes * (to_float64(b) - l64)
    s.c = axes * (to_float64(c) - l64)
    ab = s.b - s.a
    bc = s.c - s.b
    ca = s.a - s.c
    det = wp.dot(wp.cross(ab, -ca), s.a)
    reach = wp.max(largest(s.a), wp.max(largest(s.b), largest(s.c)))
    edge = wp.max(largest(ab), wp.max(largest(bc), largest(ca)))
    s.n0 = wp.cross(s.b, bc)
    s.n1 = wp.cross(s.c, ca)
    s.n2 = wp.cross(s.a, ab)
    s.oriented = wp.abs(det) > wp.float64(8.0) * ROUNDING * edge * edge * reach
    if det < wp.float64(0.0):
        s.n0 = -s.n0
        s.n1 = -s.n1
        s.n2 = -s.n2
    s.error = wp.float64(8.0) * ROUNDING * reach * edge
    return s


@wp.func
def scaled_plane(n: wp.vec3d, p: wp.vec3d) -> wp.vec4f:
    """n . (x - p) scaled to |n|_max = 1, rounded once to float32; zero where n is."""
    size = largest(n)
    if not (size > wp.float64(0.0)):
        return wp.vec4f(0.0, 0.0, 0.0, 0.0)
    m = n / size
    return wp.vec4f(
        wp.float32(m[0]), wp.float32(m[1]), wp.float32(m[2]), wp.float32(-wp.dot(m, p))
    )


@wp.func
def occluder_of(light: wp.vec3f, a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, size: wp.float32) -> Occluder:
    """``size`` bounds every coordinate of the hit points."""
    l64 = to_float64(light)
    a64 = to_float64(a)
    b64 = to_float64(b)
    c64 = to_float64(c)
    la = a64 - l64
    n = wp.cross(b64 - a64, c64 - a64)
    det = wp.dot(n, la)
    n0 = wp.cross(b64 - l64, c64 - b64)
    n1 = wp.cross(c64 - l64, a64 - c64)
    n2 = wp.cross(la, b64 - a64)
    if det < wp.float64(0.0):
        n0 = -n0
        n1 = -n1
        n2 = -n2
    else:
        n = -n
    o = Occluder()
    o.e0 = scaled_plane(n0, b64)
    o.e1 = scaled_plane(n1, c64)
    o.e2 = scaled_plane(n2, a64)
    o.plane = scaled_plane(n, a64)
    # n, c and the hit point are rounded once each, products and sums seven times more; the float64 part is lost in it.
    far = wp.max(wp.abs(o.e0[3]), wp.max(wp.abs(o.e1[3]), wp.max(wp.abs(o.e2[3]), wp.abs(o.plane[3]))))
    o.bound = 12.0 * U32 * (3.0 * size + far) + 1.0e-36
    return o


@wp.func
def value_at(plane: wp.vec4f, h: wp.vec4f) -> wp.float32:
    return plane[0] * h[0] + plane[1] * h[1] + plane[2] * h[2] + plane[3]


@wp.func
def shade(
    i: wp.int32,
    at: wp.int32,
    index: wp.int32,
    width: wp.int32,
    occluder: Occluder,
    lights: wp.array(dtype=wp.vec3f),
    eye: wp.array(dtype=wp.vec3f),
    column: wp.array(dtype=wp.vec3f),
    row: wp.array(dtype=wp.vec3f),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    weld: wp.array(dtype=wp.int32),
    rays: wp.array(dtype=wp.vec4f),
    pixels: wp.array(dtype=wp.int32),
    visibility: wp.array2d(dtype=wp.uint8),
):
    """Test the ray at place ``at`` against the triangle and set its bit."""
    h = rays[at]
    low = wp.min(value_at(occluder.e0, h), wp.min(value_at(occluder.e1, h), value_at(occluder.e2, h)))
    if low < -occluder.bound:
        return
    side = value_at(occluder.plane, h)
    own = wp.cast(h[3], wp.int32)
    if side > occluder.bound or own == i:
        return
    pixel = pixels[at]
    if low > occluder.bound and side < -occluder.bound:
        visibility[index, pixel] = wp.uint8(1)
        return
    if visibility[index, pixel] != wp.uint8(0):
        return
    mine = triangles[own]
    o = eye[0]
    d = column[pixel % width] + row[pixel // width]
    hit = hit_point(o, d, plane_distance(o, d, points[mine[0]], points[mine[1]], points[mine[2]]))
    face = triangles[i]
    if occludes(
        hit, lights[index], points[face[0]], points[face[1]], points[face[2]], weld_of(weld, face),
        wp.float64(largest(o)),
    ):  # fmt: skip
        visibility[index, pixel] = wp.uint8(1)


@wp.func
def holds_light(light: wp.vec3f, a: wp.vec3f, b: wp.vec3f, c: wp.vec3f) -> wp.bool:
    """Whether the light lies on the triangle's plane within rounding: then ``occludes`` is always False."""
    a64 = to_float64(a)
    ab = to_float64(b) - a64
    ac = to_float64(c) - a64
    la = to_float64(light) - a64
    return wp.abs(wp.dot(wp.cross(ab, ac), la)) <= U64 * largest(ab) * largest(ac) * wp.float64(16.0) * total(la)


@wp.func
def cell_box(s: Setup, face: wp.int32, rectangle: wp.array(dtype=wp.int32), cells: wp.int32) -> wp.vec4i:
    """Cells of a face that the triangle's box covers (first and last column and row); empty if last < first."""
    empty = wp.vec4i(0, 0, -1, -1)
    a = on_face(s.a, face)
    b = on_face(s.b, face)
    c = on_face(s.c, face)
    reach = wp.max(largest(a), wp.max(largest(b), largest(c)))
    slack = ROUNDING * reach
    zero = wp.float64(0.0)
    if a[0] <= zero and b[0] <= zero and c[0] <= zero:
        return empty
    # Wholly beyond one of the face's four sides.
    for axis in range(1, 3):
        if (a[axis] > a[0] + slack and b[axis] > b[0] + slack and c[axis] > c[0] + slack) or (
            -a[axis] > a[0] + slack and -b[axis] > b[0] + slack and -c[axis] > c[0] + slack
        ):
            return empty
    if not (a[0] > wp.float64(1.0e-6) * reach and b[0] > wp.float64(1.0e-6) * reach and c[0] > wp.float64(1.0e-6) * reach):
        return wp.vec4i(0, 0, cells - 1, cells - 1)
    r = face_rectangle(face, rectangle, cells)
    au = a[1] / a[0]
    bu = b[1] / b[0]
    cu = c[1] / c[0]
    av = a[2] / a[0]
    bv = b[2] / b[0]
    cv = c[2] / c[0]
    least_u = wp.min(au, wp.min(bu, cu))
    most_u = wp.max(au, wp.max(bu, cu))
    least_v = wp.min(av, wp.min(bv, cv))
    most_v = wp.max(av, wp.max(bv, cv))
    # Coordinates are known to ROUNDING of the corner's size over its distance along the face.
    pad = wp.float64(8.0) * slack / wp.min(a[0], wp.min(b[0], c[0]))
    n = wp.float64(cells)
    if (
        (most_u + pad - r[0]) * r[2] < zero
        or (least_u - pad - r[0]) * r[2] > n
        or (most_v + pad - r[1]) * r[3] < zero
        or (least_v - pad - r[1]) * r[3] > n
    ):
        return empty
    return wp.vec4i(
        cell_along(least_u - pad, r[0], r[2], cells),
        cell_along(least_v - pad, r[1], r[3], cells),
        cell_along(most_u + pad, r[0], r[2], cells),
        cell_along(most_v + pad, r[1], r[3], cells),
    )


@wp.func
def highest(n: wp.vec3d, u0: wp.float64, u1: wp.float64, v0: wp.float64, v1: wp.float64) -> wp.float64:
    return n[0] + wp.max(n[1] * u0, n[1] * u1) + wp.max(n[2] * v0, n[2] * v1)


@wp.func
def cells_missed(
    s: Setup, face: wp.int32, r: wp.vec4d, x0: wp.int32, y0: wp.int32, x1: wp.int32, y1: wp.int32
) -> wp.bool:
    """Whether the rectangle of cells certainly misses the triangle; a hundredth of a cell is added all around."""
    hair = wp.float64(0.01)
    u0 = r[0] + (wp.float64(x0) - hair) / r[2]
    u1 = r[0] + (wp.float64(x1 + 1) + hair) / r[2]
    v0 = r[1] + (wp.float64(y0) - hair) / r[3]
    v1 = r[1] + (wp.float64(y1 + 1) + hair) / r[3]
    limit = -wp.float64(4.0) * s.error
    return s.oriented and (
        highest(on_face(s.n0, face), u0, u1, v0, v1) < limit
        or highest(on_face(s.n1, face), u0, u1, v0, v1) < limit
        or highest(on_face(s.n2, face), u0, u1, v0, v1) < limit
    )


@wp.func
def rays_in_row(
    offset: wp.array(dtype=wp.int32), face: wp.int32, x0: wp.int32, x1: wp.int32, y: wp.int32, cells: wp.int32
) -> wp.vec2i:
    """First ray and end of cells x0..x1 of a row, which must lie in one block."""
    return wp.vec2i(offset[cell_index(face, x0, y, cells)], offset[cell_index(face, x1, y, cells) + 1])


@wp.kernel(enable_backward=False, grid_stride=False)
def stream_kernel(
    triangle_count: wp.int32,
    index: wp.int32,
    cells: wp.int32,
    inline_cells: wp.int32,
    inline_rays: wp.int32,
    width: wp.int32,
    queued: wp.bool,
    lights: wp.array(dtype=wp.vec3f),
    frame: wp.array(dtype=wp.mat33d),
    rectangle: wp.array(dtype=wp.int32),
    size: wp.array(dtype=wp.float32),
    eye: wp.array(dtype=wp.vec3f),
    column: wp.array(dtype=wp.vec3f),
    row: wp.array(dtype=wp.vec3f),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    valid: wp.array(dtype=wp.uint8),
    weld: wp.array(dtype=wp.int32),
    offset: wp.array(dtype=wp.int32),
    rays: wp.array(dtype=wp.vec4f),
    pixels: wp.array(dtype=wp.int32),
    visibility: wp.array2d(dtype=wp.uint8),
    counts: wp.array(dtype=wp.int32),
    records: wp.array2d(dtype=wp.vec4f),
    strips: wp.array(dtype=wp.vec4i),
    items: wp.array(dtype=wp.vec4i),
):
    """One thread a triangle: few rays are tested here, more are queued by blocks of cells or by strips of blocks."""
    i = wp.tid()
    if i >= triangle_count or valid[i] == wp.uint8(0):
        return
    corners = triangles[i]
    a = points[corners[0]]
    b = points[corners[1]]
    c = points[corners[2]]
    light = lights[index]
    if holds_light(light, a, b, c):
        return
    s = setup_of(light, frame[0], a, b, c)
    occluder = Occluder()
    made = wp.bool(False)
    face = wp.int32(-1)
    while face < FACES - 1:
        face += 1
        if rectangle[4 + face] == 0:
            box = cell_box(s, face, rectangle, cells)
            if box[2] >= box[0] and box[3] >= box[1]:
                r = face_rectangle(face, rectangle, cells)
                bx0 = box[0] // CELLS
                by0 = box[1] // CELLS
                bx1 = box[2] // CELLS
                by1 = box[3] // CELLS
                covered = (box[2] - box[0] + 1) * (box[3] - box[1] + 1)
                number = wp.int32(EMPTY)
                if covered <= inline_cells:
                    number = wp.int32(0)
                    for y in range(box[1], box[3] + 1):
                        for bx in range(bx0, bx1 + 1):
                            x0 = wp.max(box[0], bx * CELLS)
                            x1 = wp.min(box[2], bx * CELLS + CELLS - 1)
                            span = rays_in_row(offset, face, x0, x1, y, cells)
                            number += span[1] - span[0]
                if number > 0:
                    if not made:
                        occluder = occluder_of(light, a, b, c, size[0])
                        made = True
                        if queued:
                            records[i, 0] = occluder.e0
                            records[i, 1] = occluder.e1
                            records[i, 2] = occluder.e2
                            records[i, 3] = occluder.plane
                            records[i, 4] = wp.vec4f(occluder.bound, 0.0, 0.0, 0.0)
                    if number <= inline_rays:
                        for y in range(box[1], box[3] + 1):
                            for bx in range(bx0, bx1 + 1):
                                x0 = wp.max(box[0], bx * CELLS)
                                x1 = wp.min(box[2], bx * CELLS + CELLS - 1)
                                span = rays_in_row(offset, face, x0, x1, y, cells)
                                for at in range(span[0], span[1]):
                                    shade(
                                        i, at, index, width, occluder, lights, eye, column, row, points, triangles,
                                        weld, rays, pixels, visibility,
                                    )  # fmt: skip
                    elif not queued:
                        for by in range(by0, by1 + 1):
                            for bx in range(bx0, bx1 + 1):
                                x = bx * CELLS
                                y = by * CELLS
                                first = offset[cell_index(face, x, y, cells)]
                                stop = offset[cell_index(face, x + CELLS - 1, y + CELLS - 1, cells) + 1]
                                if stop > first:
                                    if not cells_missed(s, face, r, x, y, x + CELLS - 1, y + CELLS - 1):
                                        for at in range(first, stop):
                                            shade(
                                                i, at, index, width, occluder, lights, eye, column, row, points,
                                                triangles, weld, rays, pixels, visibility,
                                            )  # fmt: skip
                    elif (bx1 - bx0 + 1) * (by1 - by0 + 1) > FEW_BLOCKS:
                        place = reserve(counts, STRIPS, by1 - by0 + 1)
                        for by in range(by0, by1 + 1):
                            if place < strips.shape[0]:
                                strips[place] = wp.vec4i(i, face, by, bx0 | (bx1 << 16))
                            place += 1
                    else:
                        for by in range(by0, by1 + 1):
                            for bx in range(bx0, bx1 + 1):
                                queue_block(i, s, face, r, bx, by, cells, offset, counts, items)


@wp.func
def queue_block(
    i: wp.int32,
    s: Setup,
    face: wp.int32,
    r: wp.vec4d,
    bx: wp.int32,
    by: wp.int32,
    cells: wp.int32,
    offset: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
    items: wp.array(dtype=wp.vec4i),
):
    """Queue the rays of a block, 64 an item, unless it is empty or certainly missed."""
    x = bx * CELLS
    y = by * CELLS
    first = offset[cell_index(face, x, y, cells)]
    stop = offset[cell_index(face, x + CELLS - 1, y + CELLS - 1, cells) + 1]
    if stop > first:
        if not cells_missed(s, face, r, x, y, x + CELLS - 1, y + CELLS - 1):
            number = (stop - first + 63) // 64
            place = reserve(counts, ITEMS, number)
            for k in range(number):
                if place + k < items.shape[0]:
                    items[place + k] = wp.vec4i(i, first + 64 * k, stop, 0)


@wp.kernel(enable_backward=False, grid_stride=False)
def strip_kernel(
    threads: wp.int32,
    index: wp.int32,
    cells: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    frame: wp.array(dtype=wp.mat33d),
    rectangle: wp.array(dtype=wp.int32),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    offset: wp.array(dtype=wp.int32),
    strips: wp.array(dtype=wp.vec4i),
    counts: wp.array(dtype=wp.int32),
    items: wp.array(dtype=wp.vec4i),
):
    """Huge triangles: eight threads a row of blocks, each takes every eighth block."""
    k = wp.tid()
    stop = wp.min(counts[STRIPS], strips.shape[0]) * 8
    while k < stop:
        strip = strips[k // 8]
        i = strip[0]
        corners = triangles[i]
        s = setup_of(lights[index], frame[0], points[corners[0]], points[corners[1]], points[corners[2]])
        r = face_rectangle(strip[1], rectangle, cells)
        bx = (strip[3] & 65535) + k % 8
        while bx <= strip[3] >> 16:
            queue_block(i, s, strip[1], r, bx, strip[2], cells, offset, counts, items)
            bx += 8
        k += threads


@wp.kernel(enable_backward=False, grid_stride=False)
def item_kernel(
    threads: wp.int32,
    index: wp.int32,
    width: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    eye: wp.array(dtype=wp.vec3f),
    column: wp.array(dtype=wp.vec3f),
    row: wp.array(dtype=wp.vec3f),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    weld: wp.array(dtype=wp.int32),
    records: wp.array2d(dtype=wp.vec4f),
    counts: wp.array(dtype=wp.int32),
    items: wp.array(dtype=wp.vec4i),
    rays: wp.array(dtype=wp.vec4f),
    pixels: wp.array(dtype=wp.int32),
    visibility: wp.array2d(dtype=wp.uint8),
):
    """Queued items: 64 threads each, one a ray."""
    k = wp.tid()
    stop = wp.min(counts[ITEMS], items.shape[0])
    item = k // 64
    while item < stop:
        work = items[item]
        at = work[1] + k % 64
        if at < work[2]:
            i = work[0]
            occluder = Occluder()
            occluder.e0 = records[i, 0]
            occluder.e1 = records[i, 1]
            occluder.e2 = records[i, 2]
            occluder.plane = records[i, 3]
            occluder.bound = records[i, 4][0]
            shade(
                i, at, index, width, occluder, lights, eye, column, row, points, triangles, weld, rays, pixels,
                visibility,
            )  # fmt: skip
        item += threads // 64
