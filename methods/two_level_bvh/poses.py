"""Where bodies are in a frame: the maps that take rays to them, how far their vertices are from there, and their boxes.

The truth of a frame is its float32 mesh. A body's map (:mod:`..trees.trace.bodies`) is found from three of its vertices,
now and when its tree was made: axes through both triples give the rotation in float64, and the point between the first two
the translation, for the rotation as float32 holds it. Whatever the map, it takes each vertex to within some distance of
where that was when the tree was made. That distance, found in float64 for all of them (to 2^-50 of the largest coordinate,
which :data:`..trees.trace.bodies.RAY_UNITS` has room for), is what boxes must be padded by besides the rounding of rays.

In a rigid motion it is a few roundings of the mesh. The three vertices are as far apart as they come, so that an error of
their places moves no other vertex by more than a few times as much.
"""

import warp as wp

from ...harness.frame.geometry import value_struct
from ...harness.frame.vectors import to_float64
from ..gpu.entries import entry, set_entry
from ..trees.builders.scene_box import write_box
from ..trees.native import BASICS
from ..trees.nodes import LARGEST
from ..trees.trace.bodies import MOST_RAY_UNITS, RAY_UNITS

RIGID = 1024.0
"""Most units of u Q (:mod:`..trees.trace.bodies`) that a vertex of a rigid body is off by, 5e-4 of the scene: with more its
triangles do not move together, and boxes so wide would be of no use.
"""

U = wp.constant(wp.float64(2.0**-24))
WORDS = wp.constant(7)
MOST = 0x7FFFFFFF
"""A word that nothing was lowered to."""

MOST_UNITS = wp.constant(wp.float64(2.0**30))
USUAL, UNUSUAL = wp.constant(wp.float64(RAY_UNITS)), wp.constant(wp.float64(MOST_RAY_UNITS))


@value_struct
class Axes:
    """Three perpendicular axes of length 1."""

    x: wp.vec3d
    y: wp.vec3d
    z: wp.vec3d


@wp.func
def axes_of(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d) -> Axes:
    """x from a to b, y towards c from there; some where the points do not tell."""
    one = wp.float64(1.0)
    none = wp.float64(0.0)
    x = b - a
    if wp.length_sq(x) == none:
        x = wp.vec3d(one, none, none)
    x = x / wp.length(x)
    z = wp.cross(x, c - a)
    if wp.length_sq(z) == none:
        z = wp.cross(x, wp.where(wp.abs(x[0]) < wp.float64(0.6), wp.vec3d(one, none, none), wp.vec3d(none, one, none)))
    z = z / wp.length(z)
    return Axes(x, wp.cross(z, x), z)


@wp.func
def corner(points: wp.array[wp.vec3f], vertex: wp.int32) -> wp.vec3d:
    return to_float64(entry(points, vertex))


@wp.kernel(enable_backward=False, grid_stride=False)
def pose_kernel(
    references: wp.array[wp.vec3i],
    rest: wp.array[wp.vec3f],
    points: wp.array[wp.vec3f],
    max_coordinate: wp.array[wp.float32],
    bodies: wp.array[wp.vec4f],
    need: wp.array[wp.int32],
):
    """One thread per body: the rows of (R, s). ``need``: cleared."""
    body = wp.tid()
    if body == 0:
        need[0] = 0
        need[1] = 0
    of = references[body]
    a = corner(points, of[0])
    b = corner(points, of[1])
    c = corner(points, of[2])
    p = corner(rest, of[0])
    q = corner(rest, of[1])
    r = corner(rest, of[2])
    if a == p and b == q and c == r:  # rays stay as they are
        bodies[4 * body] = wp.vec4f(1.0, 0.0, 0.0, 0.0)
        bodies[4 * body + 1] = wp.vec4f(0.0, 1.0, 0.0, 0.0)
        bodies[4 * body + 2] = wp.vec4f(0.0, 0.0, 1.0, 0.0)
        return
    now = axes_of(a, b, c)
    then = axes_of(p, q, r)
    half = wp.float64(0.5)
    place = half * a + half * b
    for i in range(3):
        row = then.x[i] * now.x + then.y[i] * now.y + then.z[i] * now.z
        x = wp.float32(row[0])
        y = wp.float32(row[1])
        z = wp.float32(row[2])
        s = half * p[i] + half * q[i] - wp.dot(to_float64(wp.vec3f(x, y, z)), place)
        shift = wp.float32(s)
        if max_coordinate[0] >= LARGEST:
            shift = wp.NAN  # a ray could overflow on its way there
        bodies[4 * body + i] = wp.vec4f(x, y, z, shift)


@wp.func
def moved(bodies: wp.array[wp.vec4f], row: wp.int32, p: wp.vec3f) -> wp.float64:
    """A coordinate of where a body's map takes a point."""
    r = entry(bodies, row)
    return wp.dot(wp.vec3d(wp.float64(r[0]), wp.float64(r[1]), wp.float64(r[2])), to_float64(p)) + wp.float64(r[3])


@wp.func_native(
    BASICS
    + f"constexpr int WORDS = {WORDS};"
    + """
const float least[WORDS] = {lower[0], lower[1], lower[2], -upper[0], -upper[1], -upper[2], -off};
for (int k = 0; k < WORDS; k++) {
    int own = ordered((int)bits(least[k])), *at = found.data + WORDS * body + k;
#if defined(__CUDA_ARCH__)
    for (int step = 16; step > 0; step >>= 1) own = min(own, __shfl_xor_sync(0xffffffffu, own, step));
    if ((threadIdx.x & 31) == 0) atomicMin(at, own);
#else
    if (own < *at) *at = own;
#endif
}
"""
)
def lower_to(lower: wp.vec3f, upper: wp.vec3f, off: wp.float32, body: wp.int32, found: wp.array[wp.int32]):
    """Lower a body's words, integers in the order of floats, to these: by all lanes of a warp, on a CPU by one."""


@wp.func_native(
    BASICS
    + """
float value = real((unsigned int)ordered(found.data[at]));
found.data[at] = 0x7fffffff;
return value;
"""
)
def taken(found: wp.array[wp.int32], at: wp.int32) -> wp.float32:
    """What a word was lowered to, as a float, not a number where nothing did; the word is as at first."""


@wp.kernel(enable_backward=False, grid_stride=False)
def vertex_kernel(
    chunks: wp.array[wp.vec3i],
    lanes: wp.int32,
    vertices: wp.array[wp.int32],
    rest: wp.array[wp.vec3f],
    points: wp.array[wp.vec3f],
    bodies: wp.array[wp.vec4f],
    found: wp.array[wp.int32],
):
    """``lanes`` threads per chunk (a body, the first of its ``vertices`` and the end): lowers the words of the body.

    found  int32 [bodies, 7]: low corner and negated high corner of its finite vertices, and the largest distance along an
           axis that its map leaves one off by, negated; infinite for one that was not finite when the tree was made
    """
    thread = wp.tid()
    chunk = entry(chunks, thread // lanes)
    body = chunk[0]
    lower = wp.vec3f(wp.INF, wp.INF, wp.INF)
    upper = wp.vec3f(-wp.INF, -wp.INF, -wp.INF)
    off = wp.float32(0.0)
    k = chunk[1] + thread % lanes
    while k < chunk[2]:
        vertex = entry(vertices, k)
        p = entry(points, vertex)
        if wp.isfinite(p):
            lower = wp.min(lower, p)
            upper = wp.max(upper, p)
            was = corner(rest, vertex)
            for i in range(3):
                # Rounded to float32, and up by more than that.
                away = wp.float32(wp.abs(moved(bodies, 4 * body + i, p) - was[i])) * 1.000001
                if not (away <= off):
                    off = wp.where(away < wp.INF, away, wp.INF)
        k += lanes
    lower_to(lower, upper, off, body, found)


@wp.kernel(enable_backward=False, grid_stride=False)
def body_kernel(
    count: wp.int32,
    threads: wp.int32,
    unit: wp.float64,
    least: wp.float32,
    max_coordinate: wp.array[wp.float32],
    found: wp.array[wp.int32],
    corners: wp.array[wp.vec3f],
    valid: wp.array[wp.uint8],
    need: wp.array[wp.int32],
    lowered: wp.array[wp.int32],
    box: wp.array[wp.float32],
    extent: wp.array[wp.float32],
    cleared: wp.array[wp.int32],
):
    """The bodies' boxes as triangles of their two ``corners``; the box of all; and ``cleared`` is filled with zeros. Whole
    blocks.

    need  int32 [2]: the padding that boxes of bodies need, in ``unit``, and units of u Q that a vertex is off by, at most
    """
    body = wp.tid()
    word = body
    while word < cleared.shape[0]:
        cleared[word] = 0
        word += threads
    lower = wp.vec3f(wp.INF, wp.INF, wp.INF)
    upper = wp.vec3f(-wp.INF, -wp.INF, -wp.INF)
    q = U * wp.float64(wp.max(max_coordinate[0], least))
    rays = wp.where(max_coordinate[0] < LARGEST, USUAL, UNUSUAL) * q
    while body < count:
        at = WORDS * body
        low = wp.vec3f(taken(found, at), taken(found, at + 1), taken(found, at + 2))
        high = wp.vec3f(-taken(found, at + 3), -taken(found, at + 4), -taken(found, at + 5))
        off = -wp.float64(taken(found, at + 6))
        some = wp.isfinite(low)
        set_entry(valid, body, wp.uint8(some))
        if some:
            set_entry(corners, 2 * body, low)
            set_entry(corners, 2 * body + 1, high)
            lower = wp.min(lower, low)
            upper = wp.max(upper, high)
            wp.atomic_max(need, 0, wp.int32(wp.min((rays + off) / unit, MOST_UNITS)) + 1)
            wp.atomic_max(need, 1, wp.int32(wp.min(off / q, MOST_UNITS)))
        body += threads
    write_box(lower, upper, lowered, box, extent)
