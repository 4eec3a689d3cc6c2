"""Host side of the streams: arrays and launches of the camera's pass over the pixels and a light's over its rays."""

from __future__ import annotations

import math

import warp as wp

from ...harness.frame import Frame
from ...harness.passes import Pass
from ...harness.scene import Effects
from ...harness.specialise import specialised
from . import camera_queue, camera_stream, light_bins, light_queue, light_stream
from .parameters import Build
from .queue import COUNTERS, needs_kernel

THREADS = 132 * 2048
"""Threads of a kernel that empties a queue: they stride over what is there, so the count stays on the device."""

BLOCK_DIM = 128


class Queues:
    """What the streams of one frame share: queues, plane records, and where needs are kept.

    strips vec4i [strip_capacity], items vec4i [item_capacity], blocks vec4i [block_capacity], doubts vec2i
    [doubt_capacity]; counts int32 [4]; records vec4f [triangles, 5] and depths vec3d [triangles]: planes of queued
    triangles. Without queues (CPU) all but the doubts are one element long.
    """

    def __init__(self, frame: Frame, queued: bool, capacity: tuple[int, int, int, int], needs: wp.array):
        self.queued = queued
        self.needs = needs
        strips, items, blocks, doubts = capacity if queued else (1, 1, 1, capacity[3])
        with wp.ScopedDevice(frame.device):
            self.counts = wp.zeros(COUNTERS, dtype=wp.int32)
            self.strips = wp.zeros(strips, dtype=wp.vec4i)
            self.items = wp.zeros(items, dtype=wp.vec4i)
            self.blocks = wp.zeros(blocks, dtype=wp.vec4i)
            self.doubts = wp.zeros(doubts, dtype=wp.vec2i)
            self.depths = wp.zeros(max(1, frame.triangle_count) if queued else 1, dtype=wp.vec3d)
            self.records = wp.zeros((max(1, frame.triangle_count) if queued else 1, 5), dtype=wp.vec4f)
        self.threads = THREADS if wp.get_device(frame.device).is_cuda else 64
        self.device = frame.device

    def keep_needs(self, first: int) -> None:
        wp.launch(
            needs_kernel, dim=COUNTERS, inputs=[self.counts], outputs=[self.needs, first], device=self.device
        )


class CameraStream:
    """Primary rays. nearest uint64 [pixels]; hit vec3d [pixels]: float64 hit points."""

    def __init__(self, frame: Frame, queues: Queues, effects: Effects):
        self.frame, self.queues, self.effects = frame, queues, effects
        with wp.ScopedDevice(frame.device):
            self.nearest = wp.zeros(frame.pixels, dtype=wp.uint64)
            self.hit = wp.zeros(frame.pixels, dtype=wp.vec3d)

    def passes(self) -> list[Pass]:
        scene = ("points", "triangles", "camera", *self.effects.surface_reads())
        words = ("nearest words",)
        passes = [Pass("camera: stream triangles", "trace", scene, words, self.launch_stream)]
        if self.queues.queued:
            items = ("camera items",)
            passes.append(
                Pass("camera: strips to blocks", "trace", (*scene, *words), items, self.launch_strips)
            )
            passes.append(
                Pass("camera: queued blocks", "trace", (*scene, *words, *items), words, self.launch_items)
            )
        return [*passes, Pass("camera: resolve", "trace", (*scene, *words), ("hits",), self.launch_resolve)]

    def launch_stream(self) -> None:
        f, q = self.frame, self.queues
        self.nearest.zero_()
        q.counts.zero_()
        wp.launch(
            specialised(camera_stream.stream_kernel, self.effects.switches()),
            dim=max(1, f.triangle_count),
            inputs=[
                f.triangle_count, f.width, f.height, 0 if q.queued else 2**30, f.eye, f.axes, f.tangents, f.column,
                f.row, f.points, f.triangles, f.valid, f.weld, f.alpha,
            ],
            outputs=[self.nearest, q.counts, q.records, q.depths, q.strips, q.items],
            device=f.device,
            block_dim=BLOCK_DIM,
        )  # fmt: skip

    def launch_strips(self) -> None:
        f, q = self.frame, self.queues
        wp.launch(
            camera_queue.strip_kernel,
            dim=q.threads,
            inputs=[
                q.threads,
                f.width,
                f.height,
                f.eye,
                f.axes,
                f.tangents,
                f.column,
                f.row,
                f.points,
                f.triangles,
                q.records,
                q.strips,
            ],
            outputs=[q.counts, q.items],
            device=f.device,
            block_dim=BLOCK_DIM,
        )

    def launch_items(self) -> None:
        f, q = self.frame, self.queues
        wp.launch(
            specialised(camera_queue.item_kernel, self.effects.switches()),
            dim=q.threads,
            inputs=[
                q.threads, f.width, f.eye, f.column, f.row, f.points, f.triangles, f.weld, q.records, q.depths,
                q.counts, q.items, f.alpha,
            ],
            outputs=[self.nearest],
            device=f.device,
            block_dim=BLOCK_DIM,
        )  # fmt: skip
        q.keep_needs(0)

    def launch_resolve(self) -> None:
        f, a = self.frame, self.frame.answers
        across, down = -(-f.width // 8), -(-f.height // 4)
        wp.launch(
            camera_stream.resolve_kernel,
            dim=across * down * 32,
            inputs=[
                f.width, f.height, across, f.eye, f.column, f.row, f.points, f.triangles, f.weld, self.nearest,
            ],
            outputs=[a.triangle, a.t, a.u, a.v, self.hit],
            device=f.device,
            block_dim=256,
        )  # fmt: skip


class RayBins:
    """Cells of one light's cube and the rays in them; lights of a frame take turns with the same arrays."""

    def __init__(self, frame: Frame, build: Build):
        side = math.sqrt(frame.pixels)
        if frame.triangle_count <= frame.pixels // 2:
            side /= 2
        self.cells = build.cells or min(4096, max(64, 8 * round(side / 8)))
        number = int(light_bins.FACES) * self.cells**2
        with wp.ScopedDevice(frame.device):
            self.box = wp.zeros(6, dtype=wp.int32)
            self.axes = wp.zeros(1, dtype=wp.mat33d)
            self.cube = wp.zeros(1, dtype=light_bins.Cube)
            self.table = wp.zeros(int(light_bins.FACES), dtype=wp.vec4f)
            self.rectangle = wp.zeros(4 + int(light_bins.FACES), dtype=wp.int32)
            self.place = wp.zeros(frame.pixels, dtype=wp.vec3d)
            self.slot = wp.zeros(frame.pixels, dtype=wp.vec2i)
            self.count = wp.zeros(number, dtype=wp.int32)
            self.offset = wp.zeros(number + 1, dtype=wp.int32)
            self.rays = wp.zeros(frame.pixels, dtype=wp.vec4f)
            self.pixels = wp.zeros(frame.pixels, dtype=wp.int32)


class LightStream:
    """Shadow rays of one light."""

    def __init__(
        self,
        frame: Frame,
        index: int,
        build: Build,
        hit: wp.array,
        queues: Queues,
        bins: RayBins | None,
        effects: Effects,
    ):
        self.effects = effects
        self.frame, self.index, self.build, self.hit, self.queues = frame, index, build, hit, queues
        self.bins = bins or RayBins(frame, build)

    def passes(self) -> list[Pass]:
        i = self.index
        light, effect = f"light/{i}", f"shadows/{i}"
        seen = ("points", "hits", light, *self.effects.mask_reads(i))
        place, rays, bits = f"ray places/{i}", f"ray cells/{i}", f"visibility/{i}"
        scene = ("points", "triangles", "hits", light, rays, *self.effects.surface_reads())
        build = "light build"
        passes = [
            Pass(f"light {i}: map rays", build, seen, (place,), self.launch_map, effect),
            Pass(f"light {i}: count and scan", build, (place,), (f"ray offsets/{i}",), self.launch_count, effect),
            Pass(f"light {i}: scatter rays", build, ("hits", f"ray offsets/{i}"), (rays,), self.launch_scatter, effect),
            Pass(f"light {i}: stream triangles", "shadow", scene, (bits,), self.launch_stream, effect),
        ]  # fmt: skip
        if self.queues.queued:
            blocks, items = (f"light blocks/{i}",), (f"light items/{i}",)
            passes += [
                Pass(
                    f"light {i}: strips to blocks",
                    "shadow",
                    (*scene, bits),
                    blocks,
                    self.launch_strips,
                    effect,
                ),
                Pass(
                    f"light {i}: blocks to rays",
                    "shadow",
                    (*scene, *blocks),
                    items,
                    self.launch_blocks,
                    effect,
                ),
                Pass(
                    f"light {i}: queued rays", "shadow", (*scene, *items), (bits,), self.launch_items, effect
                ),
            ]
        return [
            *passes,
            Pass(f"light {i}: doubtful pairs", "shadow", scene, (bits,), self.launch_doubts, effect),
        ]

    def launch_map(self) -> None:
        f, b = self.frame, self.bins
        device = f.device
        wp.launch(light_bins.clear_kernel, dim=6, outputs=[b.box], device=device)
        if f.vertex_count:
            wp.launch(
                light_bins.scene_box_kernel,
                dim=f.vertex_count,
                inputs=[f.points],
                outputs=[b.box],
                device=device,
            )
        wp.launch(
            light_bins.aim_kernel,
            dim=1,
            inputs=[self.index, f.posts, b.box],
            outputs=[b.axes, b.cube, b.rectangle],
            device=device,
        )
        wp.launch(
            specialised(light_bins.map_kernel, self.effects.switches(self.index)),
            dim=f.pixels,
            inputs=[self.index, f.posts, b.axes, f.answers.triangle, self.hit, f.receivers],
            outputs=[b.place, b.rectangle, f.answers.visibility],
            device=device,
        )

    def launch_count(self) -> None:
        f, b = self.frame, self.bins
        b.count.zero_()
        wp.launch(
            light_bins.table_kernel,
            dim=int(light_bins.FACES),
            inputs=[b.cells, b.rectangle],
            outputs=[b.table],
            device=f.device,
        )
        wp.launch(
            light_bins.count_kernel,
            dim=f.pixels,
            inputs=[b.cells, b.place, b.rectangle],
            outputs=[b.count, b.slot],
            device=f.device,
        )
        wp.utils.array_scan(b.count, b.offset[1:], inclusive=True)

    def launch_scatter(self) -> None:
        f, b = self.frame, self.bins
        wp.launch(
            light_bins.scatter_kernel,
            dim=f.pixels,
            inputs=[f.answers.triangle, self.hit, b.slot, b.offset],
            outputs=[b.rays, b.pixels],
            device=f.device,
        )

    def launch_stream(self) -> None:
        f, b, q = self.frame, self.bins, self.queues
        q.counts.zero_()
        wp.launch(
            specialised(light_stream.make_stream_kernel(q.queued), self.effects.switches(self.index)),
            dim=max(1, f.triangle_count),
            inputs=[
                f.triangle_count, self.index, b.cells, self.build.inline_cells, self.build.inline_rays, f.lights,
                b.cube, b.table, f.points, f.triangles, f.valid, b.offset, b.rays, b.pixels, f.alpha,
            ],
            outputs=[f.answers.visibility, q.counts, q.records, q.strips, q.blocks, q.doubts],
            device=f.device,
            block_dim=BLOCK_DIM,
        )  # fmt: skip

    def _seen(self) -> list[object]:
        f, b = self.frame, self.bins
        return [self.queues.threads, self.index, b.cells, f.lights, b.cube, b.table, f.points, f.triangles]

    def launch_strips(self) -> None:
        f, q = self.frame, self.queues
        wp.launch(
            light_queue.strip_kernel,
            dim=q.threads,
            inputs=[*self._seen(), q.strips],
            outputs=[q.counts, q.blocks],
            device=f.device,
            block_dim=BLOCK_DIM,
        )

    def launch_blocks(self) -> None:
        f, b, q = self.frame, self.bins, self.queues
        wp.launch(
            light_queue.block_kernel,
            dim=q.threads,
            inputs=[*self._seen(), b.offset, q.blocks],
            outputs=[q.counts, q.items],
            device=f.device,
            block_dim=BLOCK_DIM,
        )

    def launch_items(self) -> None:
        f, b, q = self.frame, self.bins, self.queues
        wp.launch(
            specialised(light_queue.item_kernel, self.effects.switches(self.index)),
            dim=q.threads,
            inputs=[q.threads, self.index, q.records, q.counts, q.items, b.rays, b.pixels, f.alpha],
            outputs=[f.answers.visibility, q.doubts],
            device=f.device,
            block_dim=BLOCK_DIM,
        )

    def launch_doubts(self) -> None:
        f, q = self.frame, self.queues
        wp.launch(
            specialised(light_queue.doubt_kernel, self.effects.switches(self.index)),
            dim=q.threads,
            inputs=[
                q.threads, self.index, f.lights, f.eye, f.points, f.triangles, f.weld, self.hit, q.counts,
                q.doubts, f.alpha,
            ],
            outputs=[f.answers.visibility],
            device=f.device,
            block_dim=BLOCK_DIM,
        )  # fmt: skip
        q.keep_needs(COUNTERS * (1 + self.index))
