"""Where rays meet the planes of triangles, in float64."""

from __future__ import annotations

import numpy as np

from .arithmetic import F64, edge_bound, triangle_distance


def plane_numbers(corners: F64, o: F64, d: F64) -> tuple[F64, F64, F64, F64]:
    """t, u, v and the slope n . d (n the unit normal) of rays on the planes of their triangles, in float64.

    corners [n, 3, 3], o and d [n, 3]; results [n], not finite where a ray is coplanar.
    """
    a, e, f = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(e, f)
    with np.errstate(divide="ignore", invalid="ignore"):
        area = np.linalg.norm(normal, axis=1)
        slope = np.einsum("ij,ij->i", normal, d) / area
        t = np.einsum("ij,ij->i", normal, a - o) / area / slope
        p = o + t[:, None] * d - a
        u = np.einsum("ij,ij->i", np.cross(p, f), normal) / area**2
        v = np.einsum("ij,ij->i", np.cross(e, p), normal) / area**2
    return t, u, v, slope


def beside_off_the_eye(o: F64, d: F64, t: float, corners: F64) -> bool:
    """Whether the point o + t d of a triangle's plane is within the bound of the triangle, and farther from the eye.

    o and d [3], corners [1, 3, 3].
    """
    met = (o + t * d)[None]
    limit = edge_bound(o[None], met)[0]
    return bool(triangle_distance(met, met, corners)[0][0] <= limit < t * np.linalg.norm(d))
