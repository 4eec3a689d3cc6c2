"""A mesh whose triangles vanish and appear: every method answers each of its frames rightly, one after the other."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from shadowbench.harness.frame.devices import find_device
from shadowbench.harness.frame.registry import make_method, method_class, method_names
from shadowbench.harness.frame.session import Session
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.score import score_answers
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.readers.topology import fixed_topology
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene

SIZE = (24, 24)
BALLS = (1, 4, 0, 2)
"""How many balls there are in each frame."""

EXACT = [name for name in method_names() if not getattr(make_method(name), "known_inexact", None)]
CASES = [
    *((name, {}) for name in EXACT),
    *((name, {"update": "refit"}) for name in ("bvh2", "embree", "hybrid", "warp_bvh")),
    ("warp_bvh", {"update": "bvh_rebuild"}),
]


def drops():
    """Balls that appear and vanish above a floor, whose number of triangles changes from frame to frame."""
    floor = np.array([[-2, -1, -2], [2, -1, -2], [2, -1, 2], [-2, -1, 2]], dtype=np.float32)
    ground = (floor, np.array([[0, 2, 1], [0, 3, 2]], dtype=np.int32))
    frames = []
    for k, count in enumerate(BALLS):
        balls = [
            trimesh.creation.icosphere(1, 0.4).apply_translation((0.9 * i - 1.2, 0.1 * k, 0.3 * i))
            for i in range(count)
        ]
        mesh = trimesh.util.concatenate(balls) if balls else trimesh.Trimesh()
        points, faces = mesh.vertices.reshape(-1, 3), mesh.faces.reshape(-1, 3)
        frames.append([ground, (points.astype(np.float32), faces.astype(np.int32))])
    fixed = fixed_topology(frames)
    assert fixed.padded == (1,)
    geometry = Geometry(fixed.faces, lambda k: fixed.frames[k], len(fixed.frames))
    camera, lights = Camera((0.5, 1.5, 5.0), (0.0, -0.3, 0.0)), (Light((1.0, 4.0, 1.0)),)
    return prepare(Scene("drops", "Drops", lambda: geometry, camera, lights))


@pytest.fixture(scope="module")
def scene():
    return drops()


def test_what_vanishes_has_no_hits(scene):
    assert [int(scene.points(k)[1].sum()) for k in range(4)] == [2 + 80 * count for count in BALLS]


@pytest.mark.parametrize(("name", "settings"), CASES, ids=str)
def test_triangles_that_vanish_and_appear_are_answered_exactly(scene, name, settings):
    device = find_device("cpu")
    assert "cpu" in method_class(name).devices
    session = Session(make_method(name, settings), scene, *SIZE, device)
    for frame in (0, 1, 2, 3, 1, 0):
        moment = scene.moment(frame, *SIZE)
        scored = score_answers(Judge.of(scene, moment), session.answers(moment))
        assert scored.score.true_errors == 0, f"frame {frame}"
