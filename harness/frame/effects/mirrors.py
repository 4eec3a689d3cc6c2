"""Mirrored rays. The harness makes them from the hits of the previous bounce, in the same way for every method and for
the reference.

The float32 rays define what is mirrored. The closest hit with t > 0 counts; no triangle is excluded. The direction is
reflected at the geometric normal in float64 and rounded once. The origin is the hit point, computed again in float64 on
the plane of its triangle, moved off the surface to the side that the ray came from by the bound of
:func:`left_surface`, and rounded outward, so that no float32 query hits the mirror again.
"""

from collections.abc import Callable
from functools import partial

import warp as wp

from ...scene.effects import Effects, Switches
from ..frame import Frame
from ..geometry import Camera, Hits, Mesh, Rays, corners_of, mirrored_ray, ray_of
from ..schedule.passes import Pass
from ..vectors import largest, to_float32, to_float64
from .specialise import effects, specialised

GAMMA7 = wp.constant(wp.float64(7.0 * 2.0**-24 / (1.0 - 7.0 * 2.0**-24)))
"""Relative error bound of seven float32 roundings (Pharr, Jakob & Humphreys, PBRT, 4th edition, section 6.8)."""

FINE = wp.constant(wp.float64(2.0**-48))  # relative error of the float64 hit point: 32 units in the last place
OUTWARD = wp.constant(wp.float64(2.0**-23))  # at least one unit in the last place of any float32, relative


@wp.func
def spread(a: wp.float64, b: wp.float64, c: wp.float64, x: wp.float64) -> wp.float64:
    """|x| and the largest distance from x to a, b and c: the numbers that a query subtracts along one axis."""
    return wp.abs(x) + wp.max(wp.abs(a - x), wp.max(wp.abs(b - x), wp.abs(c - x)))


@wp.func
def outward(x: wp.float64, step: wp.float64) -> wp.float64:
    """x + step and one more unit in the last place, so that rounding to float32 does not undo the step."""
    y = x + step
    if step > wp.float64(0.0):
        return y + OUTWARD * wp.abs(y)
    if step < wp.float64(0.0):
        return y - OUTWARD * wp.abs(y)
    return y


@wp.func
def left_surface(
    h: wp.vec3d, side: wp.vec3d, way: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, size: wp.float64
) -> wp.vec3d:
    """Origin of the ray along ``way`` that leaves the triangle (a, b, c) at h, on the side of the unit normal ``side``.

    The point h is moved by the error bound of a float32 query perpendicular to the surface: the coordinates that the
    query subtracts and multiplies, projected on the normal, and for a query that measures along the ray, the extent of
    the triangle along the ray. ``size`` is the largest coordinate that h was computed from.
    """
    extent = wp.max(largest(a - h), wp.max(largest(b - h), largest(c - h)))
    step = FINE * (extent + largest(h) + size) + GAMMA7 * (
        wp.abs(side[0]) * spread(a[0], b[0], c[0], h[0])
        + wp.abs(side[1]) * spread(a[1], b[1], c[1], h[1])
        + wp.abs(side[2]) * spread(a[2], b[2], c[2], h[2])
        + extent * wp.abs(wp.dot(side, way)) / largest(way)
    )
    return wp.vec3d(outward(h[0], step * side[0]), outward(h[1], step * side[1]), outward(h[2], step * side[2]))


@wp.kernel(enable_backward=False)
def mirror_kernel(camera: Camera, mesh: Mesh, mirror: wp.array(dtype=wp.uint8), hits: Hits, rays: Rays, mirrored: Rays):
    """The mirrored ray of each pixel whose hit is a mirror; zero and not active elsewhere."""
    pixel = wp.tid()
    mirrored.origin[pixel] = wp.vec3f(0.0, 0.0, 0.0)
    mirrored.direction[pixel] = wp.vec3f(0.0, 0.0, 0.0)
    mirrored.active[pixel] = wp.uint8(0)
    hit = hits.triangle[pixel]
    if hit < 0:
        return
    if mirror[hit] == wp.uint8(0):
        return
    ray = ray_of(camera, pixel)
    if wp.static(effects.bounced):
        ray = mirrored_ray(rays, pixel)
    o = to_float64(ray.origin)
    d = to_float64(ray.direction)
    corners = corners_of(mesh, hit)
    a = to_float64(corners.a)
    b = to_float64(corners.b)
    c = to_float64(corners.c)
    n = wp.cross(b - a, c - a)
    slope = wp.dot(n, d)
    h = o + d * (wp.dot(n, a - o) / slope)
    way = d - n * (wp.float64(2.0) * slope / wp.dot(n, n))
    side = wp.normalize(n)
    if slope > wp.float64(0.0):
        side = -side
    start = to_float32(left_surface(h, side, way, a, b, c, largest(o)))
    onward = to_float32(way)
    # A ray in the plane of the mirror is not traced; only a wrong answer can produce one.
    if wp.isfinite(start) and wp.isfinite(onward):
        mirrored.origin[pixel] = start
        mirrored.direction[pixel] = onward
        mirrored.active[pixel] = wp.uint8(1)


def mirror_passes(frame: Frame, effects: Effects) -> list[Pass]:
    """The passes that make the rays of each bounce from the hits of the previous bounce."""

    def launch(bounce: int) -> None:
        kernel = specialised(mirror_kernel, Switches(bounced=frame.tabled(bounce - 1)))
        seen = frame.hits(bounce - 1), frame.rays(bounce - 1)
        frame.launch(kernel, frame.pixels, [frame.camera, frame.mesh, frame.mirror, *seen], [frame.rays(bounce)])

    passes = []
    for b in range(1, effects.bounces + 1):
        before = ("hits", "camera") if b == 1 else (f"hits/{b - 1}", f"rays/{b - 1}")
        reads = ("points", "triangles", "surfaces", *before)
        passes.append(Pass(f"bounce {b}: rays", "trace", reads, (f"rays/{b}",), partial(launch, b), effect="mirror"))
    return passes


def traced_bounces(
    effects: Effects, structure: tuple[str, ...], trace: Callable[[int], None], shadow: Callable[[int, int], None],
    of_light: Callable[[int], tuple[str, ...]] = lambda light: (),
) -> list[Pass]:  # fmt: skip
    """A method's own passes for mirrored rays, after those of its primary rays.

    structure  the resources of the method that tracing reads, and those of the harness apart from the surfaces
    trace      trace(bounce) fills ``frame.hits(bounce)`` from ``frame.rays(bounce)``, a miss where there is no ray
    shadow     shadow(light, bounce) fills row ``light`` of ``frame.bits(bounce)`` for those hits
    of_light   of_light(light): the resources of the method that only its shadow rays read
    """
    passes = []
    for b in range(1, effects.bounces + 1):
        reads = (*structure, *effects.surface_reads(), f"rays/{b}")
        name = f"bounce {b}: mirrored rays"
        passes.append(Pass(name, "trace", reads, (f"hits/{b}",), partial(trace, b), effect="mirror"))
        for i in (i for i, wanted in enumerate(effects.shadows) if wanted):
            own = (*reads, *of_light(i), f"hits/{b}", f"light/{i}", *effects.receiver_reads(i, b))
            name = f"bounce {b}, light {i}: shadow rays"
            passes.append(Pass(name, "shadow", own, (f"shadowed/{i}/{b}",), partial(shadow, i, b), effect="mirror"))
    return passes
