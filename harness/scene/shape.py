"""The measurements of a mesh from which a camera is chosen: what can be hit, its bounds, its walls and its upward axis."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import F64, I32, I64, Floats
from .prepared import finite_bounds
from .scene import Geometry, Vector

_FLAT = 1e-14  # area over the product of two edges up to which a triangle has none
_SPECK = 1e-3  # area of triangles over the square of their box's diagonal below which a picture hardly shows them

_NEAR = 4.0


@dataclass(frozen=True, eq=False)
class Shape:
    """The measurements from which views are chosen.

    points  float64 [n, 3]: vertices of the triangles that are to be seen, of frames spread over the whole length
    sides   share of each side of the bounding box that triangles lie on, float64 [axis, low or high]
    up      index of the upward axis
    corners float64 [n, 3, 3]: of those triangles, in the first frame that has any
    far     number of triangles, in the frame that has most of them, that are too far from the others to be seen
    """

    points: F64
    sides: F64
    up: int
    corners: F64
    far: int = 0

    @property
    def low(self) -> F64:
        return finite_bounds(self.points)[0]

    @property
    def high(self) -> F64:
        return finite_bounds(self.points)[1]

    @property
    def radius(self) -> float:
        """Half the diagonal of the bounding box; 1 where that is zero."""
        return float(np.linalg.norm(self.high - self.low) / 2) or 1.0

    @property
    def thinnest(self) -> int:
        """Index of the axis along which it extends least."""
        return int(np.argmin(self.high - self.low))

    def facing(self, direction: F64) -> float:
        """Share of the area that is seen from a direction, a unit vector: 0 for planes that are all seen edge-on."""
        e, f = self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0]
        normals = np.cross(e, f)
        total = float(np.linalg.norm(normals, axis=1).sum())
        return float(np.abs(normals @ direction).sum()) / total if total else 1.0

    def frame(self) -> tuple[F64, F64, F64]:
        """Right, up and towards the viewer of the front view: right-handed."""
        x, y, z = np.eye(3)
        return ((-y, x, z), (x, y, z), (x, z, -y))[self.up]  # the front of a z-up scene is its -y side


def shape_of(geometry: Geometry, up: Vector | None = None) -> Shape:
    """Measures a mesh in at most 8 frames, without what cannot be hit and far specks. ``up``: if known."""
    chosen = np.unique(np.linspace(0, geometry.frame_count - 1, 8).round().astype(int))
    points, corners, far = [np.zeros((0, 3))], np.zeros((0, 3, 3)), 0
    for k in chosen:
        positions = geometry.positions(int(k))
        shown, others = _shown(positions, geometry.faces)
        far = max(far, others)
        used = np.zeros(len(positions), dtype=bool)
        used[geometry.faces[shown]] = True
        points.append(positions[used].astype(np.float64))
        if not len(corners):
            corners = positions.astype(np.float64)[geometry.faces[shown]]
    seen = np.concatenate(points) if any(map(len, points)) else np.zeros((1, 3))
    low, high = seen.min(axis=0), seen.max(axis=0)
    axis = _upward(low, high) if up is None else int(np.argmax(np.abs(up)))
    return Shape(seen, _covered(corners, low, high), axis, corners, far)


def _shown(points: Floats, faces: I32) -> tuple[I64, int]:
    """The triangles that a picture is to show, and how many have an area and are not to be shown: far from most of it.

    Where all area together would be a speck in the bounding box, such as a model far from a marker at the origin, it is the
    triangles around the middle of the area: within :data:`_NEAR` times the distance that most of it, a half at least, is at.
    """
    corners = points.astype(np.float64)[faces]
    with np.errstate(invalid="ignore", over="ignore"):
        finite = (np.abs(corners) < np.finfo(np.float32).max).all(axis=(1, 2))
        e, f = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = np.linalg.norm(np.cross(e, f), axis=1)
        flat = area <= _FLAT * np.linalg.norm(e, axis=1) * np.linalg.norm(f, axis=1)
    shown = np.flatnonzero(finite & ~flat)
    corners, area = corners[shown], area[shown]
    if not len(shown) or not _speck(corners, area):
        return shown, 0
    middle = [_quantile(corners[:, :, axis].mean(axis=1), area, 0.5) for axis in range(3)]
    away = np.abs(corners - middle).max(axis=(1, 2))
    for most in (0.9, 0.75, 0.5):
        near = away <= _NEAR * _quantile(away, area, most)
        if not _speck(corners[near], area[near]):
            return shown[near], int((~near).sum())
    return shown, 0


def _speck(corners: F64, area: F64) -> bool:
    """Whether triangles are so small in their bounding box that a picture of the box would hardly show them."""
    extent = np.ptp(corners.reshape(-1, 3), axis=0)
    return bool(area.sum() < _SPECK * (extent @ extent))


def _quantile(values: F64, weights: F64, share: float) -> float:
    """The value that this share of the weights is not above."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(total, share * total[-1])]])


def _covered(corners: F64, low: NDArray, high: NDArray) -> F64:
    """Share of each side of the box that triangles within 3 % of it and parallel to it add up to, [axis, end]."""
    extent = np.maximum(high - low, 1e-30)
    sides = np.zeros((3, 2))
    with np.errstate(invalid="ignore", over="ignore"):
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
        for axis in range(3):
            area = extent[(axis + 1) % 3] * extent[(axis + 2) % 3]
            for end, place in enumerate((low, high)):
                near = (np.abs(corners[:, :, axis] - place[axis]) <= 0.03 * extent[axis]).all(axis=1)
                sides[axis, end] = np.nansum(np.abs(normal[near, axis])) / area
    return sides


def _upward(low: NDArray, high: NDArray) -> int:
    """Index of the upward axis where the file does not say: guessed. The one axis along which it rests on zero while
    the others straddle it; else the axis along which it is much thinner than along the others (terrain); else y, which
    most programs use.
    """
    extent = np.maximum(high - low, 1e-30)
    rests = (np.abs(low) <= 0.03 * extent) & (high > 0)
    straddles = (low < -0.2 * extent) & (high > 0.2 * extent)
    others = [np.delete(np.arange(3), axis) for axis in range(3)]
    standing = [axis for axis in range(3) if rests[axis] and straddles[others[axis]].all()]
    thin = [axis for axis in range(3) if (extent[axis] < 0.4 * extent[others[axis]]).all()]
    return [*standing, *thin, 1][0]
