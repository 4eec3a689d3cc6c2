"""The exact tree: a wp.Bvh over padded boxes, rebuilt in place, queried with the shared triangle tests; capture-safe."""

from __future__ import annotations

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.frame.alpha import Alpha
from ...harness.frame.effects.mirrors import traced_bounces
from ...harness.frame.effects.specialise import effects, specialised
from ...harness.frame.frame import Frame
from ...harness.frame.geometry import Camera, Hits, Mesh, Rays, mirrored_ray, ray_of
from ...harness.frame.schedule.passes import Pass
from ...harness.scene.effects import Effects
from ..common.bands import Band, Bands
from ..common.bounces import bounced_tests
from ..common.box_tree import QUERY_BLOCK, BoxTree, traverse
from ..common.corner_records import CornerRecords
from ..common.pixels import pixel_of
from ..common.ray_passes import shadow_ray_passes
from ..exact.ray_queries import (
    SLACK,
    any_hit,
    any_opaque_hit,
    closest_hit,
    closest_opaque_hit,
    nothing_found,
    shadow_segment,
)
from ..exact.triangle import write_hit, write_miss


@wp.kernel(enable_backward=False, grid_stride=False)
def primary_kernel(
    blocks: wp.bool,
    tree: wp.uint64,
    records: CornerRecords,
    camera: Camera,
    mesh: Mesh,
    alpha: Alpha,
    mirrored: Rays,
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
        if mirrored.active[pixel] == wp.uint8(0):
            write_miss(hits, pixel)
            return
        ray = mirrored_ray(mirrored, pixel)
    found = nothing_found(wp.INF)
    if wp.static(effects.alpha):
        found = traverse(closest_opaque_hit, tree, records, alpha, ray.origin, ray.direction, ray, found)
    else:
        found = traverse(closest_hit, tree, records, alpha, ray.origin, ray.direction, ray, found)
    if tests.shape[0] > 0:
        tests[pixel] = found.tests
    write_hit(hits, hit_points, pixel, ray, found.triangle, found.t, mesh)


@wp.kernel(enable_backward=False, grid_stride=False)
def shadow_kernel(
    blocks: wp.bool,
    light: wp.int32,
    tree: wp.uint64,
    records: CornerRecords,
    camera: Camera,
    alpha: Alpha,
    lights: wp.array(dtype=wp.vec3f),
    hits: Hits,
    hit_points: wp.array(dtype=wp.vec3d),
    receivers: wp.array2d(dtype=wp.uint8),
    mirrored: Rays,
    shadowed: wp.array2d(dtype=wp.uint8),
    tests: wp.array(dtype=wp.int32),
):
    """Whether anything meets the open segment from each float64 hit point to the light; ``tests`` is added to."""
    pixel = pixel_of(wp.tid(), camera.width, camera.height, blocks)
    if pixel < 0:
        return
    own = hits.triangle[pixel]
    if own < 0:
        shadowed[light, pixel] = wp.uint8(0)
        return
    if wp.static(effects.receivers):
        if receivers[light, pixel] == wp.uint8(0):
            shadowed[light, pixel] = wp.uint8(0)
            return
    origin = camera.eye[0]
    if wp.static(effects.bounced):
        origin = mirrored.origin[pixel]
    segment = shadow_segment(hit_points[pixel], lights[light], own, origin)
    way = segment.light - segment.start
    found = nothing_found(SLACK)
    if wp.static(effects.alpha):
        found = traverse(any_opaque_hit, tree, records, alpha, segment.start, way, segment, found)
    else:
        found = traverse(any_hit, tree, records, alpha, segment.start, way, segment, found)
    if tests.shape[0] > 0:
        tests[pixel] = tests[pixel] + found.tests
    shadowed[light, pixel] = wp.uint8(found.done)


class ExactBvh:
    """A box tree over a frame's triangles and the passes that rebuild and query it.

    constructor  what Warp builds; on CUDA only "lbvh" can be rebuilt in place
    leaf_size    triangles per leaf
    blocks       whether 32 consecutive threads take a block of 8x4 pixels instead of 32 pixels of a row
    bounces      how many times mirrored rays are reflected
    threads      of a CPU, that each trace a band of the image; 0: one for each core
    """

    def __init__(
        self, frame: Frame, constructor: str, leaf_size: int, blocks: bool, bounces: int = 0, threads: int = 1
    ):
        self.frame, self.blocks = frame, blocks
        self.bands = Bands(frame, threads)
        self.tree = BoxTree(frame, constructor, leaf_size)
        with wp.ScopedDevice(frame.device):
            self.hit = wp.zeros(frame.pixels, dtype=wp.vec3d)
            self.bounced_hit = wp.zeros((bounces, frame.pixels) if bounces else (0, 0), dtype=wp.vec3d)
            self.uncounted = wp.zeros(0, dtype=wp.int32)
        self.lights: list[int] = []

    def tests_per_pixel(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Triangle tests of each pixel's primary ray and of its shadow rays. The last frame is traced again to count
        them."""
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
        reads = ("bvh", "camera", *effects.surface_reads())
        passes = [*self.tree.passes(), Pass("primary rays", "trace", reads, ("hits",), self._primary)]
        passes += shadow_ray_passes(effects, ("bvh", "hits", "camera"), self._shadow)
        passes += traced_bounces(
            effects,
            ("bvh", "points", "triangles"),
            lambda b: self._primary(bounce=b),
            lambda i, b: self._shadow(i, bounce=b),
        )
        return passes

    def _hits(self, bounce: int) -> wp.array:
        return self.bounced_hit[bounce - 1] if bounce else self.hit

    def _primary(self, tests: wp.array | None = None, bounce: int = 0) -> None:
        self.bands.run(self._primary_of, bounce, tests=tests)

    def _primary_of(self, band: Band, bounce: int, tests: wp.array | None = None) -> None:
        frame = self.frame
        wp.launch(
            specialised(primary_kernel, self.effects.switches(bounce=bounce)),
            dim=band.thread_count(self.blocks),
            inputs=[
                self.blocks, self.tree.id, self.tree.records, band.camera, frame.mesh, frame.alpha,
                band.fields_of(frame.rays(bounce)),
            ],
            outputs=[
                band.fields_of(frame.hits(bounce)), band.of(self._hits(bounce)),
                self.uncounted if tests is None else band.of(tests),
            ],
            block_dim=QUERY_BLOCK,
            device=frame.device,
        )  # fmt: skip

    def _shadow(self, light: int, tests: wp.array | None = None, bounce: int = 0) -> None:
        self.bands.run(self._shadow_of, light, bounce, tests=tests)

    def _shadow_of(self, band: Band, light: int, bounce: int, tests: wp.array | None = None) -> None:
        frame = self.frame
        wp.launch(
            specialised(shadow_kernel, self.effects.switches(light, bounce)),
            dim=band.thread_count(self.blocks),
            inputs=[
                self.blocks, light, self.tree.id, self.tree.records, band.camera, frame.alpha, frame.lights,
                band.fields_of(frame.hits(bounce)), band.of(self._hits(bounce)), band.of(frame.masks(bounce)),
                band.fields_of(frame.rays(bounce)),
            ],
            outputs=[band.of(frame.bits(bounce)), self.uncounted if tests is None else band.of(tests)],
            block_dim=QUERY_BLOCK,
            device=frame.device,
        )  # fmt: skip
