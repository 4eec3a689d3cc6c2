"""S06-S16, S21, S22, S34: lights inside, on, near to and far from surfaces."""

from typing import Any

import numpy as np

from ..arrays import F64
from ..scene.scene import Light
from .case import BESIDE, ORIGIN, Counts, Trial, axes, hard, rows, view
from .shapes import ball_on_floor, box, fan, joined, lattice, pixel_centres, plane, quad, triangles

ON_PLANE = "t = 0 taken for a hit; an origin on the wrong side"

TOUCHING, UNPADDED = "triangles that touch the outermost shadow rays", "light-grid bounds without padding"

SLAB = box((-1, -1, -1e-6), (1, 1, 1e-6))


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
    is excused, because rounding explains it. 64 steps are twice the bound of excused errors."""
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
    triangles do not shadow each other."""
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
    behind the light. The directions to this plane extend the rectangle of all rays over a quarter of the sphere."""
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
