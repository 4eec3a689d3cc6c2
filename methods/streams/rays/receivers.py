"""Receivers of a light, marked where the rays are placed: the rule of :mod:`....harness.frame.effects.receivers`, with
the same bits.

A cone is decided in float32, from the distance t, where a bound on the rounding allows. The triangle is read only in doubt,
and where eye and light must lie on one side of its plane and that is not known of each triangle
(:attr:`....harness.frame.frame.Frame.front_facing`). Where the region of the rays is known before them, what finds it
knows that, too (:mod:`.region`).
"""

from __future__ import annotations

import warp as wp

from ....harness.frame.effects.receivers import note_receiver, receives
from ....harness.frame.geometry import Camera, Mesh, Ray
from ...common.pixels import tile_pixel
from ...exact.triangle import largest
from ...gpu.division import about_root
from ...gpu.entries import entry, set_entry
from ..cube.cells import RayCells
from ..cube.farthest import empty_tiles
from ..reads import corners_at, direction_at
from .hit_points import Point, Words, point_of
from .sort import place_ray

ROUNDED = wp.constant(wp.float32(2.0**-19))
"""Bound on the error of a cone's margin in units of the sum of the coordinates that it is computed from: t is known to 2^-23
and float32 rounds to 2^-24, so a coordinate of the way from the light is off by less than 2^-22 of the sum, and the margin
by less than twice 2^-20 of it, the root's error included."""

LEAST_WAY, MOST_WAY = wp.constant(wp.float32(1.0e-15)), wp.constant(wp.float32(1.0e15))
"""Ways from a light whose squares float32 holds."""

REGISTERS = 48
"""Registers per thread, for ten blocks of 128 per multiprocessor."""


@wp.func
def cone_margin(place: wp.vec3f, cone: wp.vec4f, ray: Ray, point: Point) -> wp.float32:
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
def is_receiver(
    light: wp.int32,
    facing: wp.bool,
    ray: Ray,
    point: Point,
    mesh: Mesh,
    lights: wp.array(dtype=wp.vec3f),
    spots: wp.array2d(dtype=wp.float64),
    front_facing: wp.array2d(dtype=wp.uint8),
    cones: wp.array(dtype=wp.vec4f),
) -> wp.bool:
    """Whether the hit of a ray has a shadow ray to a light."""
    asked = facing
    wanted = wp.bool(True)
    unsure = wp.bool(True)
    if front_facing.shape[0] > 0:
        asked = wp.bool(False)
        wanted = entry(front_facing, light, point.triangle) != wp.uint8(0)
        unsure = wanted and spots[light, 0] != wp.float64(0.0)
    if unsure:
        margin = wp.float32(0.0)
        if not asked and not point.exact_path:
            margin = cone_margin(entry(lights, light), entry(cones, light), ray, point)
        wanted = margin > 0.0
        if margin == 0.0:
            wanted = receives(light, asked, ray, corners_at(mesh, point.triangle), lights, spots)
    return wanted


@wp.func
def mark_receiver(
    light: wp.int32,
    facing: wp.bool,
    pixel: wp.int32,
    at: wp.vec2i,
    point: Point,
    camera: Camera,
    mesh: Mesh,
    lights: wp.array(dtype=wp.vec3f),
    spots: wp.array2d(dtype=wp.float64),
    front_facing: wp.array2d(dtype=wp.uint8),
    cones: wp.array(dtype=wp.vec4f),
    receivers: wp.array2d(dtype=wp.uint8),
    reached: wp.array(dtype=wp.int32),
) -> wp.bool:
    """Mark whether a pixel has a shadow ray to a light, and return it. reached: int32 [1], set to 1 if there is one; or
    empty."""
    wanted = wp.bool(False)
    if point.triangle >= 0:
        ray = Ray(entry(camera.eye, 0), direction_at(camera, at[0], at[1]))
        wanted = is_receiver(light, facing, ray, point, mesh, lights, spots, front_facing, cones)
    set_entry(receivers, light, pixel, wp.uint8(wanted))
    if wanted:
        note_receiver(reached)
    return wanted


@wp.kernel(enable_backward=False, grid_stride=False, cuda_max_registers=REGISTERS)
def map_kernel(
    first: wp.int32,
    light: wp.int32,
    facing: wp.bool,
    camera: Camera,
    mesh: Mesh,
    lights: wp.array(dtype=wp.vec3f),
    spots: wp.array2d(dtype=wp.float64),
    front_facing: wp.array2d(dtype=wp.uint8),
    cones: wp.array(dtype=wp.vec4f),
    proxy_positions: wp.array(dtype=wp.vec3f),
    axes: wp.array(dtype=wp.mat33d),
    rays: Words,
    keeps: wp.bool,
    cells: RayCells,
    receivers: wp.array2d(dtype=wp.uint8),
    reached: wp.array(dtype=wp.int32),
    shadowed: wp.array2d(dtype=wp.uint8),
):
    """:func:`.sort.map_kernel`, which also marks the receivers (:func:`mark_receiver`)."""
    empty_tiles(cells.farthest, first + wp.tid(), camera.width, camera.height)
    at = tile_pixel(first + wp.tid(), camera.width, camera.height)
    point = Point()
    wanted = wp.bool(False)
    pixel = at[1] * camera.width + at[0]
    if at[0] >= 0:
        set_entry(shadowed, light, pixel, wp.uint8(0))
        point = point_of(rays, pixel, at, camera, mesh)
        wanted = mark_receiver(
            light,
            facing,
            pixel,
            at,
            point,
            camera,
            mesh,
            lights,
            spots,
            front_facing,
            cones,
            receivers,
            reached,
        )
    place_ray(
        rays,
        point,
        wanted,
        pixel,
        at,
        camera,
        mesh,
        entry(proxy_positions, light),
        entry(axes, light),
        keeps,
        cells,
    )
