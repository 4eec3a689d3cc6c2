"""The camera's passes: arrays and launches of the stream of triangles over its pixels."""

from __future__ import annotations

from typing import Any

import warp as wp

from ....harness.frame.frame import Frame
from ....harness.frame.passes import Pass
from ....harness.frame.specialise import specialised
from ....harness.scene.effects import Effects
from ...common.bands import Band, Bands
from ..parameters import Streams
from ..queues import BLOCK_DIM, COUNTERS, Queues, Step, copy_counts_kernel, in_shares
from . import queue as camera_queue
from . import resolve as camera_resolve
from . import stream as camera_stream


class CameraStream:
    """Primary rays. hit vec3d [pixels]: float64 hit points; vec3f, if they are to be ``rounded``. ``threads``: of a CPU,
    that each resolve a band of the image.

    ``needs`` (int64): where the stream's counters are copied to for another method. structure: resources of a structure
    that the steps read.
    """

    structure: tuple[str, ...] = ()

    def __init__(
        self,
        frame: Frame,
        build: Streams,
        queues: Queues,
        effects: Effects,
        needs: wp.array | None = None,
        rounded: bool = False,
        threads: int = 1,
    ):
        self.frame, self.queues = frame, queues
        self.build: Any = build
        self.effects, self.needs = effects, needs
        self.queue = queues.of_stream(0)
        self.resolve = camera_resolve.rounded_kernel if rounded else camera_resolve.resolve_kernel
        with wp.ScopedDevice(frame.device):
            self.hit = wp.zeros(frame.pixels, dtype=wp.vec3f if rounded else wp.vec3d)
        self.bands = Bands(frame, threads)

    def passes(self) -> list[Pass]:
        """Clear, stream the shares of the triangles at the same time, and resolve."""
        scene = (*self.structure, "points", "triangles", "camera", *self.effects.surface_reads())
        words = ("nearest words",)
        passes = [Pass("camera: clear", "trace", scene, words, self.queues.cleared.zero_)]
        steps = [*self.steps(), ("doubtful pairs", (), (), self.launch_doubts)]
        passes += in_shares("camera", "trace", steps, self.queues, (*scene, *words), words)
        passes.append(Pass("camera: resolve", "trace", (*scene, *words), ("hits",), self.launch_resolve))
        return passes

    def steps(self) -> list[Step]:
        """The passes of each share of the triangles before the doubtful pairs are decided."""
        steps: list[Step] = [("stream triangles", (), ("items",), self.launch_stream)]
        if self.queues.queued:
            steps += [
                ("queued rows", ("items",), ("parts",), self.launch_items),
                ("further parts", ("parts",), (), self.launch_parts),
            ]
        return steps

    def launch_stream(self, share: int) -> None:
        f, q = self.frame, self.queues
        wp.launch(
            specialised(camera_stream.make_stream_kernel(q.queued), self.effects.switches()),
            dim=q.share_threads,
            inputs=[q.share(share), self.build.inline_pixels, f.camera, f.mesh, f.alpha],
            outputs=[q.nearest, self.queue[share]],
            device=f.device,
            block_dim=BLOCK_DIM,
        )

    def _launch_rows(self, share: int, again: bool) -> None:
        f, q = self.frame, self.queues
        wp.launch(
            specialised(camera_queue.make_item_kernel(q.cuda, again), self.effects.switches()),
            dim=q.threads,
            inputs=[q.threads, self.build.part, f.camera, f.alpha],
            outputs=[q.nearest, self.queue[share]],
            device=f.device,
            block_dim=BLOCK_DIM,
        )

    def launch_items(self, share: int) -> None:
        self._launch_rows(share, again=False)

    def launch_parts(self, share: int) -> None:
        self._launch_rows(share, again=True)

    def launch_doubts(self, share: int) -> None:
        f, q = self.frame, self.queues
        wp.launch(
            specialised(camera_stream.doubt_kernel, self.effects.switches()),
            dim=q.few_threads,
            inputs=[q.few_threads, f.camera, f.mesh, f.alpha],
            outputs=[q.nearest, self.queue[share]],
            device=f.device,
            block_dim=BLOCK_DIM,
        )
        if self.needs is not None:
            counts = self.queue[share].counts
            wp.launch(
                copy_counts_kernel, dim=COUNTERS, inputs=[counts], outputs=[self.needs], device=f.device
            )

    def launch_resolve(self) -> None:
        self.bands.run(self._resolve_band)

    def _resolve_band(self, band: Band) -> None:
        f = self.frame
        wp.launch(
            self.resolve,
            dim=band.thread_count(True),
            inputs=[band.camera, f.mesh, band.of(self.queues.nearest)],
            outputs=[band.fields_of(f.hits(0)), band.of(self.hit)],
            device=f.device,
            block_dim=BLOCK_DIM,
        )
