"""Whether the sizes in a frame are so unlike that float64 leaves signs open which float32 inputs decide.

What rounds a float32 ray near its hit is 2^-20 of the largest coordinate s of its origin and of the hit. A method's float64
tests should know more. With R the largest coordinate of a triangle, and L that of a light, they know

* on which side of the triangle's plane a point lies to about 2^-46.4 aspect R, the aspect being edge times edge over twice
  the area;
* on which side of an edge a shadow segment passes to about 2^-45.4 R R / L where the light is nearer than R: both ends of
  the edge may be far from the segment and from the light.

So float64 suffices unless aspect R exceeds :data:`WIDE_PLANES` s, or R R :data:`WIDE_LIGHTS` s L; or an eye or a light lies
beside a plane by less than float64 knows. For rays from the eye, s is the eye's largest coordinate or its distance from the
triangle, the larger of both; for all others it is taken from the triangle that lies nearest to the origin. Such a frame is
wide, and methods then find the signs in more digits (the switch ``wide``).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .moment import F32, Moment

F64 = NDArray[np.float64]

WIDE_PLANES = 2.0**26
WIDE_LIGHTS = 2.0**25

FAR_LIGHT = 2.0**50
"""A light so many times as far away as the mesh is large has only a direction: all planes along it may hold it."""

IN_PLANE = 16 * 2.0**-53
"""Rounding of a point's side of a plane, in units of edge times edge times the point's way to a corner."""


class Sizes:
    """Sizes of the valid triangles of a mesh, and their planes.

    points [vertex_count, 3], faces [triangle_count, 3], valid [triangle_count]: 1 where an area is not 0
    nearest, farthest  the least and the largest coordinate of a triangle, each the largest of its own
    """

    def __init__(self, points: F32, faces: NDArray[np.int32], valid: NDArray[np.uint8]):
        self.points = points
        faces = faces[valid != 0]
        a, b, c = (points[faces[:, i]].astype(np.float64) for i in range(3))
        self._low, self._high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
        size = np.maximum(-self._low, self._high).max(axis=1)
        e, f = b - a, c - a
        self._corner, self._normal = a, np.cross(e, f)
        self._edges = np.abs(e).max(axis=1) * np.abs(f).max(axis=1)
        self._height = np.einsum("ij,ij->i", self._normal, a)
        # The height is a sum of this size; beyond twice its rounding a point is off the plane.
        self._doubt = 4 * IN_PLANE * self._edges * np.abs(a).sum(axis=1)
        # An area that rounding takes for 0 is at most this.
        self._area = np.maximum(np.abs(self._normal).max(axis=1), 2.0**-54 * self._edges)
        self._aspect_size = self._edges / self._area * size
        self._aspect = float((self._edges / self._area).max(initial=0.0))
        self.nearest, self.farthest = float(size.min(initial=np.inf)), float(size.max(initial=0.0))

    def too_thin(self) -> bool:
        """Whether some triangle is wide for rays that start at any other."""
        most = WIDE_PLANES * min(self.nearest, self.farthest)
        return self._aspect > WIDE_PLANES or bool(self._aspect_size.max(initial=0.0) > most)

    def too_near(self, eye: F32) -> bool:
        """Whether some triangle is wide for rays from an eye."""
        x = eye.astype(np.float64)
        beside = np.maximum(np.maximum(self._low - x, x - self._high), 0.0).max(axis=1)
        # A normal's largest coordinate is at most its length, which is at most twice that.
        above = np.abs(self._normal @ x - self._height) / (2 * self._area)
        start = np.maximum(np.maximum(beside, above), np.abs(x).max())
        return bool((self._aspect_size > WIDE_PLANES * start).any())

    def beside_a_plane(self, point: F32) -> bool:
        """Whether a point is off the plane of some triangle by less than float64 knows, but not by 0."""
        x = point.astype(np.float64)
        side = self._normal @ x - self._height
        rows = np.nonzero(np.abs(side) <= self._doubt + 4 * IN_PLANE * np.abs(x).sum() * self._edges)[0]
        way = x - self._corner[rows]
        near = np.abs(np.einsum("ij,ij->i", self._normal[rows], way))
        doubtful = near <= IN_PLANE * self._edges[rows] * np.abs(way).sum(axis=1)
        # What is 0 in either form is taken for 0: planes along the axes, and whole numbers.
        return bool((doubtful & ((near > 0) | (side[rows] != 0))).any())


def is_wide(moment: Moment, sizes: Sizes) -> bool:
    """Whether a frame with a mesh of these sizes is wide."""
    if sizes.too_thin() or (not moment.orthographic and sizes.too_near(moment.eye)):
        return True
    lights = np.abs(moment.lights.astype(np.float64)).max(axis=1)
    near = min(sizes.nearest, sizes.farthest)
    if (sizes.farthest**2 > WIDE_LIGHTS * near * np.maximum(lights, near)).any():
        return True
    ends = moment.lights[lights <= FAR_LIGHT * sizes.farthest]
    if not moment.orthographic:
        ends = np.concatenate([moment.eye[None], ends])
    return any(sizes.beside_a_plane(end) for end in ends)
