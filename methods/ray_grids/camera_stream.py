"""Primary rays: one ray a pixel lies in the grid; triangles are streamed over it.

The nearest hit of a pixel is kept as one 64-bit word, 40 bits of 1 / t and 24 of the complemented index, by atomic
maximum: the order in which triangles arrive does not matter. Edge functions in float32 with an error bound decide
all but a few pixels; those, and every 1 / t, are float64 (:mod:`..common.triangle`).
"""

from __future__ import annotations

import warp as wp

from ...harness.alpha import Alpha
from ...harness.specialise import effects
from ..common.alpha import hit_counts
from ..common.reserve import reserve
from ..common.screen import camera_space, out_of_view, pixel_box
from ..common.triangle import (
    FLOOR32,
    U32,
    U64,
    hit_distance,
    largest,
    nearness_key,
    to_float64,
    weld_of,
    write_hit,
)
from .queue import ITEMS, STRIPS

BLOCK = wp.constant(8)
"""Side of a block of pixels or cells; 64 threads of the GPU share one (triangle, block) item."""

INLINE_PIXELS = wp.constant(16)
FEW_BLOCKS = wp.constant(4)


@wp.struct
class Planes:
    """Edge planes through the eye, turned so that inside is positive; signs beyond ``bound`` are certain."""

    n0: wp.vec3f
    n1: wp.vec3f
    n2: wp.vec3f
    bound: wp.float32


@wp.func
def edge_planes(o: wp.vec3f, a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, longest: wp.float32) -> Planes:
    """``longest`` bounds |d|_1 of every pixel. A triangle seen edge-on within rounding gets an infinite bound."""
    pa = a - o
    pb = b - o
    pc = c - o
    ab = b - a
    bc = c - b
    ca = a - c
    reach = wp.max(largest(pa), wp.max(largest(pb), largest(pc)))
    edge = wp.max(largest(ab), wp.max(largest(bc), largest(ca)))
    a64 = to_float64(a)
    n = wp.cross(to_float64(b) - a64, to_float64(c) - a64)
    det = wp.dot(n, a64 - to_float64(o))
    planes = Planes()
    planes.n0 = wp.cross(pb, bc)
    planes.n1 = wp.cross(pc, ca)
    planes.n2 = wp.cross(pa, ab)
    planes.bound = 16.0 * U32 * longest * reach * edge + FLOOR32
    if not (wp.abs(det) > wp.float64(96.0) * U64 * wp.float64(reach) * wp.float64(edge) * wp.float64(edge)):
        planes.bound = wp.INF
    if det < wp.float64(0.0):
        planes.n0 = -planes.n0
        planes.n1 = -planes.n1
        planes.n2 = -planes.n2
    return planes


@wp.func
def longest_direction(tangents: wp.array(dtype=wp.float32)) -> wp.float32:
    """A bound on |d|_1: forward, right and up have length 1, so each sums to at most sqrt 3."""
    return 1.7321 * (1.0001 + tangents[0] + tangents[1])


@wp.func
def inverse_depth(o: wp.vec3f, a: wp.vec3f, b: wp.vec3f, c: wp.vec3f) -> wp.vec3d:
    """m with 1 / t = m . d on the triangle's plane, float64; zero where the plane passes the eye."""
    a64 = to_float64(a)
    n = wp.cross(to_float64(b) - a64, to_float64(c) - a64)
    height = wp.dot(n, a64 - to_float64(o))
    if height == wp.float64(0.0):
        return wp.vec3d()
    return n / height


@wp.func
def offered(
    i: wp.int32,
    o: wp.vec3f,
    d: wp.vec3f,
    planes: Planes,
    m: wp.vec3d,
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    weld: wp.array(dtype=wp.int32),
) -> wp.uint64:
    """Test one pixel: the word of the hit, larger where it is nearer (ties: of lower index), or 0 where there is none."""
    low = wp.min(wp.dot(planes.n0, d), wp.min(wp.dot(planes.n1, d), wp.dot(planes.n2, d)))
    if low < -planes.bound:
        return wp.uint64(0)
    inverse = wp.dot(m, to_float64(d))
    if not (low > planes.bound):
        face = triangles[i]
        t = hit_distance(o, d, points[face[0]], points[face[1]], points[face[2]], weld_of(weld, face))
        if t <= wp.float64(0.0):
            return wp.uint64(0)
        inverse = wp.float64(1.0) / t
    if not (inverse > wp.float64(0.0)):
        return wp.uint64(0)
    return (nearness_key(inverse) << wp.uint64(24)) | wp.uint64(0xFFFFFF - i)


@wp.func
def keep(pixel: wp.int32, word: wp.uint64, nearest: wp.array(dtype=wp.uint64)):
    """Keep a hit if it is the nearest so far."""
    if word > nearest[pixel]:
        wp.atomic_max(nearest, pixel, word)


@wp.func
def block_missed(
    planes: Planes,
    bx: wp.int32,
    by: wp.int32,
    width: wp.int32,
    height: wp.int32,
    column: wp.array(dtype=wp.vec3f),
    row: wp.array(dtype=wp.vec3f),
) -> wp.bool:
    """Whether the block certainly misses the triangle: a plane is linear, so its highest value is at a corner."""
    x0 = column[bx * BLOCK]
    x1 = column[wp.min(bx * BLOCK + BLOCK, width) - 1]
    y0 = row[by * BLOCK]
    y1 = row[wp.min(by * BLOCK + BLOCK, height) - 1]
    limit = -2.0 * planes.bound
    return (
        wp.max(wp.dot(planes.n0, x0), wp.dot(planes.n0, x1))
        + wp.max(wp.dot(planes.n0, y0), wp.dot(planes.n0, y1))
        < limit
        or wp.max(wp.dot(planes.n1, x0), wp.dot(planes.n1, x1))
        + wp.max(wp.dot(planes.n1, y0), wp.dot(planes.n1, y1))
        < limit
        or wp.max(wp.dot(planes.n2, x0), wp.dot(planes.n2, x1))
        + wp.max(wp.dot(planes.n2, y0), wp.dot(planes.n2, y1))
        < limit
    )


@wp.func
def write_item(
    at: wp.int32, i: wp.int32, box: wp.vec4i, bx: wp.int32, by: wp.int32, items: wp.array(dtype=wp.vec4i)
):
    """An item: triangle, first pixel column and row, and last column and row packed into 16 bits each."""
    if at < items.shape[0]:
        x0 = wp.max(box[0], bx * BLOCK)
        y0 = wp.max(box[1], by * BLOCK)
        x1 = wp.min(box[2], bx * BLOCK + BLOCK - 1)
        y1 = wp.min(box[3], by * BLOCK + BLOCK - 1)
        items[at] = wp.vec4i(i, x0, y0, (y1 - y0) * BLOCK + (x1 - x0))


@wp.kernel(enable_backward=False, grid_stride=False)
def stream_kernel(
    triangle_count: wp.int32,
    width: wp.int32,
    height: wp.int32,
    inline_blocks: wp.int32,
    eye: wp.array(dtype=wp.vec3f),
    axes: wp.array(dtype=wp.vec3f),
    tangents: wp.array(dtype=wp.float32),
    column: wp.array(dtype=wp.vec3f),
    row: wp.array(dtype=wp.vec3f),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    valid: wp.array(dtype=wp.uint8),
    weld: wp.array(dtype=wp.int32),
    alpha: Alpha,
    nearest: wp.array(dtype=wp.uint64),
    counts: wp.array(dtype=wp.int32),
    records: wp.array2d(dtype=wp.vec4f),
    depths: wp.array(dtype=wp.vec3d),
    strips: wp.array(dtype=wp.vec4i),
    items: wp.array(dtype=wp.vec4i),
):
    """One thread a triangle. Small ones test their pixels here; larger ones are queued by blocks or strips."""
    i = wp.tid()
    if i >= triangle_count or valid[i] == wp.uint8(0):
        return
    face = triangles[i]
    o = eye[0]
    a = points[face[0]]
    b = points[face[1]]
    c = points[face[2]]
    ca = camera_space(a, o, axes)
    cb = camera_space(b, o, axes)
    cc = camera_space(c, o, axes)
    if out_of_view(ca, cb, cc, tangents[0], tangents[1]):
        return
    box = pixel_box(ca, cb, cc, tangents[0], tangents[1], width, height)
    if box[2] < box[0] or box[3] < box[1]:
        return
    planes = edge_planes(o, a, b, c, longest_direction(tangents))
    m = inverse_depth(o, a, b, c)
    if (box[2] - box[0] + 1) * (box[3] - box[1] + 1) <= INLINE_PIXELS:
        for y in range(box[1], box[3] + 1):
            for x in range(box[0], box[2] + 1):
                d = column[x] + row[y]
                word = offered(i, o, d, planes, m, points, triangles, weld)
                if wp.static(effects.alpha):
                    if word != wp.uint64(0) and not hit_counts(alpha, i, o, d, a, b, c, weld_of(weld, face)):
                        word = wp.uint64(0)
                keep(y * width + x, word, nearest)
        return
    bx0 = box[0] // BLOCK
    by0 = box[1] // BLOCK
    bx1 = box[2] // BLOCK
    by1 = box[3] // BLOCK
    blocks = (bx1 - bx0 + 1) * (by1 - by0 + 1)
    if blocks <= inline_blocks:
        for by in range(by0, by1 + 1):
            for bx in range(bx0, bx1 + 1):
                if not block_missed(planes, bx, by, width, height, column, row):
                    for y in range(wp.max(box[1], by * BLOCK), wp.min(box[3], by * BLOCK + BLOCK - 1) + 1):
                        for x in range(
                            wp.max(box[0], bx * BLOCK), wp.min(box[2], bx * BLOCK + BLOCK - 1) + 1
                        ):
                            d = column[x] + row[y]
                            word = offered(i, o, d, planes, m, points, triangles, weld)
                            if wp.static(effects.alpha):
                                if word != wp.uint64(0) and not hit_counts(
                                    alpha, i, o, d, a, b, c, weld_of(weld, face)
                                ):
                                    word = wp.uint64(0)
                            keep(y * width + x, word, nearest)
        return
    records[i, 0] = wp.vec4f(planes.n0[0], planes.n0[1], planes.n0[2], planes.bound)
    records[i, 1] = wp.vec4f(planes.n1[0], planes.n1[1], planes.n1[2], 0.0)
    records[i, 2] = wp.vec4f(planes.n2[0], planes.n2[1], planes.n2[2], 0.0)
    depths[i] = m
    if blocks <= FEW_BLOCKS:
        at = reserve(counts, ITEMS, blocks)
        for by in range(by0, by1 + 1):
            for bx in range(bx0, bx1 + 1):
                write_item(at, i, box, bx, by, items)
                at += 1
        return
    at = reserve(counts, STRIPS, by1 - by0 + 1)
    for by in range(by0, by1 + 1):
        if at < strips.shape[0]:
            y0 = wp.max(box[1], by * BLOCK)
            y1 = wp.min(box[3], by * BLOCK + BLOCK - 1)
            strips[at] = wp.vec4i(i, by, y0 | (y1 << 16), box[0] | (box[2] << 16))
        at += 1


@wp.kernel(enable_backward=False, grid_stride=False)
def resolve_kernel(
    width: wp.int32,
    height: wp.int32,
    across: wp.int32,
    eye: wp.array(dtype=wp.vec3f),
    column: wp.array(dtype=wp.vec3f),
    row: wp.array(dtype=wp.vec3f),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    weld: wp.array(dtype=wp.int32),
    nearest: wp.array(dtype=wp.uint64),
    triangle_out: wp.array(dtype=wp.int32),
    t_out: wp.array(dtype=wp.float32),
    u_out: wp.array(dtype=wp.float32),
    v_out: wp.array(dtype=wp.float32),
    hit_out: wp.array(dtype=wp.vec3d),
):
    """Answers of every pixel from its nearest word, in 8 x 4 pixel order."""
    k = wp.tid()
    x = (k // 32) % across * 8 + k % 8
    y = (k // 32) // across * 4 + (k % 32) // 8
    if x >= width or y >= height:
        return
    pixel = y * width + x
    word = nearest[pixel]
    o = eye[0]
    d = column[x] + row[y]
    best = wp.int32(-1)
    t = wp.float64(0.0)
    if word != wp.uint64(0):
        best = 0xFFFFFF - wp.int32(word & wp.uint64(0xFFFFFF))
        face = triangles[best]
        a64 = to_float64(points[face[0]])
        n = wp.cross(to_float64(points[face[1]]) - a64, to_float64(points[face[2]]) - a64)
        t = wp.dot(n, a64 - to_float64(o)) / wp.dot(n, to_float64(d))
    write_hit(pixel, o, d, best, t, points, triangles, weld, triangle_out, t_out, u_out, v_out, hit_out)
