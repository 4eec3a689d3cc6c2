"""The order of hits, which is compared by keys only where distances nearly agree, is the order of the keys everywhere."""

import numpy as np
import pytest
import warp as wp
from shadowbench.methods.exact.triangle import depth_key, nearer_of, spare_bits


@wp.kernel(enable_backward=False)
def spare_kernel(triangles: wp.array(dtype=wp.int32), spare: wp.array(dtype=wp.int32)):
    i = wp.tid()
    spare[i] = spare_bits(triangles[i])


@wp.kernel(enable_backward=False)
def order_kernel(
    triangles: wp.int32,
    t: wp.array2d(dtype=wp.float64),
    name: wp.array2d(dtype=wp.int32),
    ordered: wp.array(dtype=wp.bool),
    by_keys: wp.array(dtype=wp.bool),
):
    i = wp.tid()
    ordered[i] = nearer_of(triangles, t[i, 0], name[i, 0], t[i, 1], name[i, 1])
    spare = spare_bits(triangles)
    key = depth_key(t[i, 0], spare)
    other = depth_key(t[i, 1], spare)
    by_keys[i] = key < other or (key == other and name[i, 0] < name[i, 1])


def test_spare_bits() -> None:
    """Those of 24 that no index needs, between 0 and 8."""
    counts = np.array([1, 2, 3, 255, 65535, 65536, 65537, 131072, 131073, 1 << 23, 1 << 24], dtype=np.int32)
    spare = wp.zeros(len(counts), dtype=wp.int32, device="cpu")
    wp.launch(spare_kernel, dim=len(counts), inputs=[wp.array(counts, device="cpu")], outputs=[spare], device="cpu")
    expected = [min(8, 24 - int(count - 1).bit_length()) for count in counts]
    assert spare.numpy().tolist() == expected


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
    arrays = [
        wp.array(values, dtype=kind, device="cpu")
        for values, kind in ((np.stack([first, second], axis=1), wp.float64), (names, wp.int32))
    ]
    results = [wp.zeros(number, dtype=wp.bool, device="cpu") for _ in range(2)]
    wp.launch(order_kernel, dim=number, inputs=[triangles, *arrays], outputs=results, device="cpu")
    ordered, by_keys = (result.numpy() for result in results)
    assert 0 < np.count_nonzero(by_keys) < number
    np.testing.assert_array_equal(ordered, by_keys)
