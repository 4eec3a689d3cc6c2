"""Bounds of a triangle in a light's maps (:mod:`.light.mapping`): the place of every ray that meets it. Float64.

The rays' places are known to ``pad``: as a share of the distance, for directions.
"""

import warp as wp

from ..variants.bounds import seam_bounds, two_angle_bounds, vertex_bounds
from .mapping import CUBE, FLAT, box_of, shares_ahead, whole
from .sphere import HALF_PI, PI, ROUNDING, triangle_angles


@wp.func
def spherical_bounds(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, pad: wp.float64) -> wp.vec4d:
    """Azimuth and elevation; a direction known to ``pad`` has an azimuth known to pad / cos(elevation)."""
    bounds = triangle_angles(a, b, c)
    low = bounds[2] - pad
    high = bounds[3] + pad
    flattest = wp.cos(wp.min(HALF_PI, wp.max(wp.abs(low), wp.abs(high))))
    if flattest < wp.float64(16.0) * pad:
        return wp.vec4d(-PI, PI, low, high)
    spread = wp.float64(2.0) * pad / flattest
    return wp.vec4d(bounds[0] - spread, bounds[1] + spread, low, high)


@wp.func
def cube_bounds(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, pad: wp.float64) -> wp.vec4d:
    """Bounds in the face whose forward is x; high < low where the triangle certainly misses its pyramid."""
    reach = wp.max(wp.length(a), wp.max(wp.length(b), wp.length(c)))
    slack = wp.float64(4.0) * (pad + ROUNDING) * reach
    empty = wp.vec4d(wp.float64(1.0), wp.float64(-1.0), wp.float64(1.0), wp.float64(-1.0))
    x = wp.vec3d(a[0], b[0], c[0])
    y = wp.vec3d(a[1], b[1], c[1])
    z = wp.vec3d(a[2], b[2], c[2])
    if wp.max(x) < -slack or wp.min(y - x) > slack or wp.min(-y - x) > slack:
        return empty
    if wp.min(z - x) > slack or wp.min(-z - x) > slack:
        return empty
    share = wp.min(shares_ahead(a, b, c))
    if not (share > FLAT):
        return whole(CUBE)
    spread = wp.float64(4.0) * (pad + wp.float64(8.0) * ROUNDING) / (share * share)
    box = box_of(wp.cw_div(y, x), wp.cw_div(z, x), spread)
    one = wp.float64(1.0) + wp.float64(4.0) * pad
    box = wp.vec4d(wp.max(-one, box[0]), wp.min(one, box[1]), wp.max(-one, box[2]), wp.min(one, box[3]))
    if box[0] > box[1] or box[2] > box[3]:
        return empty
    return box


BOUNDS = {
    "azimuth-elevation": (spherical_bounds, (1, 0)),
    "two-angle": (two_angle_bounds, (1, 1)),
    "cube": (cube_bounds, (0, 0)),
    "seam": (seam_bounds, (1, 0)),
    "vertices": (vertex_bounds, (0, 0)),
}
"""By map, or looser bounds of azimuth and elevation: bounds of a triangle, and which of the two coordinates have a seam."""
