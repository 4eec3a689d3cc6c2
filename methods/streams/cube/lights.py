"""The lights of a frame as their rays and triangles see them: the cube around each, aimed at the middle of the scene.

A light outside the scene then sees everything through face 0, whose rectangle is clamped to the rays; the other faces are
whole. Light space is float64, so that the rays of a light at 1e7 scene radii are still spread over all cells.
"""

from typing import Any

import warp as wp

from ....harness.frame.frame import Frame
from ....harness.frame.geometry import Mesh, filled
from ....harness.scene import spotlight
from ...common.axes import axes_along, brought_nearer
from ...exact.triangle import largest, to_float32, to_float64
from ...gpu.entries import entry, entry_of_four, set_entry_of_four
from ...gpu.warps import least_of_lanes
from .cells import FACES
from .rectangle import EMPTY, LARGEST, RANGE, RECTANGLE_WORDS

SAMPLES = wp.constant(16)
"""Number of triangles from which the middle of the scene is computed."""

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
def turned(v: wp.vec3f, cube: Cube) -> wp.vec3f:
    return wp.vec3f(wp.dot(cube.forward, v), wp.dot(cube.right, v), wp.dot(cube.up, v))


@wp.func
def set_cube(cubes: wp.array2d(dtype=wp.vec4f), light: wp.int32, c: Cube):
    """Store a light's cube in four words, which take four instructions to load and not thirteen."""
    set_entry_of_four(cubes, light, 0, wp.vec4f(c.forward[0], c.forward[1], c.forward[2], c.distance))
    set_entry_of_four(cubes, light, 1, wp.vec4f(c.right[0], c.right[1], c.right[2], c.middle[0]))
    set_entry_of_four(cubes, light, 2, wp.vec4f(c.up[0], c.up[1], c.up[2], c.middle[1]))
    set_entry_of_four(cubes, light, 3, wp.vec4f(c.middle[2], 0.0, 0.0, 0.0))


@wp.struct
class Light:
    """A light: its number, and the arrays of all lights in which it has a row.

    index     its number                       position  vec3f [lights]
    proxy     vec3f [lights]: from where its rays and its triangles' cells are found (:func:`nearer_proxy`)
    axes      mat33d [lights]: of its cube     cube      vec4f [lights, 4]: for triangles (:func:`set_cube`)
    spot      float64 [lights, 12] (:mod:`.....harness.judge.receivers`)
    cone      vec4f [lights]: axis and cosine of its cone, rounded (:func:`cone_of`)
    front_facing  uint8 [lights, triangles]: 1 = may face it; or empty (:class:`.....harness.frame.frame.Frame`)
    """

    index: wp.int32
    position: wp.array(dtype=wp.vec3f)
    proxy: wp.array(dtype=wp.vec3f)
    axes: wp.array(dtype=wp.mat33d)
    cube: wp.array2d(dtype=wp.vec4f)
    spot: wp.array2d(dtype=wp.float64)
    cone: wp.array(dtype=wp.vec4f)
    front_facing: wp.array2d(dtype=wp.uint8)


@wp.struct
class Aim:
    """From where the rays of a light are placed, and the axes of its cube."""

    proxy: wp.vec3f
    axes: wp.mat33d


@wp.func
def position_of(light: Light) -> wp.vec3f:
    return entry(light.position, light.index)


@wp.func
def aim_of(light: Light) -> Aim:
    aim = Aim()
    aim.proxy = entry(light.proxy, light.index)
    aim.axes = entry(light.axes, light.index)
    return aim


@wp.func
def cube_of_light(light: Light) -> Cube:
    """The cube that :func:`set_cube` stored."""
    a = entry_of_four(light.cube, light.index, 0)
    b = entry_of_four(light.cube, light.index, 1)
    c = entry_of_four(light.cube, light.index, 2)
    d = entry_of_four(light.cube, light.index, 3)
    cube = Cube()
    cube.forward = wp.vec3f(a[0], a[1], a[2])
    cube.right = wp.vec3f(b[0], b[1], b[2])
    cube.up = wp.vec3f(c[0], c[1], c[2])
    cube.middle = wp.vec3f(b[3], c[3], d[0])
    cube.distance = a[3]
    return cube


@wp.func
def cone_of(light: Light) -> wp.vec4f:
    """Axis and cosine of a light's cone, rounded; zeros if the light has none."""
    cone = wp.vec4f()
    if light.spot[light.index, 0] == CONE:
        for k in range(3):
            cone[k] = wp.float32(light.spot[light.index, 1 + k])
        cone[3] = wp.float32(light.spot[light.index, 10])
    return cone


@wp.func
def nearer_proxy(position: wp.vec3f, max_coordinate: wp.float32) -> wp.vec3f:
    """The position from which rays and triangles are placed: the light's, or a point towards it at :data:`FARTHEST` times
    ``max_coordinate``. Seen from there, rays that end at the light turn by 2^-28 of their angle to the axis, far less
    than the rounding of float32.

    From farther away float64 would not distinguish the rays, and finally float32 could not represent their angles.
    """
    return brought_nearer(position, FARTHEST * max_coordinate)


@wp.kernel(enable_backward=False, grid_stride=False)
def aim_kernel(
    threads: wp.int32,
    triangle_count: wp.int32,
    max_coordinate: wp.array(dtype=wp.float32),
    proxies: wp.array(dtype=wp.vec3f),
    mesh: Mesh,
    light: Light,
    rectangle: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
    density: wp.array(dtype=wp.float32),
):
    """The proxy of a light, from where its rays are placed, the axes of its cube as rows (forward, to the scene's middle,
    first), and its cone. Empties its rectangle, counters and ``density``. ``proxies``: of the frame, of all lights.

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
    proxy = nearer_proxy(proxies[light.index], max_coordinate[0])
    light.proxy[light.index] = proxy
    forward = to_float64(middle) - to_float64(proxy)
    far = largest(forward)
    if not (far > wp.float64(0.0)) or not (far < wp.float64(wp.INF)):
        forward = wp.vec3d(wp.float64(1.0), wp.float64(0.0), wp.float64(0.0))
        far = wp.float64(1.0)
    distance = wp.length(forward / far) * far
    axes = axes_along(wp.normalize(forward / far))
    light.axes[light.index] = axes
    c = Cube()
    c.forward = to_float32(axes[0])
    c.right = to_float32(axes[1])
    c.up = to_float32(axes[2])
    c.middle = middle
    c.distance = wp.float32(distance)
    if middle == proxy:
        c.distance = 0.0
    set_cube(light.cube, light.index, c)
    light.cone[light.index] = cone_of(light)
    for k in range(LARGEST):
        rectangle[k] = EMPTY
    rectangle[LARGEST] = 0
    # No point of the scene is farther from the middle than that.
    extent = 1.75 * max_coordinate[0] + wp.length(middle)
    covered = wp.float32(1.0)
    if c.distance > 2.0 * extent:
        covered = wp.max(extent / (c.distance - extent), 1.0e-30)
    rectangle[RANGE] = wp.cast(covered, wp.int32)


class Lights:
    """What is known of all lights of a frame before their passes: of each, fields of :class:`Light`, and its rectangle int32
    [12] and table vec4f [7] (:mod:`.rectangle`).
    """

    def __init__(self, frame: Frame, number: int):
        self.frame = frame
        with wp.ScopedDevice(frame.device):
            self.proxy = wp.zeros(number, dtype=wp.vec3f)
            self.axes = wp.zeros(number, dtype=wp.mat33d)
            self.cube = wp.zeros((number, 4), dtype=wp.vec4f)
            self.cone = wp.zeros(number, dtype=wp.vec4f)
            self.rectangle = wp.zeros((number, int(RECTANGLE_WORDS)), dtype=wp.int32)
            self.table = wp.zeros((number, int(FACES) + 1), dtype=wp.vec4f)

    def light(self, index: int) -> Any:
        """The :class:`Light` of a number. Which triangles face it must have been planned."""
        frame = self.frame
        return filled(
            Light, index=index, position=frame.lights, proxy=self.proxy, axes=self.axes, cube=self.cube, cone=self.cone,
            spot=frame.spots, front_facing=frame.front_facing,
        )  # fmt: skip
