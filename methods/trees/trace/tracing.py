"""Primary rays and their shadow rays: arrays, launches, and the passes of a frame."""

from __future__ import annotations

import functools
from typing import Any

import warp as wp

from ....harness.frame.effects.specialise import specialised
from ....harness.frame.frame import Frame
from ....harness.frame.schedule.passes import Pass
from ....harness.scene.effects import Effects
from ...common.ray_passes import shadow_ray_passes
from ..nodes import Tree
from ..parameters import Build, Trace
from ..records import planes as records
from . import primary
from .careful_passes import walked
from .primary import BLOCK
from .shadow_passes import ShadowRays


class Rays(ShadowRays):
    """Everything that is traced in a frame.

    counts  of :class:`.shadow_passes.ShadowRays`; in slot 0 those of the primary rays
    eye_records vec4f [3 * triangles]: :mod:`..records.planes`
    """

    def __init__(
        self,
        frame: Frame,
        build: Build,
        trace: Trace,
        effects: Effects,
        tree: Tree,
        extent: wp.array,
        doubt_capacity: int,
    ):
        super().__init__(frame, build, trace, effects, tree, extent, doubt_capacity)
        with wp.ScopedDevice(frame.device):
            self.eye_records = wp.zeros(0 if walked(effects) else 3 * frame.triangle_count, dtype=wp.vec4f)

    def records_passes(self) -> list[Pass]:
        """Records of the triangles for the eye and for lights (not the late ones); counters. They need no tree."""
        if walked(self.effects):
            return []
        reads = ("points", "triangles", "camera")
        eye = Pass("eye: triangles", "trace", reads, ("eye triangles",), self._eye_records)
        clear = Pass("clear counts", "trace", (), ("primary counts",), self.counts[0].zero_)
        return [eye, *self.mirror_passes(), *self.light_passes(late=False), clear, *self.clear_passes()]

    def passes(self) -> list[Pass]:
        """Primary rays and shadow rays, in shares that run concurrently; then mirrored rays."""
        scene = ("bvh", "points", "triangles", *self.effects.surface_reads())
        if walked(self.effects):
            passes = self._careful_passes(scene)
        else:
            passes = self.in_shares(lambda share: self._share(share, scene))
        return passes + self.bounce_passes()

    def _share(self, share: int, scene: tuple[str, ...]) -> list[Pass]:
        """The steps of one share of the pixels. ``hits`` is all shares', ``hits of`` what a share continues with."""
        of = self.of(share)
        hits = f"hits of share{of}"
        seen = (*scene, "camera")
        run = functools.partial
        primary_reads = (*seen, "eye triangles", "primary counts")
        passes = [
            Pass(
                f"primary rays{of}", "trace", primary_reads, ("hits", hits, "primary counts"), run(self._primary, share)
            )
        ]  # fmt: skip
        return [*passes, *self.share_passes(share, (*seen, hits))]

    def _careful_passes(self, scene: tuple[str, ...]) -> list[Pass]:
        """Primary rays and shadow rays where :func:`.careful_passes.walked` asks for it."""
        seen = (*scene, "camera")
        primary_rays = Pass(
            "primary rays", "trace", seen, ("hits",), lambda: self.careful.launch_closest(0, self.starts[0])
        )
        shadows = shadow_ray_passes(self.effects, (*seen, "hits"), lambda i: self.careful.launch_shadow(i, 0))
        return [primary_rays, *shadows]

    def _eye_records(self) -> None:
        f = self.frame
        if self.exact:
            kernel, inputs = records.eye_kernel, [f.mesh, f.eye]
        else:
            kernel, inputs = records.float32_kernel, [f.mesh, 0, f.eye]
        wp.launch(kernel, dim=f.triangle_count, inputs=inputs, outputs=[self.eye_records], device=f.device)

    def _primary(self, share: int) -> None:
        f, counts = self.frame, self.counts[0, share : share + 1]
        registers = self.trace.registers
        arguments: tuple[Any, ...] = (self.trace.primary == "packet", self.build.node_bytes)
        if self.exact:
            kernel = primary.make_exact_kernel(*arguments, max(registers, primary.FLOAT64_REGISTERS))
            kernel = specialised(kernel, self.effects.switches())
            inputs: list[Any] = [f.mesh, f.alpha, self.extent]
        else:
            kernel = primary.make_float32_kernel(*arguments, registers)
            inputs = []
        wp.launch(
            kernel,
            dim=self.threads,
            inputs=[f.camera, self.parts[share], self.tree, self.eye_records, f.max_coordinate, *inputs],
            outputs=[counts, self.doubts[share], f.hits(0), self.starts[0]],
            device=f.device,
            block_dim=BLOCK,
        )
