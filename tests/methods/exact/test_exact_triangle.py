"""The float64 ray test: its bounds, as sharp where coordinates differ in size as where they do not, and wide enough; and the
order of hits, which is compared by keys only where distances nearly agree.

A power of two for each axis changes no bit of any product, sum or bound of sizes of components. So what a ray hits is the
same afterwards. A bound by the largest coordinate grows with the most stretched axis.
"""

import numpy as np
import pytest
import warp as wp
from helpers.launched import launched
from shadowbench.harness.frame.geometry import Corners, Ray
from shadowbench.methods.exact.triangle import depth_key, hit_distance, nearer_of, spare_bits

COUNT = 20_000


@wp.kernel
def distance_kernel(
    origins: wp.array(dtype=wp.vec3f), directions: wp.array(dtype=wp.vec3f), corners: wp.array2d(dtype=wp.vec3f),
    weld: wp.array(dtype=wp.vec3i), found: wp.array(dtype=wp.float64),
):  # fmt: skip
    i = wp.tid()
    triangle = Corners(corners[i, 0], corners[i, 1], corners[i, 2])
    found[i] = hit_distance(Ray(origins[i], directions[i]), triangle, weld[i])


def distances(origins: np.ndarray, directions: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """t of every ray with its own triangle, or -1."""
    weld = np.random.default_rng(5).random((len(corners), 3)).argsort(axis=1)
    inputs = [np.float32(origins), np.float32(directions), np.float32(corners), weld]
    (found,) = launched(distance_kernel, len(corners), inputs, [len(corners)])
    return found


def rays_at_edges(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles and rays that pass an edge of theirs at shares of 2^-10 to 2^-29 of their size, on either side."""
    corners = np.float32(random.normal(size=(COUNT, 3, 3)))
    origins = np.float32(random.normal(size=(COUNT, 3)) * 3)
    share, off = (random.uniform(size=COUNT), random.choice([-1.0, 1.0], COUNT) * 2.0 ** -random.uniform(10, 29, COUNT))
    weights = np.stack([share * (1 - off), (1 - share) * (1 - off), off], axis=1)
    # A long way to the point: the rounding of the direction is then less than what the ray is beside the edge.
    targets = np.einsum("ij,ijk->ik", weights, corners.astype(np.float64))
    return origins, np.float32(targets - origins), corners


def eyes_at_planes(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles seen from inside them, at heights of 2^-2 to 2^-20 of their size."""
    corners = np.float32(random.normal(size=(COUNT, 3, 3)))
    weights = random.dirichlet((1, 1, 1), COUNT)
    height = random.choice([-1.0, 1.0], COUNT) * 2.0 ** -random.uniform(2, 20, COUNT)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    origins = np.einsum("ij,ijk->ik", weights, corners) + normal * height[:, None]
    return np.float32(origins), np.float32(-normal * np.sign(height)[:, None]), corners


@pytest.mark.parametrize("rays", [rays_at_edges, eyes_at_planes])
@pytest.mark.parametrize("powers", [(30, 0, 0), (0, -25, 25), (-20, 20, -40)])
def test_axes_of_unlike_scale_change_no_answer(rays, powers) -> None:
    origins, directions, corners = rays(np.random.default_rng(3))
    plain = distances(origins, directions, corners)
    factors = np.float32(2.0) ** np.float32(powers)
    np.testing.assert_array_equal(distances(origins * factors, directions * factors, corners * factors), plain)
    assert 0.2 < (plain > 0).mean() <= 1.0


def test_an_eye_on_a_corner_or_in_the_plane_sees_nothing() -> None:
    """t is 0, whatever the sizes of the coordinates: in all of these the rounded height is not always 0."""
    random = np.random.default_rng(9)
    corners = np.float32(10.0 ** random.uniform(-8, 8, (COUNT, 3, 3)) * random.choice([-1.0, 1.0], (COUNT, 3, 3)))
    directions = np.float32(random.normal(size=(COUNT, 3)))
    for corner in range(3):
        np.testing.assert_array_equal(distances(corners[:, corner], directions, corners), -1.0)
    # Whole numbers in a plane, moved off 0 by some that are exact too: the height is exactly 0.
    whole = random.integers(-999, 1000, (COUNT, 3, 3)).astype(np.float64)
    place = random.integers(-9, 10, (COUNT, 2))
    e, f = whole[:, 1] - whole[:, 0], whole[:, 2] - whole[:, 0]
    within = whole[:, 0] + place[:, :1] * e + place[:, 1:] * f
    factors = 2.0 ** random.integers(-30, 30, (COUNT, 1, 3))
    tilted = np.float32(factors * whole), np.float32(factors[:, 0] * within)
    np.testing.assert_array_equal(distances(tilted[1], directions, tilted[0]), -1.0)


@wp.kernel(enable_backward=False)
def spare_kernel(triangles: wp.array(dtype=wp.int32), spare: wp.array(dtype=wp.int32)):
    i = wp.tid()
    spare[i] = spare_bits(triangles[i])


@wp.kernel(enable_backward=False)
def order_kernel(
    triangles: wp.int32, t: wp.array2d(dtype=wp.float64), name: wp.array2d(dtype=wp.int32),
    ordered: wp.array(dtype=wp.bool), by_keys: wp.array(dtype=wp.bool),
):  # fmt: skip
    i = wp.tid()
    ordered[i] = nearer_of(triangles, t[i, 0], name[i, 0], t[i, 1], name[i, 1])
    spare = spare_bits(triangles)
    key = depth_key(t[i, 0], spare)
    other = depth_key(t[i, 1], spare)
    by_keys[i] = key < other or (key == other and name[i, 0] < name[i, 1])


def test_spare_bits() -> None:
    """Those of 24 that no index needs, between 0 and 8."""
    counts = np.array([1, 2, 3, 255, 65535, 65536, 65537, 131072, 131073, 1 << 23, 1 << 24], dtype=np.int32)
    (spare,) = launched(spare_kernel, len(counts), [counts], [len(counts)])
    expected = [min(8, 24 - int(count - 1).bit_length()) for count in counts]
    assert spare.tolist() == expected


@pytest.mark.parametrize("triangles", [12, 70_000, 1 << 24])
def test_order_is_that_of_the_keys(triangles) -> None:
    random = np.random.default_rng(5)
    number = 200_000
    first = np.exp2(random.uniform(-300.0, 300.0, number))
    # Ratios of 1 +- 2^-20 to 2^-53, where keys may agree, and any.
    apart = np.exp2(random.uniform(-53.0, -20.0, number)) * random.choice([-1.0, 0.0, 1.0], number)
    second = np.where(
        random.random(number) < 0.9, first * (1.0 + apart), np.exp2(random.uniform(-300.0, 300.0, number))
    )
    names = random.integers(0, triangles, (number, 2)).astype(np.int32)
    inputs = [triangles, np.stack([first, second], axis=1), names]
    ordered, by_keys = launched(order_kernel, number, inputs, [number, number])
    assert 0 < np.count_nonzero(by_keys) < number
    np.testing.assert_array_equal(ordered, by_keys)
