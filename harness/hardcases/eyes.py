"""P01-P03, P07, P09-P10, P17-P22, P51-P52: eyes inside, on, near to and far from surfaces, and unusual image sizes. O:
orthographic cameras, whose parallel rays along an axis have components of 0 and meet integer corners exactly.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from ..scene.light_paths import vector
from ..scene.scene import Light
from .case import BESIDE, LAMPS, ORIGIN, Counts, Trial, axes, hard, rows, spot_light, view
from .shapes import (
    ball,
    ball_on_floor,
    box,
    fan,
    icosphere,
    joined,
    lattice,
    pixel_centres,
    plane,
    quad,
    sheet,
    soup,
    triangles,
)
from .structures import EDGES_MOVED, towers
from .surfaces import first

ABOVE = (0.3, 3.0, 0.25)

ONE_CELL = "grid traversal visits only one of the neighbouring cells"
PARTIAL = "partial tiles, thread guards"

DOWN = (0.0, 0.0, -1.0)

ZERO, ONE_EYE = "division by 0; rays in walls and through corners", "bounds that count on one eye"


@hard("P01{axis}", "triangle across the eye", "a vertex behind the eye is mirrored by the perspective division", axes())
def across_the_eye(**place: Any) -> Trial:
    """A triangle from 5 in front of the eye to 0.5 behind it, over the eye's head."""
    return view(
        triangles((-1, -1, -5), (1, -1, -5), (0, 1, 0.5)), [(0, 3, -3), (0, -3, -3)], ORIGIN, (0, 0, -1), **place
    )


@hard("P01s", "two hundred triangles around the eye", "the same, with every shape")
def many_across() -> Trial:
    return view(soup(31, 200, 1.5, 0.5), [(0.1, 0.05, -0.1), (30, 20, 10)], ORIGIN, (0.2, 0.1, -1), 1.0, (24, 24))


@hard("P02", "triangle behind the eye", "a mirror image after the perspective division")
def behind_the_eye() -> Trial:
    return view(triangles((-1, -1, 5), (1, -1, 5), (0, 1, 5)), [ABOVE], ORIGIN, (0, 0, -1), stated=Counts(0, (0,)))


@hard("P03", "eye inside a closed box", "back-face culling gives a black image")
def inside_a_box() -> Trial:
    """Every pixel hits a back face; rays meet the box's edges and a corner."""
    lights, stated = [(0.5, 0.5, 0.5), (0, 0, 9)], Counts(289)
    return view(box(-1, 1), lights, ORIGIN, (0, 0, -1), 2.0, (17, 17), watertight=True, stated=stated, closed=True)


@hard("P03b", "ray into the corner of a box", "the box test and the edge tests at a corner")
def into_a_corner() -> Trial:
    """The central ray goes exactly through a corner of the box, where three walls meet."""
    return view(box(-1, 1), [ORIGIN], ORIGIN, (1, 1, 1), 0.75, (17, 17), watertight=True, stated=Counts(289, (0,)))


@hard("P07", "rays with components 0", "division by 0; 0 times infinity")
def onto_layers(**place: Any) -> Trial:
    """Rays whose x or y component is 0 from the corners of cells, onto three squares of 64 cells, one behind the other."""
    x = np.arange(-4, 5) / 4
    layers = joined(*[sheet(x / depth, x / depth, depth) for depth in (1.0, 2.0, 3.0)])
    lights, stated = [(0, 0, -1.5), (0.25, 0.25, 4)], Counts(289)
    return view(layers, lights, ORIGIN, (0, 0, -1), 1.0, (17, 17), watertight=True, stated=stated, **place)


@hard("P07n{axis}", "rays with components -0", "division by -0; the sign of a step along -0", axes())
def minus_zero(turn: int) -> Trial:
    """The same with components -0: the view is along (-0, -0, -1) with up at (-0, -1, -0), so sums of -0 stay -0."""
    trial = onto_layers(turn=turn)
    target, up = (vector(np.roll(way, turn)) for way in ((-0.0, -0.0, -1.0), (-0.0, -1.0, -0.0)))
    camera = replace(trial.prepared.scene.camera, target=target, up=up)
    return replace(trial, moment=trial.prepared.moment(0, 17, 17, camera=camera))


@hard("P09", "rays in a plane", "endless traversal of a grid; a hit on a coplanar triangle")
def in_the_plane() -> Trial:
    """An eye in the plane of a lattice, looking along it: coplanar rays hit nothing."""
    flat, stated = lattice(pixel_centres(8), 0.0), Counts(0, (0,))
    return view(flat, [(0, 0, 2)], (3, 0, 0), (-1, 0, 0), 0.25, (9, 9), up=(0, 0, 1), stated=stated)


@hard("P10", "diagonal through corners of cells", ONE_CELL, start=0.0)
@hard("P10b", "the same from afar", ONE_CELL, start=-64.0)
def diagonal_cells(start: float) -> Trial:
    """The central ray goes along x = y = z, through the corners of cells; each diagonal cell has triangles across it."""
    corners = [p for k in np.arange(1.0, 5.0) for p in ((k + 1, k, k), (k, k + 1, k), (k, k, k + 1))]
    return view(triangles(*corners), [(-1, -1, -1), (8, 8, 8), (3, 3, 0)], (start,) * 3, (1, 1, 1), 0.25, (9, 9))


@hard(
    "P17 {width}x{height}", "image of {width}x{height}", PARTIAL,
    rows("width height", (1, 1), (33, 25), (3, 257), (257, 3), (8, 9)),
)  # fmt: skip
def odd_image(width: int, height: int) -> Trial:
    """A ball on a floor in an image whose sides are not multiples of a tile or block size."""
    eye, towards, half = BESIDE
    return view(ball_on_floor(), [(1, 2.5, 0.5)], eye, towards, half * min(1.0, height / width * 4), (width, height))


@hard("P17 {width}x{height}", "image of {width}x{height}", PARTIAL, rows("width height", (1023, 769), (7, 5000)))
def large_image(width: int, height: int) -> Trial:
    """Small triangles at the corners, along the sides and in the middle of a large image, without a background. Most
    pixels miss, which makes judging fast; pixels in partial tiles and the last pixel hit a triangle.
    """
    reach = width / height
    steps, size = (-1, -0.5, 0, 0.5, 1), 12.0 / max(width, height) * max(1.0, reach)
    places = [(x * reach, y) for x in steps for y in steps if x or y]
    tips = ((-1.1, -1.0), (1.2, -0.9), (0.1, 1.3))
    corners = np.array([(x + size * a, y + size * b, -1.0) for x, y in places for a, b in tips])
    mesh = joined(triangles(corners), triangles(corners * 0.5))
    return view(mesh, [ORIGIN, (0, 0, -0.75)], ORIGIN, (0, 0, -1), 1.0, (width, height))


@hard("P18", "up along the view", "camera axes of NaN", refused=True)
def up_along_the_view() -> Trial:
    return view(plane(2, 0, 1), [ABOVE], (0, 0, 4), (0, 0, -1), up=(0, 0, 1))


@hard("P19", "eye on a wall", "t = 0 taken for a hit")
def on_a_wall() -> Trial:
    """An eye exactly on a wall of a box does not see that wall."""
    return view(box(-1, 1), [ORIGIN], (0, 0, 1), (0, 0, -1), 1.0, (9, 9), stated=Counts(81, (0,)))


@hard("P20", "eye on a shared vertex", "directions of 0 divided by 0; every edge function 0")
def on_a_vertex() -> Trial:
    """An eye exactly on a vertex that six triangles share, and another surface ahead."""
    around = [(np.cos(a), np.sin(a), 0.25) for a in np.arange(6) * np.pi / 3]
    mesh = joined(fan(ORIGIN, around), plane(2, -2, 8))
    return view(mesh, [(0, 0, 4)], ORIGIN, (0, 0, -1), stated=Counts(256, None))


@hard("P21", "eye one step from a wall", "a near plane, an absolute epsilon")
def touching() -> Trial:
    """An eye one float32 step in front of a wall: t = 2^-23 and smaller."""
    mesh = joined(plane(2, 1.0 - 2.0**-24, 1), plane(2, 0, 4))
    return view(mesh, [(0, 0, 3), (0, 0, -1)], (0, 0, 1), (0, 0, -1), stated=Counts(256, (0, 256)))


@hard("P22", "eye at 1e5 scene sizes", "rounding of o - v; boxes thinner than a float32 step")
def far_away() -> Trial:
    return view(joined(box(-1, 1), ball(1.2, ORIGIN)), [(2, 3, 4)], (1e5, 1e5, 1e5), (-1, -1, -1), 1e-5)


@hard(
    "P51 {power}", "a floor seen from almost within it, in the shadow of many strips",
    "hit points that rounding moves along their rays",
    rows("power height", ("2^-14", 2.0**-14), ("2^-30", 2.0**-30), ("2^-42", 2.0**-42)),
)  # fmt: skip
def along_a_floor(height: float) -> Trial:
    """A floor through the x axis seen along it from almost within it, under many narrow strips that shadow it.

    The ray of a pixel meets the floor at a sine of ``height`` per unit of way. Rounding moves the hit point along the ray by
    2^-50 of its way over that sine: from one strip to another where the sine is small, unless it is computed with care. The
    floor is tilted, so that float64 rounds.
    """
    y, z = float(np.float32(0.8)), float(np.float32(0.6))
    floor = triangles((-9, -3 * y, -3 * z), (9, -3 * y, -3 * z), (0.3, 6 * y, 6 * z))
    strips = [
        quad(*((p, 0.5 * z + q * y, -0.5 * y + q * z) for p, q in ((a, -1), (a + 0.0025, -1), (a + 0.0025, 1), (a, 1))))
        for a in (0.5 + 2.0 * np.arange(400) / 400).tolist()
    ]
    lights = [(1.3, 4 * z, -4 * y), (1.0, z - y, -y - z)]
    eye, towards, up = (0.0, height * z, -height * y), (1.0, -height * z, height * y), (0.0, z, -y)
    return view(joined(floor, *strips), lights, eye, towards, 0.5 * height, (4, 64), up=up)


@hard(
    "P52{end}", "needles that reach far beyond a wide view",
    "columns of far vertices, which are rounded in proportion to their distance", rows("end seed", ("", 71), ("b", 9)),
)  # fmt: skip
def needles(seed: int) -> Trial:
    """A view of 2048 columns, and needles across it whose tips lie thousands of times as far above and below it as in front.

    A tip's coordinate along a row is rounded in proportion to its distance, so that its column is off by a pixel or more.
    """
    random = np.random.default_rng(seed)
    eye = random.normal(size=3).astype(np.float32)
    ahead, up = random.normal(size=(2, 3))
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, up)
    right /= np.linalg.norm(right)
    above = np.cross(right, ahead)
    at = (np.arange(120) - 59.5) / 120 + random.uniform(-0.002, 0.002, 120)  # beside one another
    reach = 10.0 ** random.uniform(3.6, 3.95, 120)
    corners = [
        eye + ahead + x * right + y * above
        for a, far in zip(at, reach, strict=True)
        for x, y in ((a, far), (a, -far), (a + 0.004, 0.0))
    ]
    return view(triangles(*corners), [eye + random.normal(size=3)], eye, ahead, 0.57735 * 8 / 2048, (2048, 8), up=up)


@hard("O01 {kind} {axis}", "down on boxes, {kind}", ZERO, axes("xyz"), rows("kind", "edges", "faces"))
@hard("O01 {what}", "down on boxes, {what}", ZERO, EDGES_MOVED, kind="edges")
def onto_towers(kind: str, **place: Any) -> Trial:
    """Vertical rays onto boxes with integer corners: at the even integers ("edges") through edges and corners and within
    walls, at the odd ones ("faces") through the diagonals of their squares.
    """
    mesh, shift = joined(towers(), plane(2, 0, 32)), 1.0 if kind == "edges" else 0.0
    lights = [(0.5, 0.25, 16.0), Light((0.0, 0.0, 1.0), directional=True)]
    return view(mesh, lights, (shift, shift, 8.0), DOWN, height=32.0, stated=Counts(256), **place)


@hard(
    "O02 tinybvh#168 {kind} {axis}", "a ball on integers, rays at {kind}", "rays lost at edges and at the faces of boxes",
    axes("xyz"), rows("kind eye", ("integers", (0.5, 37.0, 0.5)), ("halves", (0.0, 37.0, 0.0))),
)  # fmt: skip
def integer_ball(eye: tuple[float, ...], **place: Any) -> Trial:
    """The rays of tinybvh#168 themselves: a grid of rays along -y from the top of a mesh on a grid of integers. The
    thread's mesh is in a file that is not available; here it is a ball of 1,280 triangles of radius 37.
    """
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
