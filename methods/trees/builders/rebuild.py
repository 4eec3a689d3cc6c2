"""A tree rebuilt each frame: arrays, and launches of its build."""

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
from .keys import NO_LEAF, key_kernel
from .lbvh import make_lbvh_kernel
from .scene_box import SceneBox
from .sort import Sort

MAKERS: dict[str, Callable[[], Any]] = {"hploc": lambda: make_hploc_kernel(constants.RADIUS), "lbvh": make_lbvh_kernel}

KEY_BLOCK, MANY_KEYS = 256, 2**17
"""Threads of a block that makes keys, and from how many triangles on four times as many: a block adds to the digits' counts
once."""


class Rebuilt:
    """Boxes, keys, a sort, and the tree.

    leaves   their sorted keys and references
    scratch  vec4f [4 * triangles]; flags uint64 [triangles]
    """

    def __init__(self, frame: Frame, builder: str):
        self.frame, self.builder = frame, builder
        count = frame.triangle_count
        with wp.ScopedDevice(frame.device):
            self.flags = wp.zeros(count, dtype=wp.uint64)
            self.scratch = wp.zeros(4 * count, dtype=wp.vec4f)
        self.tree = empty_tree(frame)
        self.sort = Sort(count, constants.KEY_BITS, NO_LEAF, frame.device)
        self.box = SceneBox(frame, self.tree.extent, self.sort.state)
        self.leaves = filled(Leaves, count=self.sort.held, pairs=self.sort.sorted)

    def built(self) -> dict[str, Any]:
        """For :meth:`....harness.frame.method.Method.built`."""
        return {"update": "rebuild", "tree": self.builder}

    def passes(self) -> tuple[list[Pass], Pass, list[Pass]]:
        """The passes before all others, the one that makes the tree, and those that run concurrently with it."""
        first = [
            Pass("keys", "build", ("points", "triangles"), ("keys", "extent"), self._keys),
            Pass("sort", "build", ("keys",), ("order",), self.sort.launch),
        ]
        reads = ("points", "triangles", "max_coordinate", "order")
        return first, Pass("tree", "build", reads, ("bvh",), self._tree), []

    def _keys(self) -> None:
        f = self.frame
        self.box.launch()
        inputs = [f.mesh, f.triangle_count, constants.SHARED_AREA, self.box.box]
        outputs = [self.sort.unsorted, self.flags, self.tree, self.sort.state]
        block = KEY_BLOCK if f.triangle_count < MANY_KEYS else 4 * KEY_BLOCK
        f.launch(key_kernel, -(-f.triangle_count // (2 * block)) * block, inputs, outputs, block)

    def _tree(self) -> None:
        f, block = self.frame, constants.BLOCK
        inputs, outputs = [self.leaves, f.mesh], [self.scratch, self.flags, self.tree]
        f.launch(MAKERS[self.builder](), -(-f.triangle_count // block) * block, inputs, outputs, block)
