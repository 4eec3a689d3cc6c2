"""Which triangles a library's tree holds, and its indices: one rule for a tree that is built and for one that is refitted.

Triangles that no ray can hit are left out, so that they cost nothing. If the tree lives over an animation, a triangle that
is valid in some frame stays in it; while it is invalid it is one point, its first finite vertex, in the build and in every
refit. If its place in the build differed from that in the refit, a leaf with many such triangles would span the scene.
"""

from __future__ import annotations

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.frame.frame import Frame
from ...harness.frame.geometry import Mesh, filled
from ...harness.scene.prepared import Prepared


@wp.kernel(enable_backward=False)
def mesh_indices_kernel(mesh: Mesh, kept: wp.array(dtype=wp.int32), indices: wp.array(dtype=wp.int32)):
    """Indices of the triangles ``kept``; an invalid one becomes a finite point, which no ray hits."""
    i = wp.tid()
    triangle = kept[i]
    if mesh.valid[triangle] != wp.uint8(0) and indices[3 * i] != indices[3 * i + 1]:
        return  # as it was: most frames of most meshes write nothing
    face = mesh.triangles[triangle]
    if mesh.valid[triangle] == wp.uint8(0):
        v = face[0]
        if not wp.isfinite(mesh.points[v]):
            v = face[1]
        if not wp.isfinite(mesh.points[v]):
            v = face[2]
        if not wp.isfinite(mesh.points[v]):
            v = wp.int32(0)
            while v < mesh.points.shape[0] - 1 and not wp.isfinite(mesh.points[v]):
                v += wp.int32(1)
        face = wp.vec3i(v, v, v)
    indices[3 * i] = face[0]
    indices[3 * i + 1] = face[1]
    indices[3 * i + 2] = face[2]


def may_be_hit(prepared: Prepared) -> NDArray[np.int64]:
    """The triangles that are valid in some frame, ascending. Later frames are read only while some are not."""
    never = np.flatnonzero(prepared.points(0)[1] == 0)
    for frame in range(1, prepared.frame_count if prepared.moves else 1):
        if len(never) == 0:
            break
        never = never[prepared.points(frame)[1][never] == 0]
    return np.delete(np.arange(prepared.triangle_count), never)


class TreeTriangles:
    """The triangles in a tree and their flat indices, on the device of a frame.

    kept     int32 [count]: the triangle of each face of the tree
    names    the same; empty where a face has the number of its triangle
    indices  int32 [3 * count]
    """

    def __init__(self, frame: Frame, kept: NDArray[np.int64]):
        self._frame = frame
        self.count = len(kept)
        with wp.ScopedDevice(frame.device):
            self.kept = wp.array(kept, dtype=wp.int32)
            self.names = wp.empty(0, dtype=wp.int32) if self.count == frame.triangle_count else self.kept
            self.indices = wp.array(frame.prepared.faces[kept].ravel(), dtype=wp.int32)

    def launch_indices(self, mesh: Mesh | None = None) -> None:
        """Follow the validity flags of ``mesh``, default the frame's."""
        inputs = [self._frame.mesh if mesh is None else mesh, self.kept]
        outputs = [self.indices]
        self._frame.launch(mesh_indices_kernel, self.count, inputs, outputs)

    def at_first_frame(self) -> wp.array:
        """The points of the animation's first frame, vec3f; the indices follow its validity flags."""
        points, valid = self._frame.prepared.points(0)
        with wp.ScopedDevice(self._frame.device):
            first = wp.array(points, dtype=wp.vec3f)
            flags = wp.array(valid, dtype=wp.uint8)
        frame = self._frame
        self.launch_indices(filled(Mesh, points=first, triangles=frame.triangles, weld=frame.weld, valid=flags))
        return first
