"""The same cases at other scales, far from the origin, with lights at other distances, and near the limits of float32.

With scales and offsets that are not powers of two the mesh is rounded again; the referee judges on the rounded mesh.
Products of two lengths overflow from 2e19 on and underflow from 1e-19 down, those of three from 7e12 and 2e-13. Numbers
below 1.2e-38 are subnormal: they lose digits, and a processor that flushes them treats them as 0.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from ..scene.prepared import prepare
from ..scene.scene import Geometry, Light
from .case import BESIDE, LAMPS, ORIGIN, Counts, Trial, axes, hard, rows, view
from .shapes import ball_on_floor, joined, lattice, pixel_centres, plane, sheet, soup, triangles

SCALES = (1e-6, 1e-3, 2.0**-20, 1e3, 1e6)
OFFSETS = (1.0, 1e3, 1e5)
PLACES = rows(  # scales, and distances from the origin in sizes of the scene; not along an axis
    "place where breaks scale sizes", *((f"x{x:.3g}", f"scale {x:.3g}", "absolute epsilons", x, 0.0) for x in SCALES),
    *((f"+{x:g}", f"{x:g} scene sizes from the origin", "no recentring", 1.0, x) for x in OFFSETS),
    ("x1e-6 +1e5", "small and far off", "both at once", 1e-6, 1e5),
)  # fmt: skip

EXTREME = (1e-36, 1e-30, 1e-24, 1e-18, 1e-12, 1e12, 1e15, 5e18, 2e19, 1e20, 1e28, 1e36)
MIXED_SEEDS = (0, 1, 2, 3, 4, 5, 11, 13, 36, 42)
"""Six in a row, and four whose rays pass so close to the edges of triangles 1e7 long that a bound by the largest
coordinate takes them for hits. In 0, 2 and 3 such a bound takes the eye for a point in the plane of the triangle seen.
"""

FLUSHED = "subnormal numbers flushed to 0"


@hard("V ball {place}", "ball on a floor, {where}", "{breaks}", PLACES)
def small_scene(scale: float, sizes: float) -> Trial:
    return view(ball_on_floor(), LAMPS, *BESIDE, scale=scale, offset=np.array([0.8, -0.5, 0.33]) * sizes * 6)


@hard("V soup {place}", "soup, {where}", "{breaks}", PLACES)
def soup_scene(scale: float, sizes: float) -> Trial:
    """A triangle soup of mixed sizes with a light inside."""
    place = np.array([-0.3, 0.9, 0.7]) * sizes * 3
    return view(soup(77, 80), [(0.3, 0.4, 0.2), (4, 5, 6)], (0.3, 0.2, 3), (0, 0, -1), 0.5, scale=scale, offset=place)


@hard("V sheet {place}", "rays through vertices, {where}", "{breaks}", PLACES)
def vertex_sheet(scale: float, sizes: float) -> Trial:
    """Rays through vertices and edges of a bumpy sheet: exactly so at the scales that are powers of two."""
    x = pixel_centres(16)[::2]
    mesh = sheet(x, x, 1 + np.random.default_rng(9).integers(0, 16, (len(x), len(x))) / 16)
    place = np.array([0.6, 0.1, -0.9]) * sizes * 4
    return view(mesh, [(0.25, 0.125, 0.5), (0, 0, -4)], ORIGIN, (0, 0, -1), scale=scale, offset=place)


@hard(
    "V light {radii:g} {where}", "light {radii:g} radii from the {where}", "offsets near, rounding of v - L far",
    rows("radii", 1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6, 1e7),
    rows("where start", ("ball", (0, 1.1, 0)), ("floor", (2.0, 0.0, 1.0))),
)  # fmt: skip
def light_distance(radii: float, start: tuple[float, ...]) -> Trial:
    """A light ``radii`` scene radii from a point on top of the ball, or from the middle of the floor's edge."""
    return view(ball_on_floor(), [np.array(start) + np.array([0.36, 0.8, 0.48]) * radii * 4.3], *BESIDE)


hard(
    "V scale {scale:g}", "ball on a floor, scale {scale:g}", "float32 products that overflow or vanish",
    rows("scale", *EXTREME), sizes=0.0,
)(small_scene)  # fmt: skip


@hard(
    "V long {axis}", "a light 1e38 away from a scene as large", "one over a number beyond 2^126 flushed to 0", axes("xyz"),
)  # fmt: skip
def long_way(turn: int) -> Trial:
    """A ball on a floor, 3e37 in size: one part of the way to the light is beyond 2^126, and the others are not."""
    return view(ball_on_floor(), [(0.5, 4.0, 0.4), (0.3, 3.5, -1.0)], *BESIDE, (24, 24), turn=turn, scale=3e37)


@hard(
    "V far {radii:g}", "light {radii:g} radii away", "directions and distances from a light far away",
    rows("radii turn", (1e10, 0), (1e15, 1), (1e20, 2), (1e30, 0), (1e38, 1)),
)  # fmt: skip
def far_light(radii: float, **place: Any) -> Trial:
    """A ball on a floor, and a light so far away that its directions to the scene are the same in float32."""
    x, y, z = (radii * c for c in (0.36, 0.8, 0.48))
    return view(ball_on_floor(), [(x, y, z), (-z, 0.7 * y, -x)], *BESIDE, (24, 24), **place)


@hard(
    "V sun 3e21", "directional lights, scale 3e21", "a light at infinity, no shadow, and no word", refused=True, scale=3e21,
)  # fmt: skip
@hard(
    "V sun {scale:g}", "directional lights, scale {scale:g}", "a light that stands where float32 ends",
    rows("scale", 1e-36, 1e-12, 1e12, 1e19, 1e20),
)  # fmt: skip
def sun(**place: Any) -> Trial:
    suns = [Light(way, directional=True) for way in ((0.36, 0.8, 0.48), (-0.9, 0.3, 0.1))]
    return view(ball_on_floor(), suns, *BESIDE, (24, 24), **place)


@hard("V subnormal {axis}", "ball on a floor, scale 2^-131", FLUSHED, axes("xyz"))
def subnormal_scene(turn: int) -> Trial:
    """A ball on a floor 2^-131 in size: its coordinates have at most 18 bits, and lights and eye are subnormal too."""
    return view(ball_on_floor(), LAMPS, *BESIDE, turn=turn, scale=2.0**-131)


@hard("V among {axis}", "vertices off a plane by subnormal numbers", FLUSHED, axes("xyz"))
def among_subnormals(**place: Any) -> Trial:
    """Sheets through 0 whose vertices lie off their plane by subnormal numbers, and eye and light off the axis by such."""
    points, faces = lattice(np.arange(-4.0, 5.0) / 4, 0.0)
    noise = np.random.default_rng(41).integers(-99, 100, points.shape) * 2.0**-149
    flat = np.where(points == 0, noise, points)
    mesh = joined((flat, faces), (flat + (0, 0, -1), faces))
    lights = [(2.0**-140, 0.0, 2.0**-100), (1.0, 2.0, 3.0)]
    return view(mesh, lights, (2.0**-149, -(2.0**-130), 1.0), (0, 0, -1), 1.1, **place)


@hard(
    "V least {eye:.0e} {axis}", "sheets one least number apart, seen from {eye:.0e}", FLUSHED,
    rows("eye", 2.0**-148, 2.0**-130), axes("xyz"),
)  # fmt: skip
def one_step_from_zero(eye: float, **place: Any) -> Trial:
    """A plane at z = 0 and, in front of it but later in the list, one at the smallest positive number of float32. From
    an eye at twice that number they are at distances of 2 and 1 of it.
    """
    mesh = joined(plane(2, 0, eye * 8), plane(2, 2.0**-149, eye * 8))
    lights = [(0.25 * eye, 0.5 * eye, side * eye) for side in (4, -4)]
    return view(mesh, lights, (0, 0, eye), (0, 0, -eye), stated=Counts(256, (0, 256)), **place)


@hard("V zeros {axis}", "vertices at 0 and -0", "0 and -0 taken for two vertices", axes("xyz"))
def two_zeros(turn: int) -> Trial:
    """Squares that meet along x = 0, y = 0 and at the origin, where their own vertices are 0 or -0, from an eye at -0."""
    x = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    points, faces = sheet(x, x, 1.0)
    corners = points[faces]
    signs = np.where(np.random.default_rng(47).integers(0, 2, corners.shape), -0.0, 0.0)
    corners = np.where(corners == 0, signs, corners) * (1, 1, 2)
    mesh = joined(triangles(corners), plane(2, -4, 8))
    lights, stated = [(-0.0, 0.0, 0.0), (0.0, -0.0, 2.0)], Counts(289, (0, None))
    trial = view(mesh, lights, ORIGIN, (0, 0, -1), 1.0, (17, 17), turn=turn, stated=stated)
    # What places a mesh makes every zero positive.
    scene, zero, where = trial.prepared.scene, (-0.0, -0.0, -0.0), np.roll(mesh[0], turn, axis=1)
    camera, lamps = replace(scene.camera, eye=zero), (scene.lights[0].moved(zero), scene.lights[1])
    geometry = Geometry.static(where, trial.prepared.faces)
    prepared = prepare(replace(scene, camera=camera, lights=lamps, geometry=lambda: geometry))
    return replace(trial, prepared=prepared, moment=prepared.moment(0, 17, 17))


@hard(
    "V behind {scale:g} {seed}", "a triangle that reaches behind the light, scale {scale:g}",
    "products of three lengths that leave float32",
    rows("seed scale", (2, 1e-36), (0, 2e-16), (5, 2e-16), (3, 1e12), (9, 1e12), (7, 1e34)),
)  # fmt: skip
def behind_the_light(seed: int, **place: Any) -> Trial:
    """A triangle that reaches behind a light, whose plane passes near it, and shadows all of a floor; turned at random. At
    scales of 2e-16 and 1e12 these have signs of products of three lengths that float32 does not hold.
    """
    random = np.random.default_rng(seed)
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    height = 2.0 ** -random.uniform(3, 14)
    points, faces = joined(triangles((8, 1, 0), (-8, 7, 0), (-7, -9, 0)), plane(2, -1, 4))
    light, eye, towards = (axes @ place for place in ((0.25, 0.125, height), (0.0, 0.0, -6.0), (0.0, 0.0, 1.0)))
    return view((points @ axes.T, faces), [light], eye, towards, 0.125, stated=Counts(256, (256,)), **place)


@hard(
    "V mixed {seed}", "coordinates of 1e-8 to 1e8 in one mesh", "bounds by the largest coordinate",
    rows("seed", *MIXED_SEEDS),
)  # fmt: skip
def mixed_scene(seed: int) -> Trial:
    """Triangles, eye and lights whose coordinates are each between 1e-8 and 1e8 in size, of either sign."""
    random = np.random.default_rng(seed)
    size = 10.0 ** random.uniform(-8, 8, (600, 3, 3))
    mesh = triangles(size * random.choice([-1.0, 1.0], size.shape))
    random = np.random.default_rng(seed + 100)
    eye, *lights = 10.0 ** random.uniform(-8, 8, (3, 3)) * random.choice([-1.0, 1.0], (3, 3))
    towards = 10.0 ** random.uniform(-2, 2, 3) * random.choice([-1.0, 1.0], 3)
    return view(mesh, lights, eye, towards * np.abs(eye).max())


@hard(
    "V stretched {axis}", "ball on a floor, 1e5 times as long and flat", "bounds by the largest coordinate", axes("xyz")
)
def stretched(**place: Any) -> Trial:
    """A ball on a floor, 6e5 long, 6 wide and 1e-5 thick: each coordinate has its own factor."""
    points, faces = ball_on_floor()
    factors = np.array([1e5, 1e-5, 1.0])
    mesh, lights = (points * factors, faces), LAMPS * factors
    return view(mesh, lights, (0.3e5, 1.7e5, 3.1), (0, -1, 0), 1.2, (24, 24), up=(1, 0, 0), **place)
