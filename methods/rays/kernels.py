"""The kernels that trace one ray per pixel through any structure: closest hits and shadow bits.

A structure brings its struct of arrays and a ``walk``: walk(test, structure, mesh, alpha, part, query) calls ``test``
(:mod:`..exact.ray_queries`), which is compiled in, for the triangles that a part of a ray may meet, nearest first where it
can, and returns what was found.
"""

# Annotations are evaluated here: the struct is an argument of the factory, which Warp could not look up by its name.

import functools
from typing import Any

import warp as wp

from ...harness.frame.alpha import Alpha
from ...harness.frame.effects.specialise import effects
from ...harness.frame.geometry import Camera, Hits, Mesh, Rays, mirrored_ray, ray_of
from ..common.pixels import pixel_of
from ..exact.ray_queries import RayPart, any_hit, closest_hit, shadow_segment
from ..exact.triangle import to_float64, write_hit, write_miss
from ..gpu.entries import entry, set_entry

FOREVER = wp.constant(wp.float64(wp.inf))


def options(registers: int, fast_math: bool) -> dict[str, Any]:
    """Of a kernel. ``registers``: limit per thread on a GPU, 0: the compiler decides; ``fast_math``: whether the compiler
    may change float arithmetic.
    """
    limit: dict[str, Any] = {"cuda_max_registers": registers} if registers else {}
    return {**limit, "module_options": {"fast_math": True}} if fast_math else limit


@functools.cache
def make_primary_kernel(
    structure_type: Any,
    walk: Any,
    registers: int = 0,
    closest: Any = closest_hit,
    write: Any = None,
    fast_math: bool = False,
) -> Any:
    """Closest hit of each pixel: nearest by float64 t, ties to the lowest index. Empty ``tests``: not counted.

    ``closest``: the test of a triangle; ``write``: writes what it found, where that is not exact. Others: :func:`options`.
    """

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", **options(registers, fast_math))
    def primary_kernel(
        structure: structure_type,
        camera: Camera,
        mesh: Mesh,
        alpha: Alpha,
        mirrored: Rays,
        hits: Hits,
        hit_points: wp.array(dtype=wp.vec3d),
        tests: wp.array(dtype=wp.int32),
    ):
        pixel = pixel_of(wp.tid(), camera.width, camera.height)
        if pixel < 0:
            return
        ray = ray_of(camera, pixel)
        if wp.static(effects.bounced):
            if mirrored.active[pixel] == wp.uint8(0):
                write_miss(hits, pixel)
                return
            ray = mirrored_ray(mirrored, pixel)
        part = RayPart(to_float64(ray.origin), to_float64(ray.direction), FOREVER, -1)
        found = walk(closest, structure, mesh, alpha, part, ray)
        if tests.shape[0] > 0:
            tests[pixel] = found.tests
        if wp.static(write is None):
            write_hit(hits, hit_points, pixel, ray, found.triangle, found.t, mesh)
        else:
            write(hits, hit_points, pixel, ray, found, mesh)

    return primary_kernel


@functools.cache
def make_shadow_kernel(
    structure_type: Any,
    walk: Any,
    registers: int = 0,
    occluder: Any = None,
    starting: Any = None,
    fast_math: bool = False,
) -> Any:
    """Whether anything meets the open segment from each float64 hit point to the light; ``tests`` is added to.

    ``occluder``: the test of a triangle, exact if there is none; ``starting``: the same segment from where a method that is
    not exact starts it.
    """
    occluder = occluder or any_hit

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", **options(registers, fast_math))
    def shadow_kernel(
        light: wp.int32,
        structure: structure_type,
        camera: Camera,
        mesh: Mesh,
        alpha: Alpha,
        lights: wp.array(dtype=wp.vec3f),
        hits: Hits,
        hit_points: wp.array(dtype=wp.vec3d),
        receivers: wp.array(dtype=wp.uint8),
        mirrored: Rays,
        shadowed: wp.array(dtype=wp.uint8),
        tests: wp.array(dtype=wp.int32),
    ):
        pixel = pixel_of(wp.tid(), camera.width, camera.height)
        if pixel < 0:
            return
        own = entry(hits.triangle, pixel)
        if own < 0:
            set_entry(shadowed, pixel, wp.uint8(0))
            return
        if wp.static(effects.receivers):
            if entry(receivers, pixel) == wp.uint8(0):
                set_entry(shadowed, pixel, wp.uint8(0))
                return
        origin = camera.eye[0]
        if wp.static(effects.bounced):
            origin = mirrored.origin[pixel]
        segment = shadow_segment(hit_points[pixel], entry(lights, light), own, origin)
        way = to_float64(segment.light) - segment.hit
        if wp.static(starting is not None):
            segment = starting(structure, segment, ray_of(camera, pixel), hits, pixel, mesh)
            way = to_float64(segment.light - segment.start)
        part = RayPart(segment.hit, way, wp.float64(1.0), own)
        found = walk(occluder, structure, mesh, alpha, part, segment)
        if tests.shape[0] > 0:
            tests[pixel] = tests[pixel] + found.tests
        set_entry(shadowed, pixel, wp.uint8(found.done))

    return shadow_kernel
