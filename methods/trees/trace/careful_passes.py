"""Arrays and launches of the rays that are decided in float64 during the traversal (:mod:`.careful`)."""

from __future__ import annotations

import warp as wp

from ....harness.frame.effects.specialise import specialised
from ....harness.frame.frame import Frame
from ....harness.scene.effects import Effects
from ...common.pixels import thread_count
from ..nodes import Tree
from ..parameters import Build
from .careful import make_closest_kernel, make_shadow_kernel

BLOCK = 128


def walked(effects: Effects) -> bool:
    """Whether :class:`Careful` traces every ray of a frame: primary rays start in many points."""
    return effects.orthographic


class Careful:
    """See the module. Stateless."""

    def __init__(self, frame: Frame, build: Build, effects: Effects, tree: Tree):
        self.frame, self.effects = frame, effects
        self.tree, self.node_bytes = tree, build.node_bytes
        self.threads = thread_count(frame.width, frame.height, True)

    def launch_closest(self, bounce: int, starts: wp.array) -> None:
        f = self.frame
        wp.launch(
            specialised(make_closest_kernel(self.node_bytes), self.effects.switches(bounce=bounce)),
            dim=self.threads,
            inputs=[
                f.camera, self.tree, f.max_coordinate, f.mesh, f.alpha, f.rays(bounce),
            ],
            outputs=[f.hits(bounce), starts],
            device=f.device,
            block_dim=BLOCK,
        )  # fmt: skip

    def launch_shadow(self, light: int, bounce: int) -> None:
        f = self.frame
        wp.launch(
            specialised(make_shadow_kernel(self.node_bytes), self.effects.switches(light, bounce)),
            dim=self.threads,
            inputs=[
                f.camera, light, f.lights, self.tree, f.max_coordinate, f.mesh, f.alpha,
                f.hits(bounce), f.masks(bounce), f.rays(bounce),
            ],
            outputs=[f.bits(bounce)],
            device=f.device,
            block_dim=BLOCK,
        )  # fmt: skip
