"""The camera's passes: arrays and launches of the stream of triangles over its pixels."""

from __future__ import annotations

from typing import Any

import warp as wp

from ....harness.frame.effects.specialise import specialised
from ....harness.frame.frame import Frame
from ....harness.frame.schedule.passes import Pass
from ....harness.scene.effects import Effects
from ...common.bands import Band, Bands
from ..queues import BLOCK_DIM, COUNTERS, WORDS, Queues, Step, copy_counts_kernel, in_shares
from ..settings import Streams
from . import remainder as camera_parts
from . import resolve as camera_resolve
from . import rows as camera_rows
from . import stream as camera_stream


class CameraStream:
    """Primary rays. ``threads``: of a CPU, that each resolve a band of the image.

    hit: hit points [pixels], vec3d if the ``points`` that are kept are "exact", vec3f if they are "rounded"; else empty.

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
        points: str = "exact",
        threads: int = 1,
    ):
        self.frame, self.queues = frame, queues
        self.build: Any = build
        self.effects, self.needs = effects, needs
        self.queue = queues.of_stream(0)
        kept = points != "none"
        with wp.ScopedDevice(frame.device):
            self.hit = wp.zeros(
                frame.pixels if kept else 0, dtype=wp.vec3f if points == "rounded" else wp.vec3d
            )
            self._points = self.hit if kept else wp.zeros(0, dtype=camera_resolve.NO_POINT)
        self.bands = Bands(frame, threads)

    def passes(self) -> list[Pass]:
        """Clear, stream the shares of the triangles at the same time, and resolve."""
        scene = (*self.structure, "points", "triangles", "camera", *self.effects.surface_reads())
        words = (WORDS,)
        passes = [Pass("camera: clear", "trace", scene, words, self.queues.cleared.zero_)]
        passes += in_shares("camera", "trace", self.steps(), self.queues, (*scene, *words), words)
        passes.append(Pass("camera: resolve", "trace", (*scene, *words), ("hits",), self.launch_resolve))
        return passes

    def passes_beside(self, others: list[Pass]) -> list[Pass]:
        """The passes, and ``others``, of which few or none read the answers: on a GPU these are resolved where they leave it
        idle."""
        *first, resolve = self.passes()
        resolve = resolve.hinted(overlap=True, yields=True)
        others = [work if work.hints.early else work.hinted(phase=1) for work in others]
        return [*first, resolve, *others] if self.hit.size else [*first, *others, resolve]

    def steps(self) -> list[Step]:
        """The passes of each share of the triangles."""
        steps: list[Step] = [("stream triangles", (), ("items",), self.launch_stream)]
        if self.queues.queued:
            steps.append(("queued rows", ("items",), ("parts",), self.launch_items))
            if self.queues.cuda:
                return [*steps, ("further parts, doubtful pairs", ("parts",), (), self.launch_last)]
            steps.append(("further parts", ("parts",), (), self.launch_chunks))
        return [*steps, self.undecided()]

    def undecided(self) -> Step:
        """The last step, where undecided pairs have a pass of their own."""
        return ("doubtful pairs", (), (), self.launch_undecided)

    def launch_stream(self, share: int) -> None:
        f, q = self.frame, self.queues
        wp.launch(
            specialised(camera_stream.make_stream_kernel(q.queued), self.effects.switches()),
            dim=q.share_threads,
            inputs=[q.share(share), self.build.inline_pixels, f.camera, f.mesh, f.alpha],
            outputs=[q.nearest, q.exact_path, self.queue[share]],
            device=f.device,
            block_dim=BLOCK_DIM,
        )

    def _launch_rows(self, share: int, again: bool) -> None:
        f, q = self.frame, self.queues
        wp.launch(
            specialised(camera_rows.make_item_kernel(q.cuda, again), self.effects.switches()),
            dim=q.threads,
            inputs=[q.threads, self.build.part, f.camera, f.alpha],
            outputs=[q.nearest, self.queue[share]],
            device=f.device,
            block_dim=BLOCK_DIM,
        )

    def launch_items(self, share: int) -> None:
        self._launch_rows(share, again=False)

    def launch_chunks(self, share: int) -> None:
        self._launch_rows(share, again=True)

    def launch_last(self, share: int) -> None:
        """Further chunks and undecided pairs."""
        f, q = self.frame, self.queues
        threads = camera_parts.BLOCKS * int(BLOCK_DIM) * wp.get_device(f.device).sm_count
        wp.launch(
            specialised(camera_parts.last_kernel, self.effects.switches()),
            dim=threads,
            inputs=[threads, self.build.part, f.camera, f.mesh, f.alpha],
            outputs=[q.nearest, self.queue[share]],
            device=f.device,
            block_dim=BLOCK_DIM,
        )
        self._copy_needs(share)

    def launch_undecided(self, share: int) -> None:
        f, q = self.frame, self.queues
        wp.launch(
            specialised(camera_stream.undecided_kernel, self.effects.switches()),
            dim=q.few_threads,
            inputs=[q.few_threads, f.camera, f.mesh, f.alpha],
            outputs=[q.nearest, self.queue[share]],
            device=f.device,
            block_dim=BLOCK_DIM,
        )
        self._copy_needs(share)

    def _copy_needs(self, share: int) -> None:
        if self.needs is not None:
            f = self.frame
            counts = self.queue[share].counts
            wp.launch(
                copy_counts_kernel, dim=COUNTERS, inputs=[counts], outputs=[self.needs], device=f.device
            )

    def launch_resolve(self) -> None:
        self.bands.run(self._resolve_band)

    def _resolve_band(self, band: Band) -> None:
        f = self.frame
        wp.launch(
            specialised(camera_resolve.resolve_kernel, self.effects.switches()),
            dim=band.thread_count(True),
            inputs=[band.camera, f.mesh, band.of(self.queues.nearest)],
            outputs=[band.fields_of(f.hits(0)), band.of(self._points)],
            device=f.device,
            block_dim=BLOCK_DIM,
        )
