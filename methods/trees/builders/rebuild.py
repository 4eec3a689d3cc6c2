"""A tree rebuilt each frame: arrays, and launches of its build."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import warp as wp

from ....harness.frame.frame import Frame
from ....harness.frame.geometry import filled
from ....harness.frame.schedule.passes import Pass
from .. import constants
from ..nodes import empty_tree
from .climb import Leaves
from .hploc import make_hploc_kernel
from .keys import NO_LEAF, SceneBox, key_kernel
from .lbvh import make_lbvh_kernel
from .sort import Sort

MAKERS: dict[str, Callable[[], Any]] = {"hploc": lambda: make_hploc_kernel(constants.RADIUS), "lbvh": make_lbvh_kernel}


class Rebuilt:
    """Boxes, keys, a sort, and the tree.

    leaves   their sorted keys and references
    scratch  vec4f [4 * triangles]; flags uint64 [triangles]
    """

    def __init__(self, frame: Frame, builder: str):
        self.frame, self.builder = frame, builder
        count = frame.triangle_count
        with wp.ScopedDevice(frame.device):
            self.box = SceneBox(frame)
            self.flags = wp.zeros(count, dtype=wp.uint64)
            self.scratch = wp.zeros(4 * count, dtype=wp.vec4f)
        self.tree = empty_tree(frame)
        self.sort = Sort(count, constants.KEY_BITS, NO_LEAF, frame.device)
        self.leaves = filled(Leaves, count=self.sort.held, pairs=self.sort.sorted)

    def passes(self) -> tuple[list[Pass], Pass]:
        """The passes before the records of triangles, and the one that makes the tree, concurrently with those."""
        first = [
            Pass("keys", "build", ("points", "triangles", "max_coordinate"), ("keys", "extent"), self._keys),
            Pass("sort", "build", ("keys",), ("order",), self.sort.launch),
        ]
        reads = ("points", "triangles", "max_coordinate", "order", "extent")
        return first, Pass("tree", "build", reads, ("bvh",), self._tree)

    def _keys(self) -> None:
        f, box = self.frame, self.box.launch()
        inputs = [f.mesh, f.triangle_count, constants.SHARED_AREA, box]
        outputs = [self.sort.unsorted, self.flags, self.tree, self.sort.state]
        f.launch(key_kernel, -(-f.triangle_count // 2), inputs, outputs)

    def _tree(self) -> None:
        f = self.frame
        inputs = [self.leaves, f.mesh]
        outputs = [self.scratch, self.flags, self.tree]
        kernel = MAKERS[self.builder]()
        f.launch(kernel, -(-f.triangle_count // constants.BLOCK) * constants.BLOCK, inputs, outputs, constants.BLOCK)
