"""A wp.Bvh over padded boxes, rebuilt in place so that a captured graph may hold it, and its traversal.

Warp's slab test computes a distance with three roundings, so a ray that touches a box may be found to miss it. Boxes
are therefore padded by what those roundings can amount to (:data:`.bounds.PADDED_UNITS`; Ize 2013, "Robust BVH Ray
Traversal", does the same in the ray).
"""

from typing import Any

import warp as wp

from ...harness.frame.alpha import Alpha
from ...harness.frame.frame import Frame
from ...harness.frame.geometry import Mesh, filled
from ...harness.frame.schedule.passes import Pass
from ..exact.ray_queries import SLACK, Found, RayPart, nothing_found
from ..exact.triangle import to_float32
from .bounds import PADDED_UNITS, launch_boxes
from .corner_records import CornerRecords, valid_in

QUERY_BLOCK = 128
"""Threads of a block of a kernel that traverses. With 80 to 96 registers a thread, blocks of 256 fill a multiprocessor to a
half or less: 5 to 10 % more time on an H200.
"""


@wp.struct
class Boxes:
    """A :class:`BoxTree` as kernels take it."""

    tree: wp.uint64
    records: CornerRecords


@wp.func
def walk(test: wp.Function, boxes: Any, mesh: Mesh, alpha: Alpha, part: RayPart, query: Any) -> Found:
    """Call ``test`` for every valid triangle whose box a ray meets, by the tree's records: see :mod:`..rays.kernels`."""
    # What the loop depends on is in variables of its own, and it is left by a break right after the test. Then the
    # compiler makes one loop of steps down the tree and tests, in which the lanes of a warp stay together. With fields
    # of ``result`` in their place, or the break elsewhere, it makes two, and the rebuilt tree takes 1.2 to 3.3 times as
    # long on an H200; a vote of the lanes before every test takes 1.2 to 2 times as long.
    result = nothing_found(wp.float32(part.end) * SLACK)
    limit = result.limit
    tests = wp.int32(0)
    done = wp.bool(False)
    i = wp.int32(0)
    met = wp.bvh_query_ray(boxes.tree, to_float32(part.start), to_float32(part.direction))
    while wp.bvh_query_next(met, i, limit):
        tests += 1
        if valid_in(boxes.records, i):
            result = test(boxes.records, alpha, i, query, result)
            limit = result.limit
            done = result.done
            if done:
                break
    result.tests = tests
    return result


class BoxTree:
    """The boxes of a frame's triangles and the tree over them, with the passes that rebuild both.

    constructor  "sah", "median" or "lbvh": the order in which Warp builds it; on CUDA only "lbvh" can be rebuilt in place
    leaf_size    triangles per leaf, at least 1
    padding      of the boxes, in units of 2^-24 of the largest coordinate of scene and eye; 0 leaves them as they are
    box          float32 [6]: the box of all triangles, as :func:`.bounds.launch_bounds` writes it
    records      the triangles as a query reads them
    bvh          the wp.Bvh
    """

    def __init__(self, frame: Frame, constructor: str, leaf_size: int, padding: float = PADDED_UNITS):
        self._frame, self._constructor, self._padding = frame, constructor, padding
        # The tree must exist before the first frame; its buffers are what every rebuild uses again.
        points, valid = frame.prepared.points(0)
        corners = points[frame.prepared.faces]
        corners[valid == 0] = 0.0
        with wp.ScopedDevice(frame.device):
            self.box = wp.zeros(6, dtype=wp.float32)
            self._lowers = wp.array(corners.min(axis=1), dtype=wp.vec3f)
            self._uppers = wp.array(corners.max(axis=1), dtype=wp.vec3f)
            self.records = filled(CornerRecords, corners=wp.zeros(3 * frame.triangle_count, dtype=wp.vec4f))
        self.bvh = wp.Bvh(self._lowers, self._uppers, constructor=constructor, leaf_size=leaf_size)

    def boxes(self, kind: Any = Boxes, **fields: Any) -> Any:
        """What a kernel takes: :class:`Boxes`, or another struct with more ``fields``."""
        return filled(kind, tree=int(self.bvh.id), records=self.records, **fields)

    def passes(self) -> list[Pass]:
        """Boxes, then the tree: the resource "bvh"."""
        return [
            Pass("boxes", "build", ("points", "triangles", "max_coordinate"), ("boxes",), self._launch_boxes),
            Pass("rebuild", "build", ("boxes",), ("bvh",), self._rebuild),
        ]

    def _launch_boxes(self) -> None:
        launch_boxes(self._frame, self.box, self._lowers, self._uppers, self.records, self._padding)

    def _rebuild(self) -> None:
        self.bvh.rebuild(self._constructor)
