"""Shadow rays through a tree, of primary and of mirrored rays' hits: arrays, launches, and the passes of a frame."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import warp as wp

from ....harness.frame.effects.mirrors import traced_bounces
from ....harness.frame.effects.receivers import facing_passes, facing_reads
from ....harness.frame.effects.specialise import specialised
from ....harness.frame.frame import Frame
from ....harness.frame.geometry import filled
from ....harness.frame.schedule.passes import Hints, Pass
from ....harness.frame.schedule.threads import Launch, at_once, cpu_threads
from ....harness.scene.effects import Effects
from ...common.pixels import thread_count
from ...gpu.reserve import counted
from ..nodes import Tree
from ..parameters import Build, Trace
from ..records import planes as records
from . import mirrored, shadow
from .careful_passes import Careful, walked
from .mirror_passes import RECORDS, MirroredRays
from .primary import BLOCK, Part


def threads_built(rays: ShadowRays | None) -> dict[str, int]:
    """For :meth:`...harness.frame.method.Method.built`: threads of a CPU."""
    return {"threads": rays.shares} if rays is not None and rays.threaded else {}


def marks_receivers(cuda: bool, effects: Effects) -> bool:
    """Whether the shadow rays of primary hits mark the receivers. On a GPU a pass for them and a condition take longer than
    threads without a ray."""
    return cuda and not walked(effects)


class ShadowRays:
    """Arrays and passes for shadow rays and mirrored rays through a tree.

    counts  int32 [slots, shares]: pairs left to float64; slot 0 is for the primary rays, then one per light and bounce,
            from ``mirror_slot`` on one per bounce for the mirrored rays themselves
    doubts  vec2i [capacity] for each share: those beyond two of a ray, of one slot after another (:mod:`..undecided`)
    starts  for each bounce vec3f [pixels]: the points that shadow rays start at, rounded; nothing at a miss
    joined  uint8 [triangles / 2]; of each light light_records vec4f [3 * triangles], sides vec4f [triangles], facing uint8
            [triangles]: :mod:`..records.planes`
    marks   whether they mark the receivers (:func:`marks_receivers`)

    ``primary_starts``: those of the primary hits, if another method finds them.
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
        primary_starts: wp.array | None = None,
    ):
        if effects.alpha:
            trace = replace(trace, precision="exact")  # float32 cannot decide a hit on a triangle with holes
        self.frame, self.build, self.trace, self.effects = frame, build, trace, effects
        self.tree, self.extent = tree, extent
        self.exact = trace.precision == "exact"
        self.lights = [i for i, wanted in enumerate(effects.shadows) if wanted]
        device = wp.get_device(frame.device)
        self.shares = trace.shares if device.is_cuda else cpu_threads(trace.threads, frame.device)
        self.threaded = not device.is_cuda
        self.marks = marks_receivers(device.is_cuda, effects)
        blocks = -(-thread_count(frame.width, frame.height, True) // BLOCK)
        self.threads = BLOCK * -(-blocks // self.shares)
        self.primary_starts = primary_starts
        own = effects.bounces + (primary_starts is None)
        self.mirror_slot = 1 + frame.light_count * (effects.bounces + 1)
        slots = self.mirror_slot + effects.bounces
        with wp.ScopedDevice(frame.device):
            self.counts = wp.zeros((slots, self.shares), dtype=wp.int32)
            self.doubts = [wp.zeros(doubt_capacity, dtype=wp.vec2i) for _ in range(self.shares)]
            start = wp.zeros((own, frame.pixels), dtype=wp.vec3f)
            words = 0 if walked(effects) else frame.triangle_count
            self.light_records = {i: wp.zeros(3 * words, dtype=wp.vec4f) for i in self.lights}
            sided = {i: words if self._exactly(i) else 0 for i in self.lights}
            self.sides = {i: wp.zeros(sided[i], dtype=wp.vec4f) for i in self.lights}
            # Read two at a time.
            self.facing = {i: wp.zeros(sided[i] + sided[i] % 2, dtype=wp.uint8) for i in self.lights}
            any_sided = any(sided.values())
            self.joined = wp.array(records.joined_pairs(frame.prepared) if any_sided else [], dtype=wp.uint8)
        kept = [start[k] for k in range(own)]
        self.starts = kept if primary_starts is None else [primary_starts, *kept]
        self.parts = [filled(Part, share=share, shares=self.shares) for share in range(self.shares)]
        self.careful = Careful(frame, build, effects, tree)
        # On a GPU, where a bounce is one chain of passes, it is not divided into shares.
        self.bounce_shares = self.shares if self.threaded else 1
        self.bounce_threads = BLOCK * -(-blocks // self.bounce_shares)
        self.bounce_parts = [
            filled(Part, share=share, shares=self.bounce_shares) for share in range(self.bounce_shares)
        ]
        self._bounced: dict[tuple[int, int], Launch] = {}
        self.mirrored: MirroredRays | None = None
        if effects.bounces and not walked(effects):
            kept = self.counts[self.mirror_slot :]
            self.mirrored = MirroredRays(
                frame, build, trace, effects, tree, self.bounce_parts, self.bounce_threads, kept, self.doubts,
                self.starts,
            )  # fmt: skip

    def _exactly(self, light: int) -> bool:
        """Whether the shadow rays of a light are exact: float32 cannot trace rays from a directional one, which lies where
        its numbers end."""
        return self.exact or self.effects.is_directional(light)

    def _precision(self, light: int) -> str:
        return "exact" if self._exactly(light) else self.trace.precision

    def doubtful(self) -> dict[str, int]:
        """The pairs of the last frame that were left to float64, by kind of rays."""
        found = counted(self.counts.numpy().astype(np.int64)).sum(axis=1)
        pairs = {"primary": int(found[0]), "shadow": int(found[1 : self.mirror_slot].sum())}
        if self.mirrored is not None:
            pairs["mirror"] = int(found[self.mirror_slot :].sum())
        return pairs

    def light_passes(self, late: bool) -> list[Pass]:
        """Records of the triangles for each light. They need no tree.

        ``late``: those for the lights whose receivers another pass marks. They come after the hits: where none receives the
        light, they are left out. Not ``late``: the others, and what the rays need that mark the receivers themselves.
        """
        if walked(self.effects):
            return []
        passes = []
        for i in self.lights:
            if late == (self.effects.has_receivers(i) and not self.marks):
                passes.append(self._light_pass(i))
            if self.marks and not late:
                passes += facing_passes(self.frame, self.effects, i, self.trace.threads)
        return passes

    def _light_pass(self, light: int) -> Pass:
        reads = ("points", "triangles", "extent", f"light/{light}")
        made, launch = (f"light triangles/{light}",), functools.partial(self._light_records, light)
        return Pass(f"light {light}: triangles", "light build", reads, made, launch, f"shadows/{light}")

    def clear_passes(self) -> list[Pass]:
        """Each light's counters, before its shadow rays."""
        return [
            Pass(
                f"light {i}: clear counts", "shadow", (), (f"shadow counts/{i}",), self.counts[1 + i].zero_, f"shadows/{i}"
            )
            for i in self.lights
        ]  # fmt: skip

    def in_shares(self, of_share: Callable[[int], list[Pass]]) -> list[Pass]:
        """The passes ``of_share`` of all shares, which run concurrently, after what was made for them; the records for each
        light come before its rays.

        Threads of a CPU take the shares of one pass.
        """
        passes: list[Pass] = []
        for steps in zip(*(of_share(share) for share in range(self.shares)), strict=True):
            if self.threaded:
                passes.append(self._in_threads(steps))
            elif self.shares > 1:
                passes += (
                    replace(step, hints=Hints(parallel=(share,), phase=1), adds=True)
                    for share, step in enumerate(steps)
                )
            else:
                passes += steps
        for late in self.light_passes(late=True):
            made = set(late.writes)
            passes.insert(next(k for k, step in enumerate(passes) if made.intersection(step.reads)), late)
        return passes

    def _in_threads(self, steps: tuple[Pass, ...]) -> Pass:
        """The same step of all shares as one pass."""
        return replace(
            steps[0],
            name=steps[0].name.removesuffix(self.of(0)),
            reads=tuple(dict.fromkeys(name for step in steps for name in step.reads)),
            writes=tuple(dict.fromkeys(name for step in steps for name in step.writes)),
            launch=at_once([step.launch for step in steps]),
        )

    def share_passes(self, share: int, seen: tuple[str, ...]) -> list[Pass]:
        """The shadow rays of one share of the pixels, light after light. ``seen``: what they read apart from the lights."""
        of = self.of(share)
        run = functools.partial
        passes = []
        for i in self.lights:
            counts, planes = f"shadow counts/{i}", f"light triangles/{i}"
            masks = self.effects.receiver_reads(i)
            made, given = (masks, facing_reads(self.frame, self.effects, i)) if self.marks else ((), masks)
            reads = (*seen, f"light/{i}", planes, counts, "max_coordinate", *given)
            bits, doubts, effect = f"shadowed/{i}", f"shadow doubts/{i}{of}", f"shadows/{i}"
            name, launch = f"light {i}: shadow rays{of}", run(self._shadow, i, 0, share)
            passes.append(Pass(name, "shadow", reads, (bits, doubts, counts, *made), launch, effect))
        return passes

    def of(self, share: int) -> str:
        """The ending of the names of a share's passes and resources."""
        return f", share {share + 1} of {self.shares}" if self.shares > 1 else ""

    def mirror_passes(self) -> list[Pass]:
        """Records of the triangles for mirrored rays, which need no tree."""
        return [] if self.mirrored is None else self.mirrored.records_passes()

    def bounce_passes(self) -> list[Pass]:
        """Mirrored rays, and the shadow rays of their hits."""
        scene = ("bvh", "points", "triangles", "max_coordinate")
        if self.mirrored is None:
            closest = self.careful.launch_closest
            return traced_bounces(
                self.effects, scene, lambda b: closest(b, self.starts[b]), self.careful.launch_shadow
            )
        return traced_bounces(
            self.effects, (*scene, RECORDS), self.mirrored.launch, self._bounce_shadow, lambda i: (f"light triangles/{i}",)
        )  # fmt: skip

    def _light_records(self, light: int) -> None:
        f = self.frame
        if self._exactly(light):
            kernel, inputs = records.light_kernel, [f.mesh, light, f.lights, self.extent, self.joined]
            outputs = [self.light_records[light], self.sides[light], self.facing[light]]
        else:
            kernel, inputs = records.float32_kernel, [f.mesh, light, f.lights]
            outputs = [self.light_records[light]]
        wp.launch(kernel, dim=f.triangle_count, inputs=inputs, outputs=outputs, device=f.device)

    def _slot(self, light: int, bounce: int) -> int:
        return 1 + bounce * self.frame.light_count + light

    def _shadow_counts(self, light: int, bounce: int, share: int) -> wp.array:
        return self.counts[self._slot(light, bounce), share : share + 1]

    def _shadow(self, light: int, bounce: int, share: int) -> None:
        f, counts = self.frame, self._shadow_counts(light, bounce, share)
        build, trace = self.build, self.trace
        kernel = shadow.make_shadow_kernel(
            self._precision(light), build.node_bytes, trace.registers, self.marks
        )
        wp.launch(
            specialised(kernel, self.effects.switches(light, bounce)),
            dim=self.threads,
            inputs=[
                f.camera, self.parts[share], light, self.effects.facing, f.lights, f.spots, f.front_facing, self.tree,
                self.light_records[light], self.sides[light], self.facing[light], f.max_coordinate, self.extent, f.mesh,
                f.alpha, f.hits(bounce), self.starts[bounce],
            ],
            outputs=[f.masks(bounce), counts, self.doubts[share], f.bits(bounce)],
            device=f.device,
            block_dim=BLOCK,
        )  # fmt: skip

    def _bounce_shadow(self, light: int, bounce: int) -> None:
        self.counts[self._slot(light, bounce)].zero_()
        self.frame.bits(bounce)[light].zero_()
        if (light, bounce) not in self._bounced:
            shares = range(self.bounce_shares)
            self._bounced[light, bounce] = at_once(
                [functools.partial(self._mirrored_shadow, light, bounce, share) for share in shares]
            )
        self._bounced[light, bounce]()

    def _mirrored_shadow(self, light: int, bounce: int, share: int) -> None:
        assert self.mirrored is not None
        f, counts = self.frame, self._shadow_counts(light, bounce, share)
        kernel = mirrored.make_shadow_kernel(
            self._precision(light), self.build.node_bytes, self.trace.registers
        )
        wp.launch(
            specialised(kernel, self.effects.switches(light, bounce)),
            dim=self.bounce_threads,
            inputs=[
                *self.mirrored.list_of(bounce, share), light, f.lights, self.tree, self.light_records[light],
                self.sides[light], self.facing[light], f.max_coordinate, self.extent, f.mesh, f.alpha, f.rays(bounce),
                f.hits(bounce), self.starts[bounce], f.masks(bounce),
            ],
            outputs=[counts, self.doubts[share], f.bits(bounce)],
            device=f.device,
            block_dim=BLOCK,
        )  # fmt: skip
