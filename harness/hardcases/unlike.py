"""P60, S60-S63, V axis: triangles far larger than the eye's distance, occluders at the very ends of a segment, spots whose
borders touch a contact of two surfaces, and axes of unlike scale.

An edge whose ends are 1e9 and more times as far away as what passes it is decided by digits that float64 does not have.
"""

from typing import Any

import numpy as np

from ..scene.light_paths import vector
from .case import LAMPS, Counts, Trial, hard, rows, spot_light, view
from .shapes import Mesh, ball_on_floor, joined, plane, quad, soup, triangles

EDGE, THIRD = np.array([3.0, 2.0, 1.0]), np.array([-5.0, 7.0, 2.0])
NORMAL = np.cross(EDGE, THIRD) / np.linalg.norm(np.cross(EDGE, THIRD))
ALONG = EDGE / np.linalg.norm(EDGE)
ASIDE = np.cross(EDGE, NORMAL) / np.linalg.norm(np.cross(EDGE, NORMAL))
WALL = plane(0, 0, 2)

POWERS = rows("power turn", (30, 0), (33, 1), (43, 2), (53, 0), (100, 1))
"""Of two: the sizes of triangles. From 33 on a strip is wider than what is excused, from 53 on it is the whole picture."""

DIGITS = "edges decided from corners far away"
DISTANCES = rows("distance turn", (4.0, 0), (1e3, 1), (1e6, 2))


def giant(power: int) -> Mesh:
    """A triangle one of whose edges passes exactly through 0."""
    return triangles(*(np.array([-EDGE, 2 * EDGE, THIRD]) * 2.0**power))


def strip(power: int) -> float:
    """Half the width of a picture that shows what float64 leaves open."""
    return float(np.clip(2.0 ** (power - 51), 1e-6, 0.3))


@hard("P60 {power}", "a triangle 2^{power} large, seen at its border", DIGITS, POWERS)
def giant_edge(power: int, **place: Any) -> Trial:
    """The border of a giant triangle, seen from a height of 1, in the middle of the picture."""
    eye, lights = NORMAL + 0.013 * ASIDE + 0.021 * EDGE, [2 * NORMAL + 0.1 * ASIDE, -NORMAL]
    towards = -NORMAL - 0.013 * ASIDE
    return view(giant(power), lights, eye, towards, strip(power), up=EDGE, stated=Counts(128), **place)


@hard("S60 {power}", "the shadow of a triangle 2^{power} large", DIGITS, POWERS)
def giant_shadow(power: int, **place: Any) -> Trial:
    """The border of its shadow on a square below it."""
    square = quad(*(-NORMAL + a * ASIDE + b * ALONG for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))))
    eye, border = -2.5 * NORMAL + 0.3 * ASIDE + 0.1 * ALONG, -NORMAL - 0.2 / 1.3 * ASIDE
    mesh, light = joined(giant(power), square), 1.3 * NORMAL + 0.2 * ASIDE
    return view(mesh, [light], eye, border - eye, strip(power), up=ALONG, stated=Counts(256), **place)


@hard(
    "S61 {distance:g} {share:g}", "an occluder {share:g} of the way before a light at {distance:g}",
    "a surface near the light taken for one at the light", DISTANCES, rows("share", 1e-6, 1e-10, 1e-14),
)  # fmt: skip
def before_the_light(distance: float, share: float, **place: Any) -> Trial:
    """Light that grazes a long triangle and meets it within ``share`` of its way before the light."""
    long = triangles((0.5, 0, share), (2 * distance, distance / 1e3, share), (2 * distance, -distance / 1e3, share))
    mesh, stated = joined(WALL, long), Counts(256, (256,))
    return view(mesh, [(distance, 0, 0)], (-3, 0, 1), (1, 0, 0), 0.125, stated=stated, **place)


@hard(
    "S62 {distance:g} {gap:g}", "an occluder {gap:g} above the hit point, a light at {distance:g}",
    "a surface near the hit point taken for its own", DISTANCES, rows("gap", 1e-6, 1e-9, 1e-12),
)  # fmt: skip
def before_the_hit(distance: float, gap: float, **place: Any) -> Trial:
    """A sheet so close above a wall: the smallest gap that is promised is 2e-13 of the coordinates."""
    mesh, stated = joined(WALL, triangles((gap, -8, -6), (gap, 8, -6), (gap, 0, 9))), Counts(256, (256,))
    light = (distance, distance / 4, distance / 8)
    return view(mesh, [light], (-3, 0, 0.25), (1, 0, 0), 0.125, stated=stated, **place)


@hard(
    "S63 {number}", "spots whose borders touch a contact of two surfaces",
    "rounding of the hit point decides on which side of a spot's border it is",
    rows("number tilted turn", (0, False, 0), (1, True, 1), (2, True, 2), (3, True, 0)),
)  # fmt: skip
def spots_at_a_contact(tilted: bool, **place: Any) -> Trial:
    """A wall stands on a floor, on which there are spots that light what is above it: every hit of the floor is on their
    border, where rounding of the hit point decides whether it has a shadow ray. A rectangle and a cone of another light
    touch the line of the contact. A plate through the floor shadows both."""
    axes = np.array([(2, -1, 2), (2, 2, -1), (-1, 2, 2)] if tilted else np.eye(3))

    def placed(*p: float) -> tuple[float, float, float]:
        return vector(axes @ p)

    over, above, below, up = placed(0, 0, 1), placed(0.625, -0.25, 0), placed(0, 0, -1), placed(0, 1, 0)
    spots = [spot_light(over, below, 45.0, rise, up) for rise in (60.0, None)]
    spots += [spot_light(above, over, 90.0, rise, up) for rise in (None, 90.0)]
    plate = quad((0.5, -0.125, -1), (0.75, -0.125, -1), (0.75, 0.125, 1), (0.5, 0.125, 1))
    points, faces = joined(plane(2, 0, 3), plane(0, 1, 3), plate)
    eye, towards = placed(-0.3, -0.9, 1.7), placed(0.93, 1.05, -1.7)
    return view((points @ axes.T, faces), spots, eye, towards, 0.5, up=over, **place)


@hard(
    "V axis {power}{end}", "{what}, one axis times 2^{power}", "bounds by the largest coordinate",
    rows("end what mesh", ("", "a ball on a floor", ball_on_floor()),
         (" flat", "triangles of which none stays steep", soup(7, 24, 1.0))),
    rows("power turn", (-20, 0), (-40, 1), (-60, 2)),
)  # fmt: skip
def thin_axis(power: int, mesh: Mesh, **place: Any) -> Trial:
    """A mesh with one axis multiplied by a power of two, as are the lights, the eye and what the picture shows of that axis:
    its columns are all but one."""
    factors = np.array([1.0, 1.0, 2.0**power])
    thin, lights, eye, towards = (mesh[0] * factors, mesh[1]), LAMPS * factors, (0.3, 1.7, 1.5), (-0.2, -1.3, -1.5)
    return view(thin, lights, eye * factors, towards * factors, 2.0**power, (2, 128), up=(0, 0, 1), **place)
