"""Back-face culling (paper, section 3): legal only where the surface is closed and seen from outside.

Culling changes no answer there, up to exact ties: a ray from outside enters a closed surface through a front face,
and a segment that leaves the surface towards a light outside crosses, if anything, a face that the light sees.
Seen from inside, or through a hole, culling would lose hits; such scenes are refused, not traced wrongly.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.scene import Scene
from ..common.triangle import U64, largest, to_float64, total

FRAMES = 5
"""Frames of an animation, spread over its length, whose eye and lights are tried."""


@wp.func
def faces_away(outward: wp.float64, o: wp.vec3f, a: wp.vec3f, b: wp.vec3f, c: wp.vec3f) -> wp.bool:
    """Whether the triangle certainly turns its back to o. ``outward``: +1 or -1 as faces are wound, 0: never."""
    if outward == wp.float64(0.0):
        return False
    a64 = to_float64(a)
    ab = to_float64(b) - a64
    ac = to_float64(c) - a64
    oa = to_float64(o) - a64
    side = outward * wp.dot(wp.cross(ab, ac), oa)
    return side < -wp.float64(16.0) * U64 * largest(ab) * largest(ac) * total(oa)


@functools.lru_cache(maxsize=64)
def refusal(scene: Scene, lights_too: bool) -> str | None:
    """Why back faces of this scene must stay, or None. ``lights_too``: the lights' back faces go as well."""
    if not scene.closed:
        return "culling needs a scene declared closed"
    if scene.alpha is not None:
        return "culling needs triangles without holes: back faces are seen through them"
    geometry = scene.geometry()
    frames = np.unique(np.linspace(0, geometry.frame_count - 1, FRAMES).astype(int))
    for frame in frames:
        points = np.asarray(geometry.positions(int(frame)), dtype=np.float64).reshape(-1, 3)
        if inside(points, geometry.faces, np.asarray(scene.camera.eye)):
            return "culling needs the eye outside the closed surface"
        if lights_too:
            share = frame / max(1, geometry.frame_count - 1)
            path: Any = scene.light_path
            for light in scene.lights if path is None else path.at(scene.lights, share):
                if inside(points, geometry.faces, np.asarray(light.position)):
                    return "culling for lights needs every light outside the closed surface"
    return None


def inside(points: NDArray[np.float64], faces: NDArray[np.int32], at: NDArray[np.float64]) -> bool:
    """Whether a closed surface winds around ``at``: its solid angle there is not near zero (van Oosterom 1983)."""
    if not len(faces):
        return False
    p = points - at
    lengths = np.linalg.norm(p, axis=1)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        p = p / lengths[:, None]
        a, b, c = (p[faces[:, i]] for i in range(3))
        volume = np.einsum("ij,ij->i", a, np.cross(b, c))
        ab, bc, ca = (np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a)))
        angles = 2 * np.arctan2(volume, 1 + ab + bc + ca)
    return bool(abs(np.nansum(angles)) > np.pi)


def orientation(points: NDArray[np.float32], faces: NDArray[np.int32]) -> float:
    """+1 where faces are wound with their normal outward, -1 inward: the sign of the enclosed volume."""
    finite = points[np.isfinite(points).all(axis=1)]
    middle = finite.mean(axis=0, dtype=np.float64) if len(finite) else np.zeros(3)
    a, b, c = (points[faces[:, i]].astype(np.float64) - middle for i in range(3))
    with np.errstate(invalid="ignore"):
        volume = np.nansum(np.einsum("ij,ij->i", a, np.cross(b, c)))
    return 1.0 if volume >= 0 else -1.0
