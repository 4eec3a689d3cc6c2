"""O: orthographic cameras.

Their rays are parallel: along an axis they have components of 0 and meet meshes with integer corners exactly.
"""

from typing import Any

import numpy as np

from ..scene.scene import Light
from .case import BESIDE, LAMPS, Counts, Trial, axes, hard, rows, spot_light, view
from .shapes import ball_on_floor, box, icosphere, joined, lattice, plane
from .structures import EDGES_MOVED, towers
from .surfaces import first

DOWN = (0.0, 0.0, -1.0)

ZERO, ONE_EYE = "division by 0; rays in walls and through corners", "bounds that count on one eye"


@hard("O01 {kind} {axis}", "down on boxes, {kind}", ZERO, axes("xyz"), rows("kind", "edges", "faces"))
@hard("O01 {what}", "down on boxes, {what}", ZERO, EDGES_MOVED, kind="edges")
def onto_towers(kind: str, **place: Any) -> Trial:
    """Vertical rays onto boxes with integer corners: at the even integers ("edges") through edges and corners and within
    walls, at the odd ones ("faces") through the diagonals of their squares."""
    mesh, shift = joined(towers(), plane(2, 0, 32)), 1.0 if kind == "edges" else 0.0
    lights = [(0.5, 0.25, 16.0), Light((0.0, 0.0, 1.0), directional=True)]
    return view(mesh, lights, (shift, shift, 8.0), DOWN, height=32.0, stated=Counts(256), **place)


@hard(
    "O02 tinybvh#168 {kind} {axis}", "a ball on integers, rays at {kind}", "rays lost at edges and at the faces of boxes",
    axes("xyz"), rows("kind eye", ("integers", (0.5, 37.0, 0.5)), ("halves", (0.0, 37.0, 0.0))),
)  # fmt: skip
def integer_ball(eye: tuple[float, ...], **place: Any) -> Trial:
    """The rays of tinybvh#168 themselves: a grid of rays along -y from the top of a mesh on a grid of integers. The
    thread's mesh is in a file that is not available; here it is a ball of 1,280 triangles of radius 37."""
    points, faces = icosphere(3)
    mesh, lights, up, stated = (np.round(points * 37.0), faces), [(100.0, 200.0, 50.0)], (0, 0, 1), Counts(2500, None)
    return view(mesh, lights, eye, (0, -1, 0), size=(50, 50), up=up, height=50.0, stated=stated, **place)


@hard("O03 {axis}", "vertical rays onto a height field", ZERO, axes("xyz"), excusable=0.0)
def vertical_rays(**place: Any) -> Trial:
    """Heights of a field over a regular grid, looked up by vertical rays through all its vertices (madmann91/bvh#60)."""
    mesh = lattice(np.arange(-16.0, 17.0), np.random.default_rng(20).integers(0, 9, (33, 33)) / 2)
    eye, lights, stated = (0.5, 0.5, 64.0), [(3.0, 5.0, 40.0)], Counts(1024, None)
    return view(mesh, lights, eye, DOWN, size=(32, 32), height=32.0, stated=stated, **place)


@hard("O05 x{scale:g}", "ball on a floor, scale {scale:g}", ONE_EYE, rows("scale", 1.0, 1e-6, 1e6))
@hard("O05 off", "ball on a floor, off the origin", ONE_EYE, offset=1e4)
@hard("O05 far", "ball on a floor, from afar", ONE_EYE, away=1e5)
def oblique(away: float = 1.0, **place: Any) -> Trial:
    """A ball on a floor from the side, from an eye ``away`` times as far."""
    near, towards, _ = BESIDE
    eye = np.array(near) - (away - 1) * 3 * np.array(towards)
    return view(ball_on_floor(), LAMPS, eye, towards, size=(24, 17), height=3.0, **place)


@hard("O04 {axis}", "rays that start in a box", "a near plane; t = 0 taken for a hit", axes("xyz"))
def from_within(**place: Any) -> Trial:
    """The plane in which rays start cuts a box and holds one of its faces: what it contains is at t = 0, which is no hit."""
    mesh = joined(box((-2, -2, -1), (0, 2, 1)), box((0, -2, -1), (2, 2, 0)), plane(2, -2, 8))
    return view(mesh, [(0.5, 0.25, -1.5)], (0, 0, 0), DOWN, height=8.0, stated=Counts(256, None), **place)


SPOT = spot_light((1.0, 2.5, 0.5), (-1.0, -2.0, -0.5), 30.0, None, (0.0, 1.0, 0.0))


@hard("O06 spot", "ball on a floor, spot", ONE_EYE, lamp=SPOT)
@hard("O06 mirror", "ball on a floor, mirror", ONE_EYE, lamp=LAMPS[0], bounces=2)
def with_effects(lamp: Any, bounces: int = 0) -> Trial:
    """The ball on the floor under a spot, with shadow rays only where surfaces face lights, or with mirrors."""
    (eye, towards, _), mesh = BESIDE, ball_on_floor()
    mirror = first(len(mesh[1])) if bounces else None
    return view(mesh, [lamp, LAMPS[1]], eye, towards, size=(24, 24), height=3.0, mirror=mirror, bounces=bounces)
