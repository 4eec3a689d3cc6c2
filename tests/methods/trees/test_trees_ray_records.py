"""Mirrored rays of the tree (``records/rays.py``, ``closest.py``): what float32 accepts and rejects is float64's
verdict, and float32 decides nearly all.
"""

import numpy as np
import pytest
from helpers.mirror_scenes import answered, hall_of_mirrors
from helpers.ray_trials import PLAIN, SIDE, answers_of, assert_same, session_of
from helpers.small_scenes import soup
from numpy.typing import NDArray
from shadowbench.methods.trees.trace import closest, traversal, triangle_tests

RAYS = SIDE * SIDE
Mesh = tuple[NDArray, NDArray]


def stretched(mesh: Mesh, by: tuple[float, float, float], to: float = 0.0) -> Mesh:
    """A mesh scaled along each axis, then moved."""
    return np.asarray(mesh[0], np.float64).reshape(-1, 3) * by + to, mesh[1]


def twice(mesh: Mesh) -> Mesh:
    """Every triangle in its place a second time, turned over."""
    return mesh[0], np.concatenate([mesh[1], mesh[1][:, ::-1]])


def fans(size: float = 1.0) -> Mesh:
    """Flat squares of many triangles that meet at one corner, one above the other."""
    ring = np.linspace(0, 2 * np.pi, 25)[:-1]
    rim = np.stack([np.cos(ring), np.zeros_like(ring), np.sin(ring)], axis=-1)
    points = np.concatenate([np.concatenate([rim, [[0.0, 0.0, 0.0]]]) + [0, h, 0] for h in (-0.5, 0.0, 0.7)])
    k = np.arange(24)
    faces = np.concatenate([np.stack([k, (k + 1) % 24, np.full(24, 24)], axis=-1) + 25 * n for n in range(3)])
    return points * size, faces


def turned(mesh: Mesh) -> Mesh:
    """Flattened into floors and walls, then turned by a quarter as float32 knows its cosine: zeros become noise."""
    points = np.asarray(mesh[0], np.float64).reshape(-1, 3, 3)
    points = np.where(np.arange(3) == np.arange(len(points))[:, None, None] % 3, points[:, :1], points)
    cosine = float(np.float32(np.cos(np.float32(np.pi / 2))))
    return points @ np.array([[1, 0, 0], [0, cosine, 1], [0, -1, cosine]]), mesh[1]


MESHES = {
    "soup": soup(3, 200),
    "small triangles": soup(4, 300, size=0.02),
    "slivers": stretched(soup(5, 200), (1.0, 1.0, 1e-5)),
    "flatter than float32 knows": stretched(soup(6, 200), (1.0, 1e-9, 1.0)),
    "far from the origin": stretched(soup(7, 200), (1.0, 1.0, 1.0), 1e4),
    "tiny": stretched(soup(8, 200), (1e-12, 1e-12, 1e-12)),
    "huge": stretched(soup(9, 200), (1e12, 1e12, 1e12)),
    "beyond float32's squares": stretched(soup(10, 200), (1e20, 1e20, 1e20)),
    "in one place twice": twice(soup(11, 100)),
    "fans": fans(),
    "fans off the origin": stretched(fans(), (1.0, 1.0, 1.0), 3.3),
    "noise of an exporter": turned(soup(12, 200)),
}


@pytest.mark.parametrize("name", MESHES)
def test_hard_rays_are_decided_as_by_all_triangles_in_float64(name, device):
    walked, wanted, _ = answers_of(session_of(*MESHES[name], {}, device), 1)
    assert (wanted["triangle"] >= 0).sum() > RAYS / 20
    assert_same(walked, wanted, device)


@pytest.mark.parametrize("name", ["soup", "small triangles", "far from the origin", "huge", "noise of an exporter"])
def test_float32_decides_nearly_all_plain_rays(name, device):
    """Of each ray, which meets many boxes and up to 200 triangles."""
    _, _, undecided = answers_of(session_of(*MESHES[name], {}, device), 3, [PLAIN])
    assert undecided < 0.05 * RAYS


@pytest.fixture
def fresh_factories():
    factories = (traversal.make_closest, closest.make_listed_kernel)
    for factory in factories:
        factory.cache_clear()
    yield
    for factory in factories:
        factory.cache_clear()


@pytest.mark.parametrize("bound", ["weight_units", "plane_units"])
def test_a_test_without_a_bound_is_found(bound, device, monkeypatch, fresh_factories):
    """On a mesh whose hard rays are decided with all bounds (above)."""
    assert f"{bound} = " in triangle_tests.RAY
    planted = triangle_tests.RAY.replace(f"{bound} = ", f"{bound} = 0.0f * ")
    monkeypatch.setitem(triangle_tests.TESTS, ("ray", True), planted)
    sessions = (session_of(*MESHES[name], {}, device) for name in ("fans off the origin", "fans", "in one place twice"))
    answers = (answers_of(session, seed) for session in sessions for seed in range(3))
    assert any((walked["triangle"] != wanted["triangle"]).any() for walked, wanted, _ in answers)


def test_float32_traces_mirrored_rays_in_float32(device):
    prepared = hall_of_mirrors()
    _, exact = answered("bvh2", {}, prepared, device)
    _, got = answered("bvh2", {"precision": "float32"}, prepared, device)
    same = got["bounce_triangle"] == exact["bounce_triangle"]
    assert same.mean() > 0.97
    hit = same & (exact["bounce_triangle"] >= 0)
    np.testing.assert_allclose(got["bounce_t"][hit], exact["bounce_t"][hit], rtol=1e-3)
    assert (got["bounce_t"][hit] != exact["bounce_t"][hit]).any()


def test_pixels_without_a_ray_are_misses(device):
    _, got = answered("bvh2", {}, hall_of_mirrors(), device)
    without = got["bounce_active"] == 0
    assert without.any()
    assert (got["bounce_triangle"][without] == -1).all()
    assert np.isinf(got["bounce_t"][without]).all()
    assert (got["bounce_u"][without] == 0).all()
