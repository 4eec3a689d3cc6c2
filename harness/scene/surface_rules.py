"""Rules that choose triangles of any mesh, for effects that a scene has no surfaces of its own for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .scene import Geometry


def largest_triangles(geometry: Geometry, share: float = 0.5) -> NDArray[np.uint8]:
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
