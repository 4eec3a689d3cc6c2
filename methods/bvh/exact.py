"""wp.Bvh rebuilt in place over padded boxes, with the shared triangle tests: exact, and capture-safe.

Warp's slab test computes a distance with three roundings, so a ray that touches a box can be told that it does not.
Boxes are therefore padded by what those roundings can amount to (:data:`..common.bounds.PADDED_UNITS`; Ize 2013,
"Robust BVH Ray Traversal", does the same in the ray).
"""

from __future__ import annotations

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.frame.alpha import Alpha
from ...harness.frame.frame import Frame
from ...harness.frame.geometry import Camera, Hits, Mesh, Rays, corners_of, mirrored_ray, ray_of, weld_of
from ...harness.frame.mirrors import traced_bounces
from ...harness.frame.passes import Pass
from ...harness.frame.specialise import effects, specialised
from ...harness.scene.effects import Effects
from ..common.alpha import opaque_at_hit, opaque_to_light
from ..common.bounces import bounced_tests
from ..common.bounds import PADDED_UNITS, launch_boxes
from ..common.pixels import pixel_of, thread_count
from ..common.segment import may_occlude, occludes
from ..common.triangle import (
    NO_HIT,
    U32,
    hit_distance,
    largest,
    may_hit,
    nearer,
    to_float32,
    write_hit,
    write_miss,
)

SLACK = wp.constant(1.0 + 2.0**-20)  # a box that begins just behind the best hit may hold a tie


@wp.kernel(enable_backward=False)
def primary_kernel(
    bvh: wp.uint64,
    blocks: wp.bool,
    camera: Camera,
    mesh: Mesh,
    alpha: Alpha,
    rays: Rays,
    hits: Hits,
    hit_points: wp.array(dtype=wp.vec3d),
    tests: wp.array(dtype=wp.int32),
):
    """Closest hit of each pixel: nearest by float64 t, ties to the lowest index. Empty ``tests``: not counted."""
    pixel = pixel_of(wp.tid(), camera.width, camera.height, blocks)
    if pixel < 0:
        return
    ray = ray_of(camera, pixel)
    if wp.static(effects.bounced):
        if rays.active[pixel] == wp.uint8(0):
            write_miss(hits, pixel)
            return
        ray = mirrored_ray(rays, pixel)
    best = wp.int32(-1)
    best_t = wp.float64(wp.INF)
    limit = wp.float32(wp.INF)
    number = wp.int32(0)
    i = wp.int32(0)
    query = wp.bvh_query_ray(bvh, ray.origin, ray.direction)
    while wp.bvh_query_next(query, i, limit):
        number += 1
        if mesh.valid[i] != wp.uint8(0):
            corners = corners_of(mesh, i)
            if may_hit(ray, corners):
                distance = hit_distance(ray, corners, weld_of(mesh, i))
                if wp.static(effects.alpha):
                    if distance > wp.float64(0.0):
                        if not opaque_at_hit(alpha, i, ray, corners, weld_of(mesh, i)):
                            distance = NO_HIT
                if distance > wp.float64(0.0) and nearer(distance, i, best_t, best):
                    best = i
                    best_t = distance
                    limit = wp.float32(distance) * SLACK
    if tests.shape[0] > 0:
        tests[pixel] = number
    write_hit(hits, hit_points, pixel, ray, best, best_t, mesh)


@wp.kernel(enable_backward=False)
def shadow_kernel(
    bvh: wp.uint64,
    blocks: wp.bool,
    light: wp.int32,
    camera: Camera,
    mesh: Mesh,
    alpha: Alpha,
    lights: wp.array(dtype=wp.vec3f),
    rays: Rays,
    hits: Hits,
    hit_points: wp.array(dtype=wp.vec3d),
    receivers: wp.array2d(dtype=wp.uint8),
    visibility: wp.array2d(dtype=wp.uint8),
    tests: wp.array(dtype=wp.int32),
):
    """Whether anything meets the open segment from each float64 hit point to the light; ``tests`` is added to."""
    pixel = pixel_of(wp.tid(), camera.width, camera.height, blocks)
    if pixel < 0:
        return
    own = hits.triangle[pixel]
    if own < 0:
        visibility[light, pixel] = wp.uint8(0)
        return
    if wp.static(effects.receivers):
        if receivers[light, pixel] == wp.uint8(0):
            visibility[light, pixel] = wp.uint8(0)
            return
    h = hit_points[pixel]
    start = to_float32(h)
    target = lights[light]
    size = wp.float64(largest(camera.eye[0]))
    if wp.static(effects.bounced):
        size = wp.float64(largest(rays.origin[pixel]))
    error = U32 * largest(start)
    shadowed = wp.bool(False)
    number = wp.int32(0)
    i = wp.int32(0)
    query = wp.bvh_query_ray(bvh, start, target - start)
    while wp.bvh_query_next(query, i, SLACK):
        number += 1
        if i != own and mesh.valid[i] != wp.uint8(0):
            corners = corners_of(mesh, i)
            if may_occlude(start, target, corners, error) and occludes(
                h, target, corners, weld_of(mesh, i), size
            ):
                shadowed = True
                if wp.static(effects.alpha):
                    shadowed = opaque_to_light(alpha, i, h, target, corners, weld_of(mesh, i), size)
                if shadowed:
                    break
    if tests.shape[0] > 0:
        tests[pixel] = tests[pixel] + number
    visibility[light, pixel] = wp.uint8(shadowed)


class ExactBvh:
    """A wp.Bvh over a frame's triangles and the passes that rebuild and query it.

    constructor  what Warp builds; on CUDA only "lbvh" can be rebuilt in place
    leaf_size    boxes a leaf
    bounces      how often mirrored rays go on
    """

    def __init__(self, frame: Frame, constructor: str, leaf_size: int, swizzle: bool, bounces: int = 0):
        self.frame = frame
        self.constructor = constructor
        self.swizzle = swizzle
        self.threads = thread_count(frame.width, frame.height, swizzle)
        count = frame.triangle_count
        # The tree must exist before the first frame; its buffers are what every rebuild uses again.
        points, valid = frame.prepared.points(0)
        corners = points[frame.prepared.faces]
        corners[valid == 0] = 0.0
        with wp.ScopedDevice(frame.device):
            self.box = wp.zeros(6, dtype=wp.float32)
            self.lowers = wp.array(corners.min(axis=1), dtype=wp.vec3f)
            self.uppers = wp.array(corners.max(axis=1), dtype=wp.vec3f)
            self.hit = wp.zeros(frame.pixels, dtype=wp.vec3d)
            self.bounced_hit = wp.zeros((bounces, frame.pixels) if bounces else (0, 0), dtype=wp.vec3d)
            self.uncounted = wp.zeros(0, dtype=wp.int32)
        self.lights: list[int] = []
        self.bvh = wp.Bvh(self.lowers, self.uppers, constructor=constructor, leaf_size=leaf_size)
        assert len(self.lowers) == count

    def tests_per_pixel(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Triangle tests of each pixel's primary ray and of its shadow rays: the last frame traced again, counted."""
        primary = wp.zeros(self.frame.pixels, dtype=wp.int32, device=self.frame.device)
        shadow = wp.zeros_like(primary)
        self._primary(primary)
        for light in self.lights:
            self._shadow(light, shadow)
        return primary.numpy(), shadow.numpy()

    def counters(self) -> dict[str, int]:
        """Triangle tests of a frame."""
        primary, shadow = self.tests_per_pixel()
        return {
            "primary tests": int(primary.sum(dtype=np.int64)),
            "shadow tests": int(shadow.sum(dtype=np.int64)),
            **bounced_tests(self.frame, self.effects, self._primary, self._shadow),
        }

    def passes(self, effects: Effects) -> list[Pass]:
        self.effects = effects
        self.lights = [i for i, wanted in enumerate(effects.shadows) if wanted]
        passes = [
            Pass("boxes", "build", ("points", "triangles", "reach"), ("boxes",), self._boxes),
            Pass("rebuild", "build", ("boxes",), ("bvh",), self._rebuild),
            Pass(
                "primary rays", "trace", ("bvh", "camera", *effects.surface_reads()), ("hits",), self._primary
            ),
        ]
        for i in self.lights:
            passes.append(
                Pass(
                    f"light {i}: shadow rays",
                    "shadow",
                    ("bvh", "hits", "camera", f"light/{i}", *effects.mask_reads(i), *effects.surface_reads()),
                    (f"visibility/{i}",),
                    lambda i=i: self._shadow(i),  # type: ignore[misc]
                    effect=f"shadows/{i}",
                )
            )
        passes += traced_bounces(
            effects,
            ("bvh", "points", "triangles"),
            lambda b: self._primary(bounce=b),
            lambda i, b: self._shadow(i, bounce=b),
        )
        return passes

    def _boxes(self) -> None:
        launch_boxes(self.frame, self.box, self.lowers, self.uppers, PADDED_UNITS)

    def _rebuild(self) -> None:
        self.bvh.rebuild(self.constructor)

    def _hits(self, bounce: int) -> wp.array:
        return self.bounced_hit[bounce - 1] if bounce else self.hit

    def _primary(self, tests: wp.array | None = None, bounce: int = 0) -> None:
        counted = self.uncounted if tests is None else tests
        frame = self.frame
        wp.launch(
            specialised(primary_kernel, self.effects.switches(bounce=bounce)),
            dim=self.threads,
            inputs=[
                self.bvh.id, self.swizzle, frame.camera, frame.mesh, frame.alpha, frame.rays(bounce),
            ],
            outputs=[frame.hits(bounce), self._hits(bounce), counted],
            device=frame.device,
        )  # fmt: skip

    def _shadow(self, light: int, tests: wp.array | None = None, bounce: int = 0) -> None:
        counted = self.uncounted if tests is None else tests
        frame = self.frame
        wp.launch(
            specialised(shadow_kernel, self.effects.switches(light, bounce)),
            dim=self.threads,
            inputs=[
                self.bvh.id, self.swizzle, light, frame.camera, frame.mesh, frame.alpha, frame.lights,
                frame.rays(bounce), frame.hits(bounce), self._hits(bounce), frame.masks(bounce),
            ],
            outputs=[frame.bits(bounce), counted],
            device=frame.device,
        )  # fmt: skip
