"""Rules that choose triangles of any mesh, for effects whose surfaces the scene does not define."""

import numpy as np

from ..arrays import U8
from .scene import AlphaMask, Geometry


def largest_triangles(geometry: Geometry, share: float = 0.5) -> U8:
    """1 for the largest triangles of the first frame that together make ``share`` of its area, uint8 [triangles]."""
    points = np.asarray(geometry.positions(0), dtype=np.float64)
    a, b, c = (points[geometry.faces[:, i]] for i in range(3))
    with np.errstate(invalid="ignore", over="ignore"):
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    area = np.nan_to_num(area, posinf=0.0)
    order = np.argsort(-area, kind="stable")
    count = int(np.searchsorted(np.cumsum(area[order]), share * area.sum())) + 1
    chosen = np.zeros(len(area), dtype=np.uint8)
    chosen[order[:count]] = area[order[:count]] > 0.0
    return chosen


def perforated(geometry: Geometry, every: int = 2, holes: int = 4) -> AlphaMask:
    """A mask for any mesh: triangle 0 and every ``every``-th after it become a chequerboard with ``holes`` fields per
    side.

    The fields lie along two edges of the triangle itself, so that the pattern follows it as it moves. ``every`` = 1
    masks them all. Raises ValueError unless both are at least 1.
    """
    if every < 1 or holes < 1:
        raise ValueError("every and holes must be at least 1")
    count = len(geometry.faces)
    masked = (np.arange(count) % every == 0).astype(np.uint8)
    corners = np.array([[0, 0], [holes / 2, 0], [0, holes / 2]], dtype=np.float32)
    coordinates = np.broadcast_to(corners, (count, 3, 2)).copy()
    return AlphaMask(masked, coordinates, np.array([[1, 0], [0, 1]], dtype=np.uint8))
