"""Closest hits of rays that lie in arrays: mirrored ones, and those of an orthographic camera."""

from collections.abc import Sequence
from typing import Any

import warp as wp

from ....harness.frame.effects.specialise import specialised
from ....harness.frame.frame import Frame
from ....harness.frame.geometry import filled
from ....harness.frame.schedule.passes import Pass
from ....harness.scene.effects import Effects
from ..constants import BLOCK
from ..nodes import Tree
from ..records.rays import float32_ray_kernel, ray_kernel
from . import closest
from .closest import Listed
from .shares import Shares

RECORDS = "ray triangles"
"""The resource that :meth:`ListedRays.record_passes` writes."""


class ListedRays:
    """Such rays of a frame.

    records  vec4f [3 * triangles]: :mod:`..records.rays`
    lengths  int32 [bounces + 1, shares]: how many pixels of each share have a ray
    lists    for each bounce and share, which (:class:`.closest.Listed`)
    found    vec4i [threads] for each share: what the traversal of each ray gave

    ``starts`` as in :class:`.tree_rays.TreeRays`.
    """

    def __init__(
        self,
        frame: Frame,
        tree: Tree,
        effects: Effects,
        exact: bool,
        shares: Shares,
        starts: Sequence[wp.array],
        levels: int = 1,
    ):
        self.frame, self.tree, self.effects, self.exact, self.levels = frame, tree, effects, exact, levels
        self.shares, self.starts = shares, starts
        with wp.ScopedDevice(frame.device):
            self.records = wp.zeros(3 * frame.triangle_count, dtype=wp.vec4f)
            self.lengths = wp.zeros((effects.bounces + 1, shares.count), dtype=wp.int32)
            self.lists = [
                [
                    filled(
                        Listed,
                        count=self.lengths[bounce, share : share + 1],
                        pixels=wp.zeros(shares.threads, dtype=wp.int32),
                    )
                    for share in range(shares.count)
                ]
                for bounce in range(effects.bounces + 1)
            ]
            self.found = [wp.zeros(shares.threads if exact else 0, dtype=wp.vec4i) for _ in shares.tiles]

    def record_passes(self) -> list[Pass]:
        """Records of the triangles, which need no tree."""
        effect = None if self.effects.orthographic else "mirror"
        return [Pass("rays: triangles", "trace", ("points", "triangles"), (RECORDS,), self._records, effect)]

    def trace(self, bounce: int, share: int, undecided: Any) -> None:
        """The hits of a share's rays, and the points that shadow rays start at; ``undecided``:
        :class:`.undecided.Undecided`."""
        f, listed, found = self.frame, self.lists[bounce][share], self.found[share]
        rays, hits, starts = f.rays(bounce), f.hits(bounce), self.starts[bounce]
        switches = self.effects.switches(bounce=1)
        self._run(closest.list_kernel, [f.camera, self.shares.tiles[share], rays], [hits, listed])
        kernel = specialised(closest.make_listed_kernel(self.exact, self.levels), switches)
        self._run(kernel, [listed, rays, self.tree, self.records, undecided], [found, hits, starts])
        if self.exact:
            kernel = specialised(closest.make_resolve_kernel(bounce == 0), switches)
            self._run(kernel, [listed, rays, self.tree, f.mesh, f.alpha, undecided, found], [hits, starts])

    def _run(self, kernel: Any, inputs: list[Any], outputs: list[Any]) -> None:
        device, threads = self.frame.device, self.shares.threads
        wp.launch(kernel, dim=threads, inputs=inputs, outputs=outputs, device=device, block_dim=BLOCK)

    def _records(self) -> None:
        f, kernel = self.frame, ray_kernel if self.exact else float32_ray_kernel
        f.launch(kernel, f.triangle_count, [f.mesh], [self.records])
