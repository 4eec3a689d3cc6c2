"""The eye's rays and their shadow rays: arrays, launches, and the passes of a frame."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import warp as wp

from ...harness.frame.frame import Frame
from ...harness.frame.geometry import filled
from ...harness.frame.mirrors import traced_bounces
from ...harness.frame.passes import Pass
from ...harness.frame.specialise import specialised
from ...harness.scene.effects import Effects
from ..common.pixels import thread_count
from ..common.ray_passes import shadow_ray_passes
from . import primary, records, shadow
from .careful_passes import Careful
from .parameters import Build, Trace
from .primary import BLOCK, Part, Tree
from .records import Leaves
from .shadow import Starts

DOUBT_THREADS = 256
"""Threads a multiprocessor that go through the doubts, a few thousand mostly."""


class Rays:
    """Everything that is traced in a frame.

    counts  int32 [slots, shares]: pairs left to float64, of the eye's rays (slot 0), then of the shadow rays
    doubts  vec2i [capacity] for each share: those pairs, of one slot after another (:mod:`.doubt_text`)
    seat    int32 [bounces + 1, pixels], start vec3f [bounces + 1, pixels]: see :class:`.shadow.Starts`
    chain   int32 [pixels]: the last doubt of each eye's ray (:mod:`.doubt_text`)
    eye_records vec4f [3 * triangles]; of each light light_records likewise, sides vec4f [triangles]: :mod:`.records`
    """

    def __init__(
        self,
        frame: Frame,
        build: Build,
        trace: Trace,
        effects: Effects,
        tree: Tree,
        leaves: Leaves,
        extent: wp.array,
        doubt_capacity: int,
    ):
        self.frame, self.build, self.trace, self.effects = frame, build, trace, effects
        self.tree, self.leaves, self.extent = tree, leaves, extent
        self.exact = trace.precision == "exact"
        self.lights = [i for i, wanted in enumerate(effects.shadows) if wanted]
        device = wp.get_device(frame.device)
        self.shares = trace.shares if device.is_cuda else 1
        blocks = -(-thread_count(frame.width, frame.height, True) // BLOCK)
        self.threads = BLOCK * -(-blocks // self.shares)
        self.doubters = DOUBT_THREADS * (device.sm_count if device.is_cuda else 1)
        planes, slots = effects.bounces + 1, 1 + frame.light_count * (effects.bounces + 1)
        with wp.ScopedDevice(frame.device):
            self.counts = wp.zeros((slots, self.shares), dtype=wp.int32)
            self.doubts = [wp.zeros(doubt_capacity, dtype=wp.vec2i) for _ in range(self.shares)]
            self.seat = wp.zeros((planes, frame.pixels), dtype=wp.int32)
            self.start = wp.zeros((planes, frame.pixels), dtype=wp.vec3f)
            self.chain = wp.zeros(frame.pixels if self.exact else 0, dtype=wp.int32)
            self.eye_records = wp.zeros(3 * frame.triangle_count, dtype=wp.vec4f)
            self.light_records = {i: wp.zeros_like(self.eye_records) for i in self.lights}
            sided = frame.triangle_count if self.exact else 0
            self.sides = {i: wp.zeros(sided, dtype=wp.vec4f) for i in self.lights}
        self.parts = [filled(Part, share=share, shares=self.shares) for share in range(self.shares)]
        self.careful = Careful(frame, build, effects, tree, leaves)

    def records_passes(self) -> list[Pass]:
        """Triangles set up for the eye, and for lights that every hit receives: they need only the order of triangles."""
        if self.effects.alpha:
            return []
        reads = ("points", "triangles", "order", "camera")
        eye = Pass("eye: triangles", "trace", reads, ("eye triangles",), self._eye_records)
        return [eye, *(self._light_pass(i) for i in self.lights if not self.effects.has_receivers(i))]

    def _light_pass(self, light: int) -> Pass:
        reads = ("points", "triangles", "order", f"light/{light}")
        made, launch = (f"light triangles/{light}",), functools.partial(self._light_records, light)
        return Pass(f"light {light}: triangles", "light build", reads, made, launch, f"shadows/{light}")

    def passes(self) -> list[Pass]:
        """Primary rays and shadow rays, the shares beside each other; then mirrored ones."""
        scene = ("bvh", "order", "points", "triangles", *self.effects.surface_reads())
        if self.effects.alpha:
            passes = self._careful_passes(scene)
        else:
            reads = (*scene, "camera", "eye triangles")
            passes = [Pass("clear counts", "trace", reads, ("primary counts",), self.counts[0].zero_)]
            passes += [
                replace(step, branch=(share,), adds=True)
                for steps in zip(*(self._share(share, scene) for share in range(self.shares)), strict=True)
                for share, step in enumerate(steps)
            ]
            for i in filter(self.effects.has_receivers, self.lights):
                # After the hits: where none of them receives the light, it is left out.
                place = next(k for k, step in enumerate(passes) if f"visibility/{i}" in step.writes)
                passes.insert(place, self._light_pass(i))
        planes = () if self.effects.alpha else tuple(f"light triangles/{i}" for i in self.lights)
        return passes + traced_bounces(
            self.effects,
            ("bvh", "order", "points", "triangles", "reach", *planes),
            lambda b: self.careful.launch_closest(b, self._starts(b)),
            self._bounce_shadow,
        )

    def _share(self, share: int, scene: tuple[str, ...]) -> list[Pass]:
        """The steps of one share of the pixels. ``hits`` is all shares', ``hits of`` what a share goes on with."""
        of = f", share {share + 1} of {self.shares}" if self.shares > 1 else ""
        seats, hits = f"seats{of}", f"hits of share{of}"
        seen = (*scene, "camera")
        run = functools.partial
        primary_reads = (*seen, "eye triangles", "primary counts")
        if self.exact:
            passes = [
                Pass(f"primary rays{of}", "trace", primary_reads, (seats,), run(self._primary, share)),
                Pass(
                    f"hit points{of}",
                    "trace",
                    (*seen, seats),
                    ("hits", hits),
                    run(self._resolve, share),
                ),
            ]
        else:
            passes = [
                Pass(f"primary rays{of}", "trace", primary_reads, ("hits", hits), run(self._primary, share))
            ]
        for i in self.lights:
            reads = (
                *seen,
                hits,
                f"light/{i}",
                f"light triangles/{i}",
                "reach",
                *self.effects.receiver_reads(i),
            )
            bits, doubts, effect = f"visibility/{i}", f"shadow doubts/{i}{of}", f"shadows/{i}"
            passes.append(
                Pass(
                    f"light {i}: shadow rays{of}",
                    "shadow",
                    reads,
                    (bits, doubts),
                    run(self._shadow, i, 0, share),
                    effect,
                )
            )
            if self.exact:
                passes.append(
                    Pass(
                        f"light {i}: doubts{of}",
                        "shadow",
                        (*reads, doubts),
                        (bits,),
                        run(self._shadow_doubts, i, 0, share),
                        effect,
                    )
                )
        return passes

    def _careful_passes(self, scene: tuple[str, ...]) -> list[Pass]:
        """Primary rays and shadow rays where triangles have holes."""
        seen = (*scene, "camera")
        primary_rays = Pass(
            "primary rays", "trace", seen, ("hits",), lambda: self.careful.launch_closest(0, self._starts(0))
        )
        shadows = shadow_ray_passes(self.effects, (*seen, "hits"), lambda i: self.careful.launch_shadow(i, 0))
        return [primary_rays, *shadows]

    def _starts(self, bounce: int) -> Starts:
        return filled(Starts, seat=self.seat[bounce], point=self.start[bounce])

    def _eye_records(self) -> None:
        f = self.frame
        if self.exact:
            kernel, inputs = records.eye_kernel, [f.mesh, self.leaves, f.eye]
        else:
            kernel, inputs = records.float32_kernel, [f.mesh, self.leaves, 0, f.eye]
        wp.launch(kernel, dim=f.triangle_count, inputs=inputs, outputs=[self.eye_records], device=f.device)

    def _light_records(self, light: int) -> None:
        f = self.frame
        if self.exact:
            kernel, inputs = records.light_kernel, [f.mesh, self.leaves, light, f.lights, self.extent]
            outputs = [self.light_records[light], self.sides[light]]
        else:
            kernel, inputs = records.float32_kernel, [f.mesh, self.leaves, light, f.lights]
            outputs = [self.light_records[light]]
        wp.launch(kernel, dim=f.triangle_count, inputs=inputs, outputs=outputs, device=f.device)

    def _primary(self, share: int) -> None:
        f, counts = self.frame, self.counts[0, share : share + 1]
        arguments: tuple[Any, ...] = (
            self.trace.primary == "packet", self.build.node_bytes, self.trace.registers
        )  # fmt: skip
        if self.exact:
            kernel = primary.make_exact_kernel(*arguments)
            inputs, outputs = [], [self.seat[0], self.chain]
        else:
            kernel = primary.make_float32_kernel(*arguments)
            inputs, outputs = [self.leaves.order], [f.hits(0), self.seat[0], self.start[0]]
        wp.launch(
            kernel,
            dim=self.threads,
            inputs=[f.camera, self.parts[share], self.tree, self.eye_records, *inputs],
            outputs=[counts, self.doubts[share], *outputs],
            device=f.device,
            block_dim=BLOCK,
        )

    def _resolve(self, share: int) -> None:
        f = self.frame
        wp.launch(
            primary.resolve_kernel,
            dim=self.threads,
            inputs=[f.camera, self.parts[share], f.mesh, self.leaves, self.doubts[share], self.chain],
            outputs=[self.seat[0], f.hits(0), self.start[0]],
            device=f.device,
            block_dim=BLOCK,
        )

    def _shadow_counts(self, light: int, bounce: int, share: int) -> wp.array:
        slot = 1 + bounce * self.frame.light_count + light
        return self.counts[slot, share : share + 1]

    def _shadow(self, light: int, bounce: int, share: int) -> None:
        f, counts = self.frame, self._shadow_counts(light, bounce, share)
        counts.zero_()
        kernel = shadow.make_shadow_kernel(self.trace.precision, self.build.node_bytes, self.trace.registers)
        wp.launch(
            specialised(kernel, self.effects.switches(light, bounce)),
            dim=self.threads,
            inputs=[
                f.camera, self.parts[share], light, f.lights, self.tree, self.light_records[light], self.sides[light],
                f.reach, self.extent, f.hits(bounce), self._starts(bounce), f.masks(bounce),
            ],
            outputs=[counts, self.doubts[share], f.bits(bounce)],
            device=f.device,
            block_dim=BLOCK,
        )  # fmt: skip

    def _shadow_doubts(self, light: int, bounce: int, share: int) -> None:
        f = self.frame
        wp.launch(
            specialised(shadow.shadow_doubt_kernel, self.effects.switches(light, bounce)),
            dim=self.doubters,
            inputs=[
                self.doubters, f.camera, light, f.lights, f.mesh, self.leaves, f.hits(bounce), f.rays(bounce),
                self._shadow_counts(light, bounce, share), self.doubts[share],
            ],
            outputs=[f.bits(bounce)],
            device=f.device,
            block_dim=BLOCK,
        )  # fmt: skip

    def _bounce_shadow(self, light: int, bounce: int) -> None:
        if self.effects.alpha:
            self.careful.launch_shadow(light, bounce)
            return
        for share in range(self.shares):
            self._shadow(light, bounce, share)
            if self.exact:
                self._shadow_doubts(light, bounce, share)
