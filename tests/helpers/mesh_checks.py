"""What is checked of the meshes of stand-ins: that they are closed, and the areas of their triangles."""

import numpy as np
from numpy.typing import NDArray
from shadowbench.harness.scene.standins.shapes import Mesh


def edge_faults(faces: NDArray[np.integer]) -> int:
    """How many directed edges lack a single partner the other way: 0 if closed and consistently oriented."""
    count = int(faces.max()) + 1 if len(faces) else 0
    start, end = faces.astype(np.int64).ravel(), np.roll(faces, -1, axis=1).astype(np.int64).ravel()
    forward, backward = np.sort(start * count + end), np.sort(end * count + start)
    repeated = int((forward[1:] == forward[:-1]).sum())
    alone = np.setdiff1d(forward, backward, assume_unique=repeated == 0)
    return repeated + len(alone)


def areas(mesh: Mesh) -> NDArray[np.float64]:
    """Area of each triangle in square metres, float64 [triangle_count]."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
