"""What takes the shadow rays: the tree, or a grid of each light. Decided before the first frame, from the scene.

A grid of a light's rays tests every triangle against the rays of the cells that it covers, so that triangles which lie
behind one another cost it time. A tree costs the time of its build, in proportion to the triangles, and a walk per ray,
which ends at the first occluder. So many lights share one build, and each has a grid.
"""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from ...harness.frame.frame import Frame
from ...harness.scene.effects import Effects

MOST_LAYERS = 1.05
"""A light whose rays cross more triangles on average is enclosed, as in a furnished room; those in an empty one cross 1."""

OPEN, ENCLOSED = 600, 64
"""Pixels per triangle below which a grid is faster (docs/methods/hybrid.md says on which scenes that was found)."""

FAR = 1024.0
"""Radii beyond which a light is looked from at this distance: float64 would round the triangles' solid angles away."""

SHARED = 48
"""Pixels per triangle, times lights, from which one build and a walk to each light are faster than a grid of each, if the
lights are enclosed: found at 4 and 16 lights in rooms of 82 to 285 thousand triangles at 1024x1024 on one H200. In open
scenes a walk takes longer than a grid, so that no number of lights pays for the build.
"""

SPARSE = 4.0
"""Pixels per triangle below which no number of enclosed lights pays for the tree: a walk to each light then takes longer
than its grid (found in rooms with 4 to 64 targets at 512x512 on one H200, and 16 to 64 lights at 1024x1024 on one H100).
"""

LOOKED_FROM = 4
"""Lights from which triangles are looked at, at most."""

SAMPLED = 1 << 17
"""Triangles that are looked at, at most: every second, third ... of a larger mesh."""


def chosen(frame: Frame, effects: Effects) -> str:
    """``tree`` or ``grid``. Mirrored rays need the tree, which then serves both."""
    if effects.bounces or frame.triangle_count * OPEN <= frame.pixels:
        return "tree"
    casting = [i for i, wanted in enumerate(effects.shadows) if wanted]
    most: float = OPEN
    if mean_layers(frame, casting[:: max(1, -(-len(casting) // LOOKED_FROM))]) > MOST_LAYERS:
        most = ENCLOSED if len(casting) == 1 else max(SHARED / len(casting), SPARSE)
    return "grid" if frame.triangle_count * most > frame.pixels else "tree"


def mean_layers(frame: Frame, lights: Collection[int]) -> float:
    """How many triangles of the first frame a ray of a light crosses on its whole way through the scene, mean of ``lights``.

    The sum of the triangles' solid angles over that of the scene's bounding sphere, all directions if the light is within.
    """
    prepared = frame.prepared
    moment = prepared.moment(0, 1, 1)
    step = -(-prepared.triangle_count // SAMPLED)
    faces = prepared.faces[::step][moment.valid[::step] != 0]
    if moment.proxy_positions is None or not lights or not len(faces) or not prepared.radius > 0.0:
        return 0.0
    found = []
    for post in moment.proxy_positions[list(lights)].astype(np.float64):
        way = (post - prepared.middle) / prepared.radius
        away = float(np.linalg.norm(way))
        if away > FAR:
            way, away = way * (FAR / away), FAR
        seen = 4.0 * np.pi if away <= 1.0 else 2.0 * np.pi / away**2 / (1.0 + np.sqrt(1.0 - 1.0 / away**2))
        angles = solid_angles(moment.points, faces, prepared.middle + way * prepared.radius)
        found.append(step * angles.sum() / seen)
    return float(np.mean(found))


def solid_angles(
    points: NDArray[np.float32], faces: NDArray[np.int32], eye: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Solid angle of each triangle from ``eye``, steradians [n] (Van Oosterom and Strackee 1983); 0 where not finite."""
    with np.errstate(all="ignore"):
        ways = points.astype(np.float64) - eye
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        a, b, c = ways[faces[:, 0]], ways[faces[:, 1]], ways[faces[:, 2]]
        # Of differences: those of a far or small triangle are lost in the product of the directions.
        volume = np.abs(np.einsum("ij,ij->i", a, np.cross(b - a, c - a)))
        denominator = 1.0 + np.einsum("ij,ij->i", a, b) + np.einsum("ij,ij->i", b, c) + np.einsum("ij,ij->i", c, a)
        return np.nan_to_num(2.0 * np.arctan2(volume, denominator), nan=0.0)
