"""The same cases at other scales, far from the origin, and with lights at other distances.

With scales and offsets that are not powers of two the mesh is rounded again; the referee judges on the rounded mesh.
"""

import numpy as np

from .case import Trial, hard, rows, view
from .shapes import Mesh, ball, joined, pixel_centres, quad, sheet, soup

SCALES = (1e-6, 1e-3, 2.0**-20, 1e3, 1e6)
OFFSETS = (1.0, 1e3, 1e5)
PLACES = rows(
    "place where breaks scale offset", *((f"x{x:.3g}", f"scale {x:.3g}", "absolute epsilons", x, 0.0) for x in SCALES),
    *((f"+{x:g}", f"{x:g} scene sizes from the origin", "no recentring", 1.0, x) for x in OFFSETS),
    ("x1e-6 +1e5", "small and far off", "both at once", 1e-6, 1e5),
)  # fmt: skip


def ball_on_floor() -> Mesh:
    floor = quad((-3, 0, -3), (3, 0, -3), (3, 0, 3), (-3, 0, 3))
    return joined(floor, ball(0.5, (0, 0.6, 0)))


@hard("V ball {place}", "ball on a floor, {where}", "{breaks}", PLACES)
def small_scene(scale: float, offset: float) -> Trial:
    """A ball on a floor; ``offset`` in scene sizes, not along an axis."""
    place = np.array([0.8, -0.5, 0.33]) * offset * 6 * scale
    return view(
        ball_on_floor(), [(1, 2.5, 0.5), (-0.4, 0.1, 0.7)], (0.3, 1.7, 3.1), (-0.1, -0.45, -1), 0.5,
        scale=scale, offset=place,
    )  # fmt: skip


@hard("V soup {place}", "soup, {where}", "{breaks}", PLACES)
def soup_scene(scale: float, offset: float) -> Trial:
    """A triangle soup of mixed sizes with a light inside."""
    place = np.array([-0.3, 0.9, 0.7]) * offset * 3 * scale
    return view(soup(77, 80), [(0.3, 0.4, 0.2), (4, 5, 6)], (0.3, 0.2, 3), (0, 0, -1), 0.5, scale=scale, offset=place)


@hard("V sheet {place}", "rays through vertices, {where}", "{breaks}", PLACES)
def vertex_sheet(scale: float, offset: float) -> Trial:
    """Rays through vertices and edges of a bumpy sheet: exactly so at the scales that are powers of two."""
    x = pixel_centres(16)[::2]
    depth = 1 + np.random.default_rng(9).integers(0, 16, (len(x), len(x))) / 16
    place = np.array([0.6, 0.1, -0.9]) * offset * 4 * scale
    return view(
        sheet(x, x, depth), [(0.25, 0.125, 0.5), (0, 0, -4)], (0, 0, 0), (0, 0, -1), 1.0, scale=scale, offset=place
    )


@hard(
    "V light {radii:g} {where}", "light {radii:g} radii from the {where}", "offsets near, rounding of v - L far",
    rows("radii", 1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6, 1e7), rows("where inside", ("ball", True), ("floor", False)),
)  # fmt: skip
def light_distance(radii: float, inside: bool) -> Trial:
    """A light ``radii`` scene radii from a point on top of the ball, or from the middle of the floor's edge."""
    direction = np.array([0.36, 0.8, 0.48])
    start = np.array([0, 1.1, 0]) if inside else np.array([2.0, 0.0, 1.0])
    x, y, z = (start + direction * radii * 4.3).tolist()
    return view(ball_on_floor(), [(x, y, z)], (0.3, 1.7, 3.1), (-0.1, -0.45, -1), 0.5)
