"""Where a shadow ray starts: the schemes that renderers use against self-shadowing, side by side.

The normal is turned to the light's side. Schemes that move the point skip no triangle.
"""

import warp as wp

from ...harness.frame.geometry import Corners, Ray
from ..common.bounds import box_high, box_low
from ..exact.triangle import to_float32, to_float64
from ..rays.offset import shadow_origin, stepped
from .parameters import ORIGINS

HIT_POINT, IDENTITY, BARYCENTRIC, RAY = (
    wp.constant(ORIGINS.index(name)) for name in ("hit_point", "identity", "barycentric", "ray")
)
WACHTER_BINDER, ERROR_BOUND = (wp.constant(ORIGINS.index(name)) for name in ("wachter_binder", "error_bound"))
EPSILON_2, EPSILON_4 = (wp.constant(ORIGINS.index(name)) for name in ("epsilon_1e-2", "epsilon_1e-4"))


@wp.func
def scene_radius(box: wp.array(dtype=wp.float32)) -> wp.float32:
    return 0.5 * wp.length(box_high(box) - box_low(box))


@wp.func
def start_of(
    scheme: wp.int32,
    ray: Ray,
    hit: wp.vec3f,
    corners: Corners,
    light: wp.vec3f,
    box: wp.array(dtype=wp.float32),
    sheared: wp.bool,
) -> wp.vec3f:
    """The float32 start of the shadow ray of the hit (t, u, v) of ``ray`` on a triangle; not of scheme HIT_POINT.

    ``box``: of the scene (:func:`..common.bounds.launch_bounds`). ``sheared``: whether the test finds its distance from
    coordinates along the ray; the error bound depends on it.
    """
    if scheme == RAY:
        return ray.origin + hit[0] * ray.direction
    if scheme == ERROR_BOUND:
        return shadow_origin(ray, light, corners, sheared)
    p = (1.0 - hit[1] - hit[2]) * corners.a + hit[1] * corners.b + hit[2] * corners.c
    if scheme == IDENTITY:
        return p
    if scheme == BARYCENTRIC:
        return p
    a64 = to_float64(corners.a)
    n = to_float32(wp.normalize(wp.cross(to_float64(corners.b) - a64, to_float64(corners.c) - a64)))
    if wp.dot(n, light - p) < 0.0:
        n = -n
    if scheme == WACHTER_BINDER:
        return stepped(p, n)
    epsilon = wp.float32(1.0e-6)
    if scheme == EPSILON_2:
        epsilon = 1.0e-2
    if scheme == EPSILON_4:
        epsilon = 1.0e-4
    return p + n * (epsilon * scene_radius(box))
