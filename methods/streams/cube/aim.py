"""A cube around the light, and where it is aimed: at the middle of the scene.

A light outside the scene then sees everything through face 0, whose rectangle is clamped to the rays; the other faces are
whole. Light space is float64, so that the rays of a light at 1e7 scene radii are still spread over all cells.
"""

from __future__ import annotations

import warp as wp

from ....harness.frame.geometry import Mesh
from ....harness.scene import spotlight
from ...common.axes import axes_along, brought_nearer
from ...exact.triangle import largest, to_float32, to_float64
from ...gpu.entries import entry_of_four, set_entry_of_four
from ...gpu.warps import least_of_lanes

FACES = wp.constant(6)

SAMPLES = wp.constant(16)
"""Number of triangles from which the middle of the scene is computed."""

LOW_U, LOW_V, HIGH_U, HIGH_V = wp.constant(0), wp.constant(1), wp.constant(2), wp.constant(3)
"""A light's rectangle is int32 [:data:`RECTANGLE_WORDS`]. Its first words are the sides of what the rays cover of face
0, :func:`ordered`: the least u and v, and the least -u and -v. Without a ray they are :data:`EMPTY`."""

FACE = wp.constant(4)
"""From this word on, one for each face: 0 where rays lie on it, else :data:`EMPTY`."""

LARGEST = wp.constant(10)
"""After the faces: bits of the largest coordinate of a hit point, as float32; 0 without a ray."""

RANGE = wp.constant(11)
"""Last: a bound on the magnitude of u and v of what the scene covers of face 0, as float32; at most 1."""

RECTANGLE_WORDS = wp.constant(12)

EMPTY = wp.constant(2147483647)

FARTHEST = wp.constant(2.0**28)

CONE = wp.constant(wp.float64(spotlight.CONE))


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


@wp.func
def set_cube(cubes: wp.array2d(dtype=wp.vec4f), light: wp.int32, c: Cube):
    """Store a light's cube in four words, which take four instructions to load and not thirteen."""
    set_entry_of_four(cubes, light, 0, wp.vec4f(c.forward[0], c.forward[1], c.forward[2], c.distance))
    set_entry_of_four(cubes, light, 1, wp.vec4f(c.right[0], c.right[1], c.right[2], c.middle[0]))
    set_entry_of_four(cubes, light, 2, wp.vec4f(c.up[0], c.up[1], c.up[2], c.middle[1]))
    set_entry_of_four(cubes, light, 3, wp.vec4f(c.middle[2], 0.0, 0.0, 0.0))


@wp.func
def cube_of(cubes: wp.array2d(dtype=wp.vec4f), light: wp.int32) -> Cube:
    """The cube that :func:`set_cube` stored."""
    a = entry_of_four(cubes, light, 0)
    b = entry_of_four(cubes, light, 1)
    c = entry_of_four(cubes, light, 2)
    d = entry_of_four(cubes, light, 3)
    cube = Cube()
    cube.forward = wp.vec3f(a[0], a[1], a[2])
    cube.right = wp.vec3f(b[0], b[1], b[2])
    cube.up = wp.vec3f(c[0], c[1], c[2])
    cube.middle = wp.vec3f(b[3], c[3], d[0])
    cube.distance = a[3]
    return cube


@wp.func
def ordered(x: wp.float32) -> wp.int32:
    """An integer that is ordered as the floats are, so that atomics find the least."""
    bits = wp.cast(x, wp.int32)
    if bits < 0:
        bits = bits ^ 2147483647
    return bits


@wp.func
def from_ordered(bits: wp.int32) -> wp.float32:
    """The float of an integer made by :func:`ordered`."""
    word = bits
    if word < 0:
        word = word ^ 2147483647
    return wp.cast(word, wp.float32)


@wp.func
def cone_of(light: wp.int32, spots: wp.array2d(dtype=wp.float64)) -> wp.vec4f:
    """Axis and cosine of a light's cone, rounded; zeros if the light has none."""
    cone = wp.vec4f()
    if spots[light, 0] == CONE:
        for k in range(3):
            cone[k] = wp.float32(spots[light, 1 + k])
        cone[3] = wp.float32(spots[light, 10])
    return cone


@wp.func
def nearer_proxy(proxy: wp.vec3f, reach: wp.float32) -> wp.vec3f:
    """The position from which rays and triangles are placed: the light's, or a point towards it at :data:`FARTHEST` times
    ``reach``. Seen from there, rays that end at the light turn by 2^-28 of their angle to the axis, far less than the
    rounding of float32.

    From farther away float64 would not distinguish the rays, and finally float32 could not represent their angles.
    """
    return brought_nearer(proxy, FARTHEST * reach)


@wp.kernel(enable_backward=False, grid_stride=False)
def aim_kernel(
    threads: wp.int32,
    index: wp.int32,
    triangle_count: wp.int32,
    reach: wp.array(dtype=wp.float32),
    lights: wp.array(dtype=wp.vec3f),
    spots: wp.array2d(dtype=wp.float64),
    mesh: Mesh,
    proxy_positions: wp.array(dtype=wp.vec3f),
    frames: wp.array(dtype=wp.mat33d),
    cubes: wp.array2d(dtype=wp.vec4f),
    cones: wp.array(dtype=wp.vec4f),
    rectangles: wp.array2d(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
    density: wp.array(dtype=wp.float32),
):
    """The position from which a light's rays are placed and the axes of its cube as rows (forward, to the scene's middle,
    first); its cone. Empties its rectangle, counters and ``density``.

    The middle is that of a few triangles: any point among the triangles is suitable, and a box of all would cost a pass.
    The lanes of a warp read them at once (``threads`` is 32, or 1 on the CPU); the first does the rest.
    """
    low = wp.vec3f(wp.INF)
    high = wp.vec3f(-wp.INF)
    lane = wp.tid()
    for k in range(lane, counts.shape[0], threads):
        counts[k] = 0
    for k in range(lane, density.shape[0], threads):
        density[k] = 0.0
    for k in range(lane, SAMPLES, threads):
        i = wp.int32(wp.int64(triangle_count) * wp.int64(2 * k + 1) / wp.int64(2 * SAMPLES))
        if i < triangle_count:
            if mesh.valid[i] != wp.uint8(0):
                p = mesh.points[mesh.triangles[i][0]]
                low = wp.min(low, p)
                high = wp.max(high, p)
    low = wp.vec3f(least_of_lanes(low[0]), least_of_lanes(low[1]), least_of_lanes(low[2]))
    high = -wp.vec3f(least_of_lanes(-high[0]), least_of_lanes(-high[1]), least_of_lanes(-high[2]))
    if lane > 0:
        return
    middle = wp.vec3f(0.0)
    if low[0] < wp.INF:
        middle = 0.5 * low + 0.5 * high
    proxy = nearer_proxy(lights[index], reach[0])
    proxy_positions[index] = proxy
    forward = to_float64(middle) - to_float64(proxy)
    far = largest(forward)
    if not (far > wp.float64(0.0)) or not (far < wp.float64(wp.INF)):
        forward = wp.vec3d(wp.float64(1.0), wp.float64(0.0), wp.float64(0.0))
        far = wp.float64(1.0)
    distance = wp.length(forward / far) * far
    axes = axes_along(wp.normalize(forward / far))
    frames[index] = axes
    c = Cube()
    c.forward = to_float32(axes[0])
    c.right = to_float32(axes[1])
    c.up = to_float32(axes[2])
    c.middle = middle
    c.distance = wp.float32(distance)
    if middle == proxy:
        c.distance = 0.0
    set_cube(cubes, index, c)
    cones[index] = cone_of(index, spots)
    for k in range(LARGEST):
        rectangles[index, k] = EMPTY
    rectangles[index, LARGEST] = 0
    # No point of the scene is farther from the middle than that.
    extent = 1.75 * reach[0] + wp.length(middle)
    covered = wp.float32(1.0)
    if c.distance > 2.0 * extent:
        covered = wp.max(extent / (c.distance - extent), 1.0e-30)
    rectangles[index, RANGE] = wp.cast(covered, wp.int32)
