"""V scale, V far, V sun, V behind, V mixed and more: scenes, lights and directions near the limits of float32.

Products of two lengths overflow from 2e19 on and underflow from 1e-19 down, those of three from 7e12 and 2e-13. Numbers
below 1.2e-38 are subnormal: they lose digits, and a processor that flushes them treats them as 0.
"""

from dataclasses import replace

import numpy as np

from ..scene.prepared import prepare
from ..scene.scene import Geometry, Light, Vector
from .case import Counts, Trial, axes, hard, rows, view
from .shapes import Mesh, joined, plane, sheet, triangles
from .variants import ball_on_floor, small_scene

SCALES = (1e-36, 1e-30, 1e-24, 1e-18, 1e-12, 1e12, 1e15, 5e18, 2e19, 1e20, 1e28, 1e36)
MIXED_SEEDS = (0, 1, 2, 3, 4, 5, 11, 13, 36, 42)
"""Six in a row, and four whose rays pass so close to the edges of triangles 1e7 long that a bound by the largest
coordinate takes them for hits. In 0, 2 and 3 such a bound takes the eye for a point in the plane of the triangle seen."""

FLUSHED = "subnormal numbers flushed to 0"

hard(
    "V scale {scale:g}", "ball on a floor, scale {scale:g}", "float32 products that overflow or vanish",
    rows("scale", *SCALES), offset=0.0,
)(small_scene)  # fmt: skip


@hard(
    "V far {radii:g}", "light {radii:g} radii away", "directions and distances from a light far away",
    rows("radii turn", (1e10, 0), (1e15, 1), (1e20, 2), (1e30, 0), (1e38, 1)),
)  # fmt: skip
def far_light(radii: float, turn: int) -> Trial:
    """A ball on a floor, and a light so far away that its directions to the scene are the same in float32."""
    x, y, z = (radii * c for c in (0.36, 0.8, 0.48))
    return view(
        ball_on_floor(), [(x, y, z), (-z, 0.7 * y, -x)], (0.3, 1.7, 3.1), (-0.1, -0.45, -1), 0.5, (24, 24), turn=turn
    )


@hard(
    "V sun 3e21", "directional lights, scale 3e21", "a light at infinity, no shadow, and no word", refused=True, scale=3e21,
)  # fmt: skip
@hard(
    "V sun {scale:g}", "directional lights, scale {scale:g}", "a light that stands where float32 ends",
    rows("scale", 1e-36, 1e-12, 1e12, 1e19, 1e20),
)  # fmt: skip
def sun(scale: float) -> Trial:
    suns = [Light(way, directional=True) for way in ((0.36, 0.8, 0.48), (-0.9, 0.3, 0.1))]
    return view(ball_on_floor(), suns, (0.3, 1.7, 3.1), (-0.1, -0.45, -1), 0.5, (24, 24), scale=scale)


@hard("V subnormal {axis}", "ball on a floor, scale 2^-131", FLUSHED, axes("xyz"))
def subnormal_scene(turn: int) -> Trial:
    """A ball on a floor 2^-131 in size: its coordinates have at most 18 bits, and lights and eye are subnormal too."""
    return view(
        ball_on_floor(), [(1, 2.5, 0.5), (-0.4, 0.1, 0.7)], (0.3, 1.7, 3.1), (-0.1, -0.45, -1), 0.5, turn=turn,
        scale=2.0**-131,
    )  # fmt: skip


@hard("V among {axis}", "vertices off a plane by subnormal numbers", FLUSHED, axes("xyz"))
def among_subnormals(turn: int) -> Trial:
    """Sheets through 0 whose vertices lie off their plane by subnormal numbers, and eye and light off the axis by such."""
    x = np.arange(-4.0, 5.0) / 4
    points, faces = sheet(x, x, 1.0)
    noise = np.random.default_rng(41).integers(-99, 100, points.shape) * 2.0**-149
    flat = np.where(points * (1, 1, 0) == 0, noise, points * (1, 1, 0))
    low = flat + (0, 0, -1)
    return view(
        joined((flat, faces), (low, faces)), [(2.0**-140, 0.0, 2.0**-100), (1.0, 2.0, 3.0)], (2.0**-149, -(2.0**-130), 1.0),
        (0, 0, -1), 1.1, (16, 16), turn=turn,
    )  # fmt: skip


@hard(
    "V least {eye:.0e} {axis}", "sheets one least number apart, seen from {eye:.0e}", FLUSHED,
    rows("eye", 2.0**-148, 2.0**-130), axes("xyz"),
)  # fmt: skip
def one_step_from_zero(eye: float, turn: int) -> Trial:
    """A plane at z = 0 and, in front of it but later in the list, one at the smallest positive number of float32.

    From an eye at twice that number they are at distances of 2 and 1 of it.
    """
    least = 2.0**-149
    half = eye * 8
    lights = [(0.25 * eye, 0.5 * eye, side * eye) for side in (4, -4)]
    return view(
        joined(plane(2, 0, half), plane(2, least, half)), lights, (0, 0, eye), (0, 0, -eye), 1.0,
        turn=turn, stated=Counts(256, (0, 256)),
    )  # fmt: skip


@hard("V zeros {axis}", "vertices at 0 and -0", "0 and -0 taken for two vertices", axes("xyz"))
def two_zeros(turn: int) -> Trial:
    """Squares that meet along x = 0, y = 0 and at the origin, where their own vertices are 0 or -0, from an eye at -0."""
    x = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    points, faces = sheet(x, x, 1.0)
    corners = points[faces]
    signs = np.where(np.random.default_rng(47).integers(0, 2, corners.shape), -0.0, 0.0)
    corners = np.where(corners == 0, signs, corners) * (1, 1, 2)
    trial = view(
        joined(triangles(corners), plane(2, -4, 8)), [(-0.0, 0.0, 0.0), (0.0, -0.0, 2.0)], (0, 0, 0), (0, 0, -1), 1.0,
        (17, 17), turn=turn, stated=Counts(289, (0, None)),
    )  # fmt: skip
    scene = trial.prepared.scene
    zero: tuple[float, float, float] = (-0.0, -0.0, -0.0)
    where = np.roll(np.concatenate([corners.reshape(-1, 3), plane(2, -4, 8)[0]]), turn, axis=1)
    prepared = prepare(
        replace(
            scene, camera=replace(scene.camera, eye=zero), geometry=lambda: Geometry.static(where, trial.prepared.faces),
            lights=(replace(scene.lights[0], position=zero), scene.lights[1]),
        )
    )  # fmt: skip
    return replace(trial, prepared=prepared, moment=prepared.moment(0, 17, 17))


@hard(
    "V behind {scale:g} {seed}", "a triangle that reaches behind the light, scale {scale:g}",
    "products of three lengths that leave float32",
    rows("seed scale", (2, 1e-36), (0, 2e-16), (5, 2e-16), (3, 1e12), (9, 1e12), (7, 1e34)),
)  # fmt: skip
def behind_the_light(seed: int, scale: float) -> Trial:
    """A triangle that reaches behind a light, whose plane passes near it, and shadows all of a floor; turned at random. At
    scales of 2e-16 and 1e12 these have signs of products of three lengths that float32 does not hold."""
    random = np.random.default_rng(seed)
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    height = 2.0 ** -random.uniform(3, 14)
    roof = triangles((8, 1, 0), (-8, 7, 0), (-7, -9, 0))
    points, faces = joined(roof, plane(2, -1, 4))
    light, eye, towards = (tuple(axes @ place) for place in ((0.25, 0.125, height), (0.0, 0.0, -6.0), (0.0, 0.0, 1.0)))
    return view((points @ axes.T, faces), [light], eye, towards, 0.125, scale=scale, stated=Counts(256, (256,)))


def mixed(seed: int) -> Mesh:
    """Triangles whose coordinates are each between 1e-8 and 1e8 in size, of either sign."""
    random = np.random.default_rng(seed)
    size = 10.0 ** random.uniform(-8, 8, (600, 3, 3))
    return triangles(size * random.choice([-1.0, 1.0], size.shape))


@hard(
    "V mixed {seed}", "coordinates of 1e-8 to 1e8 in one mesh", "bounds by the largest coordinate",
    rows("seed", *MIXED_SEEDS),
)  # fmt: skip
def mixed_scene(seed: int) -> Trial:
    """Such triangles with an eye and lights whose coordinates are mixed in the same way."""
    random = np.random.default_rng(seed + 100)
    eye, *lights = (10.0 ** random.uniform(-8, 8, (3, 3)) * random.choice([-1.0, 1.0], (3, 3))).tolist()
    towards = 10.0 ** random.uniform(-2, 2, 3) * random.choice([-1.0, 1.0], 3)
    far = max(map(abs, eye))
    return view(mixed(seed), [(a, b, c) for a, b, c in lights], eye, towards * far, 1.0)


@hard(
    "V stretched {axis}", "ball on a floor, 1e5 times as long and flat", "bounds by the largest coordinate", axes("xyz")
)
def stretched(turn: int) -> Trial:
    """A ball on a floor, 6e5 long, 6 wide and 1e-5 thick: each coordinate has its own factor."""
    points, faces = ball_on_floor()
    factors = np.array([1e5, 1e-5, 1.0])

    def at(x: float, y: float, z: float) -> Vector:
        return x * 1e5, y * 1e-5, z

    return view(
        (points * factors, faces), [at(1, 2.5, 0.5), at(-0.4, 0.1, 0.7)], (0.3e5, 1.7e5, 3.1), (0, -1, 0), 1.2, (24, 24),
        up=(1, 0, 0), turn=turn,
    )  # fmt: skip
