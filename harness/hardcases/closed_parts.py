"""S70-S79: closed surfaces, of which a method may leave out what faces away from the light.

Where a surface is closed, a shadow ray leaves it as often as it enters. What this rests on is broken in every way: parts
that touch, cross or enclose one another, that are wound inward, turn inside out or have no thickness, that are closed in
some frames only or by welding only, with eyes and lights on and inside them, holes and edges of more than two triangles.
Boxes have their faces where pixels' rays meet the floor, so that hit points lie exactly on edges and on two surfaces.
"""

from dataclasses import replace

import numpy as np

from ..arrays import F64, I64
from ..scene.prepared import prepare
from ..scene.scene import AlphaMask, Geometry
from .case import Trial, axes, hard, rows, view
from .shapes import Mesh, ball, box, joined, plane, quad, split, triangles

ABOVE = (0.0, 0.0, 8.0)
"""An eye whose 16 x 16 rays meet the floor z = 0 in odd quarters."""

LIGHTS = ((-3.0, 0.3, 2.0), (3.0, 1.25, 0.75), (0.5, -2.5, 0.5))
BELOW = ((0.3, 0.2, -5.0), (2.0, -1.0, -4.0))
FLOOR = plane(2, 0.0, 8.0)

ONE_SIDE = "what faces away left out though no other triangle of the surface meets the ray"


def seen_from_above(mesh: Mesh, lights: tuple[tuple[float, ...], ...] = LIGHTS, turn: int = 0) -> Trial:
    return view(mesh, [(x, y, z) for x, y, z in lights], ABOVE, (0, 0, -1), 0.5, turn=turn)


def reversed_(mesh: Mesh) -> Mesh:
    """The same triangles, wound the other way."""
    return mesh[0], mesh[1][:, ::-1]


@hard("S70{axis}", "boxes on a floor that touch", "hit points on edges of two surfaces", axes())
def touching(turn: int = 0) -> Trial:
    """Boxes on a floor that share faces, edges, corners; hit points on their lowest edges."""
    low, size = ((0.75, 0.75), (1.75, 0.75), (0.75, -1.75), (-1.75, -1.75), (-0.75, -0.75)), (1.0, 1.0)
    boxes = [box((x, y, 0), (x + size[0], y + size[1], 1 + k % 2)) for k, (x, y) in enumerate(low)]
    return seen_from_above(joined(FLOOR, *boxes), turn=turn)


@hard(
    "S71 {what}", "balls that cross or enclose one another", ONE_SIDE,
    rows("what nested inward", ("crossing", False, False), ("crossing inward", False, True), ("nested", True, False),
         ("nested inward", True, True)),
)  # fmt: skip
def crossing(nested: bool, inward: bool) -> Trial:
    """Balls that cross, or lie within one another, some wound inward."""
    second = reversed_(ball(0.75, (0.25, 0.5, 1))) if inward else ball(0.75, (0.25, 0.5, 1))
    sizes = [ball(0.375, (0.25, 0.5, 1)), ball(1.5, (0.25, 0.5, 1))] if nested else [ball(0.75, (1.25, 0.5, 1.25))]
    return seen_from_above(joined(FLOOR, second, *sizes))


@hard("S72{axis}", "a surface that is half inside out", ONE_SIDE, axes())
def half_turned(turn: int = 0) -> Trial:
    """One closed surface of two boxes that share an edge; the smaller one is wound inward. Seen from above and from
    outside, its faces show their backs."""
    points, faces = joined(
        box((-1.75, -1.75, 0.5), (0.25, 0.25, 2)), reversed_(box((0.25, 0.25, 0.5), (1.25, 1.25, 2)))
    )
    return seen_from_above(joined(FLOOR, welded(points, faces)), (*LIGHTS, *BELOW), turn)


@hard("S72 covered{axis}", "the same under a square", ONE_SIDE, axes())
def covered(turn: int = 0) -> Trial:
    """The same, its inward part covered by a square just on top, which has the lower index and is what is seen."""
    points, faces = joined(
        box((-1.75, -1.75, 0.5), (0.25, 0.25, 2)), reversed_(box((0.25, 0.25, 0.5), (1.25, 1.25, 2)))
    )
    lid = quad((0.25, 0.25, 2), (1.25, 0.25, 2), (1.25, 1.25, 2), (0.25, 1.25, 2))
    return seen_from_above(
        joined(lid, plane(2, -6, 8), welded(points, faces)), ((0.3, 0.2, -5.0), (0.7, 0.9, -4.0)), turn
    )


@hard("S73{axis}", "a closed sheet without thickness", "its far side taken for an occluder", axes())
def folded(turn: int = 0) -> Trial:
    """A closed sheet without thickness, whose two sides have other diagonals: lit from the side that the eye does not see,
    and not shadowed."""
    square = np.array([(-1.75, -1.75, 1), (1.75, -1.75, 1), (1.75, 1.75, 1), (-1.75, 1.75, 1)])
    faces = np.array([(0, 1, 2), (0, 2, 3), (1, 0, 3), (1, 3, 2)])
    return seen_from_above(joined(plane(2, -6, 8), (square, faces)), (*BELOW, *LIGHTS), turn)


@hard("S73 doubled", "a ball wound both ways, one twice", "the two sides taken for a closed surface")
def doubled() -> Trial:
    """Every triangle of a ball twice, wound both ways, and of another twice wound alike."""
    one, other = ball(0.75, (-1, 0, 1)), ball(0.75, (1, 0, 1))
    faces = np.concatenate([one[1], one[1][:, ::-1]])
    return seen_from_above(joined(FLOOR, (one[0], faces), (other[0], np.concatenate([other[1], other[1]]))))


def welded(points: F64, faces: I64) -> Mesh:
    """The same triangles with shared vertices."""
    found, of = np.unique(points, axis=0, return_inverse=True)
    return found, of.reshape(-1)[faces]


@hard("S74 {frame}", "pieces that fly apart", "a weld of another frame", rows("frame", 0, 1, 2))
def falling_apart(frame: int) -> Trial:
    """Boxes of triangles without shared vertices; from frame 1 on each piece of them moves away from the others."""
    whole = split(joined(box((-1.75, -0.75, 1), (-0.75, 0.25, 2)), box((0.25, 0.25, 0.5), (1.25, 1.25, 1.5))))
    points, faces = joined(FLOOR, whole)
    random = np.random.default_rng(7)
    way = np.repeat(random.uniform(-0.5, 0.5, (len(whole[1]), 3)), 3, axis=0)

    def positions(k: int) -> F64:
        result = points.copy()
        result[len(FLOOR[0]) :] += (k % 2) * way
        return result

    trial = seen_from_above((points, faces))
    scene = replace(trial.prepared.scene, geometry=lambda: Geometry(faces.astype(np.int32), positions, 3))
    prepared = prepare(scene)
    moments = [prepared.moment(k, 16, 16) for k in range(frame + 1)]
    return replace(trial, prepared=prepared, moment=moments[-1], before=tuple(moments[:-1]))


@hard("S75", "surfaces that are open, or closed but for one triangle", ONE_SIDE)
def opened() -> Trial:
    """A box without a side, one whose side is wound the other way, and one with a fin at an edge, all with hit points
    inside."""
    side = box((-1.75, -1.75, 0.5), (-0.75, -0.75, 2))
    without = side[0], side[1][[k for k in range(12) if k not in (6, 7)]]
    points, faces = box((0.25, 0.25, 0.5), (1.25, 1.25, 2))
    faces[2] = faces[2][::-1]
    fin = joined(box((-1.25, 0.75, 0.5), (-0.25, 1.75, 2)), triangles((-1.25, 0.75, 0.5), (-1.25, 0.75, 2), (-2, 0, 1)))
    return seen_from_above(joined(FLOOR, without, (points, faces), welded(*fin)))


@hard("S76{axis}", "an edge of four triangles", "edges of two triangles only", axes())
def edge_of_four(turn: int = 0) -> Trial:
    """Two boxes that share an edge, with welded vertices: four triangles meet there, and the surface is closed."""
    boxes = joined(box((-1.75, -1.75, 0), (0.25, 0.25, 1)), box((0.25, 0.25, 0), (1.25, 1.25, 1)))
    return seen_from_above(joined(FLOOR, welded(*boxes)), turn=turn)


@hard("S77 within", "in the part of a surface that is inside out", ONE_SIDE)
def within_turned() -> Trial:
    """Eye and receivers in the part that is wound inward of a closed surface: its faces show their fronts, and what leaves
    it towards the light faces away."""
    boxes = joined(box((-24, -24, 0), (-4, -4, 16)), reversed_(box((-4, -4, 0), (4, 4, 16))))
    return seen_from_above(joined(ball(0.75, (0.5, 0.5, 2)), welded(*boxes)), ((30.0, 1.0, 9.0), (1.0, 40.0, 30.0)))


@hard(
    "S77 {place}", "eye or light on or in a ball", ONE_SIDE,
    rows("place", "eye", "light", "both", "on", "eye on", "corner"),
)  # fmt: skip
def ends_inside(place: str) -> Trial:
    """Eye or light or both in a ball, on a vertex of it, or in a corner of its box."""
    mesh = joined(FLOOR, ball(2.0, (0, 0, 4)), ball(0.5, (0.5, 0.5, 1)))
    inside, on, outside = (0.25, 0.5, 4.5), (0.0, 2.0, 4.0), (3.0, 1.0, 7.0)
    places = {
        "eye": (inside, outside), "light": (ABOVE, inside), "both": ((0, 0.5, 4), inside), "on": (ABOVE, on),
        "eye on": (on, outside), "corner": (ABOVE, (1.9, 1.9, 5.9)),
    }  # fmt: skip
    eye, light = places[place]
    return view(mesh, [light, (-3.0, 0.3, 2.0)], eye, (0.05, -0.1, -1), 0.75, (24, 24))


@hard("S78", "a closed surface with holes", ONE_SIDE)
def with_holes() -> Trial:
    """A box with holes in one of its sides, and one without."""
    mesh = joined(FLOOR, box((-1.75, -1.75, 0.5), (0.25, 0.25, 2)), box((0.25, 0.25, 0.5), (1.25, 1.25, 2)))
    masked = np.zeros(len(mesh[1]), dtype=np.uint8)
    masked[4:6] = 1
    corners = np.tile(np.array([(0, 0), (3, 0), (0, 3)], dtype=np.float32), (len(mesh[1]), 1, 1))
    mask = AlphaMask(masked, corners, np.array([[1, 0], [0, 1]], dtype=np.uint8))
    return view(mesh, list(LIGHTS), ABOVE, (0, 0, -1), 0.5, alpha=lambda geometry: mask)


@hard("S79", "a surface closed by triangles without area", "edges that seem open")
def without_area() -> Trial:
    """A box whose sides are closed by triangles without area: three corners in a line."""
    points, faces = box((-1.75, -1.75, 0.25), (0.25, 0.25, 2))
    a, b = next((face[0], face[1]) for face in faces)
    middle = len(points)
    points = np.concatenate([points, [(points[a] + points[b]) / 2]])
    first = faces[0]
    cut = [(a, middle, first[2]), (middle, b, first[2]), (a, b, middle)]
    return seen_from_above(joined(FLOOR, (points, np.concatenate([faces[1:], cut]))))
