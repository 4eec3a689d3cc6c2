"""Receivers of a light, marked where the rays are placed: the rule of :mod:`....harness.frame.effects.receivers`, with
the same bits.

A cone is decided in float32, from the distance t, where a bound on the rounding allows. The triangle is read only in doubt,
and where eye and light must lie on one side of its plane and that is not known of each triangle
(:attr:`....harness.frame.frame.Frame.front_facing`). Where the region of the rays is known before them, what finds it
knows that, too (:mod:`.region`).
"""

import warp as wp

from ....harness.frame.effects.receivers import note_receiver, receives
from ....harness.frame.geometry import Mesh, Ray
from ...common.reads import corners_at, ray_at
from ...exact.triangle import largest
from ...gpu.division import about_root
from ...gpu.entries import entry, set_entry
from ..cube.lights import Light, position_of
from .hit_points import HitPoint, PrimaryHits

ROUNDED = wp.constant(wp.float32(2.0**-19))
"""Bound on the error of a cone's margin in units of the sum of the coordinates that it is computed from: t is known to 2^-23
and float32 rounds to 2^-24, so a coordinate of the way from the light is off by less than 2^-22 of the sum, and the margin
by less than twice 2^-20 of it, the root's error included."""

LEAST_WAY, MOST_WAY = wp.constant(wp.float32(1.0e-15)), wp.constant(wp.float32(1.0e15))
"""Ways from a light whose squares float32 holds."""


@wp.func
def cone_margin(place: wp.vec3f, cone: wp.vec4f, ray: Ray, point: HitPoint) -> wp.float32:
    """Positive where a hit lies certainly in the cone (:func:`..cube.aim.cone_of`) of a light at ``place``, negative
    where it certainly does not; else 0, as where there is no cone."""
    v = (ray.origin + ray.direction * point.t) - place
    # In the cone: the part of v along its axis is at least cosine |v|.
    inside = wp.dot(wp.vec3f(cone[0], cone[1], cone[2]), v) - cone[3] * about_root(wp.dot(v, v))
    size = largest(v)
    bound = ROUNDED * ((point.way + largest(ray.origin)) + (largest(place) + size))
    margin = wp.float32(0.0)
    if size > LEAST_WAY and size < MOST_WAY and wp.abs(inside) > bound:
        margin = inside
    return margin


@wp.func
def is_receiver(light: Light, facing: wp.bool, ray: Ray, point: HitPoint, mesh: Mesh) -> wp.bool:
    """Whether the hit of a ray has a shadow ray to a light."""
    asked = facing
    wanted = wp.bool(True)
    unsure = wp.bool(True)
    if light.front_facing.shape[0] > 0:
        asked = wp.bool(False)
        wanted = entry(light.front_facing, light.index, point.triangle) != wp.uint8(0)
        unsure = wanted and light.spot[light.index, 0] != wp.float64(0.0)
    if unsure:
        margin = wp.float32(0.0)
        if not asked and not point.exact_path:
            margin = cone_margin(position_of(light), entry(light.cone, light.index), ray, point)
        wanted = margin > 0.0
        if margin == 0.0:
            corners = corners_at(mesh, point.triangle)
            wanted = receives(light.index, asked, ray, corners, light.position, light.spot)
    return wanted


@wp.func
def mark_receiver(
    light: Light,
    facing: wp.bool,
    pixel: wp.int32,
    at: wp.vec2i,
    point: HitPoint,
    hits: PrimaryHits,
    receivers: wp.array2d(dtype=wp.uint8),
    reached: wp.array(dtype=wp.int32),
) -> wp.bool:
    """Mark whether a pixel has a shadow ray to a light, and return it. reached: int32 [1], set to 1 if there is one; or
    empty."""
    wanted = wp.bool(False)
    if point.triangle >= 0:
        wanted = is_receiver(light, facing, ray_at(hits.camera, at[0], at[1]), point, hits.mesh)
    set_entry(receivers, light.index, pixel, wp.uint8(wanted))
    if wanted:
        note_receiver(reached)
    return wanted
