"""The lights of a frame as their rays and triangles see them: the cubes, aimed at the middle of the scene, and their
arrays."""

from typing import Any

import warp as wp

from ....harness.frame.frame import Frame
from ....harness.frame.geometry import filled
from ...gpu.entries import entry, entry_of_four, set_entry_of_four
from .faces import FACES
from .rectangle import RECTANGLE_WORDS


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


@wp.struct
class Light:
    """A light: its number, and the arrays of all lights in which it has a row.

    index     its number                       position  vec3f [lights]
    proxy     vec3f [lights]: from where its rays and its triangles' cells are found (:func:`.aim.nearer_proxy`)
    axes      mat33d [lights]: of its cube     cube      vec4f [lights, 4]: for triangles (:func:`set_cube`)
    spot      float64 [lights, 12] (:mod:`.....harness.judge.receivers`)
    cone      vec4f [lights]: axis and cosine of its cone, rounded (:func:`.aim.cone_of`)
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
    return cube_of(light.cube, light.index)


class Lights:
    """What is known of all lights of a frame before their passes.

    Per light: proxy, axes, cube, cone (:class:`Light`), rectangle int32 [12] (:mod:`.aim`), table vec4f [7]
    (:mod:`.rectangle`).
    """

    def __init__(self, frame: Frame, number: int):
        faces = int(FACES)
        self.frame = frame
        with wp.ScopedDevice(frame.device):
            self.proxy = wp.zeros(number, dtype=wp.vec3f)
            self.axes = wp.zeros(number, dtype=wp.mat33d)
            self.cube = wp.zeros((number, 4), dtype=wp.vec4f)
            self.cone = wp.zeros(number, dtype=wp.vec4f)
            self.rectangle = wp.zeros((number, int(RECTANGLE_WORDS)), dtype=wp.int32)
            self.table = wp.zeros((number, faces + 1), dtype=wp.vec4f)

    def light(self, index: int) -> Any:
        """The :class:`Light` of a number. Which triangles face it must have been planned."""
        frame = self.frame
        return filled(
            Light, index=index, position=frame.lights, proxy=self.proxy, axes=self.axes, cube=self.cube, cone=self.cone,
            spot=frame.spots, front_facing=frame.front_facing,
        )  # fmt: skip
