"""Where rays meet the planes of triangles: in float64 where that suffices, exactly elsewhere."""

import math

import numpy as np

from ..arrays import F64
from . import arithmetic as exact
from .arithmetic import edge_bound
from .distances import triangle_distance

ROUNDING = 2.0**-49  # error in float64 of a triple product of differences of float32 numbers, in units of its terms
SURE = 2.0**-30  # float64 suffices up to this error of t (relative), u and v: 2^-12 of what is allowed of an answer


def plane_numbers(corners: F64, o: F64, d: F64) -> tuple[F64, F64, F64, F64]:
    """t, u, v and the slope n . d (n the unit normal) of rays on the planes of their triangles. corners [n, 3, 3], o
    and d [n, 3], all float32 numbers; results [n], not finite where a ray is coplanar."""
    a, e, f = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(e, f)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        area = np.linalg.norm(normal, axis=1)
        under, over = np.einsum("ij,ij->i", normal, d), np.einsum("ij,ij->i", normal, a - o)
        slope = under / area
        t = over / under
        p = o + t[:, None] * d - a
        u = np.einsum("ij,ij->i", np.cross(p, f), normal) / area**2
        v = np.einsum("ij,ij->i", np.cross(e, p), normal) / area**2
        edges = np.linalg.norm(e, axis=1) * np.linalg.norm(f, axis=1)
        doubt = np.abs(edges * np.linalg.norm(d, axis=1) / under) + np.abs(edges * np.linalg.norm(a - o, axis=1) / over)
        sure = ROUNDING * np.maximum(doubt, edges / area) <= SURE
    for i in np.nonzero(~sure)[0]:
        t[i], u[i], v[i], slope[i] = _exactly(corners[i], o[i], d[i])
    return t, u, v, slope


def _exactly(corners: F64, o: F64, d: F64) -> tuple[float, float, float, float]:
    """:func:`plane_numbers` of one ray, each exact and rounded once but for the root in the slope."""
    values = np.concatenate([o, d, corners.ravel()]).astype(np.float32)
    if not np.isfinite(values).all():
        return math.nan, math.nan, math.nan, math.nan
    scale, ints = exact.integers(values)
    origin, way, triangle = ints[0:3], ints[3:6], ints[6:15]
    weights = exact.hit_weights(origin, way, triangle)
    normal, height = exact.plane_of(origin, triangle)
    under, longest = exact.dot(normal, way), max(map(abs, normal))
    if not under:
        return math.nan, math.nan, math.nan, 0.0
    unit = math.hypot(*(n / longest for n in normal))
    all_weights = sum(weights)
    slope = under / (longest << max(scale, 0)) * 2.0 ** max(-scale, 0) / unit
    return height / under, weights[1] / all_weights, weights[2] / all_weights, slope


def beside_off_the_eye(o: F64, d: F64, t: float, corners: F64) -> bool:
    """Whether the point o + t d of a triangle's plane is within the bound of the triangle, and farther from the eye. o
    and d [3], corners [1, 3, 3]."""
    met = (o + t * d)[None]
    limit = edge_bound(o[None], met)[0]
    return bool(triangle_distance(met, met, corners)[0][0] <= limit < t * np.linalg.norm(d))
