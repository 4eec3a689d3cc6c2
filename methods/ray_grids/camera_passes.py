"""The camera's passes: arrays and launches of the stream of triangles over its pixels."""

from __future__ import annotations

import warp as wp

from ...harness.frame import Frame
from ...harness.passes import Pass
from ...harness.scene import Effects
from ...harness.specialise import specialised
from ..common.pixels import thread_count
from . import camera_queue, camera_resolve, camera_stream
from .parameters import Build
from .queues import BLOCK_DIM, COUNTERS, Queues, keep_kernel


class CameraStream:
    """Primary rays. hit vec3d [pixels]: float64 hit points.

    ``needs`` (int64): where another method wants the stream's counters copied to.
    """

    def __init__(
        self, frame: Frame, build: Build, queues: Queues, effects: Effects, needs: wp.array | None = None
    ):
        self.frame, self.build, self.queues = frame, build, queues
        self.effects, self.needs = effects, needs
        with wp.ScopedDevice(frame.device):
            self.hit = wp.zeros(frame.pixels, dtype=wp.vec3d)

    def passes(self) -> list[Pass]:
        scene = ("points", "triangles", "camera", *self.effects.surface_reads())
        words, items, parts = ("nearest words",), ("camera items",), ("camera parts",)
        writes: tuple[str, ...] = words
        passes = []
        if self.queues.queued:
            passes = [
                Pass("camera: queued rows", "trace", (*scene, *words, *items), (*words, *parts), self.launch_items),
                Pass("camera: further parts", "trace", (*scene, *words, *parts), words, self.launch_parts),
            ]  # fmt: skip
            writes += items
        return [
            Pass("camera: stream triangles", "trace", scene, writes, self.launch_stream),
            *passes,
            Pass("camera: doubtful pairs", "trace", (*scene, *words), words, self.launch_doubts),
            Pass("camera: resolve", "trace", (*scene, *words), ("hits",), self.launch_resolve),
        ]

    def launch_stream(self) -> None:
        f, q = self.frame, self.queues
        q.cleared.zero_()
        wp.launch(
            specialised(camera_stream.make_stream_kernel(q.queued), self.effects.switches()),
            dim=max(1, f.triangle_count),
            inputs=[
                f.triangle_count, f.width, f.height, self.build.inline_pixels, f.eye, f.axes, f.tangents, f.column,
                f.row, f.points, f.triangles, f.valid, f.alpha,
            ],
            outputs=[q.nearest, q.counts[0], q.records, q.depths, q.items, q.doubts],
            device=f.device,
            block_dim=BLOCK_DIM,
        )  # fmt: skip

    def _launch_rows(self, again: bool) -> None:
        f, q = self.frame, self.queues
        wp.launch(
            specialised(camera_queue.make_item_kernel(q.cuda, again), self.effects.switches()),
            dim=q.threads,
            inputs=[
                q.threads, self.build.part, f.width, f.height, f.tangents, f.column, f.row, q.records, q.depths,
                q.items, f.alpha,
            ],
            outputs=[q.nearest, q.counts[0], q.parts, q.doubts],
            device=f.device,
            block_dim=BLOCK_DIM,
        )  # fmt: skip

    def launch_items(self) -> None:
        self._launch_rows(again=False)

    def launch_parts(self) -> None:
        self._launch_rows(again=True)

    def launch_doubts(self) -> None:
        f, q = self.frame, self.queues
        wp.launch(
            specialised(camera_stream.doubt_kernel, self.effects.switches()),
            dim=q.threads,
            inputs=[
                q.threads, f.width, f.eye, f.column, f.row, f.points, f.triangles, f.weld, q.counts[0], q.doubts,
                f.alpha,
            ],
            outputs=[q.nearest],
            device=f.device,
            block_dim=BLOCK_DIM,
        )  # fmt: skip
        if self.needs is not None:
            wp.launch(keep_kernel, dim=COUNTERS, inputs=[q.counts[0]], outputs=[self.needs], device=f.device)

    def launch_resolve(self) -> None:
        f, a = self.frame, self.frame.answers
        wp.launch(
            camera_resolve.resolve_kernel,
            dim=thread_count(f.width, f.height, True),
            inputs=[
                f.width, f.height, f.eye, f.column, f.row, f.points, f.triangles, f.weld, self.queues.nearest,
            ],
            outputs=[a.triangle, a.t, a.u, a.v, self.hit],
            device=f.device,
            block_dim=BLOCK_DIM,
        )  # fmt: skip
