"""The sort of keys with what goes with them."""

import numpy as np
import pytest
import warp as wp
from shadowbench.methods.trees.builders.sort import Sort, count_digits

BLOCK = 256


@wp.kernel(enable_backward=False, grid_stride=False)
def count_kernel(
    count: wp.int32,
    passes: wp.int32,
    nothing: wp.int32,
    keys: wp.array(dtype=wp.int32),
    state: wp.array(dtype=wp.int32),
):
    i = wp.tid()
    key = nothing
    if i < count:
        key = keys[i]
    count_digits(key, nothing, nothing, passes, state)


@pytest.mark.parametrize("count", [1, 31, 2047, 2048, 2049, 70_000, 450_000])
@pytest.mark.parametrize("bits", [24, 30])
def test_sorting_is_stable(count, bits, device):
    random = np.random.default_rng(count)
    keys = random.integers(0, 2**bits if count % 2 else 300, count).astype(np.int32)
    nothing = 2**bits - 1
    keys[random.random(count) < 0.4] = nothing
    sort = Sort(count, bits, nothing, device)
    for _ in range(2):
        sort.unsorted.keys.assign(keys)
        sort.unsorted.values.assign(np.arange(count, dtype=np.int32))
        sort.state.zero_()
        inputs = [count, sort.passes, nothing, sort.unsorted.keys]
        threads = -(-count // BLOCK) * BLOCK
        wp.launch(count_kernel, threads, inputs, [sort.state], device=device, block_dim=BLOCK)
        sort.launch()
        wanted = np.argsort(keys, kind="stable")[: (keys < nothing).sum()]
        assert sort.held.numpy()[0] == len(wanted)
        np.testing.assert_array_equal(sort.sorted.values.numpy()[: len(wanted)], wanted)
        np.testing.assert_array_equal(sort.sorted.keys.numpy()[: len(wanted)], keys[wanted])
