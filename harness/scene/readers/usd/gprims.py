"""Spheres, cubes, cones, cylinders, capsules and planes as triangles, about the origin and outwards.

All but cube and plane are surfaces of revolution: a profile of radii and heights, turned in :data:`AROUND` steps. The
number of triangles does not depend on the sizes, so that a shape that grows keeps its topology.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ....arrays import F64, I32
from ...standins.shapes import box, grid, lathe

AROUND, POLE_TO_POLE = 32, 16
"""Segments of a circle, and from one pole of a sphere to the other. Multiples of 4: bounds are those of the shape."""

RESOLUTION = f"{AROUND} segments around, {POLE_TO_POLE} from pole to pole"

Sizes = dict[str, float]
Surface = tuple[F64, I32]

_POLE = np.pi / 2


def _revolved(radii: ArrayLike, heights: ArrayLike) -> Surface:
    """The surface of a profile turned about z. Its first and last point lie on the axis and become one vertex each."""
    profile = np.column_stack([radii, heights])
    profile[[0, -1], 0] = 0.0
    turned = lathe(profile, AROUND)
    return turned.vertices[:, [2, 0, 1]], turned.faces  # it turns about y


def _arc(radius: float, first: float, last: float, steps: int) -> tuple[NDArray, NDArray]:
    """Radii and heights of a circle's points from one latitude to another. The equator between them is one of them."""
    latitude = np.linspace(first, last, steps + 1)
    if first < 0.0 < last:
        latitude[1 + int(np.abs(latitude[1:-1]).argmin())] = 0.0
    return radius * np.cos(latitude), radius * np.sin(latitude)


def _sphere(sizes: Sizes) -> Surface:
    return _revolved(*_arc(sizes["radius"], -_POLE, _POLE, POLE_TO_POLE))


def _cube(sizes: Sizes) -> Surface:
    half = sizes["size"] / 2
    return box((-half, -half, -half), (half, half, half))


def _cone(sizes: Sizes) -> Surface:
    half = sizes["height"] / 2
    return _revolved([0, sizes["radius"], 0], [-half, -half, half])


def _cylinder(sizes: Sizes) -> Surface:
    half = sizes["height"] / 2
    return _revolved([0, sizes["radiusBottom"], sizes["radiusTop"], 0], [-half, -half, half, half])


def _capsule(sizes: Sizes) -> Surface:
    """The radii are those of the ends of the cylinder, or of the cone that the spheres of both ends touch."""
    half, low, high = sizes["height"] / 2, sizes["radiusBottom"], sizes["radiusTop"]
    slope = (high - low) / (2 * half) if half > 0.0 else 0.0
    touch, size = -math.atan(slope), math.hypot(1.0, slope)
    below = _arc(low * size, -_POLE, touch, POLE_TO_POLE // 2)
    above = _arc(high * size, touch, _POLE, POLE_TO_POLE // 2)
    heights = [below[1] - half + low * slope, above[1] + half + high * slope]
    return _revolved(np.concatenate([below[0], above[0]]), np.concatenate(heights))


def _plane(sizes: Sizes) -> Surface:
    """About the origin; its normal is z, its width lies along x."""
    width, length = sizes["width"], sizes["length"]
    return grid((-width / 2, -length / 2, 0), (width, 0, 0), (0, length, 0))


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
