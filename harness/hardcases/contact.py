"""P34-P37, S36-S38, M07: eyes, lights and surfaces in contact, and surfaces that are closer together than a distant eye
resolves.

An eye or a light exactly on a vertex, on an edge or in a plane has a hit at t = 0, which does not count. With corners that
need all of float32's digits, rounding puts such a hit before or behind the eye. Where eye and receiver are far apart, a gap
must be measured at the receiver.
"""

from typing import Any

import numpy as np

from ..arrays import F64
from .case import Counts, Trial, hard, rows, view
from .shapes import Mesh, fan, float32_of, icosphere, joined, lattice, plane, triangles

PLACES = ("vertex", "edge", "plane")

BEHIND = "t of a hit at the eye is rounding, of either sign"
LOST = "a tolerance from the lengths of edges, or from where the eye is, is wider than the gap"


def touched(seed: int, place: str) -> tuple[Mesh, F64]:
    """A triangle with corners of 24 random bits, and a point on it, exact in float32: its second corner, the middle of an
    edge, or a point between the first corner and that middle.
    """
    random = np.random.default_rng(seed)
    if place == "vertex":
        corners = float32_of(random.uniform(-1, 1, (3, 3)))
        return triangles(*corners), corners[1]
    # Multiples of 2^-22; those that are halved are even.
    a, middle = 2 * random.integers(-(2**21), 2**21, (2, 3)) / 2.0**22
    half = random.integers(-(2**22), 2**22, 3) / 2.0**22
    return triangles(a, middle - half, middle + half), middle if place == "edge" else (a + middle) / 2


def dented(times: int, random: np.random.Generator) -> Mesh:
    points, faces = icosphere(times)
    return float32_of(points * random.uniform(0.8, 1.2, (len(points), 1))), faces


@hard("P34 {at} {seed}", "eye on the {at} of a triangle", BEHIND, rows("at", *PLACES), rows("seed", 0, 1))
@hard("P34 vertex {seed}", "eye on the vertex of a triangle", BEHIND, rows("seed", 2, 3), at="vertex")
@hard(
    "P34 {at} {what}", "the same, {what}", BEHIND, rows("at", *PLACES),
    rows("what seed scale turn", ("small", 5, 2.0**-30, 0), ("large", 6, 2.0**40, 0), ("y", 7, 1.0, 1), ("z", 8, 1.0, 2)),
)  # fmt: skip
@hard("P34 vertex off", "the same, off the origin", BEHIND, seed=9, at="vertex", offset=3.7)
def eye_on(seed: int, at: str, **place: Any) -> Trial:
    """An eye on a triangle, which therefore no ray hits; all rays hit a wall ahead, which is lit from the eye.
    ``scale`` is a power of two, so that the eye remains exactly on the triangle. With an ``offset`` (in scene sizes)
    this is true only of an eye on a vertex.
    """
    mesh, eye = touched(seed, at)
    towards = np.random.default_rng(seed + 1000).normal(size=3)
    axis = int(np.abs(towards).argmax())
    mesh = joined(mesh, plane(axis, float(np.sign(towards[axis])) * 4, 64))
    return view(mesh, [eye, (0.25, 0.5, -8.0)], eye, towards, 0.5, stated=Counts(256, (0, None)), **place)


@hard("P34 mesh {seed}", "eye on a vertex of a dented ball", BEHIND, rows("seed", 0, 1, 2))
def eye_on_mesh(seed: int) -> Trial:
    """An eye on a vertex of a dented ball: the triangles around it are not hit, those across are; a light on another."""
    random = np.random.default_rng(seed)
    mesh = dented(2, random)
    eye, light = mesh[0][random.choice(len(mesh[0]), 2, replace=False)]
    return view(mesh, [light, eye], eye, -eye)


@hard(
    "S36 {at} {seed}", "light on the {at} of a triangle", "a surface at the light shadows all",
    rows("at", *PLACES), rows("seed scale turn", (0, 1.0, 0), (1, 2.0**-30, 1), (2, 2.0**40, 2)),
)  # fmt: skip
def light_on(seed: int, at: str, **place: Any) -> Trial:
    """Lights on a vertex, an edge and in the plane of a triangle, which does not shadow the receivers."""
    mesh, light = touched(seed, at)
    a, b, c = mesh[0]
    beside = float32_of(a + 2 * (b - a) + (c - a)) if at == "plane" else light
    stated = Counts(256, (0, None if at == "plane" else 0))
    return view(
        joined(mesh, plane(2, -4, 16)), [light, beside], (0.5, 0.25, -16), (0, 0, 1), 0.25, stated=stated, **place
    )


@hard(
    "S38 {height:g}", "light {height:g} above a triangle", "a surface near the light taken for one at the light",
    rows("height turn", (1e-12, 0), (1e-11, 1), (1e-10, 2)),
)  # fmt: skip
def light_off_plane(height: float, **place: Any) -> Trial:
    """A light above a triangle by far less than float32's rounding: not at the light, it shadows all below."""
    mesh = joined(triangles((8, 1, 0), (-8, 7, 0), (-7, -9, 0)), plane(2, -1, 4))
    lights, stated = [(0.25, 0.125, height), (0.25, 0.125, -height)], Counts(256, (256, 0))
    return view(mesh, lights, (0, 0, -6), (0, 0, 1), 0.125, stated=stated, **place)


@hard("M07", "eye on a vertex of mirrors", BEHIND)
def mirrors_at_the_eye() -> Trial:
    """An eye on a vertex of mirrors: no ray starts at the mirrors that the eye touches."""
    points, faces = dented(1, np.random.default_rng(3))
    mirror = np.ones(len(faces), dtype=np.uint8)
    return view((points, faces), [(0.1, 0.2, 0.3)], points[7], -points[7], mirror=lambda geometry: mirror, bounces=2)


@hard(
    "S37 {distance:g} {width:g}", "a blade {width:g} wide, seen from {distance:g}", LOST,
    rows("distance width", (1e5, 1e-4), (1e3, 1e-5), (1e7, 1e-4), (1e4, 1e-6)),
)  # fmt: skip
@hard(
    "S37 {what}", "the blade at 1e5, {what}", LOST,
    rows("what turn scale", ("y", 1, 1.0), ("z", 2, 1.0), ("small", 0, 1e-9), ("large", 1, 1e9)), distance=1e5, width=1e-4,
)  # fmt: skip
def blade(distance: float, width: float, **place: Any) -> Trial:
    """A blade close above a floor that a distant eye sees from below: every visible point lies under the blade."""
    gap = width / 10
    mesh = joined(plane(2, 0, 1), triangles((0, -0.9, gap), (width / 2, 0.9, gap), (-width / 2, 0.9, gap)))
    eye, half, stated = (0, 0, -distance), 0.125 * width / distance, Counts(80, (80,))
    return view(mesh, [(0.3, 0.1, 4)], eye, (0, 0, 1), half, (8, 10), up=(0, 1, 0), stated=stated, **place)


@hard(
    "P35{end}", "two sheets {gap:g} apart, seen from {distance:g}",
    "the lower index wins where t differ by less than a method can tell",
    rows("end distance gap turn scale", ("", 1e6, 1e-3, 0, 1.0), ("y", 1e6, 2e-4, 1, 1e-7), ("z", 1e6, 2e-4, 2, 1e7),
         ("near", 1e3, 2e-7, 0, 1.0)),
)  # fmt: skip
def two_sheets(distance: float, gap: float, **place: Any) -> Trial:
    """A hidden sheet whose triangles have the lower indices, close behind the visible one."""
    x = np.arange(-2, 3) / 2
    mesh, lights = joined(lattice(x, (1.0 - gap) - 1.0), lattice(x, 0.0)), [(0.5, 0.25, 4), (0.25, 0.5, -2 * gap)]
    stated = Counts(256, (0, 256))
    return view(mesh, lights, (0.1, 0.2, distance), (0, 0, -1), 0.5 / distance, stated=stated, **place)


@hard(
    "P36 {half:g} {axis}", "a floor of half-width {half:g} from nearby", "tolerances that grow with the size of a triangle",
    rows("half axis turn", (1e4, "x", 0), (1e7, "x", 0), (1e7, "y", 1), (1e8, "z", 2)),
)  # fmt: skip
def wide_floor(half: float, **place: Any) -> Trial:
    """A floor of two triangles whose common edge crosses the picture, seen from nearby, with objects on it."""
    thing = triangles((0.25, -0.125, 0.25), (0.375, 0.25, 0.25), (-0.25, 0.25, 0.375))
    mesh, lights = joined(plane(2, 0, half), thing), [(2.0, -1.0, 1.0), (half, half / 2, half / 4)]
    return view(mesh, lights, (0.1, 0.05, 1), (0, 0.01, -1), 0.5, (32, 32), stated=Counts(1024), **place)


@hard(
    "P37 {distance:.0e}", "rays exactly through vertices {distance:.0e} away",
    "no rule for rays through vertices, or one that ends where float64 does", rows("distance", 2.0**20, 2.0**26),
)  # fmt: skip
def far_fan(distance: float) -> Trial:
    """Fans of six triangles so far away that a float32 step of a direction is wider; a ray is aimed at each."""
    random = np.random.default_rng(5)
    fans = []
    for x, y, _ in lattice((2 * np.arange(16) - 15) / 16, 0.0)[0]:
        middle = np.array([x, y, -1.0]) * (distance * 2.0 ** random.integers(0, 3))
        around = float32_of(middle + random.normal(size=(6, 3)) * (1, 1, 0.1))
        angle = np.arctan2(around[:, 1] - middle[1], around[:, 0] - middle[0])
        fans.append(fan(middle, around[np.argsort(angle)]))
    return view(joined(*fans), [(0.0, 0.0, 1.0)], (0, 0, 0), (0, 0, -1))
