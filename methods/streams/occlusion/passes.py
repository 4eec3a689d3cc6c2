"""The passes that test triangles against a light's rays: the stream, larger triangles in groups of rows, undecided pairs."""

from __future__ import annotations

import functools
from typing import Any

import warp as wp

from ....harness.frame.effects.specialise import specialised, with_type
from ....harness.frame.geometry import filled
from ..queues import BLOCK_DIM, Step
from ..rays.light_rays import LightRays
from . import groups, on_cpu, rows, stream
from .ray_test import RememberedBits, ShadowBits
from .undecided import make_undecided_kernel


class Occlusion:
    """Tests triangles against the rays of a light.

    last      int32 [pixels]: where the triangle that shadows a ray is noted (:class:`.ray_test.RememberedBits`), or None
    overlaps  whether triangles are streamed while the rays are sorted into cells, and not after that
    """

    def __init__(self, rays: LightRays, last: wp.array | None = None, overlaps: bool = False):
        self.rays, self.overlaps = rays, overlaps
        self.kind = ShadowBits if last is None else RememberedBits
        given = {} if last is None else {"last": last}
        shadowed = rays.frame.answers.shadowed
        self.bits: Any = filled(self.kind, light=rays.index, triangle=rays.cells.triangle, shadowed=shadowed, **given)

    def of_rays(self, kernel: wp.Kernel) -> wp.Kernel:
        """A kernel for the effects of the light and the class of :attr:`bits`."""
        kernel = kernel if self.kind is ShadowBits else with_type(kernel, "bits", self.kind)
        return specialised(kernel, self.rays.switches)

    def steps(self) -> list[Step]:
        """The passes of each share of the triangles before the undecided pairs are decided."""
        if not self.rays.queues.queued:
            return [("stream triangles", (), (), self.launch_stream)]
        steps: list[Step] = [
            ("stream triangles", (), ("large triangles",), self.launch_stream),
            ("split large", ("large triangles",), ("items",), self.launch_split),
        ]
        if self.rays.settings.groups == "stream":
            steps = [("stream triangles", (), ("items",), self.launch_stream)]
        return [
            *steps,
            ("queued rows", ("items",), ("chunks",), functools.partial(self.launch_rows, False)),
            ("further chunks", ("chunks",), (), functools.partial(self.launch_rows, True)),
        ]

    def launch_stream(self, share: int) -> None:
        r, f, q, settings = self.rays, self.rays.frame, self.rays.queues, self.rays.settings
        threads, kernel = q.share_threads // int(BLOCK_DIM), on_cpu.stream_kernel
        if q.queued:
            threads = q.share_threads
            kernel = stream.make_stream_kernel(settings.groups == "stream", not self.overlaps)
        mesh = f.flagged_mesh(r.effects)
        inputs = [q.share(share), settings.inline_cells, settings.inline_rays, r.light, r.cells, mesh, f.alpha]
        outputs = [self.bits, r.queue[share]]
        f.launch(self.of_rays(r.of_cells(kernel)), threads, inputs, outputs, BLOCK_DIM)

    def launch_split(self, share: int) -> None:
        r, f = self.rays, self.rays.frame
        threads = int(groups.SPLITTERS) * r.queues.few_threads
        inputs = [threads, r.light, r.cells.table, f.mesh]
        outputs = [r.queue[share]]
        f.launch(specialised(groups.split_kernel, r.switches), threads, inputs, outputs, BLOCK_DIM)

    def launch_rows(self, again: bool, share: int) -> None:
        """Groups of rows, or their further chunks (``again``)."""
        r, f, q = self.rays, self.rays.frame, self.rays.queues
        inputs = [q.threads, r.settings.chunk, r.cells, f.alpha]
        outputs = [self.bits, r.queue[share]]
        f.launch(self.of_rays(r.of_cells(rows.make_rows_kernel(again))), q.threads, inputs, outputs, BLOCK_DIM)

    def launch_undecided(self, outside: wp.array, share: int) -> None:
        """Pairs that float32 left; the rays ``outside`` the region (:mod:`..rays.cone`) with the first share's."""
        r, f, q = self.rays, self.rays.frame, self.rays.queues
        kernel = make_undecided_kernel(bool(r.exact.size), share == 0 and outside.size > 0)
        inputs = [q.few_threads, r.light, f.camera, f.flagged_mesh(r.effects), f.alpha, r.exact, outside]
        outputs = [self.bits, r.queue[share]]
        f.launch(self.of_rays(kernel), q.few_threads, inputs, outputs, BLOCK_DIM)
