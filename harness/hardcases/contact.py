"""P34-P37, S36-S38, M07: eyes, lights and surfaces in contact, and surfaces that are closer together than a distant eye
resolves.

An eye or a light exactly on a vertex, on an edge or in a plane has a hit at t = 0, which does not count. With corners that
need all of float32's digits, rounding puts such a hit before or behind the eye. Where eye and receiver are far apart, a gap
must be measured at the receiver.
"""

import numpy as np

from ..arrays import F64
from .case import Counts, Trial, hard, rows, view
from .shapes import Mesh, float32_of, icosphere, joined, plane, quad, sheet, triangles

PLACES = ("vertex", "edge", "plane")

BEHIND = "t of a hit at the eye is rounding, of either sign"
LOST = "a tolerance from the lengths of edges, or from where the eye is, is wider than the gap"


def touched(seed: int, place: str) -> tuple[Mesh, F64]:
    """A triangle with corners of 24 random bits, and a point on it, exact in float32: its second corner, the middle of an
    edge, or a point between the first corner and that middle."""
    random = np.random.default_rng(seed)
    if place == "vertex":
        corners = float32_of(random.uniform(-1, 1, (3, 3)))
        return triangles(*corners), corners[1]
    # Multiples of 2^-22; those that are halved are even.
    a, middle = 2 * random.integers(-(2**21), 2**21, (2, 3)) / 2.0**22
    half = random.integers(-(2**22), 2**22, 3) / 2.0**22
    point = middle if place == "edge" else (a + middle) / 2
    return triangles(a, middle - half, middle + half), point


@hard("P34 {place} {seed}", "eye on the {place} of a triangle", BEHIND, rows("place", *PLACES), rows("seed", 0, 1))
@hard("P34 vertex {seed}", "eye on the vertex of a triangle", BEHIND, rows("seed", 2, 3), place="vertex")
@hard(
    "P34 {place} {what}", "the same, {what}", BEHIND, rows("place", *PLACES),
    rows("what seed scale turn", ("small", 5, 2.0**-30, 0), ("large", 6, 2.0**40, 0), ("y", 7, 1.0, 1), ("z", 8, 1.0, 2)),
)  # fmt: skip
@hard("P34 vertex off", "the same, off the origin", BEHIND, seed=9, place="vertex", offset=3.7)
def eye_on(seed: int, place: str, scale: float = 1.0, turn: int = 0, offset: float = 0.0) -> Trial:
    """An eye on a triangle, which therefore no ray hits; all rays hit a wall ahead, which is lit from the eye.

    ``scale`` is a power of two, so that the eye remains exactly on the triangle. With an ``offset`` (in scene sizes) this
    is true only of an eye on a vertex.
    """
    mesh, eye = touched(seed, place)
    towards = np.random.default_rng(seed + 1000).normal(size=3)
    axis = int(np.abs(towards).argmax())
    wall = plane(axis, float(np.sign(towards[axis])) * 4, 64)
    return view(
        joined(mesh, wall), [eye.tolist(), (0.25, 0.5, -8.0)], eye.tolist(), towards, 0.5, turn=turn, scale=scale,
        offset=(offset * scale,) * 3, stated=Counts(256, (0, None)),
    )  # fmt: skip


@hard("P34 mesh {seed}", "eye on a vertex of a dented ball", BEHIND, rows("seed", 0, 1, 2))
def eye_on_mesh(seed: int) -> Trial:
    """An eye on a vertex of a dented ball: the triangles around it are not hit, those across are; a light on another."""
    points, faces = icosphere(2)
    random = np.random.default_rng(seed)
    points = float32_of(points * random.uniform(0.8, 1.2, (len(points), 1)))
    eye, light = points[random.choice(len(points), 2, replace=False)]
    return view((points, faces), [light.tolist(), eye.tolist()], eye.tolist(), -eye, 1.0)


@hard(
    "S36 {place} {seed}", "light on the {place} of a triangle", "a surface at the light shadows all",
    rows("place", *PLACES), rows("seed scale turn", (0, 1.0, 0), (1, 2.0**-30, 1), (2, 2.0**40, 2)),
)  # fmt: skip
def light_on(seed: int, place: str, scale: float = 1.0, turn: int = 0) -> Trial:
    """Lights on a vertex, an edge and in the plane of a triangle, which does not shadow the receivers."""
    mesh, light = touched(seed, place)
    a, b, c = mesh[0]
    beside = a + 2 * (b - a) + (c - a) if place == "plane" else light
    return view(
        joined(mesh, plane(2, -4, 16)), [light.tolist(), float32_of(beside).tolist()], (0.5, 0.25, -16), (0, 0, 1), 0.25,
        scale=scale, turn=turn, stated=Counts(256, (0, None if place == "plane" else 0)),
    )  # fmt: skip


@hard(
    "S38 {height:g}", "light {height:g} above a triangle", "a surface near the light taken for one at the light",
    rows("height turn", (1e-12, 0), (1e-11, 1), (1e-10, 2)),
)  # fmt: skip
def light_off_plane(height: float, turn: int = 0) -> Trial:
    """A light above a triangle by far less than the rounding of float32: the triangle is not at the light, and shadows
    everything below."""
    roof = triangles((8, 1, 0), (-8, 7, 0), (-7, -9, 0))
    return view(
        joined(roof, plane(2, -1, 4)), [(0.25, 0.125, height), (0.25, 0.125, -height)], (0, 0, -6), (0, 0, 1), 0.125,
        turn=turn, stated=Counts(256, (256, 0)),
    )  # fmt: skip


@hard("M07", "eye on a vertex of mirrors", BEHIND, seed=3)
def mirrors_at_the_eye(seed: int) -> Trial:
    """An eye on a vertex of mirrors: no ray starts at the mirrors that the eye touches."""
    points, faces = icosphere(1)
    random = np.random.default_rng(seed)
    points = float32_of(points * random.uniform(0.8, 1.2, (len(points), 1)))
    return view(
        (points, faces), [(0.1, 0.2, 0.3)], points[7].tolist(), -points[7], 1.0,
        mirror=lambda geometry: np.ones(len(geometry.faces), dtype=np.uint8), bounces=2,
    )  # fmt: skip


@hard(
    "S37 {distance:g} {width:g}", "a blade {width:g} wide, seen from {distance:g}", LOST,
    rows("distance width", (1e5, 1e-4), (1e3, 1e-5), (1e7, 1e-4), (1e4, 1e-6)),
)  # fmt: skip
@hard(
    "S37 {what}", "the blade at 1e5, {what}", LOST,
    rows("what turn scale", ("y", 1, 1.0), ("z", 2, 1.0), ("small", 0, 1e-9), ("large", 1, 1e9)), distance=1e5, width=1e-4,
)  # fmt: skip
def blade(distance: float, width: float, turn: int = 0, scale: float = 1.0) -> Trial:
    """A blade close above a floor that a distant eye sees from below: every visible point lies under the blade."""
    floor = quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
    gap = width / 10
    long = triangles((0, -0.9, gap), (width / 2, 0.9, gap), (-width / 2, 0.9, gap))
    return view(
        joined(floor, long), [(0.3, 0.1, 4)], (0, 0, -distance), (0, 0, 1), 0.125 * width / distance, (8, 10),
        up=(0, 1, 0), turn=turn, scale=scale, stated=Counts(80, (80,)),
    )  # fmt: skip


@hard(
    "P35{end}", "two sheets {gap:g} apart, seen from {distance:g}",
    "the lower index wins where t differ by less than a method can tell",
    rows("end distance gap turn scale", ("", 1e6, 1e-3, 0, 1.0), ("y", 1e6, 2e-4, 1, 1e-7), ("z", 1e6, 2e-4, 2, 1e7),
         ("near", 1e3, 2e-7, 0, 1.0)),
)  # fmt: skip
def two_sheets(distance: float, gap: float, turn: int = 0, scale: float = 1.0) -> Trial:
    """A hidden sheet whose triangles have the lower indices, close behind the visible one."""
    x = np.arange(-2, 3) / 2
    behind, front = (moved_sheet(x, z) for z in (-gap, 0.0))
    return view(
        joined(behind, front), [(0.5, 0.25, 4), (0.25, 0.5, -2 * gap)], (0.1, 0.2, distance), (0, 0, -1),
        0.5 / distance, turn=turn, scale=scale, stated=Counts(256, (0, 256)),
    )  # fmt: skip


def moved_sheet(x: F64, z: float) -> Mesh:
    points, faces = sheet(x, x, 1.0)
    return points + np.array([0, 0, 1 + z]), faces


@hard(
    "P36 {half:g} {axis}", "a floor of half-width {half:g} from nearby", "tolerances that grow with the size of a triangle",
    rows("half axis turn", (1e4, "x", 0), (1e7, "x", 0), (1e7, "y", 1), (1e8, "z", 2)),
)  # fmt: skip
def wide_floor(half: float, turn: int = 0) -> Trial:
    """A floor of two triangles whose common edge crosses the picture, seen from nearby, with objects on it."""
    floor = plane(2, 0, half)
    thing = triangles((0.25, -0.125, 0.25), (0.375, 0.25, 0.25), (-0.25, 0.25, 0.375))
    return view(
        joined(floor, thing), [(2.0, -1.0, 1.0), (half, half / 2, half / 4)], (0.1, 0.05, 1), (0, 0.01, -1), 0.5,
        (32, 32), turn=turn, stated=Counts(1024),
    )  # fmt: skip


@hard(
    "P37 {distance:.0e}", "rays exactly through vertices {distance:.0e} away",
    "no rule for rays through vertices, or one that ends where float64 does", rows("distance", 2.0**20, 2.0**26),
)  # fmt: skip
def far_fan(distance: float) -> Trial:
    """Fans of six triangles, seen from so far away that one float32 step of a direction is wider than they are; a ray is
    aimed exactly at each."""
    random = np.random.default_rng(5)
    size = 16
    x = ((2 * np.arange(size) + 1 - size) / size).astype(np.float32).astype(np.float64)
    corners = []
    for row in range(size):
        for column in range(size):
            depth = distance * 2.0 ** random.integers(0, 3)
            middle = np.array([x[column], x[row], -1.0]) * depth
            around = float32_of(middle + random.normal(size=(6, 3)) * (1, 1, 0.1))
            angle = np.argsort(np.arctan2(around[:, 1] - middle[1], around[:, 0] - middle[0]))
            ring = around[angle]
            corners += [p for k in range(6) for p in (middle, ring[k], ring[(k + 1) % 6])]
    return view(triangles(*corners), [(0.0, 0.0, 1.0)], (0, 0, 0), (0, 0, -1), 1.0, (size, size))
