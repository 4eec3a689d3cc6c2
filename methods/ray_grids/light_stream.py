"""Shadow rays: triangles streamed over the rays in the cells of the light's cube.

The planes through the light and each edge are stored as n . p + c in float32 with a bound on their error over the
whole scene; what they cannot decide goes to ``occludes`` in float64. A set bit stays set, so the order in which
triangles arrive does not matter. Which cells a triangle covers is reckoned relative to the scene's middle in
float32, with a pad that covers its rounding; rays are placed in float64.
"""

from __future__ import annotations

import warp as wp

from ..common.triangle import U32, largest, occludes, to_float64, total, weld_of
from .light_bins import CELLS, EMPTY, FACES, Cube, cell_index, face_rectangle, on_face
from .queue import DOUBTS, ITEMS, STRIPS, reserve
from .spans import Flat, row_span

FEW_BLOCKS = wp.constant(4)
FEW_RAYS = wp.constant(96)
"""A block with more rays than this is queued by its cell rows, cut to the triangle."""


@wp.struct
class Occluder:
    """Inward planes through the light and the edges, and the triangle's plane, positive on the light's side.

    Each is (n, c): signs of n . p + c beyond ``bound`` are certain for every hit point p of the scene.
    """

    e0: wp.vec4f
    e1: wp.vec4f
    e2: wp.vec4f
    plane: wp.vec4f
    bound: wp.float32


@wp.func
def occluder_of(light: wp.vec3f, a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, size: wp.float32) -> Occluder:
    """Planes in float32. ``size`` bounds every coordinate of the hit points and of the triangle.

    n = (p - light) x (q - p), scaled so that its parts are at most 2, is known to 8 u a part; over |h - p|_1 <= 6
    size that is 48 u size, and n . h + c rounds by 78 u size more. A triangle that the light sees edge-on within
    rounding gets an infinite bound: float64 decides all its candidates.
    """
    la = a - light
    lb = b - light
    lc = c - light
    ab = b - a
    bc = c - b
    ca = a - c
    reach = wp.max(largest(la), wp.max(largest(lb), largest(lc)))
    edge = wp.max(largest(ab), wp.max(largest(bc), largest(ca)))
    o = Occluder()
    if not (reach * edge > 1.0e-30 and reach * edge < 1.0e30 and edge * edge > 1.0e-30):
        o.bound = wp.INF
        return o
    n = wp.cross(ca, ab) / (edge * edge)
    det = wp.dot(n, la)
    toward = 1.0 / (reach * edge)
    # Inside is positive, and so is the light's side of the triangle.
    if det > 0.0:
        n = -n
    else:
        toward = -toward
    n0 = wp.cross(lb, bc) * toward
    n1 = wp.cross(lc, ca) * toward
    n2 = wp.cross(la, ab) * toward
    o.e0 = wp.vec4f(n0[0], n0[1], n0[2], -wp.dot(n0, b))
    o.e1 = wp.vec4f(n1[0], n1[1], n1[2], -wp.dot(n1, c))
    o.e2 = wp.vec4f(n2[0], n2[1], n2[2], -wp.dot(n2, a))
    o.plane = wp.vec4f(n[0], n[1], n[2], -wp.dot(n, a))
    o.bound = 128.0 * U32 * size + 1.0e-36
    if not (wp.abs(det) > 64.0 * U32 * reach):
        o.bound = wp.INF
    return o


@wp.func
def value_at(plane: wp.vec4f, h: wp.vec4f) -> wp.float32:
    return plane[0] * h[0] + plane[1] * h[1] + plane[2] * h[2] + plane[3]


@wp.func
def shade(
    i: wp.int32,
    at: wp.int32,
    index: wp.int32,
    occluder: Occluder,
    rays: wp.array(dtype=wp.vec4f),
    pixels: wp.array(dtype=wp.int32),
    visibility: wp.array2d(dtype=wp.uint8),
    counts: wp.array(dtype=wp.int32),
    doubts: wp.array(dtype=wp.vec2i),
):
    """Test the ray at place ``at`` against the triangle: set its bit, or leave the pair to float64.

    Few pairs are doubtful, but nearly every warp meets one; deciding them on the spot would hold up all its lanes.
    """
    h = rays[at]
    low = wp.min(value_at(occluder.e0, h), wp.min(value_at(occluder.e1, h), value_at(occluder.e2, h)))
    if low < -occluder.bound:
        return
    side = value_at(occluder.plane, h)
    if side > occluder.bound or wp.cast(h[3], wp.int32) == i:
        return
    pixel = pixels[at]
    if low > occluder.bound and side < -occluder.bound:
        visibility[index, pixel] = wp.uint8(1)
    elif visibility[index, pixel] == wp.uint8(0):
        place = reserve(counts, DOUBTS, 1)
        if place < doubts.shape[0]:
            doubts[place] = wp.vec2i(i, pixel)


@wp.kernel(enable_backward=False, grid_stride=False)
def doubt_kernel(
    threads: wp.int32,
    index: wp.int32,
    width: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    eye: wp.array(dtype=wp.vec3f),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    weld: wp.array(dtype=wp.int32),
    hit: wp.array(dtype=wp.vec3d),
    counts: wp.array(dtype=wp.int32),
    doubts: wp.array(dtype=wp.vec2i),
    visibility: wp.array2d(dtype=wp.uint8),
):
    """Pairs that float32 could not decide."""
    k = wp.tid()
    stop = wp.min(counts[DOUBTS], doubts.shape[0])
    origin_size = wp.float64(largest(eye[0]))
    while k < stop:
        pair = doubts[k]
        k += threads
        if visibility[index, pair[1]] == wp.uint8(0):
            face = triangles[pair[0]]
            if occludes(
                hit[pair[1]], lights[index], points[face[0]], points[face[1]], points[face[2]], weld_of(weld, face),
                origin_size,
            ):  # fmt: skip
                visibility[index, pair[1]] = wp.uint8(1)


@wp.func
def cube_space(p: wp.vec3f, cube: Cube) -> wp.vec3f:
    v = p - cube.middle
    return wp.vec3f(wp.dot(cube.forward, v) + cube.distance, wp.dot(cube.right, v), wp.dot(cube.up, v))


@wp.func
def on_cells(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, reach: wp.float32, r: wp.vec4d) -> Flat:
    """Cell coordinates of the corners on a face (corners given as along, across, up).

    ``reach`` bounds |p - middle|_1 of the corners: across and up are known to 8 u of it, so u = across / along to
    (1 + |u|) 16 u reach / along, and the rounding of u itself; a thousandth of a cell covers the scaling.
    """
    flat = Flat()
    nearest = wp.min(a[0], wp.min(b[0], c[0]))
    flat.known = nearest > 0.01 * wp.max(largest(a), wp.max(largest(b), largest(c)))
    if flat.known:
        low_u = wp.float32(r[0])
        low_v = wp.float32(r[1])
        per_u = wp.float32(r[2])
        per_v = wp.float32(r[3])
        ua = wp.vec2f(a[1] / a[0], a[2] / a[0])
        ub = wp.vec2f(b[1] / b[0], b[2] / b[0])
        uc = wp.vec2f(c[1] / c[0], c[2] / c[0])
        widest = wp.max(
            wp.max(wp.max(wp.abs(ua[0]), wp.abs(ua[1])), wp.max(wp.abs(ub[0]), wp.abs(ub[1]))),
            wp.max(wp.max(wp.abs(uc[0]), wp.abs(uc[1])), wp.max(wp.abs(low_u), wp.abs(low_v))),
        )
        flat.a = wp.vec2f((ua[0] - low_u) * per_u, (ua[1] - low_v) * per_v)
        flat.b = wp.vec2f((ub[0] - low_u) * per_u, (ub[1] - low_v) * per_v)
        flat.c = wp.vec2f((uc[0] - low_u) * per_u, (uc[1] - low_v) * per_v)
        flat.pad = 32.0 * U32 * ((1.0 + widest) * reach / nearest + widest) * wp.max(per_u, per_v) + 1.0e-3
    return flat


@wp.func
def whole_cells(x: wp.float32, cells: wp.int32) -> wp.int32:
    return wp.int32(wp.clamp(x, 0.0, wp.float32(cells) - 0.5))


@wp.func
def flat_box(flat: Flat, cells: wp.int32) -> wp.vec4i:
    """First and last column and row of cells; empty if last < first."""
    x0 = wp.min(flat.a[0], wp.min(flat.b[0], flat.c[0])) - flat.pad
    y0 = wp.min(flat.a[1], wp.min(flat.b[1], flat.c[1])) - flat.pad
    x1 = wp.max(flat.a[0], wp.max(flat.b[0], flat.c[0])) + flat.pad
    y1 = wp.max(flat.a[1], wp.max(flat.b[1], flat.c[1])) + flat.pad
    n = wp.float32(cells)
    if x1 < 0.0 or y1 < 0.0 or x0 > n or y0 > n:
        return wp.vec4i(0, 0, -1, -1)
    return wp.vec4i(whole_cells(x0, cells), whole_cells(y0, cells), whole_cells(x1, cells), whole_cells(y1, cells))


@wp.func
def beyond_face(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, slack: wp.float32) -> wp.bool:
    """Whether the whole triangle lies certainly behind a face's centre or beyond one of its four sides."""
    least = wp.min(a[0], wp.min(b[0], c[0]))
    most = wp.max(a[0], wp.max(b[0], c[0]))
    return (
        most < -slack
        or (a[1] - a[0] > slack and b[1] - b[0] > slack and c[1] - c[0] > slack)
        or (-a[1] - a[0] > slack and -b[1] - b[0] > slack and -c[1] - c[0] > slack)
        or (a[2] - a[0] > slack and b[2] - b[0] > slack and c[2] - c[0] > slack)
        or (-a[2] - a[0] > slack and -b[2] - b[0] > slack and -c[2] - c[0] > slack)
    ) and least < wp.INF


@wp.func
def span_of(
    offset: wp.array(dtype=wp.int32), face: wp.int32, x0: wp.int32, x1: wp.int32, y: wp.int32, cells: wp.int32
) -> wp.vec2i:
    """First ray and end of cells x0..x1 of a row; they must lie in one block."""
    first = cell_index(face, x0, y, cells)
    return wp.vec2i(offset[first], offset[first + (x1 - x0) + 1])


@wp.func
def between_planes(
    light: wp.vec3f,
    axes: wp.mat33d,
    face: wp.int32,
    a32: wp.vec3f,
    b32: wp.vec3f,
    c32: wp.vec3f,
    r: wp.vec4d,
    y0: wp.int32,
    y1: wp.int32,
    cells: wp.int32,
) -> wp.vec2i:
    """First and last cell of rows y0..y1 that a triangle reaching behind the light may cover. Float64.

    On a face the planes through the light and the edges are lines n0 + n1 u + n2 v >= 0; they hold for triangles
    that cannot be projected, too.
    """
    l64 = to_float64(light)
    a = on_face(axes * (to_float64(a32) - l64), face)
    b = on_face(axes * (to_float64(b32) - l64), face)
    c = on_face(axes * (to_float64(c32) - l64), face)
    det = wp.dot(wp.cross(b - a, c - a), a)
    reach = wp.max(largest(a), wp.max(largest(b), largest(c)))
    edge = wp.max(largest(b - a), wp.max(largest(c - b), largest(a - c)))
    rounding = wp.float64(1.0e-14)
    if wp.abs(det) <= wp.float64(8.0) * rounding * edge * edge * reach:
        return wp.vec2i(0, cells - 1)
    sign = wp.sign(det)
    hair = wp.float64(0.01)
    v0 = r[1] + (wp.float64(y0) - hair) / r[3]
    v1 = r[1] + (wp.float64(y1 + 1) + hair) / r[3]
    error = wp.float64(64.0) * rounding * reach * edge
    low = wp.float64(-2.0)
    high = wp.float64(2.0)
    for k in range(3):
        n = wp.cross(b, c - b) * sign
        if k == 1:
            n = wp.cross(c, a - c) * sign
        if k == 2:
            n = wp.cross(a, b - a) * sign
        rest = n[0] + wp.max(n[2] * v0, n[2] * v1) + error
        if wp.abs(n[1]) > error:
            u = -rest / n[1]
            if n[1] > wp.float64(0.0):
                low = wp.max(low, u)
            else:
                high = wp.min(high, u)
        elif rest + error * wp.float64(2.0) < wp.float64(0.0):
            high = wp.float64(-2.0)
    first = wp.floor(wp.clamp((low - r[0]) * r[2] - wp.float64(0.1), wp.float64(0.0), wp.float64(cells)))
    last = wp.floor(wp.clamp((high - r[0]) * r[2] + wp.float64(0.1), wp.float64(-1.0), wp.float64(cells - 1)))
    return wp.vec2i(wp.int32(first), wp.int32(last))


@wp.func
def queue_rays(
    i: wp.int32, first: wp.int32, stop: wp.int32, counts: wp.array(dtype=wp.int32), items: wp.array(dtype=wp.vec4i)
):
    """Queue rays first..stop for triangle i, 32 an item."""
    number = (stop - first + 31) // 32
    place = reserve(counts, ITEMS, number)
    for k in range(number):
        if place + k < items.shape[0]:
            items[place + k] = wp.vec4i(i, first + 32 * k, stop, 0)


@wp.func
def queue_block(
    i: wp.int32,
    face: wp.int32,
    flat: Flat,
    box: wp.vec4i,
    bx: wp.int32,
    by: wp.int32,
    cells: wp.int32,
    offset: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
    items: wp.array(dtype=wp.vec4i),
):
    """Queue the rays of a block of cells: all of them where they are few, else cell row by cell row."""
    start = cell_index(face, bx * CELLS, by * CELLS, cells)
    first = offset[start]
    stop = offset[start + CELLS * CELLS]
    if stop - first <= FEW_RAYS:
        if stop > first:
            queue_rays(i, first, stop, counts, items)
        return
    y = wp.max(box[1], by * CELLS)
    last = wp.min(box[3], by * CELLS + CELLS - 1)
    while y <= last:
        x0 = wp.max(box[0], bx * CELLS)
        x1 = wp.min(box[2], bx * CELLS + CELLS - 1)
        if flat.known:
            span = row_span(flat, wp.float32(y), wp.float32(y + 1))
            x0 = wp.max(x0, whole_cells(span[0], cells))
            x1 = wp.min(x1, whole_cells(wp.max(span[1], -1.0), cells))
            if span[1] < 0.0:
                x1 = -1
        if x1 >= x0:
            part = span_of(offset, face, x0, x1, y, cells)
            if part[1] > part[0]:
                queue_rays(i, part[0], part[1], counts, items)
        y += 1


@wp.kernel(enable_backward=False, grid_stride=False)
def stream_kernel(
    triangle_count: wp.int32,
    index: wp.int32,
    cells: wp.int32,
    inline_cells: wp.int32,
    inline_rays: wp.int32,
    queued: wp.bool,
    lights: wp.array(dtype=wp.vec3f),
    frame: wp.array(dtype=wp.mat33d),
    cubes: wp.array(dtype=Cube),
    rectangle: wp.array(dtype=wp.int32),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    valid: wp.array(dtype=wp.uint8),
    offset: wp.array(dtype=wp.int32),
    rays: wp.array(dtype=wp.vec4f),
    pixels: wp.array(dtype=wp.int32),
    visibility: wp.array2d(dtype=wp.uint8),
    counts: wp.array(dtype=wp.int32),
    records: wp.array2d(dtype=wp.vec4f),
    strips: wp.array(dtype=wp.vec4i),
    items: wp.array(dtype=wp.vec4i),
    doubts: wp.array(dtype=wp.vec2i),
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
    cube = cubes[0]
    qa = cube_space(a, cube)
    qb = cube_space(b, cube)
    qc = cube_space(c, cube)
    reach = wp.max(total(a - cube.middle), wp.max(total(b - cube.middle), total(c - cube.middle)))
    slack = 32.0 * U32 * (reach + cube.distance)
    occluder = Occluder()
    made = wp.bool(False)
    face = wp.int32(-1)
    while face < FACES - 1:
        face += 1
        if rectangle[4 + face] == 0:
            fa = on_face(qa, face)
            fb = on_face(qb, face)
            fc = on_face(qc, face)
            if not beyond_face(fa, fb, fc, slack):
                flat = on_cells(fa, fb, fc, reach, face_rectangle(face, rectangle, cells))
                box = wp.vec4i(0, 0, cells - 1, cells - 1)
                if flat.known:
                    box = flat_box(flat, cells)
                if box[2] >= box[0]:
                    bx0 = box[0] // CELLS
                    by0 = box[1] // CELLS
                    bx1 = box[2] // CELLS
                    by1 = box[3] // CELLS
                    number = wp.int32(EMPTY)
                    if (box[2] - box[0] + 1) * (box[3] - box[1] + 1) <= inline_cells:
                        number = wp.int32(0)
                        for y in range(box[1], box[3] + 1):
                            for bx in range(bx0, bx1 + 1):
                                x0 = wp.max(box[0], bx * CELLS)
                                x1 = wp.min(box[2], bx * CELLS + CELLS - 1)
                                span = span_of(offset, face, x0, x1, y, cells)
                                number += span[1] - span[0]
                    if number > 0:
                        if not made:
                            occluder = occluder_of(light, a, b, c, cube.size)
                            made = True
                            if queued and number > inline_rays:
                                records[i, 0] = occluder.e0
                                records[i, 1] = occluder.e1
                                records[i, 2] = occluder.e2
                                records[i, 3] = occluder.plane
                                records[i, 4] = wp.vec4f(occluder.bound, 0.0, 0.0, 0.0)
                        elif queued and number > inline_rays:
                            records[i, 0] = occluder.e0
                            records[i, 1] = occluder.e1
                            records[i, 2] = occluder.e2
                            records[i, 3] = occluder.plane
                            records[i, 4] = wp.vec4f(occluder.bound, 0.0, 0.0, 0.0)
                        if number <= inline_rays or not queued:
                            for y in range(box[1], box[3] + 1):
                                x_low = box[0]
                                x_high = box[2]
                                if not flat.known:
                                    ends = between_planes(
                                        light, frame[0], face, a, b, c, face_rectangle(face, rectangle, cells), y, y,
                                        cells,
                                    )  # fmt: skip
                                    x_low = ends[0]
                                    x_high = ends[1]
                                elif number > inline_rays:
                                    cut = row_span(flat, wp.float32(y), wp.float32(y + 1))
                                    x_low = wp.max(x_low, whole_cells(cut[0], cells))
                                    x_high = wp.min(x_high, whole_cells(wp.max(cut[1], 0.0), cells))
                                for bx in range(x_low // CELLS, x_high // CELLS + 1):
                                    x0 = wp.max(x_low, bx * CELLS)
                                    x1 = wp.min(x_high, bx * CELLS + CELLS - 1)
                                    if x1 >= x0:
                                        span = span_of(offset, face, x0, x1, y, cells)
                                        for at in range(span[0], span[1]):
                                            shade(i, at, index, occluder, rays, pixels, visibility, counts, doubts)
                        elif (bx1 - bx0 + 1) * (by1 - by0 + 1) > FEW_BLOCKS:
                            place = reserve(counts, STRIPS, by1 - by0 + 1)
                            for by in range(by0, by1 + 1):
                                if place < strips.shape[0]:
                                    strips[place] = wp.vec4i(i, face, by, 0)
                                place += 1
                        else:
                            for by in range(by0, by1 + 1):
                                for bx in range(bx0, bx1 + 1):
                                    queue_block(i, face, flat, box, bx, by, cells, offset, counts, items)


@wp.kernel(enable_backward=False, grid_stride=False)
def strip_kernel(
    threads: wp.int32,
    index: wp.int32,
    cells: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    frame: wp.array(dtype=wp.mat33d),
    cubes: wp.array(dtype=Cube),
    rectangle: wp.array(dtype=wp.int32),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    offset: wp.array(dtype=wp.int32),
    strips: wp.array(dtype=wp.vec4i),
    counts: wp.array(dtype=wp.int32),
    items: wp.array(dtype=wp.vec4i),
):
    """One row of blocks of a large triangle a thread: queue the blocks between its edges."""
    k = wp.tid()
    stop = wp.min(counts[STRIPS], strips.shape[0])
    cube = cubes[0]
    while k < stop:
        strip = strips[k]
        k += threads
        i = strip[0]
        face = strip[1]
        by = strip[2]
        corners = triangles[i]
        a = points[corners[0]]
        b = points[corners[1]]
        c = points[corners[2]]
        reach = wp.max(total(a - cube.middle), wp.max(total(b - cube.middle), total(c - cube.middle)))
        flat = on_cells(
            on_face(cube_space(a, cube), face), on_face(cube_space(b, cube), face), on_face(cube_space(c, cube), face),
            reach, face_rectangle(face, rectangle, cells),
        )  # fmt: skip
        box = wp.vec4i(0, 0, cells - 1, cells - 1)
        if flat.known:
            box = flat_box(flat, cells)
            span = row_span(flat, wp.float32(by * CELLS), wp.float32(by * CELLS + CELLS))
            box[0] = wp.max(box[0], whole_cells(span[0], cells))
            if span[1] < 0.0:
                box[2] = -1
            else:
                box[2] = wp.min(box[2], whole_cells(span[1], cells))
        else:
            y = by * CELLS
            rectangle_of_face = face_rectangle(face, rectangle, cells)
            ends = between_planes(lights[index], frame[0], face, a, b, c, rectangle_of_face, y, y + CELLS - 1, cells)
            box[0] = ends[0]
            box[2] = ends[1]
        if box[2] >= box[0]:
            for bx in range(box[0] // CELLS, box[2] // CELLS + 1):
                queue_block(i, face, flat, box, bx, by, cells, offset, counts, items)


@wp.kernel(enable_backward=False, grid_stride=False)
def item_kernel(
    threads: wp.int32,
    index: wp.int32,
    records: wp.array2d(dtype=wp.vec4f),
    counts: wp.array(dtype=wp.int32),
    items: wp.array(dtype=wp.vec4i),
    rays: wp.array(dtype=wp.vec4f),
    pixels: wp.array(dtype=wp.int32),
    visibility: wp.array2d(dtype=wp.uint8),
    doubts: wp.array(dtype=wp.vec2i),
):
    """Queued items: 32 threads each, one a ray."""
    k = wp.tid()
    stop = wp.min(counts[ITEMS], items.shape[0])
    item = k // 32
    while item < stop:
        work = items[item]
        at = work[1] + k % 32
        if at < work[2]:
            i = work[0]
            occluder = Occluder()
            occluder.e0 = records[i, 0]
            occluder.e1 = records[i, 1]
            occluder.e2 = records[i, 2]
            occluder.plane = records[i, 3]
            occluder.bound = records[i, 4][0]
            shade(i, at, index, occluder, rays, pixels, visibility, counts, doubts)
        item += threads // 32
