"""S06-S16, S21, S22, S34: lights inside, on, near to and far from surfaces.

S01-S05, S17, S18: occluders where a spherical map around the light has seams, poles and curved edges; each exists three
times with permuted coordinates, so that it meets a seam or pole along any axis.

A: lights with an area that touches, crosses or lies in a surface, of extreme size, with targets on vertices. Judged are
the shadow bits of the targets; a surface exactly at a target does not count.
"""

import math
from typing import Any

import numpy as np

from ..arrays import F64
from ..scene.scene import Light, Vector
from ..scene.targets import target_places
from .case import BESIDE, ORIGIN, Counts, Trial, axes, hard, rows, spot_light, view
from .shapes import ball, ball_on_floor, box, fan, joined, lattice, pixel_centres, plane, quad, triangles

ON_PLANE = "t = 0 taken for a hit; an origin on the wrong side"

TOUCHING, UNPADDED = "triangles that touch the outermost shadow rays", "light-grid bounds without padding"

SLAB = box((-1, -1, -1e-6), (1, 1, 1e-6))

DOWN = (0.0, 0.0, -1.0)


@hard(
    "S01{axis}", "wall across the azimuth's seam", "a box of azimuths wraps to the full circle or its complement", axes(),
)  # fmt: skip
def seam(**place: Any) -> Trial:
    """A wall at x = -2 that the half plane of azimuth pi crosses; receivers at x = -4 within its shadow."""
    mesh, stated = joined(plane(0, -2, 1), plane(0, -4, 8)), Counts(256, (256,))
    return view(mesh, [ORIGIN], (-8, 0, 0), (1, 0, 0), 0.125, (32, 8), stated=stated, **place)


@hard("S02{axis}", "pole inside a triangle", "bounds that are not the full circle of azimuth up to the pole", axes())
def pole_inside(**place: Any) -> Trial:
    """A triangle that contains the pole; the receivers are three times as far away."""
    mesh = joined(triangles((0.4, 0, 1), (-0.3, 0.35, 1), (-0.2, -0.3, 1)), plane(2, 3, 8))
    return view(mesh, [ORIGIN], (0, 0, 7), (0, 0, -1), 3 / 32, (8, 8), stated=Counts(64, (64,)), **place)


@hard("S03{axis}", "nadir under a ceiling light", "a pole of the spherical map among the receivers", axes())
def nadir(**place: Any) -> Trial:
    """A table of 4 x 4 under a ceiling light; receivers on the floor all around the nadir."""
    mesh = joined(plane(2, -1.5, 2), plane(2, -3, 8))
    return view(mesh, [ORIGIN], (0, 0, -7), (0, 0, 1), 0.75, stated=Counts(256, (256,)), **place)


@hard("S04{axis}", "edge through the pole", "azimuths that differ by exactly pi, with two ways round", axes())
def edge_through_pole(**place: Any) -> Trial:
    """An edge that passes exactly over the light: the azimuths of its ends differ by pi. The shadow rays of the middle
    row of receivers meet the edge, which belongs to the closed triangle; the others miss it.
    """
    mesh = joined(triangles((1, 0, 2), (-1, 0, 2), (-1, 1e-3, 2)), plane(2, 4, 8))
    return view(mesh, [ORIGIN], (0, 0, 8), (0, 0, -1), 5 / 32, (16, 5), stated=Counts(80, (16,)), **place)


@hard(
    "S05{axis}", "bulge of a great circle", "the box of the vertices misses every ray: great arcs bulge beyond it", axes(),
)  # fmt: skip
def bulge(**place: Any) -> Trial:
    """An edge between elevations of 45 degrees reaches 57: every receiver lies between the two."""

    def at(azimuth: float, elevation: float) -> tuple[float, float, float]:
        a, b = math.radians(azimuth), math.radians(elevation)
        return math.cos(b) * math.cos(a), math.cos(b) * math.sin(a), math.sin(b)

    mesh, stated = joined(triangles(at(50, 45), at(-50, 45), at(0, 30)), plane(0, 3, 16)), Counts(32, (32,))
    return view(mesh, [ORIGIN], (7, 0, 3.85), (-1, 0, 0), 0.175, (2, 16), up=(0, 0, 1), stated=stated, **place)


@hard("S18{axis}", "walls all around the light", "seam, both poles and every face of a cube at once", axes())
def around_the_light(**place: Any) -> Trial:
    """Large triangles on every side of the light, across the seam and both poles, and receivers behind all of them."""
    shell = joined(*(plane(axis, at, 3) for axis in (2, 0, 1) for at in (1, -1)), plane(2, -4, 64))
    return view(shell, [ORIGIN], (0, 0, -8), (0, 0, 1), 8.0, stated=Counts(256, (256,)), **place)


@hard("S17{axis}", "spot over the seam", "a rectangle stored as (min, max) has min > max", axes(), side=-1.0)
@hard(
    "S17r{axis}", "the same spot, away from the seam", "nothing by itself: compared with the spot over the seam", axes(),
    side=1.0,
)  # fmt: skip
def spot_over_seam(side: float, **place: Any) -> Trial:
    """S01 with a spotlight whose rectangle of azimuth runs from 170 to 190 degrees, across the seam. ``side`` 1: the
    same scene rotated by exactly 180 degrees, so that the rectangle runs from -10 to 10 degrees.
    """
    wall = quad((-2, -1, -1), (-2, 0.25, -1), (-2, 0.25, 1), (-2, -1, 1))
    points, faces = joined(wall, plane(0, -4, 8))
    mesh, light = (points * (-side, -side, 1), faces), spot_light(ORIGIN, (side, 0, 0), 10.0, 10.0, (0, 0, 1))
    eye, towards, stated = (8 * side, 0, 0), (-side, 0, 0), Counts(256, (120,))
    return view(mesh, [light], eye, towards, 0.25, up=(0, 0, 1), stated=stated, **place)


@hard("S06", "light in a triangle", "a surface at the light (t = 1) taken for an occluder")
def light_in_triangle() -> Trial:
    """A light exactly in the plane of a triangle, which does not shadow it, and one just below, which it shadows."""
    mesh = joined(triangles((4, 0, 0), (-4, 4, 0), (-4, -4, 0)), plane(2, 2, 4))
    return view(
        mesh, [ORIGIN, (0, 0, 0.5), (0, 0, -0.25)], (0, 0, 6), (0, 0, -1), 0.125, (8, 8), stated=Counts(64, (0, 0, 64))
    )


@hard("S07", "light on a vertex and on an edge", "a vertex without a direction: atan2(0, 0)")
def light_on_vertex() -> Trial:
    """A light on the tip that four triangles share, and one on their edge: a surface at the light does not count."""
    mesh = joined(fan(ORIGIN, [(1, 1, -1), (-1, 1, -1), (-1, -1, -1), (1, -1, -1)]), plane(2, -3, 8))
    return view(mesh, [ORIGIN, (0.5, 0.5, -0.5)], (0, 0, -7), (0, 0, 1), 0.25, stated=Counts(256, (0, None)))


@hard("S08", "closed box from within", "culling from the light drops every wall")
def box_from_within() -> Trial:
    """Eye and one light inside a closed box, another light above its lid."""
    lights, stated = [ORIGIN, (0, 0, 5)], Counts(256, (0, 256))
    return view(box(-1, 1), lights, (0.25, 0.125, 0.5), (0, 0, -1), stated=stated, closed=True)


@hard("S08b", "closed box from without", "a light frustum that must be the full sphere")
def box_from_without() -> Trial:
    """A light inside a closed box: everything outside is dark."""
    mesh, lights, stated = joined(box(-1, 1), plane(2, -2, 8)), [ORIGIN, (0.875, -0.875, 0.5)], Counts(256, (256, 256))
    return view(mesh, lights, (0, 0, -6), (0, 0, 1), watertight=True, stated=stated)


@hard("S09", "slab 2e-6 thick around the light", "light leaks if the ray offset exceeds the thickness")
def thin_slab() -> Trial:
    """A light inside a slab 2e-6 thick; receivers beyond it."""
    return view(joined(SLAB, plane(2, 1, 4)), [ORIGIN], (0, 0, 5), (0, 0, -1), 0.5, stated=Counts(256, (256,)))


@hard("S09b", "onto the thin slab", "a near plane beyond its faces")
def onto_thin_slab() -> Trial:
    """The slab itself as receiver: its upper face is lit by a light inside, 1e-6 away, and shadowed from one below."""
    return view(SLAB, [ORIGIN, (0, 0, -1)], (0, 0, 4), (0, 0, -1), 0.125, stated=Counts(256, (0, 256)), closed=True)


@hard(
    "S10 {distance:g}", "light at {distance:g}",
    "rounding of v - L; rays from the light that end before t = 1 lose every shadow", rows("distance", 1e3, 1e5, 1e7),
)  # fmt: skip
def far_light(distance: float) -> Trial:
    """A square at z = 1 shadows the plane z = 0 from a light at (0, 0, distance)."""
    mesh = joined(plane(2, 1, 1), plane(2, 0, 4))
    return view(mesh, [(0, 0, distance)], (0, 0, -4), (0, 0, 1), 0.5, stated=Counts(256, (64,)))


@hard(
    "S10b {distance:g}", "light at {distance:g}, from the side", "the same off the axes", rows("distance", 1e3, 1e5, 1e7),
)  # fmt: skip
def oblique_far_light(distance: float) -> Trial:
    """A ball on a floor under a far light from the side."""
    return view(ball_on_floor(), [np.array([0.48, 0.64, 0.6]) * distance], *BESIDE)


@hard("S11", "occluder 1e-4 from the light", "a near plane, an absolute epsilon")
def tiny_occluder() -> Trial:
    """A square 2e-5 wide, 1e-4 from the light; receivers at distance 1."""
    mesh = joined(plane(2, 1e-4, 1e-5), plane(2, 1, 2))
    return view(mesh, [ORIGIN], (0, 0, 5), (0, 0, -1), 0.0625, stated=Counts(256, (36,)))


@hard("S12", "grazing light on a tilted floor", "a fixed epsilon: acne")
def grazing_floor() -> Trial:
    """A tilted floor of many triangles under a grazing light; nothing shadows it."""

    def height(x: F64 | float, y: F64 | float) -> F64 | float:
        return 0.37 * x - 0.21 * y - 3.1

    x = pixel_centres(12, 2.0)
    floor = lattice(x, height(*np.meshgrid(x, x)))
    return view(floor, [(40.0, 30.0, height(40, 30) + 0.05)], ORIGIN, (0, 0, -1), 0.4, (24, 24))


@hard(
    "S13{end}", "two sheets {apart} apart, from {side}", "an offset through the next sheet",
    rows("end side above apart steps", ("", "above", True, "one step", 1), ("b", "below", False, "one step", 1),
         ("c", "above", True, "64 steps", 64), ("d", "below", False, "64 steps", 64)),
)  # fmt: skip
def two_sheets(above: bool, steps: int) -> Trial:
    """Two planes ``steps`` float32 steps apart. From above, the upper plane is visible and lit. At one step a wrong bit
    is excused, because rounding explains it. 64 steps are twice the bound of excused errors.
    """
    eye, towards = ((0, 0, 3), (0, 0, -1)) if above else ((0, 0, -1), (0, 0, 1))
    mesh = joined(plane(2, 1.0, 2), plane(2, 1.0 + steps * 2.0**-23, 2))
    stated = Counts(64, (0, 64) if above else (64, 0))
    return view(mesh, [(0.3, 0.2, 2.5), (0.3, 0.2, -0.5)], eye, towards, 0.25, (8, 8), stated=stated)


@hard("S12b{axis}", "receivers exactly on their plane", ON_PLANE, axes(), steps=0)
@hard("S12c{axis}", "receivers half a step off their plane", ON_PLANE, axes(), steps=1)
@hard("S12d{axis}", "receivers beside their plane", ON_PLANE, axes(), steps=3)
def on_their_plane(steps: int, **place: Any) -> Trial:
    """Receivers exactly on their plane (0 steps), or rounded to above or below it (1, 3). A sheet that rises by
    ``steps`` float32 steps from end to end, under grazing lights from both sides; some rays meet its vertices. Its
    triangles do not shadow each other.
    """
    x = pixel_centres(9, 2.0)
    mesh = lattice(x, 1.0 + np.round((x + 2) / 4 * steps) * 2.0**-23)
    lights = [(30.0, 20.0, 1.0 + 2.0**-10), (-30.0, 20.0, 1.0 - 2.0**-10), (0.3, 0.2, 4), (0.3, 0.2, -2)]
    stated = Counts(256, (0,) * 4) if not steps else None
    return view(mesh, lights, (0, 0, 2), (0, 0, -1), stated=stated, **place)


@hard("S14", "receiver at the light", "a ray of length 0: NaN tile")
def receiver_at_light() -> Trial:
    """Pixels whose hit point is the position of the light: there is no direction to it, and they are lit."""
    near = 4 * float(pixel_centres(16, 0.5)[9])
    lights = [(near, near, 0), (near, -near, 0), ORIGIN]
    return view(plane(2, 0, 4), lights, (0, 0, 4), (0, 0, -1), 0.5, stated=Counts(256, (0, 0, 0)))


@hard("S21", "wall on a floor that holds the light", "segments in a plane that touch an edge")
def wall_on_floor() -> Trial:
    """Light and receivers in the plane of the floor, and a wall on it; shadow rays meet the wall's lower edge."""
    wall = quad((1, -8, 0), (1, 8, 0), (1, 8, 2), (1, -8, 2))
    return view(joined(plane(2, 0, 4), wall), [(3, 0, 0)], (0, 0, 4), (0, 0, -1), 0.5, stated=Counts(256))


@hard("S15", "two lights at one place", "a light grid shared or overwritten by another light")
def same_place() -> Trial:
    """Three lights, two of them at one place: their rows of bits are the same."""
    lights = [(1, 3, 1), (-2, 1, 0.5), Light((1, 3, 1), intensity=0.5)]
    return view(ball_on_floor(), lights, *BESIDE, (24, 24), same_lights=((0, 2),))


@hard("S16", "all shadow rays in one tile", "chunk counts, short counters, empty tiles")
def one_tile() -> Trial:
    """All receivers except a column of 256 lie in one tile of the light: 130,816 rays, twice the range of 16 bits. The
    eye sees a small part of a near screen, half of it behind a wall. Past the edge of the screen it sees a plane just
    behind the light. The directions to this plane extend the rectangle of all rays over a quarter of the sphere.
    """
    above = 3 / 128
    edge = 510 / 512 / 128 / 16  # between the last two columns
    screen = quad((-1, -8, 4), (edge, -8, 4), (edge, 8, 4), (-1, 8, 4))
    wall = quad((-1, -1, 2), (1, -1, 2), (1, above / 2, 2), (-1, above / 2, 2))
    mesh, stated = joined(screen, wall, plane(2, -1 / 64, 8)), Counts(512 * 256, (511 * 128,))
    return view(mesh, [ORIGIN], (0, above, 4 + 1 / 16), (0, 0, -1), 2.0**-8, (512, 256), stated=stated)


@hard("S34", TOUCHING, UNPADDED, light=(1.796875, -1.8671875, -0.71484375))
@hard("S34b", TOUCHING, UNPADDED, light=(1.2890625, 1.7890625, -0.50390625))
def beyond_the_rays(light: tuple[float, float, float]) -> Trial:
    """Sixty small triangles, each touching one of the outermost shadow rays with a vertex, from outside.

    The vertex is exactly half way to the receiver. The light is off centre, so that its frame is rotated, and vertex and
    receiver are rounded differently. Except for that vertex, the triangle is outside the rectangle of the rays: if the
    vertex is rounded outwards, a grid without a pad omits the triangle.
    """
    x = 4 * pixel_centres(16)
    receivers = lattice(x, -4.0)[0]
    outwards = np.sign(receivers) * (np.abs(receivers) == x[-1])
    rim = outwards.any(axis=1)
    receivers, outwards = receivers[rim], outwards[rim]
    aside = outwards[:, [1, 0, 2]] * (-1, 1, 0) / 64
    touching = (np.array(light) + receivers) / 2
    further = touching + outwards / 16
    mesh = joined(triangles(np.stack([touching, further + aside, further - aside], axis=1)), plane(2, -4, 8))
    return view(mesh, [light], (0, 0, -8), (0, 0, 1), stated=Counts(256, (60,)))


@hard("S22", "light at the eye", "acne at silhouettes")
def light_at_eye() -> Trial:
    """A light at the eye: every closest hit is also the surface closest to the light, so none is shadowed."""
    return view(ball_on_floor(), [BESIDE[0]], *BESIDE, (24, 24))


def area(shape: str, size: float | tuple[float, float], samples: int = 4, at: Vector = ORIGIN) -> Light:
    """An area at a place, its plane perpendicular to z."""
    return Light(at, shape=shape, size=size, samples=samples, towards=DOWN)


@hard("A01", "area in the plane of a surface", "a surface at the light, and planes through it")
def in_surface() -> Trial:
    """A rectangle in the plane of a ceiling, which shadows nothing, and a disc in the plane of a triangle it overlaps."""
    lights = [area("rectangle", (2, 1)), area("disc", 1.5, at=(0.5, 0.25, -1))]
    mesh = joined(plane(2, 0, 8), triangles((0, 0, -1), (2, 0, -1), (0, 2, -1)), plane(2, -3, 8))
    stated = Counts(64, (*[None] * 4, *[0] * 4))
    return view(mesh, lights, (0, 0, -7), (0, 0, 1), 0.25, (8, 8), stated=stated)


@hard("A02", "area crossed by a surface", "one side taken for all targets of a light", height=0.0)
@hard("A03", "area that stands on a surface", "an offset from the light", height=0.25)
def across_surface(height: float) -> Trial:
    """A sphere that a sheet crosses, with targets on both sides; or that stands on it. Receivers beyond the sheet."""
    lamp = area("sphere", 0.5, 8, (0.0, 0.0, height))
    return view(joined(plane(2, 0, 1), plane(2, -2, 8)), [lamp], (0, 0, -6), (0, 0, 1), 0.5, (8, 8))


@hard("A04", "area around a box", "targets inside and outside one surface")
def around_surface() -> Trial:
    """A sphere of targets on the corners' radius of a box: nearly in its surface everywhere."""
    lamp = area("sphere", 2.0 * 3.0**0.5, 8)
    return view(joined(box(-1, 1), plane(2, -3, 8)), [lamp], (0, 0, -8), (0, 0, 1), 0.5, (8, 8))


@hard("A05", "area of size 0", "division by the size of a light", size=0.0)
@hard("A06", "area of size 1e-30", "division by the size of a light", size=1e-30)
@hard("A07", "area of 1e6 radii", "one region for all targets of a light", size=4e6)
@hard("A08", "rectangle of 1e6 radii", "one region for all targets of a light", size=4e6, shape="rectangle")
def of_size(size: float, shape: str = "sphere") -> Trial:
    """A light over a ball, its targets in one place or far outside the scene."""
    equal = tuple((0, i) for i in range(1, 4)) if size < 1e-20 else ()
    mesh, lamp = joined(ball(0.75, ORIGIN), plane(2, -1, 4)), area(shape, size, at=(0.5, 0.75, 3.0))
    return view(mesh, [lamp], (0, 0, -5), (0, 0, 1), 0.75, (8, 8), same_lights=equal)


@hard("A09", "targets on vertices", "a surface at the light counts")
def at_vertices() -> Trial:
    """A triangle hangs at each target by a corner, so that each target is a vertex and the others look past or at it."""
    lamp = area("rectangle", 2.0)
    hung = [(p, (p[0] + 0.5, p[1], -1.0), (p[0], p[1] + 0.5, -1.0)) for p in target_places(lamp, 0, np.zeros(3), DOWN)]
    return view(joined(triangles(*hung), plane(2, -3, 8)), [lamp], (0, 0, -7), (0, 0, 1), 0.5, (8, 8))


@hard("A10", "256 targets", "a fixed number of lights", large=True, lights=1, samples=256)
@hard("A11", "64 lights with areas", "a fixed number of lights", large=True, lights=64, samples=2)
def many(lights: int, samples: int) -> Trial:
    """Many lights, or one with many targets, over a ball."""
    lamps = [area("disc", 1.0, samples, (float(x), 0.5, 2.5)) for x in np.linspace(-1, 1, lights)]
    return view(joined(ball(0.75, ORIGIN), plane(2, -1, 4)), lamps, (0, 0, -5), (0, 0, 1), 0.75, (4, 4))
