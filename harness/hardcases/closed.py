"""P12i, P29-P31, S19, S20, S31 and more: rays exactly through vertices and edges of closed surfaces, from inside.

From inside there is no silhouette: around every vertex that a ray meets, the triangles form a closed fan. So a ray that
hits nothing has leaked through the surface, whatever the rounding. Sheets are closed by a cone behind the eye
(:func:`~.shapes.closed_behind`); the eye or the light is inside.
"""

import numpy as np

from ..arrays import F64
from .case import ORIGIN, Counts, Trial, hard, rows, view
from .shapes import Mesh, closed_behind, icosphere, joined, pixel_centres, plane, quad, sheet, split

NO_RULE = "boxes without padding; no rule for rays through edges"
NEIGHBOURS = "neighbours of the hit triangle taken for occluders"
FLAT = "hit points off their ray by rounding, and far along it at grazing incidence"
UNWELDED = "edge planes built in the order of vertex indices"
FAR = "cancellation in float64 edge functions, for rays through vertices"

SIDE = 64
"""Side of the image in pixels for cases that need many rays, because leaks are rare."""

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
    return view(
        split(mesh) if unwelded else mesh, [(shift, shift, 0.5 + shift)], (shift,) * 3, (0, 0, -1), 1.0,
        watertight=True, stated=Counts(256),
    )  # fmt: skip


def directions(towards: tuple[float, float, float], half: float, side: int) -> F64:
    """The float32 directions [side * side, 3] of all pixels from the origin, as float64."""
    rays = view(plane(2, -1, 1), [], ORIGIN, towards, half, (side, side)).moment
    return rays.directions(np.arange(side * side)).astype(np.float64)


def on_rays(towards: tuple[float, float, float], half: float, deepest: int, side: int = SIDE) -> Mesh:
    """A closed surface with a vertex exactly on the float32 ray of every pixel, whatever its direction.

    A vertex is its pixel's direction times a power of two up to 2^deepest, so that only the arithmetic of the
    intersection test rounds. The tip of the cone is as far behind the eye as the deepest vertex is in front of it.
    """
    depth = 2.0 ** np.random.default_rng(21).integers(0, deepest + 1, (side * side, 1))
    _, faces = sheet(np.arange(side), np.arange(side), 1.0)
    points = directions(towards, half, side) * depth
    return closed_behind((points, faces), -np.asarray(towards) * 2.0 ** (deepest + 1))


@hard("P29", "rays through vertices in odd directions", NO_RULE, towards=ODD[0], half=0.7, deepest=2)
@hard("P29b", "the same, split", NO_RULE, towards=ODD[1], half=0.45, deepest=3, unwelded=True)
@hard("P29c", "the same, shallow", NO_RULE, towards=ODD[2], half=0.6, deepest=1)
def odd_vertices(towards: tuple[float, float, float], half: float, deepest: int, unwelded: bool = False) -> Trial:
    """Every ray of the image meets a vertex of :func:`on_rays`. Without lights; :func:`odd_lights` has them."""
    mesh = on_rays(towards, half, deepest)
    return view(
        split(mesh) if unwelded else mesh, [], ORIGIN, towards, half, (SIDE, SIDE),
        watertight=True, stated=Counts(SIDE * SIDE),
    )  # fmt: skip


@hard("P29d", "lights on rays through vertices", NEIGHBOURS, towards=ODD[0], half=0.7, deepest=2, side=16)
@hard("P29e", "the same, deeper", NEIGHBOURS, towards=ODD[1], half=0.45, deepest=3, side=16)
@hard("S35", "lights on flat rays through vertices", FLAT, towards=ODD[0], half=0.15, deepest=6, side=32, behind=False)
@hard("S35b", "the same, shallower", FLAT, towards=ODD[1], half=0.3, deepest=4, side=32, behind=False)
def odd_lights(towards: tuple[float, float, float], half: float, deepest: int, side: int, behind: bool = True) -> Trial:
    """The same with a light at the eye, and with ``behind`` one more behind the eye.

    The deeper the surface, the more grazing some rays meet their triangle. If a hit point is wrong along such a ray by
    more than its rounding, a neighbouring triangle that faces the ray shadows it.
    """
    lights = [ORIGIN, tuple((-np.asarray(towards)).tolist())][: 1 + behind]
    return view(
        on_rays(towards, half, deepest, side), lights, ORIGIN, towards, half, (side, side), watertight=True,
        stated=Counts(side * side, (0, None)[: 1 + behind]),
    )  # fmt: skip


@hard("S19c", "shadow rays through vertices in odd directions", NO_RULE, half=0.7)
def odd_shadow_vertices(half: float) -> Trial:
    """Every shadow ray meets a vertex of :func:`on_rays`, which contains the light; the receivers are outside.

    Seen from behind, the pixels' rays meet the plane z = -8 at exactly eight times their directions from the light.
    """
    mesh = on_rays((0, 0, -1), half, 2)
    return view(
        joined(mesh, plane(2, -8, 16)), [ORIGIN], (0, 0, -16), (0, 0, 1), half, (SIDE, SIDE), watertight=True,
        stated=Counts(SIDE * SIDE, (SIDE * SIDE,)),
    )  # fmt: skip


@hard("S19", "shadow rays through vertices", NO_RULE, unwelded=False, every=1)
@hard("S19b", "shadow rays through split vertices", UNWELDED, unwelded=True, every=1)
@hard("S20", "shadow rays through edges", NO_RULE, unwelded=False, every=2)
@hard("S20b", "shadow rays through split edges", UNWELDED, unwelded=True, every=2)
def through_vertices(unwelded: bool, every: int) -> Trial:
    """Shadow rays exactly through the vertices (every = 1) or vertices, edges and diagonals (2) of a bumpy sheet.

    The light is at the origin. A receiver at 4 (x, y, -1) is shadowed by the vertex on that ray.
    """
    x = pixel_centres(16)[::every]
    bumps = 1 + np.random.default_rng(5).integers(0, 8, (len(x), len(x))) / 8
    mesh = closed_behind(sheet(x, x, bumps), (0, 0, 2))
    # From behind the plane z = -4, at 4 from it: the same half width, so pixels meet it at 4 (x, y).
    return view(
        joined(split(mesh) if unwelded else mesh, plane(2, -4, 8)), [ORIGIN], (0, 0, -8), (0, 0, 1), 1.0,
        watertight=True, stated=Counts(256, (256,)),
    )  # fmt: skip


@hard("S24", "shadow rays through a flat rim", NO_RULE)
def through_rim() -> Trial:
    """A flat sheet whose border, met by the outer shadow rays, lies in the faces of its bounding box; walls behind it.

    Receivers at 3 (x, y, -1), sheet at (x, y, -1): thirds are rounded, so a ray can miss an unpadded box at its face.
    """
    x = pixel_centres(16)
    return view(
        joined(closed_behind(sheet(x, x, 1.0), (0, 0, 1)), plane(2, -3, 4)), [ORIGIN], (0, 0, -6), (0, 0, 1), 1.0,
        watertight=True, stated=Counts(256, (256,)),
    )  # fmt: skip


def snapped_sphere(eye: tuple[float, float, float]) -> Mesh:
    """An icosphere on a grid of 2^-12 whose vertices in front of the eye lie exactly on rays of pixels.

    Each vertex in front of the eye is moved to the nearest ray of an even column and row, at a depth on the grid. Pixels
    meet it exactly, and the pixel half way between two vertices meets their edge. Nothing is rounded.
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


@hard("P12i", "rays through an icosphere's vertices and edges", NO_RULE, eye=ORIGIN)
@hard("P12j", "the same from another point within", NO_RULE, eye=(0.25, -0.125, 0.375))
def inside_sphere(eye: tuple[float, float, float]) -> Trial:
    """An icosphere seen from a point inside it, and a light at another."""
    return view(
        snapped_sphere(eye), [(-0.125, 0.25, 0.0)], eye, (0, 0, -1), 1.0, (SIDE, SIDE), watertight=True,
        stated=Counts(SIDE * SIDE, (0,) if eye == ORIGIN else None),
    )  # fmt: skip


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
    eye = AXES[0] * radii
    light = tuple((eye * 0.5).tolist())
    return view(
        far_shell(radii), [light], eye.tolist(), (-eye).tolist(), 0.9 / radii, (24, 24), up=AXES[2].tolist(),
        watertight=True, stated=Counts(576),
    )  # fmt: skip


@hard("S31 {radii:g}", "a light in a shell {radii:g} long", FAR, rows("radii", 1e3, 1e5, 1e6, 1e7))
def far_light_inside(radii: float) -> Trial:
    """A distant light inside the shell, and a floor behind the patch, seen from behind: the floor is all in shadow."""
    floor = [(-2.0 * AXES[0] + 0.75 * (i * AXES[1] + j * AXES[2])) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return view(
        joined(far_shell(radii), quad(*floor)), [tuple((AXES[0] * radii).tolist())], (AXES[0] * -4).tolist(),
        AXES[0].tolist(), 0.25, (24, 24), up=AXES[2].tolist(), watertight=True, stated=Counts(576, (576,)),
    )  # fmt: skip
