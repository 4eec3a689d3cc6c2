"""S70-S79: closed surfaces, of which a method may leave out what faces away from the light.

Where a surface is closed, a shadow ray leaves it as often as it enters. What this rests on is broken in every way: parts
that touch, cross or enclose one another, that are wound inward, turn inside out or have no thickness, that are closed in
some frames only or by welding only, with eyes and lights on and inside them, holes and edges of more than two triangles.
Boxes have their faces where pixels' rays meet the floor, so that hit points lie exactly on edges and on two surfaces.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np

from ..scene.scene import AlphaMask
from .case import Trial, axes, hard, played, rows, view
from .shapes import Mesh, Point, ball, box, joined, plane, split, triangles, welded

ABOVE = (0.0, 0.0, 8.0)  # an eye whose 16 x 16 rays meet the floor z = 0 in odd quarters

LIGHTS = ((-3.0, 0.3, 2.0), (3.0, 1.25, 0.75), (0.5, -2.5, 0.5))
BELOW = ((0.3, 0.2, -5.0), (2.0, -1.0, -4.0))
FLOOR, LOW_FLOOR = plane(2, 0.0, 8.0), plane(2, -6, 8)

ONE_SIDE = "what faces away left out though no other triangle of the surface meets the ray"

LARGE, SMALL = box((-1.75, -1.75, 0.5), (0.25, 0.25, 2)), box((0.25, 0.25, 0.5), (1.25, 1.25, 2))
"""Two boxes that share an edge."""


def seen_from_above(mesh: Mesh, lights: Iterable[Point] = LIGHTS, **given: Any) -> Trial:
    return view(mesh, lights, ABOVE, (0, 0, -1), 0.5, **given)


def inward(mesh: Mesh) -> Mesh:
    """The same triangles, wound the other way."""
    return mesh[0], mesh[1][:, ::-1]


@hard("S70{axis}", "boxes on a floor that touch", "hit points on edges of two surfaces", axes())
def touching(**place: Any) -> Trial:
    """Boxes on a floor that share faces, edges, corners; hit points on their lowest edges."""
    low = ((0.75, 0.75), (1.75, 0.75), (0.75, -1.75), (-1.75, -1.75), (-0.75, -0.75))
    boxes = [box((x, y, 0), (x + 1.0, y + 1.0, 1 + k % 2)) for k, (x, y) in enumerate(low)]
    return seen_from_above(joined(FLOOR, *boxes), **place)


@hard(
    "S71 {what}", "balls that cross or enclose one another", ONE_SIDE,
    rows("what nested turned", ("crossing", False, False), ("crossing inward", False, True), ("nested", True, False),
         ("nested inward", True, True)),
)  # fmt: skip
def crossing(nested: bool, turned: bool) -> Trial:
    """Balls that cross, or lie within one another, some wound inward."""
    middle = (0.25, 0.5, 1)
    first = ball(0.75, middle)
    others = [ball(0.375, middle), ball(1.5, middle)] if nested else [ball(0.75, (1.25, 0.5, 1.25))]
    return seen_from_above(joined(FLOOR, inward(first) if turned else first, *others))


@hard("S72{axis}", "a surface that is half inside out", ONE_SIDE, axes())
def half_turned(**place: Any) -> Trial:
    """A closed surface of two boxes with a common edge; the smaller is wound inward and shows its backs."""
    solid = welded(*joined(LARGE, inward(SMALL)))
    return seen_from_above(joined(FLOOR, solid), (*LIGHTS, *BELOW), **place)


@hard("S72 covered{axis}", "the same under a square", ONE_SIDE, axes())
def covered(**place: Any) -> Trial:
    """The same, its inward part covered by a square just on top, which has the lower index and is what is seen."""
    points, faces = plane(2, 2, 0.5)
    solid = welded(*joined(LARGE, inward(SMALL)))
    mesh = joined((points + (0.75, 0.75, 0), faces), LOW_FLOOR, solid)
    return seen_from_above(mesh, ((0.3, 0.2, -5.0), (0.7, 0.9, -4.0)), **place)


@hard("S73{axis}", "a closed sheet without thickness", "its far side taken for an occluder", axes())
def folded(**place: Any) -> Trial:
    """A closed sheet without thickness, whose sides have other diagonals: lit from behind, and not shadowed."""
    sheet = plane(2, 1, 1.75)[0], np.array([(0, 1, 2), (0, 2, 3), (1, 0, 3), (1, 3, 2)])
    return seen_from_above(joined(LOW_FLOOR, sheet), (*BELOW, *LIGHTS), **place)


@hard("S73 doubled", "a ball wound both ways, one twice", "the two sides taken for a closed surface")
def doubled() -> Trial:
    """Every triangle of a ball twice, wound both ways, and of another twice wound alike."""
    (points, faces), (others, alike) = ball(0.75, (-1, 0, 1)), ball(0.75, (1, 0, 1))
    both = (points, np.concatenate([faces, faces[:, ::-1]])), (others, np.concatenate([alike, alike]))
    return seen_from_above(joined(FLOOR, *both))


@hard("S74 {frame}", "pieces that fly apart", "a weld of another frame", rows("frame", 0, 1, 2))
def falling_apart(frame: int) -> Trial:
    """Boxes of triangles without shared vertices; from frame 1 on each piece of them moves away from the others."""
    whole = split(joined(box((-1.75, -0.75, 1), (-0.75, 0.25, 2)), box((0.25, 0.25, 0.5), (1.25, 1.25, 1.5))))
    mesh = joined(FLOOR, whole)
    apart = mesh[0].copy()
    apart[len(FLOOR[0]) :] += np.repeat(np.random.default_rng(7).uniform(-0.5, 0.5, (len(whole[1]), 3)), 3, axis=0)
    return played(seen_from_above(mesh), (mesh[0], apart, mesh[0]), frame)


@hard("S75", "surfaces that are open, or closed but for one triangle", ONE_SIDE)
def opened() -> Trial:
    """A box without a side, one whose side is wound the other way, one with a fin; all with hit points inside."""
    side = box((-1.75, -1.75, 0.5), (-0.75, -0.75, 2))
    without = side[0], np.delete(side[1], (6, 7), axis=0)
    points, faces = SMALL[0], SMALL[1].copy()
    faces[2] = faces[2][::-1]
    fin = joined(box((-1.25, 0.75, 0.5), (-0.25, 1.75, 2)), triangles((-1.25, 0.75, 0.5), (-1.25, 0.75, 2), (-2, 0, 1)))
    return seen_from_above(joined(FLOOR, without, (points, faces), welded(*fin)))


@hard("S76{axis}", "an edge of four triangles", "edges of two triangles only", axes())
def edge_of_four(**place: Any) -> Trial:
    """Two boxes that share an edge, with welded vertices: four triangles meet there, and the surface is closed."""
    boxes = joined(box((-1.75, -1.75, 0), (0.25, 0.25, 1)), box((0.25, 0.25, 0), (1.25, 1.25, 1)))
    return seen_from_above(joined(FLOOR, welded(*boxes)), **place)


@hard("S77 within", "in the part of a surface that is inside out", ONE_SIDE)
def within_turned() -> Trial:
    """Eye and receivers in a part wound inward: it shows fronts; what leaves it towards the light faces away."""
    boxes = joined(box((-24, -24, 0), (-4, -4, 16)), inward(box((-4, -4, 0), (4, 4, 16))))
    return seen_from_above(joined(ball(0.75, (0.5, 0.5, 2)), welded(*boxes)), ((30.0, 1.0, 9.0), (1.0, 40.0, 30.0)))


INSIDE, ON, OUTSIDE = (0.25, 0.5, 4.5), (0.0, 2.0, 4.0), (3.0, 1.0, 7.0)


@hard(
    "S77 {place}", "eye or light on or in a ball", ONE_SIDE,
    rows("place eye light", ("eye", INSIDE, OUTSIDE), ("light", ABOVE, INSIDE), ("both", (0, 0.5, 4), INSIDE),
         ("on", ABOVE, ON), ("eye on", ON, OUTSIDE), ("corner", ABOVE, (1.9, 1.9, 5.9))),
)  # fmt: skip
def ends_inside(eye: tuple[float, ...], light: tuple[float, ...]) -> Trial:
    """Eye or light or both in a ball, on a vertex of it, or in a corner of its box."""
    mesh = joined(FLOOR, ball(2.0, (0, 0, 4)), ball(0.5, (0.5, 0.5, 1)))
    return view(mesh, [light, (-3.0, 0.3, 2.0)], eye, (0.05, -0.1, -1), 0.75, (24, 24))


@hard("S78", "a closed surface with holes", ONE_SIDE)
def with_holes() -> Trial:
    """A box with holes in one of its sides, and one without."""
    mesh = joined(FLOOR, LARGE, SMALL)
    masked = np.isin(np.arange(len(mesh[1])), (4, 5)).astype(np.uint8)
    corners = np.tile(np.array([(0, 0), (3, 0), (0, 3)], dtype=np.float32), (len(mesh[1]), 1, 1))
    mask = AlphaMask(masked, corners, np.array([[1, 0], [0, 1]], dtype=np.uint8))
    return seen_from_above(mesh, alpha=lambda geometry: mask)


@hard("S79", "a surface closed by triangles without area", "edges that seem open")
def without_area() -> Trial:
    """A box whose sides are closed by triangles without area: three corners in a line."""
    points, faces = box((-1.75, -1.75, 0.25), (0.25, 0.25, 2))
    (a, b, c), middle = faces[0], len(points)
    points = np.concatenate([points, [(points[a] + points[b]) / 2]])
    cut = [(a, middle, c), (middle, b, c), (a, b, middle)]
    return seen_from_above(joined(FLOOR, (points, np.concatenate([faces[1:], cut]))))
