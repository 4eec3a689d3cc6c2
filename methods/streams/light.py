"""The passes of one light: its rays are placed, and triangles are tested against them."""

from __future__ import annotations

from functools import partial
from typing import Any

import warp as wp

from ...harness.frame.effects.specialise import with_type
from ...harness.frame.geometry import filled
from ...harness.frame.schedule.passes import Pass
from .occlusion import on_cpu, rows, stream
from .occlusion.last_occluder import LastOccluder
from .occlusion.planes import RememberedBits, ShadowBits
from .occlusion.undecided import make_undecided_kernel
from .queues import BLOCK_DIM, Step, in_shares
from .rays.placing import ByRays, LightRays


class Occlusion:
    """Tests triangles against the rays of a light.

    last      int32 [pixels]: where the triangle that shadows a ray is noted (:class:`.occlusion.planes.RememberedBits`), or
              None
    overlaps  whether triangles are streamed while the rays are sorted into cells, and not after that
    """

    def __init__(self, rays: LightRays, last: wp.array | None = None, overlaps: bool = False):
        self.rays, self.overlaps = rays, overlaps
        self.kind: Any = ShadowBits if last is None else RememberedBits
        given = {} if last is None else {"last": last}
        shadowed = rays.frame.answers.shadowed
        self.bits = filled(self.kind, light=rays.index, triangle=rays.cells.triangle, shadowed=shadowed, **given)

    def launch(self, kernel: wp.Kernel, share: int, threads: int, inputs: list[Any]) -> None:
        """Launch a kernel of a step: after its inputs come the bits, if it sets them, and the queue of the share."""
        outputs = [self.rays.queue[share]]
        if "bits" in kernel.func.__annotations__:
            outputs = [self.bits, *outputs]
            kernel = with_type(kernel, "bits", self.kind) if self.kind is RememberedBits else kernel
        self.rays.launch(kernel, threads, inputs, outputs, BLOCK_DIM)

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
            ("queued rows", ("items",), ("chunks",), partial(self.launch_rows, False)),
            ("further chunks", ("chunks",), (), partial(self.launch_rows, True)),
        ]

    def launch_stream(self, share: int) -> None:
        r, f, q, settings = self.rays, self.rays.frame, self.rays.queues, self.rays.settings
        threads, kernel = q.share_threads // int(BLOCK_DIM), on_cpu.stream_kernel
        if q.queued:
            threads = q.share_threads
            kernel = stream.make_stream_kernel(settings.groups == "stream", not self.overlaps)
        inputs = [q.share(share), settings.inline_cells, settings.inline_rays, r.light, r.cells]
        self.launch(kernel, share, threads, [*inputs, f.flagged_mesh(r.effects), f.alpha])

    def launch_split(self, share: int) -> None:
        r = self.rays
        threads = int(rows.SPLITTERS) * r.queues.few_threads
        self.launch(rows.split_kernel, share, threads, [threads, r.light, r.cells.table, r.frame.mesh])

    def launch_rows(self, again: bool, share: int) -> None:
        """Groups of rows, or their further chunks (``again``)."""
        r, threads = self.rays, self.rays.queues.threads
        self.launch(rows.make_rows_kernel(again), share, threads, [threads, r.settings.chunk, r.cells, r.frame.alpha])

    def launch_undecided(self, outside: wp.array, share: int) -> None:
        """Pairs that float32 left; the rays ``outside`` the region (:mod:`.rays.region`) with the first share's."""
        r, f, threads = self.rays, self.rays.frame, self.rays.queues.few_threads
        kernel = make_undecided_kernel(bool(r.exact.size), share == 0 and outside.size > 0)
        inputs = [threads, r.light, f.camera, f.flagged_mesh(r.effects), f.alpha, r.exact, outside]
        self.launch(kernel, share, threads, inputs)


class Light:
    """The passes of a light, from how its rays are placed and how triangles are tested against them. memory: tests first the
    triangle that shadowed each ray in the last frame, or None.
    """

    def __init__(self, placing: ByRays, occlusion: Occlusion, memory: LastOccluder | None = None):
        self.rays, self.placing, self.occlusion, self.memory = placing.rays, placing, occlusion, memory

    def passes(self, branch: int = 0) -> list[Pass]:
        """The light's passes, which may run at the same time as those of lights in another branch."""
        r = self.rays
        cells, bits = r.name("ray cells"), r.name("shadowed")
        seen = ("points", "triangles", f"light/{r.index}", r.name("light aim"), *r.effects.surface_reads())
        placed, sorting, steps = self.placing.passes(), self.placing.sorting(), self.occlusion.steps()

        def shared(some: list[Step], reads: tuple[str, ...], writes: tuple[str, ...]) -> list[Pass]:
            return in_shares(r.who, "shadow", some, r.queues, (*seen, *reads), writes, r.effect)

        if self.occlusion.overlaps:
            sorting = [work.hinted(overlap=True) for work in sorting]
            sorting += shared(steps[:1], (r.name("ray places"),), ())
            steps = steps[1:]
        tested = shared(steps, (cells, bits), (bits,))
        undecided: Step = ("undecided pairs", (), (), partial(self.occlusion.launch_undecided, self.placing.outside))
        tested += shared([undecided], (cells, "camera", *(("hits",) if r.exact.size else ()), bits), (bits,))
        if self.memory is not None:
            tested = [self.memory.noting(work) for work in tested]
            placed = [*placed[:-1], self.memory.settling(), placed[-1]]
        return [work.hinted(parallel=(branch, *work.hints.parallel)) for work in (*placed, *sorting, *tested)]
