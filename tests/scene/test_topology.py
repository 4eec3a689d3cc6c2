"""Parts over time as one mesh of fixed topology: each frame has exactly the triangles that it had."""

import numpy as np
import pytest
from shadowbench.harness.scene.readers.polygons import fixed_topology

FACES = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
MORE = np.array([[3, 1, 0], [0, 1, 2], [4, 0, 1]], dtype=np.int32)


def piece(seed: int, count: int = 4, faces=FACES, kind=np.float32):
    return np.random.default_rng(seed).random((count, 3), dtype=np.float32).astype(kind), faces.copy()


@pytest.mark.parametrize(
    ("frames", "triangles", "padded", "vanishing"),
    [
        ([[piece(0), piece(k)] for k in range(3)], 4, (), ()),
        ([[piece(0), piece(1)], [piece(0), None]], 4, (), (1,)),
        ([[one, piece(9)] for one in (piece(0), piece(1, 5, MORE), None, piece(2, faces=FACES[:1]))], 5, (0,), ()),
        ([[piece(0)], [piece(0, 5, kind=np.float64)]], 2, (0,), ()),  # one more vertex is another topology
        ([[None, piece(0)], [None, piece(1)]], 2, (), ()),
        ([[None], [None]], 0, (), ()),
    ],
)
def test_each_frame_has_its_triangles(frames, triangles, padded, vanishing):
    fixed = fixed_topology(frames)
    assert (len(fixed.faces), fixed.padded, fixed.vanishing) == (triangles, padded, vanishing)
    kinds = {one[0].dtype for frame in frames for one in frame if one}
    for frame, points in zip(frames, fixed.frames, strict=True):
        corners = points[fixed.faces]
        own = [one[0][one[1]] for one in frame if one]
        assert corners[np.isfinite(corners).all(axis=(1, 2))].tolist() == [t for part in own for t in part.tolist()]
        assert points.dtype == (np.float64 if np.dtype(np.float64) in kinds else np.float32)
        assert padded or len(points) == sum(max(len(f[i][0]) if f[i] else 0 for f in frames) for i in range(len(frame)))
