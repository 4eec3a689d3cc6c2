"""P32, P33, S32, S33: cases found by random search on methods with one rounding margin (pad) removed.

Each has a few triangles with small dyadic coordinates. Rays meet their borders exactly, in a tile of one pixel or in one
cell. No other case depends on these pads. With default settings the cases are easy; tests run them with the settings for
which the pad decides.
"""

from typing import Any

import numpy as np

from ..scene.prepared import prepare
from ..scene.scene import Camera, Geometry, Light, Scene
from .case import Trial, hard


# A triangle met at a corner and along its edges; it touches tiles of one pixel only at their border.
@hard(
    "P32", "a triangle on the borders of tiles", "tile bounds without padding",
    points=[(1.3177083730697632, 2.625, 0.468505859375), (1.2065972089767456, 1.625, 0.1907280832529068),
            (2.3177082538604736, 3.625, -0.5870497226715088)],
    faces=[(0, 2, 1)], camera=Camera((0.984375, -0.375, 0.968505859375), (0.984375, 0.625, 0.968505859375), (0, 0, 1),
                                     28.072486935852957),
    light=Light((0.8732638955116272, 0.625, 1.0240614414215088)), size=(9, 9),
)  # fmt: skip
# A triangle with an edge in the face of its bounding box, where rays enter the grid; many cells.
@hard(
    "P33", "a triangle in the face of its box", "cell bounds without padding",
    points=[(-0.0263671875, 0.000972747802734375, -0.01416015625), (-0.0263671875, 0.000972747802734375, -0.01806640625),
            (-0.0732421875, -0.013187408447265625, -0.0283203125)],
    faces=[(0, 1, 2)], camera=Camera((-0.0107421875, 0.000484466552734375, -0.0146484375),
                                     (-0.0263671875, 0.000484466552734375, -0.0146484375), (0, 1, 0), 53.13010235415598),
    light=Light((262112.0, -393088.0, -130992.0)), size=(8, 16),
)  # fmt: skip
# A directional light and two triangles with a common vertex: float32 rounds the rays to outside their bounds.
@hard(
    "S32", "directional light along edges", "light-tile bounds without padding",
    points=[(-0.102294921875, -0.096923828125, -0.078125), (-0.121826171875, -0.112548828125, -0.19921875),
            (-0.125732421875, -0.065673828125, -0.1171875), (-0.063232421875, -0.065673828125, -0.1796875),
            (-0.266357421875, -0.128173828125, -0.3515625)],
    faces=[(0, 2, 1), (1, 4, 3)],
    camera=Camera((0.014892578125, -0.003173828125, -0.0078125), (0.014892578125, -0.018798828125, -0.0078125), (0, 0, 1),
                  126.86989764584402),
    light=Light((-0.005855560302734375, -0.009761810302734375, -0.09179306030273438), directional=True), size=(8, 8),
)  # fmt: skip
# A distant light whose rays to three triangles differ by less than float32 can resolve.
@hard(
    "S33", "rays of a far light that float32 cannot tell apart", "bounds without padding",
    points=[(-1.749755859375, -1.249755859375, -7.75), (-1.749755859375, -1.249755859375, -6.25),
            (0.249755859375, -1.249755859375, -7.75), (0.249755859375, -1.249755859375, -6.25),
            (0.249755859375, -2.0, -6.25)],
    faces=[(1, 3, 4), (0, 3, 1), (0, 2, 3)],
    camera=Camera((0.125, 0.0, -0.625244140625), (0.125, 0.0, -1.625244140625), (1, 0, 0), 28.072486935852957),
    light=Light((2096128.0, 3146496.0, -4194560.0)), size=(13, 10),
)  # fmt: skip
def found(points: Any, faces: Any, camera: Camera, light: Light, size: tuple[int, int]) -> Trial:
    geometry = Geometry.static(np.array(points), np.array(faces))
    prepared = prepare(Scene("found", "Found", lambda: geometry, camera, (light,)))
    return Trial(prepared, prepared.moment(0, *size))
