"""S01-S05, S17, S18: occluders in directions where a spherical map around the light has seams, poles and curved edges.

Each case exists three times with permuted coordinates, so that it meets a seam or pole along any axis.
"""

import math
from typing import Any

from .case import ORIGIN, Counts, Trial, axes, hard, spot_light, view
from .shapes import joined, plane, quad, triangles


@hard(
    "S01{axis}", "wall across the azimuth's seam", "a box of azimuths wraps to the full circle or its complement", axes(),
)  # fmt: skip
def seam(**place: Any) -> Trial:
    """A wall at x = -2 that the half plane of azimuth pi crosses; receivers at x = -4 within its shadow."""
    mesh, stated = joined(plane(0, -2, 1), plane(0, -4, 8)), Counts(256, (256,))
    return view(mesh, [ORIGIN], (-8, 0, 0), (1, 0, 0), 0.125, (32, 8), stated=stated, **place)


@hard("S02{axis}", "pole inside a triangle", "bounds that are not the full circle of azimuth up to the pole", axes())
def pole_inside(**place: Any) -> Trial:
    """A triangle that contains the pole; the receivers are three times as far away."""
    mesh = joined(triangles((0.4, 0, 1), (-0.3, 0.35, 1), (-0.2, -0.3, 1)), plane(2, 3, 8))
    return view(mesh, [ORIGIN], (0, 0, 7), (0, 0, -1), 3 / 32, (8, 8), stated=Counts(64, (64,)), **place)


@hard("S03{axis}", "nadir under a ceiling light", "a pole of the spherical map among the receivers", axes())
def nadir(**place: Any) -> Trial:
    """A table of 4 x 4 under a ceiling light; receivers on the floor all around the nadir."""
    mesh = joined(plane(2, -1.5, 2), plane(2, -3, 8))
    return view(mesh, [ORIGIN], (0, 0, -7), (0, 0, 1), 0.75, stated=Counts(256, (256,)), **place)


@hard("S04{axis}", "edge through the pole", "azimuths that differ by exactly pi, with two ways round", axes())
def edge_through_pole(**place: Any) -> Trial:
    """An edge that passes exactly over the light: the azimuths of its ends differ by pi. The shadow rays of the middle
    row of receivers meet the edge, which belongs to the closed triangle; the others miss it.
    """
    mesh = joined(triangles((1, 0, 2), (-1, 0, 2), (-1, 1e-3, 2)), plane(2, 4, 8))
    return view(mesh, [ORIGIN], (0, 0, 8), (0, 0, -1), 5 / 32, (16, 5), stated=Counts(80, (16,)), **place)


@hard(
    "S05{axis}", "bulge of a great circle", "the box of the vertices misses every ray: great arcs bulge beyond it", axes(),
)  # fmt: skip
def bulge(**place: Any) -> Trial:
    """An edge between elevations of 45 degrees reaches 57: every receiver lies between the two."""

    def at(azimuth: float, elevation: float) -> tuple[float, float, float]:
        a, b = math.radians(azimuth), math.radians(elevation)
        return math.cos(b) * math.cos(a), math.cos(b) * math.sin(a), math.sin(b)

    mesh, stated = joined(triangles(at(50, 45), at(-50, 45), at(0, 30)), plane(0, 3, 16)), Counts(32, (32,))
    return view(mesh, [ORIGIN], (7, 0, 3.85), (-1, 0, 0), 0.175, (2, 16), up=(0, 0, 1), stated=stated, **place)


@hard("S18{axis}", "walls all around the light", "seam, both poles and every face of a cube at once", axes())
def around_the_light(**place: Any) -> Trial:
    """Large triangles on every side of the light, across the seam and both poles, and receivers behind all of them."""
    shell = joined(*(plane(axis, at, 3) for axis in (2, 0, 1) for at in (1, -1)), plane(2, -4, 64))
    return view(shell, [ORIGIN], (0, 0, -8), (0, 0, 1), 8.0, stated=Counts(256, (256,)), **place)


@hard("S17{axis}", "spot over the seam", "a rectangle stored as (min, max) has min > max", axes(), side=-1.0)
@hard(
    "S17r{axis}", "the same spot, away from the seam", "nothing by itself: compared with the spot over the seam", axes(),
    side=1.0,
)  # fmt: skip
def spot_over_seam(side: float, **place: Any) -> Trial:
    """S01 with a spotlight whose rectangle of azimuth runs from 170 to 190 degrees, across the seam. ``side`` 1: the
    same scene rotated by exactly 180 degrees, so that the rectangle runs from -10 to 10 degrees."""
    wall = quad((-2, -1, -1), (-2, 0.25, -1), (-2, 0.25, 1), (-2, -1, 1))
    points, faces = joined(wall, plane(0, -4, 8))
    mesh, light = (points * (-side, -side, 1), faces), spot_light(ORIGIN, (side, 0, 0), 10.0, 10.0, (0, 0, 1))
    eye, towards, stated = (8 * side, 0, 0), (-side, 0, 0), Counts(256, (120,))
    return view(mesh, [light], eye, towards, 0.25, up=(0, 0, 1), stated=stated, **place)
