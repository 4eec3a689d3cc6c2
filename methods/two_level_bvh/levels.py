"""Both levels on the device: the kept trees, and the tree of the bodies that is made in each frame.

The first level is made as a rebuilt tree is (:mod:`..trees.builders.rebuild`), over a mesh in which each body is a triangle
with its box.
"""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.frame.frame import Frame
from ...harness.frame.geometry import Mesh, filled
from ...harness.frame.schedule.passes import Pass
from ..trees.builders.rebuild import RadixBuild
from ..trees.builders.scene_box import MOST, SceneBox
from ..trees.constants import BLOCK
from ..trees.nodes import empty_tree
from .forest import Forest, references, used_vertices
from .poses import WORDS, body_kernel, pose_kernel, vertex_kernel

WARP = 32
CHUNK = 64
"""Vertices of a body that a warp reads."""


class Kept:
    """What is made once: of the first frame of a mesh whose triangles belong to ``bodies``.

    forest      the bodies' trees; their boxes are padded when they are packed
    references  int32 [bodies, 3]: :func:`.forest.references`
    vertices    int32: those that each body uses, one body after another
    chunks      int32 [chunks, 3]: a body, and the range of its vertices that a warp reads
    extent      the largest coordinate of the mesh
    """

    def __init__(self, points: NDArray[np.float32], faces: NDArray[np.int32], bodies: NDArray[np.int32]):
        self.points, self.count = points, int(bodies.max()) + 1
        self.forest = Forest(points[faces], bodies, self.count)
        self.references = references(points, faces, bodies)
        of, self.vertices = used_vertices(faces, bodies)
        ends = np.searchsorted(of, np.arange(self.count), side="right")
        starts = np.concatenate([[0], ends[:-1]])
        ranges = zip(range(self.count), starts, ends, strict=True)
        self.chunks = [(body, k, min(k + CHUNK, end)) for body, start, end in ranges for k in range(start, end, CHUNK)]
        finite = np.abs(points[np.isfinite(points).all(axis=1)])
        self.extent = float(finite.max(initial=0.0))


class Levels:
    """Arrays and launches of a frame.

    tree   what rays are traced through; its nodes are those of the first level, then the kept ones
    unit   what the padding is counted in, ``units`` of which boxes of bodies have
    need   int32 [2]: :func:`.poses.body_kernel`
    """

    def __init__(self, frame: Frame, kept: Kept, unit: float, units: int):
        self.frame, self.unit, self.count = frame, unit, kept.count
        # Beyond 2^126 what is padded for is no more than that (:mod:`..trees.trace.bodies`).
        self.least = min(8.0 * kept.extent, 2.0**126)
        self.chunks = len(kept.chunks)
        top = np.zeros((kept.count, 12), dtype=np.float32)
        # The last term: what float32 loses below its normal numbers, as in :func:`..trees.nodes.padding`.
        nodes = np.concatenate([top, kept.forest.packed(unit * units + 1.0e-37)]).reshape(-1, 4)
        rows = np.zeros((kept.count, 4, 4), dtype=np.float32)
        rows[:, 3, 0] = kept.forest.roots.view(np.float32)
        faces = 2 * np.arange(kept.count)[:, None] + [0, 1, 0]
        with wp.ScopedDevice(frame.device):
            self.tree = empty_tree(
                frame, nodes=wp.array(nodes, dtype=wp.vec4f), bodies=wp.array(rows.reshape(-1, 4), dtype=wp.vec4f)
            )
            self.rest = wp.array(kept.points, dtype=wp.vec3f)
            self.references = wp.array(kept.references, dtype=wp.vec3i)
            self.vertices = wp.array(kept.vertices, dtype=wp.int32)
            self.parts = wp.array(kept.chunks, dtype=wp.vec3i)
            self.found = wp.full(WORDS * self.count, MOST, dtype=wp.int32)
            self.need = wp.zeros(2, dtype=wp.int32)
            self.mesh = filled(
                Mesh,
                points=wp.zeros(2 * self.count, dtype=wp.vec3f),
                triangles=wp.array(faces, dtype=wp.vec3i),
                valid=wp.zeros(self.count, dtype=wp.uint8),
            )
            self.box, self.extent = wp.zeros(6, dtype=wp.float32), wp.zeros(1, dtype=wp.float32)
            self.lowered = wp.array([MOST] * 6 + [0], dtype=wp.int32)
        self.whole = SceneBox(frame, self.tree.extent)
        # Bodies do not share a leaf: no area is less than this.
        self.build = RadixBuild(frame, self.mesh, self.count, self.tree, "lbvh", float("nan"))

    def passes(self) -> tuple[list[Pass], Pass, list[Pass]]:
        """What the first level is made of, the pass that makes it, and those that run concurrently with all of these."""
        reads = ("points", "triangles", "max_coordinate")
        poses = Pass("bodies: poses", "build", reads, ("poses",), self._poses)
        boxes = Pass("bodies: boxes", "build", (*reads, "poses"), ("boxes",), self._boxes)
        tree = Pass("bodies: tree", "build", ("poses", "boxes", "max_coordinate"), ("bvh",), self._tree)
        first = [work.hinted(parallel=(0,)) for work in (poses, boxes)]
        return first, tree, [Pass("box", "build", ("points", "triangles"), ("extent",), self.whole.launch)]

    def _poses(self) -> None:
        f = self.frame
        inputs = [self.references, self.rest, f.points, f.max_coordinate]
        f.launch(pose_kernel, self.count, inputs, [self.tree.bodies, self.need])

    def _boxes(self) -> None:
        f, lanes = self.frame, WARP if wp.get_device(self.frame.device).is_cuda else 1
        inputs = [self.parts, lanes, self.vertices, self.rest, f.points, self.tree.bodies]
        f.launch(vertex_kernel, lanes * self.chunks, inputs, [self.found])
        # On a CPU one thread writes the box of all.
        threads = -(-self.count // BLOCK) * BLOCK if lanes > 1 else 1
        inputs = [self.count, threads, self.unit, self.least, f.max_coordinate, self.found]
        made = [self.mesh.points, self.mesh.valid, self.need]
        outputs = [*made, self.lowered, self.box, self.extent, self.build.sort.state]
        f.launch(body_kernel, threads, inputs, outputs, BLOCK)

    def _tree(self) -> None:
        self.build.make_keys(self.box)
        self.build.sort.launch()
        self.build.make_tree()

    def built(self) -> dict[str, Any]:
        """For :meth:`....harness.frame.method.Method.built`."""
        return {"update": "first level rebuilt", "tree": "SAH of each body in the first frame", "bodies": self.count}
