"""What is known of all lights before their passes: where they are aimed, and the arrays of that."""

from __future__ import annotations

import warp as wp

from ....harness.frame.frame import Frame
from . import aim as light_aim


class LightAims:
    """Cubes of all lights, aimed at the middle of the scene.

    Per light: proxy_positions vec3f, axes mat33d, cubes vec4f [4] (:func:`.aim.set_cube`), cones vec4f
    (:func:`.aim.cone_of`), rectangles int32 [12], tables vec4f [7].
    """

    def __init__(self, frame: Frame, lights: int):
        faces = int(light_aim.FACES)
        with wp.ScopedDevice(frame.device):
            self.proxy_positions = wp.zeros(lights, dtype=wp.vec3f)
            self.axes = wp.zeros(lights, dtype=wp.mat33d)
            self.cubes = wp.zeros((lights, 4), dtype=wp.vec4f)
            self.cones = wp.zeros(lights, dtype=wp.vec4f)
            self.rectangles = wp.zeros((lights, int(light_aim.RECTANGLE_WORDS)), dtype=wp.int32)
            self.tables = wp.zeros((lights, faces + 1), dtype=wp.vec4f)
