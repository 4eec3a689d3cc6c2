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
from ..common.triangle import to_float32, to_float64
from ..common.wide import read_wide, write_wide
from .light_reach import note_receiver
from .queue import COUNTERS, RAYS, SIZE, latest
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
    size bounds every coordinate of the scene, and so of every hit point.
    """

    forward: wp.vec3f
    right: wp.vec3f
    up: wp.vec3f
    middle: wp.vec3f
    distance: wp.float32
    size: wp.float32


# The lanes of a warp agree on their minimum before one of them touches the shared word: an atomic a thread would
# cost several times the pass it serves. On the CPU it is a plain minimum.
@wp.func_native("""
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 800
unsigned int active = __activemask();
int least = __reduce_min_sync(active, value);
if ((threadIdx.x & 31) == __ffs(active) - 1 && least < __ldcg(words.data + slot)) atomicMin(words.data + slot, least);
#elif defined(__CUDA_ARCH__)
if (value < __ldcg(words.data + slot)) atomicMin(words.data + slot, value);
#else
if (value < words.data[slot]) words.data[slot] = value;
#endif
""")
def lower(words: wp.array(dtype=wp.int32), slot: wp.int32, value: wp.int32): ...


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
    camera: wp.array(dtype=wp.int32),
    frames: wp.array(dtype=wp.mat33d),
    cubes: wp.array(dtype=Cube),
    rectangles: wp.array2d(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
):
    """Axes of a light's cube as rows (forward to the scene's middle first); empties its rectangle and counters.

    The middle is that of a few triangles: any point among the triangles serves, and a whole box would cost a pass.
    The lanes of a warp fetch them at once (``threads`` is 32, or 1 on the CPU); the first does the rest.
    rectangle: lows of u and v on face 0, their negated highs, then the faces in use (0 where used). ``camera``: the
    counters of the camera's stream.
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
    c.size = wp.cast(camera[SIZE], wp.float32)
    if middle == lights[index]:
        c.distance = 0.0
    cubes[index] = c
    for k in range(4 + FACES):
        rectangles[index, k] = EMPTY
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
    """Where a hit point lies (face -1 at a miss); widens the rectangle of face 0, and marks the face as used."""
    low_u = EMPTY
    low_v = EMPTY
    high_u = EMPTY
    high_v = EMPTY
    p = wp.vec4f(0.0, 0.0, -1.0, 0.0)
    if is_hit:
        p = place_of(hit, light, frame)
        face = wp.int32(p[2])
        if face == 0:
            low_u = ordered(p[0])
            low_v = ordered(p[1])
            high_u = ordered(-p[0])
            high_v = ordered(-p[1])
        if rectangle[4 + face] != 0:
            rectangle[4 + face] = 0
    # Nearly all rays lie in the rectangle of those before.
    if (
        low_u < latest(rectangle, 0)
        or low_v < latest(rectangle, 1)
        or high_u < latest(rectangle, 2)
        or high_v < latest(rectangle, 3)
    ):
        lower(rectangle, 0, low_u)
        lower(rectangle, 1, low_v)
        lower(rectangle, 2, high_u)
        lower(rectangle, 3, high_v)
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
    After them, cells along a face.
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
        table[k] = wp.vec4f(wp.float32(cells), 0.0, 0.0, 0.0)


@wp.func
def cells_of(table: wp.array(dtype=wp.vec4f)) -> wp.int32:
    """Cells along a face, as the scan left them."""
    return wp.int32(table[FACES][0])


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
