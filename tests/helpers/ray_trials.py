"""Rays that are hard to decide, traced as mirrored rays are; and the answers of all triangles tested in float64."""

from collections.abc import Sequence

import numpy as np
import warp as wp
from helpers import small_scenes
from helpers.mirror_scenes import with_mirrors
from numpy.typing import NDArray
from shadowbench.harness.frame.effects.specialise import specialised
from shadowbench.harness.frame.geometry import Hits, Mesh, Rays, corners_of, mirrored_ray, weld_of
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.methods.exact.triangle import hit_distance, hit_weights, nearer

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


def assert_same(walked: dict[str, NDArray], wanted: dict[str, NDArray], device: str) -> None:
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
