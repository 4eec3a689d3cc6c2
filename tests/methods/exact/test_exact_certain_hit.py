"""What the end of a primary ray computes in fewer instructions: quotients (``division.py``), and the same numbers as
the functions that methods share.
"""

import numpy as np
import pytest
import warp as wp
from helpers.launched import launched
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
    (found,) = launched(quotient_kernel, COUNT, [a, b], [COUNT], device)
    np.testing.assert_array_equal(found, a / b)


@pytest.mark.parametrize("size", [1.0, 1e-3, 30.0])
def test_certain_hits_are_those_of_the_shared_functions(size, device):
    """Of some origins that are so far away that every hit point is vague."""
    random = np.random.default_rng(7)
    corners = random.normal(0, 1, (COUNT, 1, 3)) + random.normal(0, size, (COUNT, 3, 3))
    corners = corners.astype(np.float32)
    extent = float(np.abs(corners).max())
    far = np.arange(COUNT) % 7 == 0
    origin = np.where(
        far[:, None], random.choice([-1.0, 1.0], (COUNT, 3)) * 1100 * extent, random.normal(0, 2, (COUNT, 3))
    )
    origin = origin.astype(np.float32)
    weights = random.dirichlet((1, 1, 1), COUNT)
    weights[::5] = [1, 0, 0]  # at a corner
    direction = ((weights[:, :, None] * corners).sum(axis=1) - origin).astype(np.float32)
    welds = random.permuted(np.tile(np.arange(3, dtype=np.int32), (COUNT, 1)), axis=1)
    inputs = [origin, direction, corners, welds, extent]
    t, uv, vague = launched(hit_kernel, COUNT, inputs, [(2, COUNT)] * 3, device)
    for found in (t, uv, vague):
        np.testing.assert_array_equal(*found)
    left = vague[0].astype(bool)
    assert left[far].all()
    assert 0 < left[~far].sum() < COUNT / 10
