"""Triangles rasterised into a depth map: the nearest depth of every texel centre, by atomic minimum.

Homogeneous rasterisation (Olano & Greer 1997): a triangle's edge planes through the light are linear over the
texels, also where a corner lies behind the light, so nothing is clipped. Depths are stored as the bits of a float32
that is not negative: their order is that of the integers.
"""

import warp as wp

from ...harness.frame.alpha import Alpha, texels_near
from ...harness.frame.effects.specialise import effects
from ...harness.frame.geometry import Corners, Mesh, corners_of
from ..exact.planes import longest_edge
from ..exact.triangle import U32, largest
from ..gpu.reserve import reserve
from ..streams.camera.pixels import largest_of
from .projection import LightMap, map_point

EMPTY = 0x3F800000
"""Bits of 1.0: nothing nearer than the end of the depth range."""

STRIP_ROWS = wp.constant(8)
INLINE_TEXELS = wp.constant(64)
STRIPS = wp.constant(0)


@wp.struct
class Cover:
    """Edge planes over (1, x, y), turned so that inside is positive; depths of the corners; first and last texels."""

    n0: wp.vec3f
    n1: wp.vec3f
    n2: wp.vec3f
    depth: wp.vec3f
    bound: wp.float32
    x0: wp.int32
    x1: wp.int32
    y0: wp.int32
    y1: wp.int32


@wp.struct
class DepthMap:
    """A light's map and what is drawn in it.

    size     texels along a side of a face     faces   faces that there is room for
    light    LightMap [1]: where it lies (:mod:`.projection`)
    texels   int32 [faces * size * size]: bits of the nearest depths
    """

    size: wp.int32
    faces: wp.int32
    light: wp.array(dtype=LightMap)
    texels: wp.array(dtype=wp.int32)


@wp.func
def first_texel(s: wp.float32, size: wp.int32) -> wp.int32:
    """The first texel whose centre is at or beyond map coordinate s, with a hundredth to spare."""
    n = wp.float32(size)
    return wp.int32(wp.ceil(wp.clamp(0.5 * n * (s + 1.0) - 0.51, 0.0, n)))


@wp.func
def last_texel(s: wp.float32, size: wp.int32) -> wp.int32:
    n = wp.float32(size)
    return wp.int32(wp.floor(wp.clamp(0.5 * n * (s + 1.0) - 0.49, -1.0, n - 1.0)))


@wp.func
def cover(m: LightMap, face: wp.int32, size: wp.int32, corners: Corners) -> Cover:
    """The texels of a face that a triangle may cover; x1 < x0 where there are none."""
    found = Cover()
    found.x0 = 0
    found.x1 = -1
    a4 = map_point(m, face, corners.a)
    b4 = map_point(m, face, corners.b)
    c4 = map_point(m, face, corners.c)
    a = wp.vec3f(a4[0], a4[1], a4[2])
    b = wp.vec3f(b4[0], b4[1], b4[2])
    c = wp.vec3f(c4[0], c4[1], c4[2])
    if a[0] <= 0.0 and b[0] <= 0.0 and c[0] <= 0.0:
        return found
    if (
        (a[1] > a[0] and b[1] > b[0] and c[1] > c[0])
        or (-a[1] > a[0] and -b[1] > b[0] and -c[1] > c[0])
        or (a[2] > a[0] and b[2] > b[0] and c[2] > c[0])
        or (-a[2] > a[0] and -b[2] > b[0] and -c[2] > c[0])
    ):
        return found
    found.x1 = size - 1
    found.y0 = 0
    found.y1 = size - 1
    if a[0] > 1.0e-4 * largest(a) and b[0] > 1.0e-4 * largest(b) and c[0] > 1.0e-4 * largest(c):
        x = wp.vec3f(a[1] / a[0], b[1] / b[0], c[1] / c[0])
        y = wp.vec3f(a[2] / a[0], b[2] / b[0], c[2] / c[0])
        found.x0 = first_texel(wp.min(x), size)
        found.x1 = last_texel(wp.max(x), size)
        found.y0 = first_texel(wp.min(y), size)
        found.y1 = last_texel(wp.max(y), size)
    if found.x1 < found.x0 or found.y1 < found.y0:
        return found
    ab = b - a
    bc = c - b
    ca = a - c
    found.n0 = wp.cross(b, bc)
    found.n1 = wp.cross(c, ca)
    found.n2 = wp.cross(a, ab)
    # Both sides of a shared edge take its texels, so that rounding leaves no crack.
    q = Corners(a, b, c)
    found.bound = 16.0 * U32 * largest_of(q) * longest_edge(q)
    if wp.dot(found.n0, a) < 0.0:
        found.n0 = -found.n0
        found.n1 = -found.n1
        found.n2 = -found.n2
    found.depth = wp.vec3f(a4[3], b4[3], c4[3])
    return found


@wp.func
def centre(texel: wp.int32, size: wp.int32) -> wp.float32:
    """Map coordinate of a texel's centre, -1..1."""
    return (2.0 * wp.float32(texel) + 1.0) / wp.float32(size) - 1.0


@wp.func
def opaque_there(alpha: Alpha, i: wp.int32, e: wp.vec3f) -> wp.bool:
    """Whether triangle i is opaque where its edge functions are e: one lookup in the bitmap, as in engines."""
    if alpha.masked[i] == wp.uint8(0):
        return True
    sum = wp.float64(e[0] + e[1] + e[2])
    return (texels_near(alpha, i, wp.float64(e[1]) / sum, wp.float64(e[2]) / sum, wp.float64(0.0)) & 1) != 0


@wp.func
def draw(found: Cover, i: wp.int32, x: wp.int32, sy: wp.float32, row: wp.int32, alpha: Alpha, depths: DepthMap):
    """Take a texel of a row, which begins at ``row`` of the map, if its centre lies in triangle i and that is opaque there.
    The depth is that of the plane.
    """
    d = wp.vec3f(1.0, centre(x, depths.size), sy)
    e = wp.vec3f(
        wp.dot(found.n0, d), wp.dot(found.n1, d), wp.dot(found.n2, d)
    )  # weights of the corners, but for their sum
    drawn = wp.bool(True)
    if wp.static(effects.alpha):
        drawn = opaque_there(alpha, i, e)
    sum = e[0] + e[1] + e[2]
    if not drawn or wp.min(e) < -found.bound or not sum > 0.0:
        return
    t = found.depth
    depth = (e[0] * t[0] + e[1] * t[1] + e[2] * t[2]) / sum
    depth = wp.clamp(depth, wp.min(t), wp.max(t))
    word = wp.cast(wp.clamp(depth, 0.0, 1.0), wp.int32)
    if word < depths.texels[row + x]:
        wp.atomic_min(depths.texels, row + x, word)


@wp.func
def row_span(found: Cover, size: wp.int32, sy: wp.float32) -> wp.vec2i:
    """First and last texel of a row that the edge planes leave, with a margin of one texel on either side."""
    first = found.x0
    last = found.x1
    for k in range(3):
        n = found.n0
        if k == 1:
            n = found.n1
        if k == 2:
            n = found.n2
        rest = n[0] + n[2] * sy + 2.0 * found.bound
        if wp.abs(n[1]) > 1.0e-6 * wp.abs(rest):
            if n[1] > 0.0:
                first = wp.max(first, first_texel(-rest / n[1], size) - 1)
            else:
                last = wp.min(last, last_texel(-rest / n[1], size) + 1)
        elif rest < 0.0:
            last = -1
    return wp.vec2i(first, last)


@wp.kernel(enable_backward=False, grid_stride=False)
def raster_kernel(
    triangle_count: wp.int32,
    queued: wp.bool,
    mesh: Mesh,
    alpha: Alpha,
    depths: DepthMap,
    counts: wp.array(dtype=wp.int32),
    strips: wp.array(dtype=wp.vec4i),
):
    """One thread per triangle and face. Large triangles are queued in strips of rows where ``queued``."""
    k = wp.tid()
    face = k // triangle_count
    i = k - face * triangle_count
    m = depths.light[0]
    size = depths.size
    if face >= wp.min(depths.faces, m.faces) or mesh.valid[i] == wp.uint8(0):
        return
    found = cover(m, face, size, corners_of(mesh, i))
    if found.x1 < found.x0 or found.y1 < found.y0:
        return
    area = wp.int64(found.x1 - found.x0 + 1) * wp.int64(found.y1 - found.y0 + 1)
    if queued and area > wp.int64(INLINE_TEXELS):
        number = (found.y1 - found.y0) // STRIP_ROWS + 1
        at = reserve(counts, STRIPS, number)
        for j in range(number):
            if at + j < strips.shape[0]:
                y0 = found.y0 + j * STRIP_ROWS
                strips[at + j] = wp.vec4i(i, face, y0, wp.min(y0 + STRIP_ROWS - 1, found.y1))
        return
    for y in range(found.y0, found.y1 + 1):
        sy = centre(y, size)
        ends = wp.vec2i(found.x0, found.x1)
        if found.x1 - found.x0 > 4:
            ends = row_span(found, size, sy)
        for x in range(ends[0], ends[1] + 1):
            draw(found, i, x, sy, (face * size + y) * size, alpha, depths)


@wp.kernel(enable_backward=False, grid_stride=False)
def strip_kernel(
    threads: wp.int32,
    slot: wp.int32,
    mesh: Mesh,
    alpha: Alpha,
    depths: DepthMap,
    counts: wp.array(dtype=wp.int32),
    strips: wp.array(dtype=wp.vec4i),
    needs: wp.array(dtype=wp.int64),
):
    """Queued strips: 64 threads each, 32 along a row and two rows at a time. ``needs[slot]``: what the queue needed."""
    k = wp.tid()
    stop = wp.min(counts[STRIPS], strips.shape[0])
    if k == 0:
        needs[slot] = wp.int64(counts[STRIPS])
    dx = k % 32
    dy = (k % 64) // 32
    item = k // 64
    m = depths.light[0]
    size = depths.size
    while item < stop:
        strip = strips[item]
        item += threads // 64
        face = strip[1]
        found = cover(m, face, size, corners_of(mesh, strip[0]))
        y = strip[2] + dy
        while y <= strip[3]:
            sy = centre(y, size)
            ends = row_span(found, size, sy)
            x = ends[0] + dx
            while x <= ends[1]:
                draw(found, strip[0], x, sy, (face * size + y) * size, alpha, depths)
                x += 32
            y += 2
