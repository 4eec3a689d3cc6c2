"""Back-face culling (paper, section 3): valid only where the surface is closed and seen from outside, with an exact test.

Culling changes no answer there, up to ties: a ray from outside enters a closed surface through a front face, and a
segment that leaves the surface towards a light outside crosses, if anything, a face that the light sees. Of two
triangles that a ray meets at one place, culling may leave the other one, and with it another rounding of the hit point.
Seen from inside, or through a hole, culling would lose hits; so it would where the triangle test itself lets a ray pass
between two front faces, which then meets no back face either. Such scenes and tests are refused, not traced wrongly.
"""

import functools
from collections.abc import Iterator
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.frame.geometry import Corners
from ...harness.scene.prepared import finite_bounds, recentre
from ...harness.scene.scene import Scene, Vector
from ...harness.scene.targets import targets_of
from ..exact.triangle import U64, largest, to_float64, total

NEAR = 1e-6
"""Distance from the surface, relative to that of a triangle's corners, within which a point counts as on it: more than
the rounding of float32.
"""


@wp.func
def faces_away(outward: wp.float64, viewer: wp.vec3f, corners: Corners) -> wp.bool:
    """Whether the triangle certainly turns its back to ``viewer``. ``outward``: +1 or -1 as faces are wound, 0: never."""
    if outward == wp.float64(0.0):
        return False
    a64 = to_float64(corners.a)
    ab = to_float64(corners.b) - a64
    ac = to_float64(corners.c) - a64
    oa = to_float64(viewer) - a64
    side = outward * wp.dot(wp.cross(ab, ac), oa)
    return side < -wp.float64(16.0) * U64 * largest(ab) * largest(ac) * total(oa)


def loses_hits(triangle_test: str) -> str | None:
    """Why back faces cannot be culled with a triangle test, or None. All tests but one may let rays pass between front
    faces.
    """
    if triangle_test == "exact":
        return None
    return f"culling needs triangle_test=exact: what slips between two front faces of {triangle_test} is lost behind"


@functools.lru_cache(maxsize=64)
def refusal(scene: Scene, lights_too: bool) -> str | None:
    """Why back faces of this scene cannot be culled, or None. ``lights_too``: the lights' back faces are culled as well.

    Every frame is tried, with its eye and lights as they are traced: recentred, in float32. A point outside the bounds
    of the surface costs nothing; one inside them costs a sum over all triangles, a fifth of a second for a million.
    """
    if not scene.closed:
        return "culling needs a scene declared closed"
    if scene.alpha is not None:
        return "culling needs triangles without holes: back faces are seen through them"
    geometry = scene.geometry()
    faces = np.asarray(geometry.faces).reshape(-1, 3)
    last: Any = None
    centre = np.zeros(3)
    for frame in range(geometry.frame_count if len(faces) else 0):
        positions = geometry.positions(frame)
        moved = positions is not last
        if moved:
            last = positions
            points = np.asarray(positions, dtype=np.float64).reshape(-1, 3)
            if frame == 0:
                centre = recentre(points)
                middle = np.add(*finite_bounds(points)) / 2
            surface = as_traced(points, centre)
            if not np.isfinite(surface[faces]).all():
                return "culling needs finite vertices: where a triangle is left out, there is a hole"
            if inside(surface, faces, as_traced(scene.camera.eye, centre)):
                return "culling needs the eye outside the closed surface"
        if lights_too and (moved or scene.light_path is not None):
            for position in lights_at(scene, frame / max(1, geometry.frame_count - 1), middle):
                if inside(surface, faces, as_traced(position, centre)):
                    return "culling for lights needs every light outside the closed surface"
    return None


def lights_at(scene: Scene, share: float, middle: NDArray[np.float64]) -> Iterator[Vector]:
    """The positions of lights with shadows, of an area those of its targets, at a share of the animation. Directional lights
    are left out: they cannot be inside. ``middle``: of the first frame.
    """
    path: Any = scene.light_path
    for light in targets_of(scene.lights if path is None else path.at(scene.lights, share), middle, scene.camera.up):
        if light.shadows and not light.directional:
            yield light.position


def as_traced(points: Any, centre: NDArray[np.float64]) -> NDArray[np.float64]:
    """Positions as every method gets them: relative to the scene's centre, rounded to float32."""
    with np.errstate(over="ignore"):
        return (np.asarray(points, dtype=np.float64) - centre).astype(np.float32).astype(np.float64)


def inside(points: NDArray[np.float64], faces: NDArray[np.int32], at: NDArray[np.float64]) -> bool:
    """Whether a closed surface winds around ``at``, or ``at`` lies on it within :data:`NEAR`.

    The solid angle of a closed surface is a multiple of 4 pi, and zero outside (van Oosterom & Strackee 1983). From a
    point of a triangle it is undefined; there half the triangle's own solid angle is at least pi / 2, and its volume is
    zero.
    """
    used = np.zeros(len(points), dtype=bool)
    used[faces] = True
    if not used.any() or (at < points[used].min(axis=0)).any() or (at > points[used].max(axis=0)).any():
        return False
    p = points - at
    lengths = np.linalg.norm(p, axis=1)
    if not lengths[used].all():
        return True
    p = p / np.where(lengths > 0.0, lengths, 1.0)[:, None]
    a, b, c = (p[faces[:, i]] for i in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a)))
    cosine = 1 + ab + bc + ca
    if ((np.abs(volume) <= NEAR) & (cosine <= NEAR)).any():
        return True
    return bool(abs((2 * np.arctan2(volume, cosine)).sum()) > 2 * np.pi)


def orientation(points: NDArray[np.float32], faces: NDArray[np.int32]) -> float:
    """+1 where faces are wound with their normal outward, -1 inward: the sign of the enclosed volume."""
    finite = points[np.isfinite(points).all(axis=1)]
    middle = finite.mean(axis=0, dtype=np.float64) if len(finite) else np.zeros(3)
    a, b, c = (points[faces[:, i]].astype(np.float64) - middle for i in range(3))
    with np.errstate(invalid="ignore"):
        volume = np.nansum(np.einsum("ij,ij->i", a, np.cross(b, c)))
    return 1.0 if volume >= 0 else -1.0
