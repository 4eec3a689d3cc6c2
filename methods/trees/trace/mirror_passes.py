"""Arrays and launches of mirrored rays that are walked as primary rays are (:mod:`.mirrored`)."""

from __future__ import annotations

import functools
from typing import Any

import warp as wp

from ....harness.frame.effects.specialise import specialised
from ....harness.frame.frame import Frame
from ....harness.frame.schedule.passes import Pass
from ....harness.frame.schedule.threads import at_once
from ....harness.scene.effects import Effects
from ..nodes import Tree
from ..parameters import Build, Trace
from ..records import rays as ray_records
from . import mirrored
from .primary import BLOCK

RECORDS = "ray triangles"
"""The resource that :meth:`MirroredRays.records_passes` writes."""


class MirroredRays:
    """Mirrored rays of a frame, in shares that threads of a CPU take at the same time.

    found    vec2i [threads] for each share: of each ray the closest certain hit (-1: none) and the last doubt
    listed   int32 [threads] for each bounce and share: the pixels that have a ray
    lengths  int32 [bounces, shares]: how many
    records  vec4f [3 * triangles]: :mod:`..records.rays`

    ``threads``: the pixels of a share, in blocks; ``counts`` int32 [bounces, shares or more]: the pairs that each left to
    float64; ``doubts`` and ``starts`` are those of :class:`.shadow_passes.ShadowRays`.
    """

    def __init__(
        self,
        frame: Frame,
        build: Build,
        trace: Trace,
        effects: Effects,
        tree: Tree,
        parts: list[Any],
        threads: int,
        counts: wp.array,
        doubts: list[wp.array],
        starts: list[wp.array],
    ):
        self.frame, self.tree, self.parts, self.threads = frame, tree, parts, threads
        bounces, self.switches = effects.bounces, effects.switches(bounce=1)
        self.exact = trace.precision == "exact"
        self.node_bytes, self.registers = build.node_bytes, trace.registers
        self.counts, self.doubts, self.starts = counts, doubts, starts
        with wp.ScopedDevice(frame.device):
            self.records = wp.zeros(3 * frame.triangle_count, dtype=wp.vec4f)
            self.lengths = wp.zeros((bounces, len(parts)), dtype=wp.int32)
            self.listed = [[wp.zeros(threads, dtype=wp.int32) for _ in parts] for _ in range(bounces)]
            self.found = [wp.zeros(threads if self.exact else 0, dtype=wp.vec4i) for _ in parts]
        shares = range(len(parts))
        self._shares = [
            at_once([functools.partial(self._share, bounce, share) for share in shares])
            for bounce in range(1, bounces + 1)
        ]

    def records_passes(self) -> list[Pass]:
        """Records of the triangles, which need no tree."""
        reads = ("points", "triangles")
        return [Pass("mirrors: triangles", "trace", reads, (RECORDS,), self._records, effect="mirror")]

    def launch(self, bounce: int) -> None:
        """The rays of a bounce, counted from 1: their hits and the points that shadow rays start at."""
        self.lengths[bounce - 1].zero_()
        self.counts[bounce - 1].zero_()
        self._shares[bounce - 1]()

    def list_of(self, bounce: int, share: int) -> list[wp.array]:
        """How many pixels of a share have a ray, and which."""
        return [self.lengths[bounce - 1, share : share + 1], self.listed[bounce - 1][share]]

    def _share(self, bounce: int, share: int) -> None:
        f = self.frame
        length, listed = self.list_of(bounce, share)
        doubts, found, starts = self.doubts[share], self.found[share], self.starts[bounce]
        hits, rays = f.hits(bounce), f.rays(bounce)
        self._run(mirrored.list_kernel, [f.camera, self.parts[share], rays], [hits, length, listed])
        walk = [length, listed, rays, self.tree, self.records, f.max_coordinate]
        pairs = [self.counts[bounce - 1, share : share + 1], doubts]
        if not self.exact:
            kernel = mirrored.make_float32_kernel(self.node_bytes, self.registers)
            self._run(kernel, walk, [*pairs, hits, starts])
            return
        kernel = mirrored.make_exact_kernel(self.node_bytes, self.registers)
        self._run(specialised(kernel, self.switches), walk, [*pairs, found])
        inputs = [length, listed, rays, f.mesh, f.alpha, doubts, found]
        self._run(specialised(mirrored.resolve_kernel, self.switches), inputs, [hits, starts])

    def _run(self, kernel: Any, inputs: list[Any], outputs: list[Any]) -> None:
        device = self.frame.device
        wp.launch(kernel, dim=self.threads, inputs=inputs, outputs=outputs, device=device, block_dim=BLOCK)

    def _records(self) -> None:
        f = self.frame
        kernel = ray_records.ray_kernel if self.exact else ray_records.float32_ray_kernel
        wp.launch(kernel, dim=f.triangle_count, inputs=[f.mesh], outputs=[self.records], device=f.device)
