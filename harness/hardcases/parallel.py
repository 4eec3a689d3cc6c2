"""O: orthographic cameras.

Their rays are parallel: along an axis they have components of 0 and meet meshes with integer corners exactly.
"""

import numpy as np

from ..scene.scene import Light
from .case import Counts, Trial, axes, hard, rows, spot_light, view
from .shapes import box, icosphere, joined, plane, sheet
from .structures import towers
from .variants import ball_on_floor

DOWN = (0.0, 0.0, -1.0)

ZERO, ONE_EYE = "division by 0; rays in walls and through corners", "bounds that count on one eye"


@hard("O01 {kind} {axis}", "down on boxes, {kind}", ZERO, axes("xyz"), rows("kind", "edges", "faces"))
@hard(
    "O01 {what}", "down on boxes, {what}", ZERO,
    rows("what scale offset", ("small", 2.0**-30, 0.0), ("large", 2.0**40, 0.0), ("off", 1.0, 1000.0)), kind="edges",
)  # fmt: skip
def onto_towers(kind: str, turn: int = 0, scale: float = 1.0, offset: float = 0.0) -> Trial:
    """Vertical rays onto boxes with integer corners: at the even integers ("edges") through edges and corners and within
    walls, at the odd ones ("faces") through the diagonals of their squares."""
    shift = 1.0 if kind == "edges" else 0.0
    sun = Light((0.0, 0.0, 1.0), directional=True)
    return view(
        joined(towers(), plane(2, 0, 32)), [(0.5, 0.25, 16.0), sun], (shift, shift, 8.0), DOWN, size=(16, 16), turn=turn,
        scale=scale, offset=(offset * scale,) * 3, height=32.0, stated=Counts(256),
    )  # fmt: skip


@hard(
    "O02 tinybvh#168 {kind} {axis}", "a ball on integers, rays at {kind}", "rays lost at edges and at the faces of boxes",
    axes("xyz"), rows("kind", "integers", "halves"),
)  # fmt: skip
def integer_ball(kind: str, turn: int = 0) -> Trial:
    """The rays of tinybvh#168 themselves: a grid of rays along -y from the top of a mesh on a grid of integers.

    The thread's mesh is in a file that is not available; here it is a ball of 1,280 triangles of radius 37.
    """
    points, faces = icosphere(3)
    eye = (0.0, 37.0, 0.0) if kind == "halves" else (0.5, 37.0, 0.5)
    return view(
        (np.round(points * 37.0), faces), [(100.0, 200.0, 50.0)], eye, (0, -1, 0), size=(50, 50), up=(0, 0, 1),
        turn=turn, height=50.0, stated=Counts(2500, None),
    )  # fmt: skip


@hard("O03 {axis}", "vertical rays onto a height field", ZERO, axes("xyz"), excusable=0.0)
def vertical_rays(turn: int = 0) -> Trial:
    """Heights of a field over a regular grid, looked up by vertical rays through all its vertices (madmann91/bvh#60)."""
    grid = np.arange(-16.0, 17.0)
    points, faces = sheet(grid, grid, 1.0)
    points = points.copy()
    points[:, 2] = (np.random.default_rng(20).integers(0, 9, (33, 33)) / 2).ravel()
    return view(
        (points, faces), [(3.0, 5.0, 40.0)], (0.5, 0.5, 64.0), DOWN, size=(32, 32), turn=turn, height=32.0,
        stated=Counts(1024, None),
    )  # fmt: skip


@hard("O05 x{scale:g}", "ball on a floor, scale {scale:g}", ONE_EYE, rows("scale", 1.0, 1e-6, 1e6))
@hard("O05 off", "ball on a floor, off the origin", ONE_EYE, scale=1.0, offset=1e4)
@hard("O05 far", "ball on a floor, from afar", ONE_EYE, scale=1.0, away=1e5)
def oblique(scale: float, offset: float = 0.0, away: float = 1.0) -> Trial:
    """A ball on a floor from the side, from an eye ``away`` times as far."""
    towards = np.array([-0.1, -0.45, -1.0])
    eye = np.array([0.3, 1.7, 3.1]) - (away - 1) * 3 * towards
    return view(
        ball_on_floor(), [(1, 2.5, 0.5), (-0.4, 0.1, 0.7)], eye.tolist(), towards, size=(24, 17), scale=scale,
        offset=(offset * scale,) * 3, height=3.0,
    )  # fmt: skip


@hard("O04 {axis}", "rays that start in a box", "a near plane; t = 0 taken for a hit", axes("xyz"))
def from_within(turn: int) -> Trial:
    """The plane in which rays start cuts a box and holds one of its faces: what it contains is at t = 0, which is no hit."""
    return view(
        joined(box((-2, -2, -1), (0, 2, 1)), box((0, -2, -1), (2, 2, 0)), plane(2, -2, 8)), [(0.5, 0.25, -1.5)], (0, 0, 0),
        DOWN, size=(16, 16), turn=turn, height=8.0, stated=Counts(256, None),
    )  # fmt: skip


@hard("O06 {what}", "ball on a floor, {what}", ONE_EYE, rows("what", "spot", "mirror"))
def with_effects(what: str) -> Trial:
    """The ball on the floor under a spot, with shadow rays only where surfaces face lights, or with mirrors."""
    lamp = spot_light((1.0, 2.5, 0.5), (-1.0, -2.0, -0.5), 30.0, None, (0.0, 1.0, 0.0))
    mirrors = what == "mirror"
    return view(
        ball_on_floor(), [lamp if what == "spot" else (1, 2.5, 0.5), (-0.4, 0.1, 0.7)], (0.3, 1.7, 3.1), (-0.1, -0.45, -1),
        size=(24, 24), height=3.0, bounces=2 if mirrors else 0,
        mirror=(lambda geometry: np.ones(len(geometry.faces), dtype=np.uint8)) if mirrors else None,
    )  # fmt: skip
