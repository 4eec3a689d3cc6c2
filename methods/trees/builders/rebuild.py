"""A tree rebuilt each frame: keys, a sort, and LBVH or H-PLOC."""

from collections.abc import Callable
from typing import Any

import warp as wp

from ....harness.frame.frame import Frame
from ....harness.frame.geometry import filled
from ....harness.frame.schedule.passes import Pass
from .. import constants
from ..nodes import Tree, empty_tree
from .climb import Leaves
from .hploc import make_hploc_kernel
from .keys import NO_LEAF, key_kernel
from .lbvh import make_lbvh_kernel
from .scene_box import SceneBox
from .sort import Sort

MAKERS: dict[str, Callable[[], Any]] = {"hploc": lambda: make_hploc_kernel(constants.RADIUS), "lbvh": make_lbvh_kernel}

KEY_BLOCK, MANY_KEYS = 256, 2**17
"""Threads of a block that makes keys, and from how many triangles on four times as many: a block adds to the digits' counts
once.
"""


class RadixBuild:
    """Arrays and launches that make a ``tree`` of the first ``count`` triangles of a mesh.

    box      float32 [6]: of all (:class:`.scene_box.SceneBox`), found before the keys are made; and with it the zeros of
             ``sort.state``
    leaves   their sorted keys and references
    scratch  vec4f [4 * count]; flags uint64 [count]

    ``shared_area``: up to which ratio of areas two triangles share a leaf (:data:`..constants.SHARED_AREA`)
    """

    def __init__(self, frame: Frame, mesh: Any, count: int, tree: Tree, builder: str, shared_area: float):
        self.frame, self.mesh, self.count, self.tree = frame, mesh, count, tree
        self.builder, self.shared_area = builder, shared_area
        with wp.ScopedDevice(frame.device):
            self.flags = wp.zeros(count, dtype=wp.uint64)
            self.scratch = wp.zeros(4 * count, dtype=wp.vec4f)
        self.sort = Sort(count, constants.KEY_BITS, NO_LEAF, frame.device)
        self.leaves = filled(Leaves, count=self.sort.held, pairs=self.sort.sorted)

    def make_keys(self, box: wp.array) -> None:
        """Keys and references of the leaves, in the ``box`` of all."""
        inputs = [self.mesh, self.count, self.shared_area, box]
        outputs = [self.sort.unsorted, self.flags, self.tree, self.sort.state]
        block = KEY_BLOCK if self.count < MANY_KEYS else 4 * KEY_BLOCK
        self.frame.launch(key_kernel, -(-self.count // (2 * block)) * block, inputs, outputs, block)

    def make_tree(self) -> None:
        """The tree of the sorted leaves."""
        block = constants.BLOCK
        inputs, outputs = [self.leaves, self.mesh], [self.scratch, self.flags, self.tree]
        self.frame.launch(MAKERS[self.builder](), -(-self.count // block) * block, inputs, outputs, block)


class Rebuilt:
    """The tree of a frame's triangles, and its passes."""

    def __init__(self, frame: Frame, builder: str):
        self.tree = empty_tree(frame)
        self.build = RadixBuild(frame, frame.mesh, frame.triangle_count, self.tree, builder, constants.SHARED_AREA)
        self.box = SceneBox(frame, self.tree.extent, self.build.sort.state)

    def built(self) -> dict[str, Any]:
        """For :meth:`....harness.frame.method.Method.built`."""
        return {"update": "rebuild", "tree": self.build.builder}

    def passes(self) -> tuple[list[Pass], Pass, list[Pass]]:
        """The passes before all others, the one that makes the tree, and those that run concurrently with it."""
        first = [
            Pass("keys", "build", ("points", "triangles"), ("keys", "extent"), self._keys),
            Pass("sort", "build", ("keys",), ("order",), self.build.sort.launch),
        ]
        reads = ("points", "triangles", "max_coordinate", "order")
        return first, Pass("tree", "build", reads, ("bvh",), self.build.make_tree), []

    def _keys(self) -> None:
        self.box.launch()
        self.build.make_keys(self.box.box)
