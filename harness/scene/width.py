"""Whether the sizes in a frame are so unlike that float64 leaves signs open which float32 inputs decide.

What rounds a float32 ray near its hit is 2^-20 of the largest coordinate s of its origin and of the hit. A method's float64
tests should know more. With R the largest coordinate of a triangle, and L that of a light, they know

* on which side of the triangle's plane a point lies to about 2^-46.4 aspect R, the aspect being edge times edge over twice
  the area;
* on which side of an edge a shadow segment passes to about 2^-45.4 R R / L where the light is nearer than R: both ends of
  the edge may be far from the segment and from the light.

So float64 suffices unless aspect R exceeds :data:`WIDE_PLANES` s, or R R :data:`WIDE_LIGHTS` s L; or an eye or a light lies
beside a plane by less than float64 knows; or the mesh is flat along an axis: a hit point is known to a share of its largest
coordinate. For rays from the eye, s is the eye's largest coordinate or its distance from the
triangle, the larger of both; for all others it is taken from the triangle that lies nearest to the origin. Such a frame is
wide, and methods then find the signs in more digits (the switch ``wide``).
"""

from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import F32, F64, I32, U8
from .moment import Moment

WIDE_PLANES = 2.0**26
WIDE_LIGHTS = 2.0**25
WIDE_AXES = 2.0**-16  # size of a mesh along an axis, in units of its largest coordinate, below which the frame is wide
FAR_LIGHT = 2.0**50  # of the mesh's size: a light so far has only a direction, and all planes along it may hold it

IN_PLANE = 32 * 2.0**-53
"""What float64 may not know of a point's side of a plane, in units of edge times edge times the way to the farthest corner:
twice the bounds of the exact methods' tests.
"""

SUSPECT = np.float32(2.0**-19)
"""The same of float32, in units of the coordinates of the point and of the triangle: others are certainly off the plane."""

CHUNK = 1 << 13  # triangles whose numbers fit a processor's cache

MANY = 1000
"""Triangles whose planes are compared with a point in rational numbers. A frame with more is taken for a wide one, which is
never wrong.
"""


class Sizes:
    """Sizes of the valid triangles of a mesh, and their planes.

    points [vertex_count, 3], faces [triangle_count, 3], valid [triangle_count]: 1 where an area is not 0
    nearest, farthest  the least and the largest coordinate of a triangle, each the largest of its own
    """

    def __init__(self, points: F32, faces: I32, valid: U8):
        self.points = points
        self._columns = np.ascontiguousarray(points.T)
        self._faces = faces if valid.all() else faces[valid != 0]
        count = len(self._faces)
        self._normal, self._height = np.empty((3, count), np.float32), np.empty(count, np.float32)
        self._size, self._aspect_size = np.empty(count, np.float32), np.empty(count)
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)
        for start in range(0, count, CHUNK):
            self._measure(slice(start, start + CHUNK))
        self.nearest = float(self._size.min(initial=np.inf))
        self.farthest = float(self._size.max(initial=0.0))

    def _measure(self, rows: slice) -> None:
        corners = a, b, c = self._corners(rows)
        normal, edges = _plane(a, b, c)
        low, high = np.minimum.reduce(corners), np.maximum.reduce(corners)
        self._low = np.minimum(self._low, low.min(axis=1))
        self._high = np.maximum(self._high, high.max(axis=1))
        size = self._size[rows] = np.maximum(-low, high).max(axis=0)
        # An area that rounding takes for 0 is at most this.
        self._aspect_size[rows] = edges / np.maximum(np.abs(normal).max(axis=0), 2.0**-54 * edges) * size
        normal /= edges
        with np.errstate(over="ignore"):
            self._normal[:, rows], self._height[rows] = normal, _dot(normal, a)

    def _corners(self, rows: slice | NDArray[np.intp]) -> tuple[F64, F64, F64]:
        """The corners of triangles, each [3, n]."""
        a, b, c = (self._columns.take(corner, axis=1).astype(np.float64) for corner in self._faces[rows].T)
        return a, b, c

    def too_flat(self) -> bool:
        """Whether the mesh is nearly flat along an axis. It may be entirely: then nothing is above anything."""
        extent = self._high - self._low
        return bool(((extent > 0) & (extent < WIDE_AXES * self.farthest)).any())

    def too_thin(self) -> bool:
        """Whether some triangle is wide for rays that start at any other."""
        return bool(self._aspect_size.max(initial=0.0) > WIDE_PLANES * self.nearest)

    def too_near(self, eye: F32) -> bool:
        """Whether some triangle is wide for rays from an eye."""
        x = eye.astype(np.float64)[:, None]
        near = np.abs(x).max()
        rows = np.nonzero(self._aspect_size > WIDE_PLANES * near)[0]
        corners = a, b, c = self._corners(rows)
        beside = np.maximum(np.min(corners, axis=0) - x, x - np.max(corners, axis=0)).max(axis=0)
        normal, edges = _plane(a, b, c)
        # A normal's largest coordinate is at most its length, which is at most twice that.
        area = np.maximum(np.abs(normal).max(axis=0), 2.0**-54 * edges)
        start = np.maximum(np.maximum(beside, np.abs(_dot(normal, x - a)) / (2 * area)), near)
        return bool((self._aspect_size[rows] > WIDE_PLANES * start).any())

    def beside_a_plane(self, point: F32) -> bool:
        """Whether a point is off the plane of some triangle by less than float64 knows, but not by 0."""
        with np.errstate(over="ignore", invalid="ignore"):
            side = np.abs(_dot(self._normal, point) - self._height)
            sure = side > SUSPECT * (self._size + np.abs(point).sum())
        rows = np.nonzero(~sure)[0]
        corners = a, b, c = self._corners(rows)
        x = point.astype(np.float64)[:, None]
        normal, edges = _plane(a, b, c)
        way = np.maximum.reduce([np.abs(x - corner).sum(axis=0) for corner in corners])
        doubtful = np.abs(_dot(normal, x - a)) <= IN_PLANE * edges * way
        # A coordinate that all corners share decides.
        level = (a == b) & (a == c)
        if (doubtful & (level & (x != a)).any(axis=0)).any():
            return True
        tilted = rows[doubtful & ~level.any(axis=0)]
        return len(tilted) > MANY or any(self._off_plane(row, point) for row in tilted)

    def _off_plane(self, row: int, point: F32) -> bool:
        """Whether a point is not exactly in the plane of a triangle."""
        a, b, c, x = ([Fraction(float(v)) for v in p] for p in (*self.points[self._faces[row]], point))
        e, f, w = ([p - q for p, q in zip(other, a, strict=True)] for other in (b, c, x))
        return sum(w[i] * (e[i - 2] * f[i - 1] - e[i - 1] * f[i - 2]) for i in range(3)) != 0


def _dot(p: NDArray[Any], q: NDArray[Any]) -> NDArray[Any]:
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


def _plane(a: F64, b: F64, c: F64) -> tuple[F64, F64]:
    """Normals [3, n] of triangles, not of unit length, and the product of two edges' largest coordinates."""
    e, f = b - a, c - a
    normal = np.stack([e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]])
    return normal, np.abs(e).max(axis=0) * np.abs(f).max(axis=0)


def is_wide(moment: Moment, sizes: Sizes) -> bool:
    """Whether a frame with a mesh of these sizes is wide."""
    if sizes.too_flat() or sizes.too_thin() or (not moment.orthographic and sizes.too_near(moment.eye)):
        return True
    lights = np.abs(moment.lights.astype(np.float64)).max(axis=1)
    if (sizes.farthest**2 > WIDE_LIGHTS * sizes.nearest * np.maximum(lights, sizes.nearest)).any():
        return True
    ends = moment.lights[lights <= FAR_LIGHT * sizes.farthest]
    if not moment.orthographic:
        ends = np.concatenate([moment.eye[None], ends])
    return any(sizes.beside_a_plane(end) for end in ends)
