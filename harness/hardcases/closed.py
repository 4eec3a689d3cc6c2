"""P08, P12-P15, P28, P29, P31, S19, S20, S24, S25, S31, S35: rays exactly through vertices and edges of flat sheets, and of
closed surfaces from inside.

From inside there is no silhouette: around every vertex that a ray meets, the triangles form a closed fan. So a ray that
hits nothing has leaked through the surface, whatever the rounding. Sheets are closed by a cone behind the eye
(:func:`~.shapes.closed_behind`); the eye or the light is inside.
"""

from typing import Any

import numpy as np

from ..arrays import F64
from .case import ORIGIN, Counts, Trial, axes, hard, rows, view
from .shapes import Mesh, Point, closed_behind, icosphere, joined, lattice, pixel_centres, plane, quad, sheet, split

NO_RULE = "boxes without padding; no rule for rays through edges"
NEIGHBOURS = "neighbours of the hit triangle taken for occluders"
FLAT = "hit points off their ray by rounding, and far along it at grazing incidence"
UNWELDED = "edge planes built in the order of vertex indices"
LEAVES = "0 times infinity: the ray leaves the box before it enters"
NO_THICKNESS = "bounding boxes without thickness: rays in their faces"
FAR = "cancellation in float64 edge functions, for rays through vertices"

SIDE = 64  # side of the image in pixels for cases that need many rays, because leaks are rare

ODD = ((1.0, 0.4, -0.8), (-0.3, 0.9, -0.5), (0.2, -0.1, 1.0))
"""View directions that are not along an axis, so that all bits of a float32 direction are used."""


@hard("P12", "rays through vertices", NO_RULE, every=1)
@hard("P13", "rays through edges", NO_RULE, every=2)
@hard("P14", "rays through split vertices", UNWELDED, every=1, unwelded=True)
@hard("P15", "rays through split edges", UNWELDED, every=2, unwelded=True, shift=0.375)
def bumpy(every: int, unwelded: bool = False, shift: float = 0.0) -> Trial:
    """A sheet whose vertices lie at varying depths on the rays of pixels; coordinates are small dyadic numbers.
    ``every``: 1: rays through vertices only; 2: rays through vertices, edges and diagonals.
    """
    x = pixel_centres(16)[::every]
    depth = 1 + np.random.default_rng(9).integers(0, 16, (len(x), len(x))) / 16
    points, faces = closed_behind(sheet(x, x, depth), (0, 0, 2))
    mesh = points + shift, faces
    light, stated = (shift, shift, 0.5 + shift), Counts(256)
    return view(split(mesh) if unwelded else mesh, [light], (shift,) * 3, (0, 0, -1), watertight=True, stated=stated)


def directions(towards: Point, half: float, side: int = 16, eye: Point = ORIGIN) -> F64:
    """The float32 directions [side * side, 3] of all pixels, as float64."""
    rays = view(plane(2, -1, 1), [], eye, towards, half, (side, side)).moment
    return rays.directions(np.arange(side * side)).astype(np.float64)


def on_rays(towards: Point, half: float, deepest: int, side: int = SIDE) -> Mesh:
    """A closed surface with a vertex exactly on the float32 ray of every pixel, whatever its direction. A vertex is its
    pixel's direction times a power of two up to 2^deepest, so that only the arithmetic of the intersection test rounds.
    The tip of the cone is as far behind the eye as the deepest vertex is in front of it.
    """
    depth = 2.0 ** np.random.default_rng(21).integers(0, deepest + 1, (side * side, 1))
    points, faces = directions(towards, half, side) * depth, lattice(np.arange(side), 0.0)[1]
    return closed_behind((points, faces), -np.asarray(towards) * 2.0 ** (deepest + 1))


@hard("P08", "flat sheet, rays to its border", NO_THICKNESS, every=1, unwelded=False)
@hard("P08b", "flat sheet, rays through edges", NO_THICKNESS, every=2, unwelded=False)
@hard("P08c", "flat sheet with split vertices", "no rule for rays through edges", every=2, unwelded=True)
def flat_sheet(every: int, unwelded: bool) -> Trial:
    """A flat sheet; rays through all its vertices and its border (1), or vertices, edges and diagonals (2)."""
    x = pixel_centres(16)[::every]
    mesh, lights = sheet(x, x, 1.0), [(0, 0, 0.5), (0.25, 0.125, -3)]
    stated = Counts((17 - every) ** 2, (0, 0))
    return view(split(mesh) if unwelded else mesh, lights, ORIGIN, (0, 0, -1), watertight=True, stated=stated)


@hard("P08d{axis}", "rays in the upper face of the scene's box", LEAVES, axes(), side=1.0)
@hard("P08e{axis}", "rays in the lower face of the scene's box", LEAVES, axes(), side=-1.0)
def beside_the_eye(side: float, **place: Any) -> Trial:
    """A flat sheet that ends at the x of the eye: the middle column of rays lies in the upper (or lower) face of its
    bounding box. Rays and border have x = 0, so the decision is not rounded. The border belongs to the closed
    triangles.
    """
    x = np.sort(side * np.arange(-8, 1) / 4.0)
    mesh, light, stated = sheet(x, np.arange(-8, 9) / 4.0, 2.0), (-side, 0.0, 3.0), Counts(9 * 17, (0,))
    return view(mesh, [light], ORIGIN, (0, 0, -1), 1.0, (17, 17), watertight=True, stated=stated, **place)


@hard("P28", "flat sheet, odd directions to its border", NO_THICKNESS)
def on_odd_rays() -> Trial:
    """A flat sheet with a vertex exactly on the float32 ray of every pixel: its border is the border of the scene."""
    mesh = directions((0, 0, -1), 0.7), lattice(np.arange(16), 0.0)[1]
    return view(mesh, [ORIGIN, (0, 0, 4)], ORIGIN, (0, 0, -1), 0.7, stated=Counts(256))


@hard("P28b", "flat squares apart, met at their corners", NO_THICKNESS, shadow=False)
@hard("S25", "shadow rays at the corners of flat squares", NO_THICKNESS, shadow=True)
def patches(shadow: bool) -> Trial:
    """Sixty-four flat squares apart from each other, each with its corners on four rays of an odd direction. Every ray
    meets the corner of one box without thickness. ``shadow``: the rays are the shadow rays instead.
    """
    index = np.arange(256).reshape(16, 16)
    a, b, c, d = index[::2, ::2], index[::2, 1::2], index[1::2, 1::2], index[1::2, ::2]
    faces = np.concatenate([np.stack(f, axis=-1).reshape(-1, 3) for f in ((a, b, c), (a, c, d))])
    mesh = directions((0, 0, -1), 0.7), faces
    if not shadow:
        return view(mesh, [(0, 0, 1)], ORIGIN, (0, 0, -1), 0.7, stated=Counts(256, (0,)))
    # Seen from behind, the rays meet the plane z = -4 at exactly four times the corners: column x and row y agree.
    return view(joined(mesh, plane(2, -4, 8)), [ORIGIN], (0, 0, -8), (0, 0, 1), 0.7, stated=Counts(256, (256,)))


@hard("P29", "rays through vertices in odd directions", NO_RULE, towards=ODD[0], half=0.7, deepest=2)
@hard("P29b", "the same, split", NO_RULE, towards=ODD[1], half=0.45, deepest=3, unwelded=True)
@hard("P29c", "the same, shallow", NO_RULE, towards=ODD[2], half=0.6, deepest=1)
def odd_vertices(towards: Point, half: float, deepest: int, unwelded: bool = False) -> Trial:
    """Every ray of the image meets a vertex of :func:`on_rays`. Without lights; :func:`odd_lights` has them."""
    mesh, stated = on_rays(towards, half, deepest), Counts(SIDE * SIDE)
    mesh = split(mesh) if unwelded else mesh
    return view(mesh, [], ORIGIN, towards, half, (SIDE, SIDE), watertight=True, stated=stated)


@hard("P29d", "lights on rays through vertices", NEIGHBOURS, towards=ODD[0], half=0.7, deepest=2, side=16)
@hard("P29e", "the same, deeper", NEIGHBOURS, towards=ODD[1], half=0.45, deepest=3, side=16)
@hard("S35", "lights on flat rays through vertices", FLAT, towards=ODD[0], half=0.15, deepest=6, side=32, lights=1)
@hard("S35b", "the same, shallower", FLAT, towards=ODD[1], half=0.3, deepest=4, side=32, lights=1)
def odd_lights(towards: Point, half: float, deepest: int, side: int, lights: int = 2) -> Trial:
    """The same with a light at the eye, and perhaps one more behind the eye. The deeper the surface, the more grazing
    some rays meet their triangle. If a hit point is wrong along such a ray by more than its rounding, a neighbouring
    triangle that faces the ray shadows it.
    """
    mesh, stated = on_rays(towards, half, deepest, side), Counts(side * side, (0, None)[:lights])
    shining = [ORIGIN, -np.asarray(towards)][:lights]
    return view(mesh, shining, ORIGIN, towards, half, (side, side), watertight=True, stated=stated)


@hard("S19c", "shadow rays through vertices in odd directions", NO_RULE)
def odd_shadow_vertices() -> Trial:
    """Every shadow ray meets a vertex of :func:`on_rays`, which contains the light; the receivers are outside. Seen
    from behind, the pixels' rays meet the plane z = -8 at exactly eight times their directions from the light.
    """
    mesh, stated = joined(on_rays((0, 0, -1), 0.7, 2), plane(2, -8, 16)), Counts(SIDE * SIDE, (SIDE * SIDE,))
    return view(mesh, [ORIGIN], (0, 0, -16), (0, 0, 1), 0.7, (SIDE, SIDE), watertight=True, stated=stated)


@hard("S19", "shadow rays through vertices", NO_RULE, unwelded=False, every=1)
@hard("S19b", "shadow rays through split vertices", UNWELDED, unwelded=True, every=1)
@hard("S20", "shadow rays through edges", NO_RULE, unwelded=False, every=2)
@hard("S20b", "shadow rays through split edges", UNWELDED, unwelded=True, every=2)
def through_vertices(unwelded: bool, every: int) -> Trial:
    """Shadow rays exactly through the vertices (every = 1) or vertices, edges and diagonals (2) of a bumpy sheet. The
    light is at the origin. A receiver at 4 (x, y, -1) is shadowed by the vertex on that ray.
    """
    x = pixel_centres(16)[::every]
    bumps = 1 + np.random.default_rng(5).integers(0, 8, (len(x), len(x))) / 8
    mesh = closed_behind(sheet(x, x, bumps), (0, 0, 2))
    mesh, stated = joined(split(mesh) if unwelded else mesh, plane(2, -4, 8)), Counts(256, (256,))
    # From behind the plane z = -4, at 4 from it: the same half width, so pixels meet it at 4 (x, y).
    return view(mesh, [ORIGIN], (0, 0, -8), (0, 0, 1), watertight=True, stated=stated)


@hard("S24", "shadow rays through a flat rim", NO_RULE)
def through_rim() -> Trial:
    """A flat sheet whose border, met by the outer shadow rays, lies in the faces of its bounding box; walls behind it.

    Receivers at 3 (x, y, -1), sheet at (x, y, -1): thirds are rounded, so a ray can miss an unpadded box at its face.
    """
    x = pixel_centres(16)
    mesh, stated = joined(closed_behind(sheet(x, x, 1.0), (0, 0, 1)), plane(2, -3, 4)), Counts(256, (256,))
    return view(mesh, [ORIGIN], (0, 0, -6), (0, 0, 1), watertight=True, stated=stated)


def snapped_sphere(eye: tuple[float, float, float]) -> Mesh:
    """An icosphere on a grid of 2^-12 whose vertices in front of the eye lie exactly on rays of pixels. Each vertex in
    front of the eye is moved to the nearest ray of an even column and row, at a depth on the grid. Pixels meet it
    exactly, and the pixel half way between two vertices meets their edge. Nothing is rounded.
    """
    points, faces = icosphere(3)
    arms = np.round(points * 4096) / 4096 - eye
    depth = np.round(-arms[:, 2:] * 64) / 64
    x = pixel_centres(SIDE)
    before = (depth[:, 0] > 0) & (np.abs(arms[:, :2]) < 63 / 64 * depth).all(axis=1)
    # Even places of a row of pixels: x[0], x[2], ...
    place = np.clip(np.round((arms[before, :2] / depth[before] - x[0]) / (2 * (x[1] - x[0]))), 0, SIDE // 2 - 1)
    on_ray = x[2 * place.astype(int)]
    arms[before] = np.concatenate([on_ray, -np.ones((len(on_ray), 1))], axis=1) * depth[before]
    return arms + eye, faces


@hard("P12i", "rays through an icosphere's vertices and edges", NO_RULE, eye=ORIGIN, stated=Counts(SIDE * SIDE, (0,)))
@hard(
    "P12j", "the same from another point within", NO_RULE, eye=(0.25, -0.125, 0.375), stated=Counts(SIDE * SIDE),
)  # fmt: skip
def inside_sphere(eye: tuple[float, float, float], stated: Counts) -> Trial:
    """An icosphere seen from a point inside it, and a light at another."""
    mesh, light = snapped_sphere(eye), (-0.125, 0.25, 0.0)
    return view(mesh, [light], eye, (0, 0, -1), 1.0, (SIDE, SIDE), watertight=True, stated=stated)


AXES = np.array([(0.48, 0.64, 0.6), (0.8, -0.6, 0.0), (0.36, 0.48, -0.8)])
"""The direction towards the distant eye or light, and two perpendicular ones."""


def far_shell(radii: float) -> Mesh:
    """A bumpy patch of size 1, perpendicular to the direction of a point ``radii`` away, closed behind that point."""
    x = np.linspace(-1, 1, 19)
    bumps = np.random.default_rng(17).uniform(-0.05, 0.05, (19, 19)).ravel()
    flat, faces = sheet(x, x, 1.0)
    points = bumps[:, None] * AXES[0] + flat[:, :1] * AXES[1] - flat[:, 1:2] * AXES[2]
    return closed_behind((points, faces), AXES[0] * radii * 1.25)


@hard("P31 {radii:g}", "within a shell {radii:g} long", FAR, rows("radii", 1e3, 1e5, 1e6, 1e7))
def far_inside(radii: float) -> Trial:
    """The patch seen from inside its shell, from far away: the rounding of the rays is larger than its triangles."""
    mesh, eye, stated = far_shell(radii), AXES[0] * radii, Counts(576)
    return view(mesh, [eye * 0.5], eye, -eye, 0.9 / radii, (24, 24), up=AXES[2], watertight=True, stated=stated)


@hard("S31 {radii:g}", "a light in a shell {radii:g} long", FAR, rows("radii", 1e3, 1e5, 1e6, 1e7))
def far_light_inside(radii: float) -> Trial:
    """A distant light inside the shell, and a floor behind the patch, seen from behind: the floor is all in shadow."""
    towards, right, up = AXES
    floor = quad(*(-2.0 * towards + 0.75 * (i * right + j * up) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))))
    mesh, light, stated = joined(far_shell(radii), floor), towards * radii, Counts(576, (576,))
    return view(mesh, [light], towards * -4, towards, 0.25, (24, 24), up=up, watertight=True, stated=stated)
