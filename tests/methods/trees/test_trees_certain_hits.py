"""What the end of a primary ray computes in fewer instructions: the same numbers as the functions that methods share."""

import numpy as np
import pytest
import warp as wp
from shadowbench.harness.frame.geometry import Corners, Ray
from shadowbench.methods.exact.certain_hit import certain_hit, is_far
from shadowbench.methods.exact.hit_point import is_vague, plane_distance
from shadowbench.methods.exact.triangle import hit_weights
from shadowbench.methods.gpu.division import quotient, reciprocal

COUNT = 20_000


@wp.kernel(enable_backward=False)
def quotient_kernel(a: wp.array(dtype=wp.float64), b: wp.array(dtype=wp.float64), found: wp.array(dtype=wp.float64)):
    i = wp.tid()
    found[i] = quotient(a[i], b[i], reciprocal(b[i]))


@wp.kernel(enable_backward=False)
def hit_kernel(
    o: wp.array(dtype=wp.vec3f), d: wp.array(dtype=wp.vec3f), corners: wp.array2d(dtype=wp.vec3f),
    welds: wp.array(dtype=wp.vec3i), extent: wp.float32, t: wp.array2d(dtype=wp.float64), uv: wp.array2d(dtype=wp.vec2f),
    vague: wp.array2d(dtype=wp.uint8),
):  # fmt: skip
    i = wp.tid()
    ray = Ray(o[i], d[i])
    triangle = Corners(corners[i, 0], corners[i, 1], corners[i, 2])
    hit = certain_hit(ray, triangle, welds[i])
    t[0, i] = hit.t
    t[1, i] = plane_distance(ray, triangle)
    uv[0, i] = hit.uv
    uv[1, i] = hit_weights(ray, triangle, welds[i])
    vague[0, i] = wp.uint8(hit.flat or is_far(ray.origin, extent))
    vague[1, i] = wp.uint8(is_vague(ray, triangle))


def products(random: np.random.Generator, count: int) -> np.ndarray:
    """Numbers of the sizes that sums of products of three float32 numbers have, with either sign."""
    return random.choice([-1.0, 1.0], count) * random.uniform(1, 2, count) * 2.0 ** random.integers(-440, 380, count)


def test_a_quotient_is_that_of_a_division(device):
    random = np.random.default_rng(5)
    a, b = products(random, COUNT), products(random, COUNT)
    a[:10] = 0.0
    near = np.arange(10, COUNT // 2)  # quotients next to a number of 53 bits, and halfway between two
    a[near] = b[near] * (1.0 + random.integers(0, 2**20, len(near)) * 2.0**-53)
    found = wp.zeros(COUNT, dtype=wp.float64, device=device)
    wp.launch(
        quotient_kernel,
        dim=COUNT,
        inputs=[wp.array(a, device=device), wp.array(b, device=device)],
        outputs=[found],
        device=device,
    )
    np.testing.assert_array_equal(found.numpy(), a / b)


@pytest.mark.parametrize("size", [1.0, 1e-3, 30.0])
def test_certain_hits_are_those_of_the_shared_functions(size, device):
    random = np.random.default_rng(7)
    corners = random.normal(0, 1, (COUNT, 1, 3)) + random.normal(0, size, (COUNT, 3, 3))
    corners = corners.astype(np.float32)
    origin = random.normal(0, 2, (COUNT, 3)).astype(np.float32)
    weights = random.dirichlet((1, 1, 1), COUNT)
    weights[::5] = [1, 0, 0]  # at a corner
    direction = ((weights[:, :, None] * corners).sum(axis=1) - origin).astype(np.float32)
    welds = random.permuted(np.tile(np.arange(3, dtype=np.int32), (COUNT, 1)), axis=1)
    t = wp.zeros((2, COUNT), dtype=wp.float64, device=device)
    uv = wp.zeros((2, COUNT), dtype=wp.vec2f, device=device)
    vague = wp.zeros((2, COUNT), dtype=wp.uint8, device=device)
    rays = [wp.array(values, dtype=wp.vec3f, device=device) for values in (origin, direction, corners)]
    wp.launch(
        hit_kernel,
        dim=COUNT,
        inputs=[*rays, wp.array(welds, dtype=wp.vec3i, device=device), float(np.abs(corners).max())],
        outputs=[t, uv, vague],
        device=device,
    )
    np.testing.assert_array_equal(*t.numpy())
    np.testing.assert_array_equal(*uv.numpy())
    np.testing.assert_array_equal(*vague.numpy())
    assert 0 < vague.numpy()[0].sum() < COUNT / 10


def test_a_far_eye_makes_every_hit_point_vague(device):
    @wp.kernel(enable_backward=False, module="unique")
    def far_kernel(origins: wp.array(dtype=wp.vec3f), far: wp.array(dtype=wp.uint8)):
        i = wp.tid()
        far[i] = wp.uint8(is_far(origins[i], 2.0))

    origins = wp.array([(0.0, 1000.0, 0.0), (0.0, 0.0, -1100.0)], dtype=wp.vec3f, device=device)
    far = wp.zeros(2, dtype=wp.uint8, device=device)
    wp.launch(far_kernel, dim=2, inputs=[origins], outputs=[far], device=device)
    assert far.numpy().tolist() == [0, 1]
