"""Arrays and launches of the rays that are decided in float64 during the traversal (:mod:`.careful`)."""

from __future__ import annotations

import warp as wp

from ...harness.frame.frame import Frame
from ...harness.frame.specialise import specialised
from ...harness.scene.effects import Effects
from .careful import make_closest_kernel, make_shadow_kernel
from .parameters import Build
from .primary import Tree
from .snippets import STACK

WALKERS = 256
"""Walkers per multiprocessor of the GPU, and on the CPU, which runs them one after another."""


def walked(effects: Effects) -> bool:
    """Whether :class:`Careful` traces every ray of a frame: triangles have holes, or primary rays start in many points."""
    return effects.alpha or effects.orthographic


class Careful:
    """stack int32 [walkers * STACK]: each walker's; empty where no ray needs one."""

    def __init__(self, frame: Frame, build: Build, effects: Effects, tree: Tree):
        self.frame, self.effects = frame, effects
        self.tree, self.node_bytes = tree, build.node_bytes
        device = wp.get_device(frame.device)
        self.walkers = WALKERS * (device.sm_count if device.is_cuda else 1)
        self.stack = wp.zeros(self.walkers * STACK if walked(effects) else 0, dtype=wp.int32, device=device)

    def launch_closest(self, bounce: int, starts: wp.array) -> None:
        f = self.frame
        wp.launch(
            specialised(make_closest_kernel(self.node_bytes), self.effects.switches(bounce=bounce)),
            dim=self.walkers,
            inputs=[
                self.walkers, f.pixels, f.camera, self.tree, f.mesh, f.alpha, f.rays(bounce), self.stack,
            ],
            outputs=[f.hits(bounce), starts],
            device=f.device,
        )  # fmt: skip

    def launch_shadow(self, light: int, bounce: int) -> None:
        f = self.frame
        wp.launch(
            specialised(make_shadow_kernel(self.node_bytes), self.effects.switches(light, bounce)),
            dim=self.walkers,
            inputs=[
                self.walkers, f.pixels, f.camera, light, f.lights, self.tree, f.mesh, f.alpha,
                f.hits(bounce), f.masks(bounce), f.rays(bounce), self.stack,
            ],
            outputs=[f.bits(bounce)],
            device=f.device,
        )  # fmt: skip
