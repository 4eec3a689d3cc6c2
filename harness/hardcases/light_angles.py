"""S01-S05, S17: occluders in directions where a spherical map around the light has seams, poles and curved edges.

Each case exists three times with permuted coordinates, so that it meets a seam or pole along any axis.
"""

import math

from .case import ORIGIN, Counts, Trial, axes, hard, spot_light, view
from .shapes import joined, plane, quad, triangles


@hard(
    "S01{axis}",
    "wall across the azimuth's seam",
    "a box of azimuths wraps to the full circle or its complement",
    axes(),
)
def seam(turn: int = 0) -> Trial:
    """A wall at x = -2 that the half plane of azimuth pi crosses; receivers at x = -4 within its shadow."""
    wall = quad((-2, -1, -1), (-2, 1, -1), (-2, 1, 1), (-2, -1, 1))
    return view(
        joined(wall, plane(0, -4, 8)), [ORIGIN], (-8, 0, 0), (1, 0, 0), 0.125, (32, 8), turn=turn,
        stated=Counts(256, (256,)),
    )  # fmt: skip


@hard("S02{axis}", "pole inside a triangle", "bounds that are not the full circle of azimuth up to the pole", axes())
def pole_inside(turn: int = 0) -> Trial:
    """A triangle that contains the pole; the receivers are three times as far away."""
    roof = triangles((0.4, 0, 1), (-0.3, 0.35, 1), (-0.2, -0.3, 1))
    return view(
        joined(roof, plane(2, 3, 8)), [ORIGIN], (0, 0, 7), (0, 0, -1), 3 / 32, (8, 8), turn=turn,
        stated=Counts(64, (64,)),
    )  # fmt: skip


@hard("S03{axis}", "nadir under a ceiling light", "a pole of the spherical map among the receivers", axes())
def nadir(turn: int = 0) -> Trial:
    """A table of 4 x 4 under a ceiling light; receivers on the floor all around the nadir."""
    table = quad((-2, -2, -1.5), (2, -2, -1.5), (2, 2, -1.5), (-2, 2, -1.5))
    return view(
        joined(table, plane(2, -3, 8)), [ORIGIN], (0, 0, -7), (0, 0, 1), 0.75, turn=turn, stated=Counts(256, (256,))
    )


@hard("S04{axis}", "edge through the pole", "azimuths that differ by exactly pi, with two ways round", axes())
def edge_through_pole(turn: int = 0) -> Trial:
    """An edge that passes exactly over the light: the azimuths of its ends differ by pi. The shadow rays of the middle
    row of receivers meet the edge, which belongs to the closed triangle; the others miss it.
    """
    blade = triangles((1, 0, 2), (-1, 0, 2), (-1, 1e-3, 2))
    return view(
        joined(blade, plane(2, 4, 8)), [ORIGIN], (0, 0, 8), (0, 0, -1), 5 / 32, (16, 5), turn=turn,
        stated=Counts(80, (16,)),
    )  # fmt: skip


@hard(
    "S05{axis}", "bulge of a great circle", "the box of the vertices misses every ray: great arcs bulge beyond it", axes(),
)  # fmt: skip
def bulge(turn: int = 0) -> Trial:
    """An edge between elevations of 45 degrees reaches 57: every receiver lies between the two."""

    def at(azimuth: float, elevation: float) -> tuple[float, float, float]:
        a, b = math.radians(azimuth), math.radians(elevation)
        return math.cos(b) * math.cos(a), math.cos(b) * math.sin(a), math.sin(b)

    arch = triangles(at(50, 45), at(-50, 45), at(0, 30))
    return view(
        joined(arch, plane(0, 3, 16)), [ORIGIN], (7, 0, 3.85), (-1, 0, 0), 0.175, (2, 16), up=(0, 0, 1),
        turn=turn, stated=Counts(32, (32,)),
    )  # fmt: skip


@hard("S18{axis}", "walls all around the light", "seam, both poles and every face of a cube at once", axes())
def around_the_light(turn: int = 0) -> Trial:
    """Large triangles on every side of the light, across the seam and both poles, and receivers behind all of them."""
    shell = plane(2, 1, 3), plane(2, -1, 3), plane(0, 1, 3), plane(0, -1, 3), plane(1, 1, 3), plane(1, -1, 3)
    return view(
        joined(*shell, plane(2, -4, 64)), [ORIGIN], (0, 0, -8), (0, 0, 1), 8.0, turn=turn, stated=Counts(256, (256,))
    )


@hard("S17{axis}", "spot over the seam", "a rectangle stored as (min, max) has min > max", axes())
@hard(
    "S17r{axis}", "the same spot, away from the seam", "nothing by itself: compared with the spot over the seam", axes(),
    seam=False,
)  # fmt: skip
def spot_over_seam(turn: int = 0, seam: bool = True) -> Trial:
    """S01 with a spotlight whose rectangle of azimuth runs from 170 to 190 degrees, across the seam.

    ``seam`` False: the same scene rotated by exactly 180 degrees, so that the rectangle runs from -10 to 10 degrees.
    """
    side = -1.0 if seam else 1.0
    wall = quad((-2, -1, -1), (-2, 0.25, -1), (-2, 0.25, 1), (-2, -1, 1))
    points, faces = joined(wall, plane(0, -4, 8))
    light = spot_light(ORIGIN, (side, 0, 0), 10.0, 10.0, (0, 0, 1))
    return view(
        (points * (-side, -side, 1), faces), [light], (8 * side, 0, 0), (-side, 0, 0), 0.25, up=(0, 0, 1),
        turn=turn, stated=Counts(256, (120,)),
    )  # fmt: skip
