"""Parts over time as one mesh of fixed topology: each frame has exactly the triangles that it had."""

import numpy as np
from shadowbench.harness.scene.readers.topology import fixed_topology

FACES = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)


def points(seed: int, count: int = 4) -> np.ndarray:
    return np.random.default_rng(seed).random((count, 3), dtype=np.float32)


def triangles(positions, faces) -> list:
    """The corners of the triangles that are there."""
    corners = positions[faces]
    return corners[np.isfinite(corners).all(axis=(1, 2))].tolist()


def test_parts_of_the_same_topology_keep_their_vertices():
    still = (points(0), FACES)
    moving = [(points(k), FACES.copy()) for k in range(3)]
    fixed = fixed_topology([[still, moving[k]] for k in range(3)])
    assert fixed.faces.tolist() == [*FACES.tolist(), *(FACES + 4).tolist()]
    assert all(np.array_equal(fixed.frames[k], np.concatenate([still[0], moving[k][0]])) for k in range(3))
    assert fixed.padded == fixed.vanishing == ()
    assert fixed.frames[0].dtype == np.float32


def test_a_part_that_is_not_there_has_no_positions():
    fixed = fixed_topology([[(points(0), FACES), (points(1), FACES)], [(points(0), FACES), None]])
    assert len(fixed.faces) == 4
    assert np.isfinite(fixed.frames[0]).all()
    assert np.isfinite(fixed.frames[1]).all(axis=1).tolist() == [True] * 4 + [False] * 4
    assert fixed.vanishing == (1,)
    assert fixed.padded == ()


def test_a_part_whose_topology_changes_has_the_triangles_of_each_frame_in_their_order():
    more = np.array([[3, 1, 0], [0, 1, 2], [4, 0, 1]], dtype=np.int32)
    frames = [(points(0), FACES), (points(1, 5), more), None, (points(2), FACES[:1])]
    fixed = fixed_topology([[frame, (points(9), FACES)] for frame in frames])
    assert len(fixed.faces) == 3 + 2
    assert fixed.padded == (0,)
    assert fixed.vanishing == ()
    for k, frame in enumerate(frames):
        own = [] if frame is None else frame[0][frame[1]].tolist()
        assert triangles(fixed.frames[k], fixed.faces) == own + points(9)[FACES].tolist()


def test_one_more_vertex_is_another_topology_and_one_part_in_float64_makes_all_so():
    fixed = fixed_topology([[(points(0), FACES)], [(points(0, 5).astype(np.float64), FACES)]])
    assert fixed.padded == (0,)
    assert fixed.frames[0].dtype == np.float64


def test_parts_that_are_never_there_take_no_room():
    fixed = fixed_topology([[None, (points(0), FACES)], [None, (points(1), FACES)]])
    assert fixed.faces.tolist() == FACES.tolist()
    assert fixed.vanishing == ()
    empty = fixed_topology([[None], [None]])
    assert empty.faces.shape == empty.frames[1].shape == (0, 3)
