"""Shadow rays sorted into the cells of a cube around the light: face, block of 8 x 8 cells, cell.

The cube is aimed at the middle of the scene, so that a light outside sees everything through face 0, whose
rectangle is clamped to the rays; the other faces are whole. Light space is float64: the rays of a light at 1e7
scene radii still spread over all cells. On a face, planes through the light are lines, so bounds are exact there.
"""

from __future__ import annotations

from typing import Any

import warp as wp

from ...harness.specialise import effects
from ..common.triangle import largest, to_float32, to_float64

CELLS = wp.constant(8)
"""Side of a block of cells."""

FIXED = wp.constant(wp.float64(1073741824.0))
"""Steps of a face coordinate in the integer rectangle: 2^30."""

FACES = wp.constant(6)


EMPTY = wp.constant(2147483647)


@wp.struct
class Cube:
    """The light's axes in float32, for triangles: q = (axes) (p - middle) + (distance, 0, 0).

    Relative to the scene's middle, directions across keep their precision at any distance of the light.
    size bounds every coordinate of the scene's vertices, and so of every hit point.
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
if ((threadIdx.x & 31) == __ffs(active) - 1 && least < words.data[slot]) atomicMin(words.data + slot, least);
#elif defined(__CUDA_ARCH__)
if (value < words.data[slot]) atomicMin(words.data + slot, value);
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


@wp.kernel(enable_backward=False)
def clear_kernel(words: wp.array(dtype=wp.int32)):
    words[wp.tid()] = EMPTY


@wp.kernel(enable_backward=False, grid_stride=False)
def scene_box_kernel(points: wp.array(dtype=wp.vec3f), box: wp.array(dtype=wp.int32)):
    """Box of the finite vertices: low corner, then the negated high corner, as ordered integers, by minimum."""
    p = points[wp.tid()]
    finite = wp.isfinite(p[0]) and wp.isfinite(p[1]) and wp.isfinite(p[2])
    for axis in range(3):
        low = EMPTY
        high = EMPTY
        if finite:
            low = ordered(p[axis])
            high = ordered(-p[axis])
        lower(box, axis, low)
        lower(box, 3 + axis, high)


@wp.kernel(enable_backward=False)
def aim_kernel(
    index: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    box: wp.array(dtype=wp.int32),
    frame: wp.array(dtype=wp.mat33d),
    cube: wp.array(dtype=Cube),
    rectangle: wp.array(dtype=wp.int32),
):
    """Axes of the cube as rows (forward to the scene's middle first); empties the rectangle.

    rectangle: lows of u and v on face 0, their negated highs, then the faces in use (0 where used).
    """
    low = wp.vec3f(from_ordered(box[0]), from_ordered(box[1]), from_ordered(box[2]))
    high = wp.vec3f(-from_ordered(box[3]), -from_ordered(box[4]), -from_ordered(box[5]))
    if box[0] == EMPTY:
        low = wp.vec3f(0.0)
        high = wp.vec3f(0.0)
    middle = 0.5 * low + 0.5 * high
    forward = to_float64(middle) - to_float64(lights[index])
    reach = wp.max(wp.abs(forward[0]), wp.max(wp.abs(forward[1]), wp.abs(forward[2])))
    if not (reach > wp.float64(0.0)) or not (reach < wp.float64(wp.INF)):
        forward = wp.vec3d(wp.float64(1.0), wp.float64(0.0), wp.float64(0.0))
        reach = wp.float64(1.0)
    distance = wp.length(forward / reach) * reach
    forward = wp.normalize(forward / reach)
    up = wp.vec3d(wp.float64(0.0), wp.float64(1.0), wp.float64(0.0))
    if wp.abs(forward[1]) > wp.float64(0.8):
        up = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(1.0))
    right = wp.normalize(wp.cross(forward, up))
    up = wp.cross(right, forward)
    frame[0] = wp.matrix_from_rows(forward, right, up)
    c = Cube()
    c.forward = to_float32(forward)
    c.right = to_float32(right)
    c.up = to_float32(up)
    c.middle = middle
    c.distance = wp.float32(distance)
    c.size = wp.max(largest(low), largest(high))
    if middle == lights[index]:
        c.distance = 0.0
    cube[0] = c
    for k in range(4 + FACES):
        rectangle[k] = EMPTY


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
def face_rectangle(face: wp.int32, rectangle: wp.array(dtype=wp.int32), cells: wp.int32) -> wp.vec4d:
    """(low u, low v, cells per u, cells per v) of a face."""
    low_u = wp.float64(-1.0)
    low_v = wp.float64(-1.0)
    high_u = wp.float64(1.0)
    high_v = wp.float64(1.0)
    if face == 0:
        low_u = wp.float64(rectangle[0] - 1) / FIXED
        low_v = wp.float64(rectangle[1] - 1) / FIXED
        high_u = wp.float64(1 - rectangle[2]) / FIXED
        high_v = wp.float64(1 - rectangle[3]) / FIXED
    n = wp.float64(cells)
    return wp.vec4d(low_u, low_v, n / (high_u - low_u), n / (high_v - low_v))


@wp.kernel(enable_backward=False)
def table_kernel(cells: wp.int32, rectangle: wp.array(dtype=wp.int32), table: wp.array(dtype=wp.vec4f)):
    """Each face's rectangle in float32, for triangles: (low u, low v, cells per u, cells per v); zero if unused."""
    face = wp.tid()
    table[face] = wp.vec4f(0.0, 0.0, 0.0, 0.0)
    if rectangle[4 + face] == 0:
        r = face_rectangle(face, rectangle, cells)
        table[face] = wp.vec4f(wp.float32(r[0]), wp.float32(r[1]), wp.float32(r[2]), wp.float32(r[3]))


@wp.func
def cell_along(x: wp.float64, low: wp.float64, per_unit: wp.float64, cells: wp.int32) -> wp.int32:
    """Monotone; the same function for rays and for triangles."""
    return wp.int32(wp.clamp((x - low) * per_unit, wp.float64(0.0), wp.float64(cells) - wp.float64(0.5)))


@wp.func
def cell_index(face: wp.int32, x: wp.int32, y: wp.int32, cells: wp.int32) -> wp.int32:
    """Cells of a block are neighbours in memory, and so are the rays in them."""
    blocks = cells // CELLS
    block = (face * blocks + y // CELLS) * blocks + x // CELLS
    return block * (CELLS * CELLS) + (y % CELLS) * CELLS + x % CELLS


@wp.kernel(enable_backward=False, grid_stride=False)
def map_kernel(
    index: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    frame: wp.array(dtype=wp.mat33d),
    triangle: wp.array(dtype=wp.int32),
    hit: wp.array(dtype=wp.vec3d),
    receivers: wp.array2d(dtype=wp.uint8),
    place: wp.array(dtype=wp.vec3d),
    rectangle: wp.array(dtype=wp.int32),
    visibility: wp.array2d(dtype=wp.uint8),
):
    """(face, u, v) of every hit point (face -1: no shadow ray); the rectangle of face 0 and the faces in use."""
    pixel = wp.tid()
    visibility[index, pixel] = wp.uint8(0)
    low_u = EMPTY
    low_v = EMPTY
    high_u = EMPTY
    high_v = EMPTY
    face = wp.int32(-1)
    wanted = triangle[pixel] >= 0
    if wp.static(effects.masked):
        wanted = receivers[index, pixel] != wp.uint8(0)
    if wanted:
        q = frame[0] * (hit[pixel] - to_float64(lights[index]))
        face = face_of(q)
        r = on_face(q, face)
        u = wp.float64(0.0)
        v = wp.float64(0.0)
        if r[0] > wp.float64(0.0):
            u = r[1] / r[0]
            v = r[2] / r[0]
        place[pixel] = wp.vec3d(wp.float64(face), u, v)
        if face == 0:
            low_u = wp.int32(wp.floor(u * FIXED))
            low_v = wp.int32(wp.floor(v * FIXED))
            high_u = wp.int32(wp.floor(-u * FIXED))
            high_v = wp.int32(wp.floor(-v * FIXED))
        if rectangle[4 + face] != 0:
            rectangle[4 + face] = 0
    else:
        place[pixel] = wp.vec3d(wp.float64(-1.0), wp.float64(0.0), wp.float64(0.0))
    lower(rectangle, 0, low_u)
    lower(rectangle, 1, low_v)
    lower(rectangle, 2, high_u)
    lower(rectangle, 3, high_v)


@wp.kernel(enable_backward=False, grid_stride=False)
def count_kernel(
    cells: wp.int32,
    place: wp.array(dtype=wp.vec3d),
    rectangle: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int32),
    slot: wp.array(dtype=wp.vec2i),
):
    """Cell of every ray, and its rank there. The rank depends on the order of threads; no answer does."""
    pixel = wp.tid()
    p = place[pixel]
    face = wp.int32(p[0])
    if face < 0:
        slot[pixel] = wp.vec2i(-1, 0)
        return
    r = face_rectangle(face, rectangle, cells)
    cell = cell_index(face, cell_along(p[1], r[0], r[2], cells), cell_along(p[2], r[1], r[3], cells), cells)
    slot[pixel] = wp.vec2i(cell, wp.atomic_add(count, cell, 1))


@wp.kernel(enable_backward=False, grid_stride=False)
def scatter_kernel(
    triangle: wp.array(dtype=wp.int32),
    hit: wp.array(dtype=wp.vec3d),
    slot: wp.array(dtype=wp.vec2i),
    offset: wp.array(dtype=wp.int32),
    rays: wp.array(dtype=wp.vec4f),
    pixels: wp.array(dtype=wp.int32),
):
    """Rays in cell order: float32 hit point and own triangle; and the pixel of each."""
    pixel = wp.tid()
    s = slot[pixel]
    if s[0] < 0:
        return
    at = offset[s[0]] + s[1]
    h = to_float32(hit[pixel])
    rays[at] = wp.vec4f(h[0], h[1], h[2], wp.cast(triangle[pixel], wp.float32))
    pixels[at] = pixel
