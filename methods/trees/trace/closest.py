"""Closest hits: the traversal; then, in float64, the triangles that it left, t, weights and the origin of shadow rays.

Rays from the eye take a thread for each pixel, and one kernel does all of it. Rays that lie in arrays (mirrored ones, and
those of an orthographic camera) are listed first: after the first bounce few pixels have a ray, spread over the image,
and in the list they stand side by side, so that the warps that trace them are full.
"""

import functools
from typing import Any

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Hits, Mesh, Ray, Rays
from ...common.reads import corners_at, weld_at
from ...exact.certain_hit import certain_hit, is_far
from ...exact.hit_point import along, flat_hit_point, plane_distance
from ...exact.holes import opaque_at_hit
from ...exact.triangle import hit_distance, hit_weights, nearer, to_float32
from ...gpu.entries import entry, set_entry
from ...gpu.reserve import reserve
from ..constants import EYE_REGISTERS, REGISTERS, RESOLVE_REGISTERS
from ..nodes import Tree
from .traversal import has_holes, make_closest
from .undecided import Undecided


@wp.struct
class Share:
    """What the kernels of a bounce take for a share of the pixels: rays, what they are traced through, what they find.

    tiles   int32 [threads / 32]: the pixels of each warp (:class:`.shares.Shares`)
    listed  int32 [threads]: the pixels that have one of the ``rays`` in arrays; count int32 [1]: how many. Else empty
    starts  vec3f [pixels]: the points that shadow rays start at, rounded; nothing at a miss
    """

    camera: Camera
    tiles: wp.array[wp.int32]
    listed: wp.array[wp.int32]
    count: wp.array[wp.int32]
    rays: Rays
    tree: Tree
    mesh: Mesh
    alpha: Alpha
    hits: Hits
    starts: wp.array[wp.vec3f]


@wp.func
def pixel_at(share: Share, thread: wp.int32) -> wp.vec2i:
    """Column and row of a thread's pixel, or -1."""
    tile = entry(share.tiles, thread >> 5)
    x = ((tile & 0xFFFF) << 3) | (thread & 7)
    y = ((tile >> 16) << 2) | ((thread >> 3) & 3)
    if x >= share.camera.width or y >= share.camera.height:
        return wp.vec2i(-1, -1)
    return wp.vec2i(x, y)


@wp.func
def eye_ray(camera: Camera, at: wp.vec2i) -> Ray:
    """The ray of a pixel; for a thread without a pixel, that of the first."""
    direction = entry(camera.column, wp.max(at[0], 0)) + entry(camera.row, wp.max(at[1], 0))
    return Ray(entry(camera.eye, 0), direction)


@wp.func
def ray_at(rays: Rays, pixel: wp.int32) -> Ray:
    """The ray of a pixel that lies in arrays."""
    return Ray(entry(rays.origin, pixel), entry(rays.direction, pixel))


@wp.func
def write_closest(hits: Hits, pixel: wp.int32, triangle: wp.int32, t: wp.float32, u: wp.float32, v: wp.float32):
    """Write an answer, or with triangle -1 and infinite t a miss."""
    set_entry(hits.triangle, pixel, triangle)
    set_entry(hits.t, pixel, t)
    set_entry(hits.u, pixel, u)
    set_entry(hits.v, pixel, v)


@wp.func
def write_float32(found: wp.vec4i, ray: Ray, pixel: wp.int32, share: Share):
    """Write what a float32 traversal gave, and the origin of shadow rays."""
    t = wp.cast(found[0], wp.float32)
    if found[3] >= 0:
        set_entry(share.starts, pixel, ray.origin + ray.direction * t)
    else:
        t = wp.INF
    write_closest(share.hits, pixel, found[3], t, wp.cast(found[1], wp.float32), wp.cast(found[2], wp.float32))


@wp.func
def resolve_hit(
    ray: Ray, found: wp.vec4i, pixel: wp.int32, share: Share, undecided: Undecided, far: wp.bool
) -> wp.vec2i:
    """Write the nearest of the certain hit and the undecided ones that ``found`` holds
    (:func:`.traversal.make_closest`): t, weights and origin of shadow rays, in float64. Returns the hit triangle or -1, and
    the same if that origin is still to be computed, because the ray is flat on it or starts ``far`` away, else -1.
    """
    i = found[0]
    following = found[1]
    last = found[2]
    best = found[3]
    if i >= 0 or last >= 0:
        nearest = wp.float64(wp.INF)
        if best >= 0:
            nearest = plane_distance(ray, corners_at(share.mesh, best))
        while i >= 0 or last >= 0:
            if i < 0:
                pair = entry(undecided.pairs, last)
                last = pair[1]
                i = pair[0]
            corners = corners_at(share.mesh, i)
            weld = weld_at(share.mesh, i)
            t = hit_distance(ray, corners, weld)
            wanted = t > wp.float64(0.0) and nearer(share.mesh, t, i, nearest, best)
            if wp.static(effects.alpha):
                if wanted:
                    wanted = opaque_at_hit(share.alpha, i, ray, corners, weld)
            if wanted:
                nearest = t
                best = i
            i = following
            following = -1
    distance32 = wp.float32(wp.INF)
    uv = wp.vec2f()
    flat = wp.bool(False)
    if best >= 0:
        hit = certain_hit(ray, corners_at(share.mesh, best), weld_at(share.mesh, best))
        flat = hit.flat
        if far:
            flat = True
        distance32 = wp.float32(hit.t)
        uv = hit.uv
        set_entry(share.starts, pixel, to_float32(along(ray, hit.t)))
    write_closest(share.hits, pixel, best, distance32, uv[0], uv[1])
    return wp.vec2i(best, wp.where(flat, best, -1))


@wp.func
def write_flat_start(ray: Ray, triangle: wp.int32, pixel: wp.int32, share: Share):
    """Write the origin of shadow rays of a ray that is flat on its triangle. Such rays are few, and slow to compute."""
    corners = corners_at(share.mesh, triangle)
    set_entry(share.starts, pixel, to_float32(flat_hit_point(ray, plane_distance(ray, corners), corners)))


@wp.func
def write_weights(ray: Ray, pixel: wp.int32, share: Share):
    """Write the weights of a hit as all methods that trace parallel rays do: such a ray often meets an edge, and a weight
    of zero keeps the sign that a division gives it.
    """
    triangle = entry(share.hits.triangle, pixel)
    if triangle >= 0:
        uv = hit_weights(ray, corners_at(share.mesh, triangle), weld_at(share.mesh, triangle))
        set_entry(share.hits.u, pixel, uv[0])
        set_entry(share.hits.v, pixel, uv[1])


@functools.cache
def make_eye(exact: bool, packets: bool, levels: int = 1) -> Any:
    """A function of a thread, 8 x 4 pixels per warp: the answer of its pixel, and the origin of shadow rays. Returns the
    pixel and the hit triangle, or -1.
    """
    closest = make_closest("eye", exact, packets, levels)

    @wp.func(module="unique")
    def trace_eye(thread: wp.int32, share: Share, records: wp.array[wp.vec4f], undecided: Undecided) -> wp.vec2i:
        at = pixel_at(share, thread)
        seen = at[0] >= 0
        ray = eye_ray(share.camera, at)
        found = closest(seen, ray, share.tree, records, undecided, has_holes())
        if not seen:
            return wp.vec2i(-1, -1)
        pixel = at[1] * share.camera.width + at[0]
        hit = found[3]
        if wp.static(exact):
            if found[0] < 0 and found[2] < 0 and hit < 0:
                write_closest(share.hits, pixel, -1, wp.INF, 0.0, 0.0)
                return wp.vec2i(pixel, -1)
            # Rays and corners are read again, so that no register holds them until here.
            again = eye_ray(share.camera, at)
            far = is_far(again.origin, entry(share.tree.extent, 0))
            of = resolve_hit(again, found, pixel, share, undecided, far)
            hit = of[0]
            if of[1] >= 0:
                write_flat_start(eye_ray(share.camera, at), of[1], pixel, share)
        else:
            write_float32(found, Ray(entry(share.camera.eye, 0), ray.direction), pixel, share)
        return wp.vec2i(pixel, hit)

    return trace_eye


@functools.cache
def make_eye_kernel(exact: bool, packets: bool, levels: int = 1) -> Any:
    """One thread per pixel: :func:`make_eye`."""
    trace_eye = make_eye(exact, packets, levels)

    @wp.kernel(
        enable_backward=False,
        grid_stride=False,
        module="unique",
        cuda_max_registers=EYE_REGISTERS if exact else REGISTERS,
    )
    def eye_kernel(share: Share, records: wp.array[wp.vec4f], undecided: Undecided):
        trace_eye(wp.tid(), share, records, undecided)

    return eye_kernel


@functools.cache
def make_tests_kernel(records: str, exact: bool, levels: int = 1) -> Any:
    """One thread per pixel: how many triangles its ray is tested against. The kernels of a frame do not count."""
    count = make_closest(records, exact, levels=levels, counts=True)

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique")
    def tests_kernel(share: Share, triangles: wp.array[wp.vec4f], undecided: Undecided, tests: wp.array[wp.int32]):
        pixel = wp.tid()
        y = pixel // share.camera.width
        if wp.static(records == "eye"):
            ray = eye_ray(share.camera, wp.vec2i(pixel - y * share.camera.width, y))
        else:
            ray = ray_at(share.rays, pixel)
        tests[pixel] = count(True, ray, share.tree, triangles, undecided, has_holes())[0]

    return tests_kernel


@wp.kernel(enable_backward=False, grid_stride=False)
def list_kernel(share: Share):
    """One thread per pixel, 8 x 4 per warp: the pixels that have a ray; all others miss."""
    at = pixel_at(share, wp.tid())
    if at[0] < 0:
        return
    pixel = at[1] * share.camera.width + at[0]
    if entry(share.rays.active, pixel) != wp.uint8(0):
        set_entry(share.listed, reserve(share.count, 0, 1), pixel)
    else:
        write_closest(share.hits, pixel, -1, wp.INF, 0.0, 0.0)


@functools.cache
def make_listed_kernel(exact: bool, levels: int = 1) -> Any:
    """One thread per listed pixel: what the traversal found, vec4i [threads], for :func:`make_resolve_kernel`; in float32
    the answer and the origin of shadow rays.
    """
    closest = make_closest("ray", exact, levels=levels)

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=REGISTERS)
    def listed_kernel(share: Share, records: wp.array[wp.vec4f], undecided: Undecided, found: wp.array[wp.vec4i]):
        k = wp.tid()
        if k >= entry(share.count, 0):
            return
        pixel = entry(share.listed, k)
        ray = ray_at(share.rays, pixel)
        one = closest(True, ray, share.tree, records, undecided, has_holes())
        if wp.static(exact):
            set_entry(found, k, one)
        else:
            write_float32(one, ray, pixel, share)

    return listed_kernel


@functools.cache
def make_resolve_kernel(parallel: bool) -> Any:
    """One thread per listed pixel: the answer, and the origin of shadow rays. ``parallel``: rays of an orthographic
    camera may start far from the scene; mirrored rays start in it.
    """

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=RESOLVE_REGISTERS)
    def resolve_kernel(share: Share, undecided: Undecided, found: wp.array[wp.vec4i]):
        k = wp.tid()
        if k >= entry(share.count, 0):
            return
        pixel = entry(share.listed, k)
        ray = ray_at(share.rays, pixel)
        far = wp.bool(False)
        if wp.static(parallel):
            far = is_far(ray.origin, entry(share.tree.extent, 0))
        of = resolve_hit(ray, entry(found, k), pixel, share, undecided, far)
        if of[1] >= 0:
            write_flat_start(ray, of[1], pixel, share)
        if wp.static(parallel):
            write_weights(ray, pixel, share)

    return resolve_kernel
