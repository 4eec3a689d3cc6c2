"""Shadow rays sorted into the cells of a cube around the light: face, row, cell.

The cube is aimed at the middle of the scene, so that a light outside sees everything through face 0, whose
rectangle is clamped to the rays; the other faces are whole. Light space is float64: the rays of a light at 1e7
scene radii still spread over all cells. On a face, planes through the light are lines, so bounds are exact there.
"""

from __future__ import annotations

from typing import Any

import warp as wp

from ...harness.specialise import effects
from ..common.pixels import tile_pixel
from ..common.reserve import number_in
from ..common.triangle import largest, to_float32, to_float64
from ..common.wide import read_wide, write_wide
from .light_reach import note_receiver
from .queue import COUNTERS, RAYS
from .warps import least_of_lanes, scan_row

SPARE = wp.constant(4)
"""Words between two rows of cells: where a row ends, and none to keep rows on 16-byte addresses."""


FACES = wp.constant(6)


EMPTY = wp.constant(2147483647)

SAMPLES = wp.constant(16)
"""Triangles that say where the middle of the scene is."""


@wp.struct
class Cube:
    """The light's axes in float32, for triangles: q = (axes) (p - middle) + (distance, 0, 0).

    Relative to the scene's middle, directions across keep their precision at any distance of the light.
    """

    forward: wp.vec3f
    right: wp.vec3f
    up: wp.vec3f
    middle: wp.vec3f
    distance: wp.float32


LARGEST = wp.constant(10)
"""Of a rectangle's words: the largest coordinate of a hit point."""


# A block agrees before one thread a word asks the words that all blocks share: a look at them by every warp would be
# as many requests to one address of the second cache, and cost several times the pass it serves.
@wp.func_native("""
#if defined(__CUDA_ARCH__)
__shared__ int agreed[6];
if (threadIdx.x < 6) agreed[threadIdx.x] = threadIdx.x < 4 ? 0x7fffffff : 0;
__syncthreads();
int used = face < 0 ? 0 : 1 << face;
#if __CUDA_ARCH__ >= 800
low_u = __reduce_min_sync(0xffffffffu, low_u);
low_v = __reduce_min_sync(0xffffffffu, low_v);
high_u = __reduce_min_sync(0xffffffffu, high_u);
high_v = __reduce_min_sync(0xffffffffu, high_v);
used = __reduce_or_sync(0xffffffffu, used);
largest = __reduce_max_sync(0xffffffffu, largest);
if ((threadIdx.x & 31) == 0 && used)
#else
if (used)
#endif
{
    atomicMin(agreed, low_u);
    atomicMin(agreed + 1, low_v);
    atomicMin(agreed + 2, high_u);
    atomicMin(agreed + 3, high_v);
    atomicOr(agreed + 4, used);
    atomicMax(agreed + 5, largest);
}
__syncthreads();
int k = threadIdx.x, *word = words.data + k;
if (k < 4) {
    if (agreed[k] < __ldcg(word)) atomicMin(word, agreed[k]);
} else if (k < 10) {
    if (agreed[4] >> (k - 4) & 1 && __ldcg(word)) *word = 0;
} else if (k == 10) {
    if (agreed[5] > __ldcg(word)) atomicMax(word, agreed[5]);
}
#else
if (face < 0) return;
if (low_u < words.data[0]) words.data[0] = low_u;
if (low_v < words.data[1]) words.data[1] = low_v;
if (high_u < words.data[2]) words.data[2] = high_u;
if (high_v < words.data[3]) words.data[3] = high_v;
words.data[4 + face] = 0;
if (largest > words.data[10]) words.data[10] = largest;
#endif
""")
def note_rays(
    words: wp.array(dtype=wp.int32),
    low_u: wp.int32,
    low_v: wp.int32,
    high_u: wp.int32,
    high_v: wp.int32,
    face: wp.int32,
    largest: wp.int32,
):
    """Lower a rectangle's sides, mark the face as used (-1: no ray), raise the largest coordinate.

    All threads of a block, full warps of it, must call it.
    """


@wp.func
def ordered(x: wp.float32) -> wp.int32:
    """An integer in the order of the floats."""
    bits = wp.cast(x, wp.int32)
    if bits < 0:
        bits = bits ^ 2147483647
    return bits


@wp.func
def from_ordered(bits: wp.int32) -> wp.float32:
    word = bits
    if word < 0:
        word = word ^ 2147483647
    return wp.cast(word, wp.float32)


@wp.kernel(enable_backward=False, grid_stride=False)
def aim_kernel(
    threads: wp.int32,
    index: wp.int32,
    triangle_count: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    valid: wp.array(dtype=wp.uint8),
    frames: wp.array(dtype=wp.mat33d),
    cubes: wp.array(dtype=Cube),
    rectangles: wp.array2d(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
):
    """Axes of a light's cube as rows (forward to the scene's middle first); empties its rectangle and counters.

    The middle is that of a few triangles: any point among the triangles serves, and a whole box would cost a pass.
    The lanes of a warp fetch them at once (``threads`` is 32, or 1 on the CPU); the first does the rest.
    rectangle: lows of u and v on face 0, their negated highs, then the faces in use (0 where used), then the bits of
    the largest coordinate of a hit point.
    """
    low = wp.vec3f(wp.INF)
    high = wp.vec3f(-wp.INF)
    lane = wp.tid()
    for k in range(lane, SAMPLES, threads):
        i = wp.int32(wp.int64(triangle_count) * wp.int64(2 * k + 1) / wp.int64(2 * SAMPLES))
        if i < triangle_count:
            if valid[i] != wp.uint8(0):
                p = points[triangles[i][0]]
                low = wp.min(low, p)
                high = wp.max(high, p)
    low = wp.vec3f(least_of_lanes(low[0]), least_of_lanes(low[1]), least_of_lanes(low[2]))
    high = -wp.vec3f(least_of_lanes(-high[0]), least_of_lanes(-high[1]), least_of_lanes(-high[2]))
    if lane > 0:
        return
    middle = wp.vec3f(0.0)
    if low[0] < wp.INF:
        middle = 0.5 * low + 0.5 * high
    forward = to_float64(middle) - to_float64(lights[index])
    far = wp.max(wp.abs(forward[0]), wp.max(wp.abs(forward[1]), wp.abs(forward[2])))
    if not (far > wp.float64(0.0)) or not (far < wp.float64(wp.INF)):
        forward = wp.vec3d(wp.float64(1.0), wp.float64(0.0), wp.float64(0.0))
        far = wp.float64(1.0)
    distance = wp.length(forward / far) * far
    forward = wp.normalize(forward / far)
    up = wp.vec3d(wp.float64(0.0), wp.float64(1.0), wp.float64(0.0))
    if wp.abs(forward[1]) > wp.float64(0.8):
        up = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(1.0))
    right = wp.normalize(wp.cross(forward, up))
    up = wp.cross(right, forward)
    frames[index] = wp.matrix_from_rows(forward, right, up)
    c = Cube()
    c.forward = to_float32(forward)
    c.right = to_float32(right)
    c.up = to_float32(up)
    c.middle = middle
    c.distance = wp.float32(distance)
    if middle == lights[index]:
        c.distance = 0.0
    cubes[index] = c
    for k in range(4 + FACES):
        rectangles[index, k] = EMPTY
    rectangles[index, LARGEST] = 0
    for k in range(COUNTERS):
        counts[k] = 0


@wp.func
def face_of(q: wp.vec3d) -> wp.int32:
    """Face of the largest coordinate: 0 +x, 1 -x, 2 +y, 3 -y, 4 +z, 5 -z."""
    x = wp.abs(q[0])
    y = wp.abs(q[1])
    z = wp.abs(q[2])
    face = wp.int32(0)
    along = q[0]
    if y > x and y >= z:
        face = 2
        along = q[1]
    elif z > x and z > y:
        face = 4
        along = q[2]
    if along < wp.float64(0.0):
        face += 1
    return face


@wp.func
def on_face(q: Any, face: wp.int32) -> Any:
    """(along, across, up) of a point in the frame of a face."""
    r = q
    if face // 2 == 1:
        r = type(q)(q[1], q[2], q[0])
    elif face // 2 == 2:
        r = type(q)(q[2], q[0], q[1])
    if face % 2 == 1:
        r = type(q)(-r[0], r[1], r[2])
    return r


@wp.func
def face_rectangle(face: wp.int32, rectangle: wp.array(dtype=wp.int32), cells: wp.int32) -> wp.vec4f:
    """(low u, low v, cells per u, cells per v) of a face."""
    low_u = wp.float32(-1.0)
    low_v = wp.float32(-1.0)
    high_u = wp.float32(1.0)
    high_v = wp.float32(1.0)
    if face == 0:
        low_u = from_ordered(rectangle[0])
        low_v = from_ordered(rectangle[1])
        high_u = -from_ordered(rectangle[2])
        high_v = -from_ordered(rectangle[3])
    n = wp.float32(cells)
    hair = (
        1.0e-6 * wp.max(wp.max(wp.abs(low_u), wp.abs(high_u)), wp.max(wp.abs(low_v), wp.abs(high_v)))
        + 1.0e-30
    )
    return wp.vec4f(low_u, low_v, n / (high_u - low_u + hair), n / (high_v - low_v + hair))


@wp.func
def cell_along(x: wp.float32, low: wp.float32, per_unit: wp.float32, cells: wp.int32) -> wp.int32:
    """Monotone; triangles are mapped by the same numbers, with a pad far beyond what this rounds."""
    return wp.int32(wp.clamp((x - low) * per_unit, 0.0, wp.float32(cells) - 0.5))


@wp.func
def cell_index(face: wp.int32, x: wp.int32, y: wp.int32, cells: wp.int32) -> wp.int32:
    """Cells of a row are neighbours in memory, and so are the rays in them."""
    return (face * cells + y) * (cells + SPARE) + x


@wp.func
def cells_in_use(rectangle: wp.array(dtype=wp.int32), cells: wp.vec2i) -> wp.int32:
    """Cells along a face: the first number where rays lie on several faces, the second where all lie on face 0.

    Fewer rays of other triangles share a finer cell, but every face in use has its cells cleared and summed up.
    """
    chosen = cells[1]
    for k in range(1, FACES):
        if rectangle[4 + k] == 0:
            chosen = cells[0]
    return chosen


@wp.func
def place_of(hit: wp.vec3d, light: wp.vec3f, frame: wp.mat33d) -> wp.vec4f:
    """(u, v, face, depth) of a hit point; reckoned in float64, so that u and v keep a float's digits at any distance.

    The depth is taken along the face's axis; infinite where the point is the light.
    """
    q = frame * (hit - to_float64(light))
    face = face_of(q)
    r = on_face(q, face)
    u = wp.float32(0.0)
    v = wp.float32(0.0)
    depth = wp.float32(wp.INF)
    if r[0] > wp.float64(0.0):
        scale = wp.float64(1.0) / r[0]
        u = wp.float32(r[1] * scale)
        v = wp.float32(r[2] * scale)
        depth = wp.float32(r[0])
    return wp.vec4f(u, v, wp.float32(face), depth)


@wp.func
def note_place(
    is_hit: wp.bool, hit: wp.vec3d, light: wp.vec3f, frame: wp.mat33d, rectangle: wp.array(dtype=wp.int32)
) -> wp.vec4f:
    """Where a hit point lies (face -1 at a miss), noted among all rays' (:func:`note_rays`)."""
    low_u = EMPTY
    low_v = EMPTY
    high_u = EMPTY
    high_v = EMPTY
    face = wp.int32(-1)
    size = wp.int32(0)
    p = wp.vec4f(0.0, 0.0, -1.0, 0.0)
    if is_hit:
        p = place_of(hit, light, frame)
        size = wp.cast(largest(to_float32(hit)), wp.int32)
        face = wp.int32(p[2])
        if face == 0:
            low_u = ordered(p[0])
            low_v = ordered(p[1])
            high_u = ordered(-p[0])
            high_v = ordered(-p[1])
    note_rays(rectangle, low_u, low_v, high_u, high_v, face, size)
    return p


@wp.kernel(enable_backward=False, grid_stride=False)
def map_kernel(
    width: wp.int32,
    height: wp.int32,
    index: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    frames: wp.array(dtype=wp.mat33d),
    triangle: wp.array(dtype=wp.int32),
    hits: wp.array(dtype=wp.vec3d),
    receivers: wp.array2d(dtype=wp.uint8),
    rectangle: wp.array(dtype=wp.int32),
    place: wp.array(dtype=wp.vec4f),
    point: wp.array(dtype=wp.vec4f),
    visibility: wp.array2d(dtype=wp.uint8),
    farthest: wp.array(dtype=wp.int32),
):
    """Places of all rays (face -1: no shadow ray), the rectangle of face 0, and the faces in use; empties ``farthest``.

    point: the hit in float32, and the pixel's number in the bits of the fourth.
    """
    tile = wp.tid()
    while tile < farthest.shape[0]:
        farthest[tile] = 0
        tile += ((width + 7) >> 3) * ((height + 3) >> 2) * 32
    at = tile_pixel(wp.tid(), width, height)
    hit = wp.vec3d()
    wanted = wp.bool(False)
    pixel = at[1] * width + at[0]
    if at[0] >= 0:
        visibility[index, pixel] = wp.uint8(0)
        wanted = triangle[pixel] >= 0
        if wp.static(effects.masked):
            wanted = receivers[index, pixel] != wp.uint8(0)
        if wanted:
            hit = hits[pixel]
    p = note_place(wanted, hit, lights[index], frames[index], rectangle)
    if at[0] >= 0:
        write_wide(place, pixel, p)
        h = to_float32(hit)
        write_wide(point, pixel, wp.vec4f(h[0], h[1], h[2], wp.cast(pixel, wp.float32)))


@wp.kernel(enable_backward=False, grid_stride=False)
def count_kernel(
    width: wp.int32,
    height: wp.int32,
    cells_either: wp.vec2i,
    place: wp.array(dtype=wp.vec4f),
    rectangle: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int32),
    slot: wp.array(dtype=wp.vec2i),
    farthest: wp.array(dtype=wp.int32),
):
    """Cell of every ray, and its rank there; the farthest receivers. Ranks depend on the order of threads; no answer
    does."""
    at = tile_pixel(wp.tid(), width, height)
    if at[0] < 0:
        return
    pixel = at[1] * width + at[0]
    p = read_wide(place, pixel)
    face = wp.int32(p[2])
    if face < 0:
        write_wide(slot, pixel, wp.vec2i(-1, 0))
        return
    cells = cells_in_use(rectangle, cells_either)
    r = face_rectangle(face, rectangle, cells)
    x = cell_along(p[0], r[0], r[2], cells)
    y = cell_along(p[1], r[1], r[3], cells)
    cell = cell_index(face, x, y, cells)
    write_wide(slot, pixel, wp.vec2i(cell, number_in(count, cell)))
    note_receiver(farthest, face, x, y, p[3], cells)


@wp.kernel(enable_backward=False, grid_stride=False)
def scan_kernel(
    cells_either: wp.vec2i,
    rectangle: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int32),
    offset: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
    table: wp.array(dtype=wp.vec4f),
):
    """Where each row's rays lie (GPU: 128 threads a row, faces without rays left out), and the faces' rectangles.

    table: each face's rectangle in float32, for triangles: (low u, low v, cells per u, cells per v); zero if unused.
    After them, cells along a face and the largest coordinate of a hit point.
    """
    k = wp.tid()
    row = k // 128
    cells = cells_in_use(rectangle, cells_either)
    if rectangle[4 + row // cells] == 0:
        scan_row(count, offset, row * (cells + SPARE), cells, counts, RAYS)
    if k < FACES:
        t = wp.vec4f(0.0, 0.0, 0.0, 0.0)
        if rectangle[4 + k] == 0:
            t = face_rectangle(k, rectangle, cells)
        table[k] = t
    if k == FACES:
        table[k] = wp.vec4f(wp.float32(cells), wp.cast(rectangle[LARGEST], wp.float32), 0.0, 0.0)


@wp.func
def cells_of(table: wp.array(dtype=wp.vec4f)) -> wp.int32:
    """Cells along a face, as the scan left them."""
    return wp.int32(table[FACES][0])


@wp.func
def reach_of(table: wp.array(dtype=wp.vec4f)) -> wp.float32:
    """The largest coordinate of a hit point, likewise."""
    return table[FACES][1]


@wp.kernel(enable_backward=False, grid_stride=False)
def scatter_kernel(
    width: wp.int32,
    height: wp.int32,
    point: wp.array(dtype=wp.vec4f),
    slot: wp.array(dtype=wp.vec2i),
    offset: wp.array(dtype=wp.int32),
    rays: wp.array(dtype=wp.vec4f),
):
    """Rays in cell order: float32 hit point, and the pixel's number in the bits of the fourth."""
    at = tile_pixel(wp.tid(), width, height)
    if at[0] < 0:
        return
    pixel = at[1] * width + at[0]
    s = read_wide(slot, pixel)
    if s[0] >= 0:
        write_wide(rays, offset[s[0]] + s[1], read_wide(point, pixel))
