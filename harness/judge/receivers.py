"""Receivers: the hit points that have a shadow ray to a light. Every method and the reference use the same rule.

There are two restrictions. A light may be a spotlight; and a scene may request shadow rays only where the visible side of
the surface faces the light (:func:`facing`; elsewhere the surface is dark with or without a shadow).

A spot is twelve float64 numbers (:func:`spot_row`): kind (0 none, 1 cone, 2 rectangle); direction, right and up,
unit length, right-handed; then the cosine of the cone's half-angle and 0, or the half-widths in azimuth and
elevation, in radians. :func:`in_spot` reads them; kernels compute the same in float64.
"""

import numpy as np
from numpy.typing import NDArray

from ..arrays import F64, Bools, Floats, Ints
from ..scene.moment import Moment
from ..scene.prepared import Prepared
from ..scene.spotlight import CONE, DOUBT, NO_SPOT
from .arithmetic import edge_bound
from .distances import plane_numbers


def in_spot(row: F64, v: Floats) -> Bools:
    """Which ways [n, 3] from a light lead into its spot. Only these points have a shadow ray; others have shadow bit 0."""
    f = v @ row[1:4]
    if row[0] == CONE:
        square = row[10] * row[10] * np.einsum("ij,ij->i", v, v)
        if row[10] >= 0.0:
            return (f >= 0.0) & (f * f >= square)
        return (f >= 0.0) | (f * f <= square)
    r, u = v @ row[4:7], v @ row[7:10]
    return (np.abs(np.arctan2(r, f)) <= row[10]) & (np.abs(np.arctan2(u, np.hypot(f, r))) <= row[11])


def from_border(row: F64, v: Floats) -> F64:
    """How far the ends of ways [n, 3] from a light lie from the border of its spot."""
    f, r, u = v @ row[1:4], v @ row[4:7], v @ row[7:10]
    if row[0] == CONE:
        return _from_ray(f, np.hypot(r, u), float(np.arccos(row[10])))
    return np.minimum(_from_ray(f, np.abs(r), row[10]), _from_ray(np.hypot(f, r), np.abs(u), row[11]))


def _from_ray(x: NDArray, y: NDArray, angle: float) -> F64:
    """Distances of points (x, y) in a plane from the ray from 0 at an angle to the x axis."""
    ahead = x * np.cos(angle) + y * np.sin(angle) > 0.0
    return np.where(ahead, np.abs(y * np.cos(angle) - x * np.sin(angle)), np.hypot(x, y))


def facing(moment: Moment, corners: Floats, light: int, eye: Floats | None = None) -> Bools:
    """Which triangles [n, 3, 3] may face the light: eye and light are on the same side of the plane, or it is
    uncertain. ``eye``: the origin of the rays, by default the moment's. A sign is uncertain below :data:`DOUBT` of the
    terms of the product: a triangle that the light sees edge-on keeps its shadow rays.
    """
    a, b, c = (corners[:, i].astype(np.float64) for i in range(3))
    normal = np.cross(b - a, c - a)
    seen = (moment.eye if eye is None else eye).astype(np.float64) - a
    lit = moment.lights[light].astype(np.float64) - a
    with np.errstate(invalid="ignore", over="ignore"):
        side_e, side_l = np.einsum("ij,ij->i", normal, seen), np.einsum("ij,ij->i", normal, lit)
        size = np.abs(b - a).max(axis=1) * np.abs(c - a).max(axis=1) * DOUBT
        sure_e = np.abs(side_e) > size * np.abs(seen).max(axis=1)
        sure_l = np.abs(side_l) > size * np.abs(lit).max(axis=1)
        return ~(sure_e & sure_l & ((side_e > 0.0) != (side_l > 0.0)))


def not_receivers(prepared: Prepared, moment: Moment, triangle: Ints) -> tuple[Bools, Bools]:
    """Which hits have no shadow ray to each light (:mod:`.judge.receivers`), and which are within
    :func:`.arithmetic.edge_bound` of a spot's border, so that they may have one or not: bool [lights, pixels] each.
    ``triangle`` [pixels]: the triangle that each pixel hits; the points are float64, on the triangles' planes.
    """
    outside = np.zeros((len(moment.lights), len(triangle)), dtype=bool)
    border = outside.copy()
    spots = [i for i, row in enumerate(moment.spots[: len(moment.lights)]) if row[0] != NO_SPOT]
    limited = range(len(moment.lights)) if moment.facing else spots
    hit = np.nonzero((triangle >= 0) & (triangle < len(prepared.faces)))[0]
    if not limited or not len(hit):
        return outside, border
    origins, directions = (part(hit).astype(np.float64) for part in (moment.origins, moment.directions))
    corners = moment.points[prepared.faces[triangle[hit]]].astype(np.float64)
    t = plane_numbers(corners, origins, directions)[0]
    points = origins + t[:, None] * directions
    bound = edge_bound(origins, points)
    for i in limited:
        wanted = np.ones(len(hit), dtype=bool)
        if i in spots:
            row, way = moment.spots[i], points - moment.lights[i].astype(np.float64)
            wanted, border[i, hit] = in_spot(row, way), from_border(row, way) <= bound
        if moment.facing:
            wanted &= facing(moment, corners, i, origins)
        outside[i, hit] = ~wanted
    return outside, border
