"""Mirrored rays of the tree (``records/rays.py``, ``closest.py``): what float32 accepts and rejects is float64's
verdict, and float32 decides nearly all.
"""

from collections.abc import Sequence

import numpy as np
import pytest
import warp as wp
from helpers import small_scenes
from helpers.mirror_scenes import answered, hall_of_mirrors, with_mirrors
from helpers.small_scenes import soup
from numpy.typing import NDArray
from shadowbench.harness.frame.effects.specialise import specialised
from shadowbench.harness.frame.geometry import Hits, Mesh, Rays, corners_of, mirrored_ray, weld_of
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.methods.exact.triangle import hit_distance, hit_weights, nearer
from shadowbench.methods.trees.trace import closest, traversal, triangle_tests

SIDE = 64
"""Rays are those of an image of this side."""


@wp.kernel(enable_backward=False)
def brute_kernel(count: wp.int32, mesh: Mesh, rays: Rays, hits: Hits):
    """The closest hit of all triangles, by the tests that methods share."""
    pixel = wp.tid()
    ray = mirrored_ray(rays, pixel)
    best = wp.int32(-1)
    best_t = wp.float64(wp.INF)
    for i in range(count):
        if mesh.valid[i] != wp.uint8(0):
            t = hit_distance(ray, corners_of(mesh, i), weld_of(mesh, i))
            if t > wp.float64(0.0) and nearer(mesh, t, i, best_t, best):
                best = i
                best_t = t
    uv = wp.vec2f()
    if best >= 0:
        uv = hit_weights(ray, corners_of(mesh, best), weld_of(mesh, best))
    hits.triangle[pixel] = best
    hits.t[pixel] = wp.float32(best_t)
    hits.u[pixel] = uv[0]
    hits.v[pixel] = uv[1]


KINDS = 7
PLAIN, IN_PLANE = 0, 5


def rays_at(corners: NDArray, kinds: Sequence[int], seed: int) -> tuple[NDArray, NDArray]:
    """Origins and directions in the box of triangles [n, 3, 3], of these kinds in turn: from anywhere to a point of a
    triangle (:data:`PLAIN`), to a corner, to an edge; from a point of a triangle to one of another, from a corner, in the
    plane of a triangle; along an axis.
    """
    random = np.random.default_rng(seed)
    count = SIDE * SIDE
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    origin = random.uniform(low, high, (count, 3))
    one, other = (corners[random.integers(0, len(corners), count)].astype(np.float64) for _ in range(2))
    weights = random.dirichlet((1, 1, 1), (2, count))
    inner, aim = ((w[:, :, None] * t).sum(axis=1) for w, t in zip(weights, (one, other), strict=True))
    edge = other[:, 0] + weights[0, :, :1] * (other[:, 1] - other[:, 0])
    kind = np.resize(kinds, count)
    origin = np.select([(kind == k)[:, None] for k in (3, 4, 5, 6)], [inner, one[:, 0], inner, one[:, 1]], origin)
    origin = origin.astype(np.float32)
    to = np.select([(kind == k)[:, None] for k in (1, 2, 5)], [other[:, 2], edge, one[:, 2]], aim)
    along = np.eye(3)[random.integers(0, 3, count)] * random.choice([-1, 1], (count, 1))
    direction = np.where((kind == 6)[:, None], along, to - origin).astype(np.float32)
    return origin, direction


def session_of(vertices: NDArray, faces: NDArray, settings: dict[str, str], device: str) -> Session:
    """A scene whose triangles are all mirrors, its frame run once."""
    prepared = small_scenes.make_scene(vertices, faces, [(5.0, 4.0, 3.0)])
    prepared = with_mirrors(prepared, np.ones(len(faces), dtype=np.uint8), 1)
    session = Session(make_method("bvh2", settings), prepared, SIDE, SIDE, device)
    session.answers(prepared.moment(0, SIDE, SIDE))
    return session


def answers_of(
    session: Session, seed: int, kinds: Sequence[int] = range(KINDS)
) -> tuple[dict[str, NDArray], dict[str, NDArray], int]:
    """Answers of the walk and of all triangles to :func:`rays_at`, and the number of pairs left to float64."""
    frame, rays = session.frame, session.method._rays
    points = frame.points.numpy()[frame.triangles.numpy()]
    points = points[np.isfinite(points).all(axis=(1, 2))]
    origin, direction = rays_at(points, kinds, seed)
    table, hits = frame.rays(1), frame.hits(1)
    table.origin.assign(origin)
    table.direction.assign(direction)
    table.active.fill_(1)
    rays.trace_listed(1)
    walked = {name: getattr(hits, name).numpy().copy() for name in ("triangle", "t", "u", "v")}
    wp.launch(
        specialised(brute_kernel, rays.effects.switches(bounce=1)),  # a flat mesh makes a wide frame
        dim=len(origin),
        inputs=[frame.triangle_count, frame.mesh, table],
        outputs=[hits],
        device=frame.device,
    )
    wanted = {name: getattr(hits, name).numpy().copy() for name in walked}
    return walked, wanted, rays.undecided_pairs()["mirror"]


def assert_as_walked(walked: dict[str, NDArray], wanted: dict[str, NDArray], device: str) -> None:
    """The answers of the walk are those of all triangles, for :func:`rays_at` of all kinds, to the last bit.

    A GPU fuses the sums of two kernels differently. Of a triangle whose plane contains the ray within rounding, that turns
    the last bits of t and of the weights, so there only the triangle and 20 bits of t are compared.
    """
    sure = np.ones(SIDE * SIDE, dtype=bool)
    if wp.get_device(device).is_cuda:
        sure = np.arange(SIDE * SIDE) % KINDS != IN_PLANE
        np.testing.assert_allclose(walked["t"], wanted["t"], rtol=2.0**-20)
    np.testing.assert_array_equal(walked["triangle"], wanted["triangle"], "triangle")
    for key, values in wanted.items():
        np.testing.assert_array_equal(walked[key][sure], values[sure], key)


RAYS = SIDE * SIDE
Triangles = tuple[NDArray, NDArray]


def stretched(mesh: Triangles, by: tuple[float, float, float], to: float = 0.0) -> Triangles:
    """A mesh scaled along each axis, then moved."""
    return np.asarray(mesh[0], np.float64).reshape(-1, 3) * by + to, mesh[1]


def twice(mesh: Triangles) -> Triangles:
    """Every triangle in its place a second time, turned over."""
    return mesh[0], np.concatenate([mesh[1], mesh[1][:, ::-1]])


def fans(size: float = 1.0) -> Triangles:
    """Flat squares of many triangles that meet at one corner, one above the other."""
    ring = np.linspace(0, 2 * np.pi, 25)[:-1]
    rim = np.stack([np.cos(ring), np.zeros_like(ring), np.sin(ring)], axis=-1)
    points = np.concatenate([np.concatenate([rim, [[0.0, 0.0, 0.0]]]) + [0, h, 0] for h in (-0.5, 0.0, 0.7)])
    k = np.arange(24)
    faces = np.concatenate([np.stack([k, (k + 1) % 24, np.full(24, 24)], axis=-1) + 25 * n for n in range(3)])
    return points * size, faces


def turned(mesh: Triangles) -> Triangles:
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
    assert_as_walked(walked, wanted, device)


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
