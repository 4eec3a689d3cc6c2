"""P38-P44, S39-S40: meshes that trees and grids find hard: one centroid, halving sizes, everything in one cell, odd counts.

Structures sort triangles by centroids and boxes. Where these do not distinguish triangles, a tree becomes deep or the
list of a cell long. Where the number of triangles reaches the end of a block or a warp, the last of them may be skipped.

P60, S60-S63, V axis: triangles far larger than the eye's distance, occluders at the very ends of a segment, spots whose
borders touch a contact of two surfaces, and axes of unlike scale. An edge whose ends are 1e9 and more times as far away
as what passes it is decided by digits that float64 does not have.
"""

import itertools
from typing import Any

import numpy as np

from ..arrays import F64
from ..scene.light_paths import vector
from ..scene.scene import Light
from .case import BESIDE, LAMPS, ORIGIN, TURNED, Counts, Trial, axes, hard, played, rows, spot_light, view
from .shapes import Mesh, ball_on_floor, box, float32_of, joined, plane, quad, sheet, soup, triangles

FLOAT32_HALVINGS = 148  # of 1, to 2^-148: twice the smallest positive number, which a corner still halves

AT_INFINITY = 10 / 192
"""Rays along the outer walls of boxes: a light at infinity is placed 2^56 radii away, so that in exact arithmetic the
rays miss the edge by 2^-56 of the scene. Float64 cannot resolve that, and every method gives the answer for parallel
rays, which meet the edge.
"""

DEPTH = "a tree that cannot tell triangles apart: endless division, chains, long leaves"
STACK = "the deepest tree: stacks that overflow"
LAST = "the last triangle of a block or a warp"
LISTS = "long lists; a ray that tests everything"
SIZES = rows("end turn scale", ("", 0, 1.0), (" y small", 1, 1e-9), (" z large", 2, 1e9))
EDGES_MOVED = rows("what scale offset", ("small", 2.0**-30, 0.0), ("large", 2.0**40, 0.0), ("off", 1.0, 1000.0))

EDGE, THIRD = np.array([3.0, 2.0, 1.0]), np.array([-5.0, 7.0, 2.0])
NORMAL = np.cross(EDGE, THIRD) / np.linalg.norm(np.cross(EDGE, THIRD))
ALONG = EDGE / np.linalg.norm(EDGE)
ASIDE = np.cross(EDGE, NORMAL) / np.linalg.norm(np.cross(EDGE, NORMAL))
WALL = plane(0, 0, 2)

POWERS = rows("power turn", (30, 0), (33, 1), (43, 2), (53, 0), (100, 1))
"""Of two: the sizes of triangles. From 33 on a strip is wider than what is excused, from 53 on it is the whole picture."""

DIGITS = "edges decided from corners far away"
DISTANCES = rows("distance turn", (4.0, 0), (1e3, 1), (1e6, 2))


@hard(
    "P38{end}", "500 triangles with one centroid", DEPTH,
    rows("end turn scale offset", ("", 0, 1.0, 0.0), (" y", 1, 1.0, 0.0), (" z", 2, 1.0, 0.0), (" small", 0, 1e-9, 0.0),
         (" large", 0, 1e9, 0.0), (" off", 0, 1.0, 3.7), (" far off", 0, 1.0, 1e4)),
    count=500,
)  # fmt: skip
@hard("P38 {count}", "{count:,} triangles with one centroid", DEPTH, rows("count", 10_000, 100_000), large=True)
def one_centroid(count: int, **place: Any) -> Trial:
    """Triangles of sizes from 1 to 2^-12; the mean of the vertices and the middle of the box of each lie at the origin.
    Along each axis the three coordinates are v, -v and 0 in some order, so both middles are exact in float32. With an
    ``offset`` (in scene sizes) they are only nearly the same.
    """
    random = np.random.default_rng(count)
    size = 2.0 ** random.uniform(-12, 0, (count, 1))
    value = float32_of(random.uniform(0.25, 1, (count, 3)) * size)
    corners = np.stack([value, -value, np.zeros_like(value)], axis=1)
    order = random.permuted(np.broadcast_to(np.arange(3)[:, None], corners.shape), axis=1)
    mesh = joined(triangles(np.take_along_axis(corners, order, axis=1)), plane(2, -2, 4))
    return view(mesh, [(2.5, 1.5, 3.0), (0.1, 0.2, -1.5)], (0.3, 0.2, 4), (0, 0, -1), 0.375, **place)


def chain(levels: F64) -> Mesh:
    """A triangle for each level s, across the diagonal of the cell from (s, s, s) to (2s, 2s, 2s)."""
    return triangles(levels[:, None, None] * np.array([(2, 1, 1), (1, 2, 1), (1, 1, 2)]))


@hard("P39 {axis}", "sizes halved 148 times", STACK, axes("xyz"), first=-FLOAT32_HALVINGS, last=0, eye=-4.0)
@hard(
    "P39 {where}", "sizes 2^{first} to 2^{last}, eye at {eye:.0e}", STACK,
    rows("where first last eye", ("near", -FLOAT32_HALVINGS, 0, 4.0), ("within", -FLOAT32_HALVINGS, 0, -(2.0**-40)),
         ("wide", -120, 120, -(2.0**122)), ("wide within", -120, 120, -1.0)),
)  # fmt: skip
def halving(first: int, last: int, eye: float, **place: Any) -> Trial:
    """Sizes 2^first to 2^last along a diagonal: the deepest tree. The eye is on it at ``eye`` (negative: beyond the
    smallest).

    The ray in the middle meets every triangle, the others meet those that are large as seen from the eye. A tree's nodes
    lie one within the other, and a ray from the small end puts one on its stack at each level.
    """
    mesh, light = chain(np.ldexp(1.0, np.arange(first, last + 1))), -2.0 * eye
    lights = [(light, 1.5 * light, light), (eye, 2 * eye, 1.5 * eye)]
    return view(mesh, lights, (eye,) * 3, (-eye,) * 3, 0.25, (9, 9), up=(0, 0, 1), **place)


@hard(
    "P39 {what}", "96 chains of halved sizes", STACK,
    rows("what turn scale", ("chains", 0, 1.0), ("chains small", 1, 1e-6), ("chains large", 2, 1e6)),
)  # fmt: skip
def many_chains(**place: Any) -> Trial:
    """Chains towards several points in all eight directions: deep trees of some thousand triangles."""
    points, faces = chain(2.0 ** np.arange(-20.0, 1.0))
    middles = np.random.default_rng(17).integers(-64, 65, (12, 3)) / 16.0
    parts = [(points * signs + middle, faces) for middle in middles for signs in itertools.product((-1, 1), repeat=3)]
    mesh, lights = joined(*parts, plane(2, -8, 16)), [(1.0, 2.0, 12.0), (0.5, 0.25, 0.125)]
    return view(mesh, lights, (0.3, 0.4, 12), (0, 0, -1), 0.5, **place)


def towers() -> Mesh:
    """Boxes with integer corners side by side and on one another: walls, edges and corners on the grid of integers."""
    heights = np.random.default_rng(3).integers(0, 5, (8, 8))
    sites = np.argwhere(heights)
    return joined(*(box((2 * i - 8, 2 * j - 8, 1), (2 * i - 6, 2 * j - 6, 1 + heights[i, j])) for i, j in sites))


@hard(
    "S39 {kind} {axis}", "shadow rays along an axis, {kind}", "division by 0; rays in walls and through corners",
    rows("kind", "faces", "edges", "point"), axes("xyz"), excusable=AT_INFINITY,
)  # fmt: skip
@hard("S39 edges {what}", "the same, {what}", "the same", EDGES_MOVED, kind="edges", excusable=AT_INFINITY)
def along_an_axis(kind: str, **place: Any) -> Trial:
    """Shadow rays along an axis among boxes with integer corners, through their edges, corners and in their walls. The
    hit points are the odd integers (x, y) of the plane z = 0, seen from below, or with "edges" the even ones. The light
    is directional, or far away on the axis above the middle for "point".
    """
    mesh, middle = joined(towers(), plane(2, 0, 32)), 1.0 if kind == "edges" else 0.0
    light = Light((0.0, 0.0, 1.0), directional=True) if kind != "point" else Light((0.0, 0.0, 2.0**40))
    lights, stated = [light, Light((0.0, 0.0, -1.0), directional=True)], Counts(64, (None, 0))
    return view(mesh, lights, (middle, middle, -8.0), (0, 0, 1), 1.0, (8, 8), up=(0, 1, 0), stated=stated, **place)


@hard(
    "P40 {kind} {axis}", "all corners on one line, {kind}", "boxes of a diagonal; no area",
    rows("kind stated", ("only", Counts(0, (0, 0))), ("wall", Counts(256, (0, 0))), ("rounded", None)), axes("xyz"),
)  # fmt: skip
def on_one_line(kind: str, stated: Counts | None, **place: Any) -> Trial:
    """Triangles whose corners are all on one line: exactly ("only", or "wall" before a wall), or as float32 rounds them."""
    random = np.random.default_rng(23)
    if kind == "rounded":
        mesh = triangles(random.uniform(-8, 8, (300, 3, 1)) * (np.array([0.36, 0.48, 0.8]) / 3))
    else:
        mesh = triangles(random.integers(-64, 65, (300, 3, 1)) / 32 * np.array([1.0, 2.0, 3.0]))
    mesh = mesh if kind == "only" else joined(mesh, plane(2, -8, 32))
    return view(mesh, [(3.0, -1.0, 9.0), (0.5, 1.0, 1.5)], (2.0, -1.0, 8.0), (0, 0, -1), stated=stated, **place)


@hard(
    "P41 {order}", "a whole frame after one of NaN or infinity", "bounds that stay NaN",
    rows("order", "nw", "wnw", "iw", "wniw"),
)  # fmt: skip
def after_nothing(order: str) -> Trial:
    """A valid frame after one whose coordinates are all NaN, which is the first or lies between two valid ones."""
    points, faces = ball_on_floor()
    frames = {"n": np.full_like(points, np.nan), "i": np.full_like(points, np.inf), "w": points}
    return played(view((points, faces), LAMPS, *BESIDE), [frames[one] for one in order], len(order) - 1)


@hard("P42 {count}", "{count} triangles", LAST, rows("count turn", (33, 0), (128, 2), (257, 2)))
@hard(
    "P42 {count}", "{count} triangles", LAST,
    rows("count turn", *((n, n % 3) for n in (31, 32, 127, 129, 255, 256, 1023, 1024, 1025))), large=True,
)  # fmt: skip
def so_many(count: int, **place: Any) -> Trial:
    """A number of triangles at the end of a block or of a warp; the last ones are large and in front of the others."""
    front = triangles(
        (-0.5, -0.6, 1.5), (0.4, -0.3, 1.6), (0.1, 0.5, 1.7), (0.5, 0.1, 1.4), (0.9, 0.2, 1.4), (0.6, 0.8, 1.5)
    )
    mesh, lights = joined(soup(count, count - 2, 0.2), front), [(0.3, 0.4, 5), (0.1, -0.2, 0.3)]
    return view(mesh, lights, (0.3, 0.2, 3), (0, 0, -1), 0.5, **place)


@hard("P43{end}", "64 triangles that fill the picture", LISTS, SIZES, count=64, same=False)
@hard("P43 plane{end}", "64 triangles that fill the picture", LISTS, SIZES, count=64, same=True)
@hard("P43 {count}", "{count:,} triangles that fill the picture", LISTS, count=4000, same=False, large=True)
@hard("P43 plane {count}", "{count:,} triangles that fill the picture", LISTS, count=1000, same=True, large=True)
def full_screen(count: int, same: bool, **place: Any) -> Trial:
    """Triangles that each fill the whole picture, in random order of depth, or all in one plane (``same``)."""
    random = np.random.default_rng(29)
    depth = np.full(count, 2.0) if same else 2 + random.permutation(count) / 1024
    angle = random.uniform(0, 2 * np.pi, (count, 1)) + 2 * np.pi / 3 * np.arange(3)
    radius = 64 * random.uniform(1, 4, (count, 1))
    level = np.broadcast_to(-depth[:, None], angle.shape)
    corners = np.stack([radius * np.cos(angle), radius * np.sin(angle), level], axis=2)
    mesh, lights = joined(triangles(corners), plane(2, -16, 4)), [ORIGIN, (0.5, 0.25, -12.0)]
    stated = Counts(256, (0, 0 if same else None))
    return view(mesh, lights, ORIGIN, (0, 0, -1), stated=stated, **place)


@hard(
    "S40 {axis}{end}", "68,644 rays and a few in one cell", "counters of 16 bits; one long list", axes("xyz"),
    rows("end light", ("", Light((0.0, 0.0, 8.0))), (" sun", Light((0.0, 0.0, 1.0), directional=True))), large=True,
)  # fmt: skip
def one_light_cell(light: Light, **place: Any) -> Trial:
    """All of 68,644 hit points but a column lie in one cell of a grid around the light, and within 2^-10 of one point.
    A second plane far outside, which one column of pixels sees, widens the extent of the grid.
    """
    half = 2.0**-10
    across = triangles((-half, -half / 3, 0.25), (half, -half / 2, 0.25), (half / 3, half, 0.25))
    outside = quad((1, -2048, 1024), (4096, -2048, 1024), (4096, 2048, 1024), (1, 2048, 1024))
    mesh, wide = joined(plane(2, 0, half), across, outside), 2 * half * 264 / 262
    return view(mesh, [light], (0, 0, -0.5), (0, 0, 1), wide, (264, 264), up=(0, 1, 0), **place)


@hard("P44{end}", "T-junctions", "rays lost at a vertex on another's edge", TURNED, exact=True, excusable=0.0)
@hard("P44 rounded{end}", "T-junctions", "rays lost at a vertex on another's edge", TURNED, exact=False)
def t_junctions(exact: bool, **place: Any) -> Trial:
    """Coarse squares beside strips of fine ones, whose vertices stand on the edges of the coarse ones. ``exact``: on
    dyadic coordinates, where no gap is left and rays pass exactly along these edges; otherwise rounding moves the
    vertices off the edges, and rays may pass between.
    """
    fine, coarse = np.arange(-8, 9) / 8, np.array([-1.0, 0.0, 1.0])
    points, faces = joined(*(sheet(np.array([k, k + 1]) / 4, fine if k % 2 else coarse, 2.0) for k in range(-4, 4)))
    if not exact:
        c, s = np.cos(0.3), np.sin(0.3)
        around = np.array([(c, -s, 0), (s, c, 0), (0, 0, 1)])
        tilt = np.array([(1, 0, 0), (0, 0.8, -0.6), (0, 0.6, 0.8)])
        middle = np.array([0, 0, -2.0])
        points = (points - middle) @ (tilt @ around).T + middle
    mesh, lights = joined((points, faces), plane(2, -6, 16)), [(0, 0, 2), (0.25, -0.125, -4)]
    size, stated = ((17, 17), Counts(289)) if exact else ((48, 48), None)
    return view(mesh, lights, ORIGIN, (0, 0, -1), 1.0, size, stated=stated, **place)


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
    touch the line of the contact. A plate through the floor shadows both.
    """
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
    """One axis of the mesh, the lights, the eye and the picture times a power of two: its columns are all but one."""
    factors = np.array([1.0, 1.0, 2.0**power])
    thin, lights, eye, towards = (mesh[0] * factors, mesh[1]), LAMPS * factors, (0.3, 1.7, 1.5), (-0.2, -1.3, -1.5)
    return view(thin, lights, eye * factors, towards * factors, 2.0**power, (2, 128), up=(0, 0, 1), **place)
