"""Spheres, cubes, cones, cylinders, capsules and planes as triangles, about the origin and outwards.

All but cube and plane are surfaces of revolution: a profile of radii and heights, turned in :data:`AROUND` steps. The
number of triangles does not depend on the sizes, so that a shape that grows keeps its topology.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

AROUND, POLE_TO_POLE = 32, 16
"""Segments of a circle, and from one pole of a sphere to the other. Multiples of 4: bounds are those of the shape."""

RESOLUTION = f"{AROUND} segments around, {POLE_TO_POLE} from pole to pole"

Sizes = dict[str, float]
Surface = tuple[NDArray[np.float64], NDArray[np.int32]]

_POLE = np.pi / 2

_CUBE = np.array([[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
_SIDES = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])


def _quads(corners: NDArray[np.integer]) -> NDArray[np.int32]:
    """Two triangles for each row of four corners."""
    return corners[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3).astype(np.int32)


def revolved(radii: NDArray[np.float64], heights: NDArray[np.float64]) -> Surface:
    """The surface of a profile turned about z. Its first and last point lie on the axis and become one vertex each."""
    angle = np.arange(AROUND) * (2 * np.pi / AROUND)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rings = len(radii) - 2
    points = np.zeros((rings * AROUND + 2, 3))
    points[0, 2], points[-1, 2] = heights[0], heights[-1]
    turned = points[1:-1].reshape(rings, AROUND, 3)
    turned[..., :2] = radii[1:-1, None, None] * circle
    turned[..., 2] = heights[1:-1, None]
    here = np.arange(AROUND)
    after = (here + 1) % AROUND
    first, last = 1, 1 + (rings - 1) * AROUND
    low = np.stack([np.zeros(AROUND, dtype=int), first + after, first + here], axis=1)
    high = np.stack([np.full(AROUND, len(points) - 1), last + here, last + after], axis=1)
    start = (1 + AROUND * np.arange(rings - 1))[:, None]
    sides = np.stack([start + here, start + after, start + AROUND + after, start + AROUND + here], axis=2)
    return points, np.concatenate([low, _quads(sides.reshape(-1, 4)), high]).astype(np.int32)


def _arc(radius: float, first: float, last: float, steps: int) -> tuple[NDArray, NDArray]:
    """Radii and heights of a circle's points from one latitude to another. The equator between them is one of them."""
    latitude = np.linspace(first, last, steps + 1)
    if first < 0.0 < last:
        latitude[1 + int(np.abs(latitude[1:-1]).argmin())] = 0.0
    return radius * np.cos(latitude), radius * np.sin(latitude)


def _sphere(sizes: Sizes) -> Surface:
    return revolved(*_arc(sizes["radius"], -_POLE, _POLE, POLE_TO_POLE))


def _cube(sizes: Sizes) -> Surface:
    return _CUBE * sizes["size"], _quads(_SIDES)


def _cone(sizes: Sizes) -> Surface:
    half = sizes["height"] / 2
    return revolved(np.array([0, sizes["radius"], 0]), np.array([-half, -half, half]))


def _cylinder(sizes: Sizes) -> Surface:
    half = sizes["height"] / 2
    radii = [0, sizes["radiusBottom"], sizes["radiusTop"], 0]
    return revolved(np.array(radii), np.array([-half, -half, half, half]))


def _capsule(sizes: Sizes) -> Surface:
    """The radii are those of the ends of the cylinder, or of the cone that the spheres of both ends touch."""
    half, low, high = sizes["height"] / 2, sizes["radiusBottom"], sizes["radiusTop"]
    slope = (high - low) / (2 * half) if half > 0.0 else 0.0
    touch, size = -math.atan(slope), math.hypot(1.0, slope)
    below = _arc(low * size, -_POLE, touch, POLE_TO_POLE // 2)
    above = _arc(high * size, touch, _POLE, POLE_TO_POLE // 2)
    heights = [below[1] - half + low * slope, above[1] + half + high * slope]
    return revolved(np.concatenate([below[0], above[0]]), np.concatenate(heights))


def _plane(sizes: Sizes) -> Surface:
    """About the origin; its normal is z, its width lies along x."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) / 2
    return corners * [sizes["width"], sizes["length"], 0], _quads(np.array([[0, 1, 2, 3]]))


SURFACES: dict[str, tuple[Callable[[Sizes], Surface], tuple[str, ...]]] = {
    "Sphere": (_sphere, ("radius",)),
    "Cube": (_cube, ("size",)),
    "Cone": (_cone, ("radius", "height")),
    "Cylinder": (_cylinder, ("radius", "height")),
    "Cylinder_1": (_cylinder, ("radiusTop", "radiusBottom", "height")),
    "Capsule": (_capsule, ("radius", "height")),
    "Capsule_1": (_capsule, ("radiusTop", "radiusBottom", "height")),
    "Plane": (_plane, ("width", "length")),
}
"""For each type of prim what makes its surface, and the attributes that give its sizes."""


def surface(kind: str, sizes: Sizes, axis: str) -> Surface:
    """The surface of a prim whose axis (of a plane: the normal) is "X", "Y" or "Z"."""
    if "radius" in sizes:
        sizes = {**sizes, "radiusTop": sizes["radius"], "radiusBottom": sizes["radius"]}
    points, faces = SURFACES[kind][0](sizes)
    if kind == "Plane" and axis == "X":  # the width lies along z, not y
        return points[:, [2, 1, 0]], faces[:, ::-1]
    if kind == "Plane" and axis == "Y":
        return points[:, [0, 2, 1]], faces[:, ::-1]
    return np.roll(points, {"X": 1, "Y": 2}.get(axis, 0), axis=1), faces
