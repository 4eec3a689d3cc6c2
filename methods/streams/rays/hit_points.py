"""Hit points as a light's grid holds them: from the words of the camera's stream, before the answers are resolved.

A word holds 1 / t of its pixel's nearest hit, which gives the hit point to 2^-29 of its way from the eye: closer than
float32 rounds it. The few hits of triangles that are seen nearly edge-on, or are far from the eye for their coordinates, are
marked by the camera's stream and computed from the triangle (:class:`..camera.pixels.Planes`), and so are those that
lie so near the light that the difference would turn their ray. What float32 cannot decide about a ray, float64 decides on
the hit point of the answer. So no answer depends on what a ray was placed by.

The difference is at most 2^-24 of the larger of the largest coordinate of all hit points and a 32nd of their way from the
eye. The bounds of :mod:`..cube.footprint`, :mod:`..occlusion.planes` and :mod:`.region` hold for such points.
"""

import warp as wp

from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Mesh
from ...common.reads import corners_at, ray_at
from ...exact.hit_point import along, hit_point, plane_distance
from ...exact.triangle import largest, spare_bits, to_float32
from ...gpu.entries import entry, entry_now
from ..camera.pixels import distance_of, index_of
from ..cube.cells import place_of
from ..cube.lights import Aim

FAR = wp.constant(wp.float32(1.0 / 32.0))
"""One over :data:`..camera.pixels.LONGEST_WAY`."""

NEAR_LIGHT = wp.constant(wp.float32(2.0**-11))
"""A ray whose hit point has less depth, as a share of its way from the eye, takes the exact point: another would turn it by
more than 2^-18.
"""


@wp.struct
class PrimaryHits:
    """The nearest hits of the camera's stream: nearest uint64 [pixels], exact_path uint8 [triangles]
    (:class:`..queues.Queues`); and of what they are hits.
    """

    camera: Camera
    mesh: Mesh
    nearest: wp.array(dtype=wp.uint64)
    exact_path: wp.array(dtype=wp.uint8)


@wp.struct
class HitPoint:
    """A hit point. triangle: -1 at a miss; way: the largest coordinate of its way from the eye; exact_path:
    whether :func:`exact_point` must give it; t: its distance, to 2^-23 of itself unless it must.
    """

    triangle: wp.int32
    hit: wp.vec3d
    t: wp.float32
    way: wp.float32
    exact_path: wp.bool


@wp.func
def has_ray(hits: PrimaryHits, receivers: wp.array2d(dtype=wp.uint8), light: wp.int32, pixel: wp.int32) -> wp.bool:
    """Whether a pixel has a ray to a light: by its hit, or, where not all hits have one, by the ``receivers``."""
    wanted = wp.bool(False)
    if wp.static(effects.receivers):
        wanted = entry(receivers, light, pixel) != wp.uint8(0)
    else:
        wanted = entry(hits.nearest, pixel) != wp.uint64(0)
    return wanted


@wp.func
def point_of(hits: PrimaryHits, pixel: wp.int32, at: wp.vec2i) -> HitPoint:
    """The hit point of a pixel in column and row ``at``."""
    point = HitPoint()
    point.triangle = -1
    word = entry(hits.nearest, pixel)
    if word != wp.uint64(0):
        spare = spare_bits(hits.mesh.triangles.shape[0])
        point.triangle = index_of(word, spare)
        point.exact_path = entry(hits.exact_path, point.triangle) != wp.uint8(0)
        ray = ray_at(hits.camera, at[0], at[1])
        t = distance_of(word, spare)
        point.t = wp.float32(t)
        point.hit = along(ray, t)
        point.way = largest(ray.direction) * point.t
    return point


@wp.func
def point_of_word(hits: PrimaryHits, pixel: wp.int32, at: wp.vec2i) -> wp.vec3f:
    """The hit point that :func:`point_of` gives, rounded; of a pixel with a hit."""
    spare = spare_bits(hits.mesh.triangles.shape[0])
    return to_float32(along(ray_at(hits.camera, at[0], at[1]), distance_of(entry(hits.nearest, pixel), spare)))


@wp.func
def exact_point(hits: PrimaryHits, pixel: wp.int32, at: wp.vec2i) -> wp.vec3d:
    """The hit point of the answer."""
    word = entry_now(hits.nearest, pixel)
    corners = corners_at(hits.mesh, index_of(word, spare_bits(hits.mesh.triangles.shape[0])))
    ray = ray_at(hits.camera, at[0], at[1])
    return hit_point(ray, plane_distance(ray, corners), corners)


@wp.struct
class Placed:
    """A hit point as a light's grid holds it. place: (u, v, face, depth) (:func:`..cube.cells.place_of`), face -1
    without a ray; h: the point; size: its share in the largest coordinate.
    """

    place: wp.vec4f
    h: wp.vec3f
    size: wp.float32


@wp.func
def placed(point: HitPoint, wanted: wp.bool, aim: Aim) -> Placed:
    """Where a hit point lies; face -1 if it has no ray (not ``wanted``), or if :func:`placed_exactly` must say."""
    found = Placed()
    found.place = wp.vec4f(0.0, 0.0, -1.0, 0.0)
    if wanted and not point.exact_path:
        place = place_of(point.hit, aim.proxy, aim.axes)
        if place[3] >= NEAR_LIGHT * point.way and place[3] < wp.INF:
            found.place = place
            found.h = to_float32(point.hit)
            found.size = wp.max(largest(found.h), FAR * point.way)
    return found


@wp.func
def placed_exactly(hits: PrimaryHits, pixel: wp.int32, at: wp.vec2i, aim: Aim) -> Placed:
    """Where the hit point of an answer lies. Few rays need it, and it takes many registers. So it reads everything again:
    what a kernel held for it, it would hold for all rays.
    """
    found = Placed()
    hit = exact_point(hits, pixel, at)
    found.place = place_of(hit, aim.proxy, aim.axes)
    found.h = to_float32(hit)
    found.size = largest(found.h)
    return found
