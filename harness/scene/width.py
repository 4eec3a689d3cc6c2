"""Whether the sizes in a frame are so unlike that float64 leaves signs open which float32 inputs decide.

What rounds a float32 ray near its hit is 2^-20 of the largest coordinate there, s. A method's float64 tests should know
more. With R the largest distance of a corner from the origin, and L that of a light, they know

* on which side of a triangle's plane a point lies to about 2^-46.4 aspect R, the aspect being edge times edge over twice
  the area;
* on which side of an edge a shadow segment passes to about 2^-45.4 R R / L where the light is nearer than R: both ends of
  the edge may be far from the segment and from the light.

So float64 suffices unless aspect R exceeds :data:`WIDE_PLANES` s, or R R :data:`WIDE_LIGHTS` s L, with s the largest
coordinate of the eye, or that of the triangle nearest to the origin; or an eye or a light lies beside a plane by less than
float64 knows. Such a frame is wide, and methods then find the signs in more digits (the switch ``wide``).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .moment import F32, Moment

WIDE_PLANES = 2.0**26
WIDE_LIGHTS = 2.0**25

FAR_LIGHT = 2.0**50
"""A light so many times as far away as the mesh is large has only a direction: all planes along it may hold it."""

IN_PLANE = 16 * 2.0**-53
"""Rounding of a point's side of a plane, in units of edge times edge times the point's way to a corner."""


class Sizes:
    """Sizes of the valid triangles of a mesh, and their planes.

    points [vertex_count, 3], faces [triangle_count, 3], valid [triangle_count]: 1 where an area is not 0
    """

    def __init__(self, points: F32, faces: NDArray[np.int32], valid: NDArray[np.uint8]):
        self.points = points
        faces = faces[valid != 0]
        a, b, c = (points[faces[:, i]].astype(np.float64) for i in range(3))
        distance = np.maximum(np.maximum(np.abs(a), np.abs(b)), np.abs(c)).max(axis=1)
        e, f = b - a, c - a
        self._corner, self._normal = a, np.cross(e, f)
        self._edges = np.abs(e).max(axis=1) * np.abs(f).max(axis=1)
        self._height = np.einsum("ij,ij->i", self._normal, a)
        # The height is a sum of this size; beyond twice its rounding a point is off the plane.
        self._doubt = 4 * IN_PLANE * self._edges * np.abs(a).sum(axis=1)
        area = np.abs(self._normal).max(axis=1)
        # An area that rounding takes for 0 is at most this.
        aspect = self._edges / np.maximum(area, 2.0**-54 * self._edges)
        self.aspect = float(aspect.max(initial=0.0))
        self.aspect_distance = float((aspect * distance).max(initial=0.0))
        self.nearest = float(distance.min(initial=np.inf))
        self.farthest = float(distance.max(initial=0.0))

    def beside_a_plane(self, point: F32) -> bool:
        """Whether a point is off the plane of some triangle by less than float64 knows, but not by 0."""
        x = point.astype(np.float64)
        with np.errstate(over="ignore", invalid="ignore"):
            side = self._normal @ x - self._height
            rows = np.nonzero(np.abs(side) <= self._doubt + 4 * IN_PLANE * np.abs(x).sum() * self._edges)[0]
        way = x - self._corner[rows]
        side = np.abs(np.einsum("ij,ij->i", self._normal[rows], way))
        return bool(((side > 0) & (side <= IN_PLANE * self._edges[rows] * np.abs(way).sum(axis=1))).any())


def is_wide(moment: Moment, sizes: Sizes) -> bool:
    """Whether a frame with a mesh of these sizes is wide."""
    starts = moment.eye[None]
    if moment.orthographic:
        starts = moment.origins(np.arange(moment.width * moment.height))
    near = min(sizes.nearest, float(np.abs(starts).max(axis=1).min()))
    if sizes.aspect_distance > WIDE_PLANES * near or sizes.aspect > WIDE_PLANES:
        return True
    lights = np.abs(moment.lights.astype(np.float64)).max(axis=1)
    if (sizes.farthest**2 > WIDE_LIGHTS * near * np.maximum(lights, near)).any():
        return True
    ends = moment.lights[lights <= FAR_LIGHT * sizes.farthest]
    if not moment.orthographic:
        ends = np.concatenate([moment.eye[None], ends])
    return any(sizes.beside_a_plane(end) for end in ends)
