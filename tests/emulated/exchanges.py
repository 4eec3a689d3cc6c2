"""A program for the emulated GPU: each function of a warp or a block, against what CUDA defines.

With a name of :data:`BROKEN`, that use of them, which must fail.
"""

import itertools
import sys
from collections.abc import Iterable, Iterator

import numpy as np
import warp as wp

LANES, WARPS, BLOCKS = 32, 4, 2
THREADS = LANES * WARPS
COUNT = THREADS * BLOCKS

MODULES = itertools.count()


def run_each(texts: Iterable[str], values: np.ndarray, count: int = COUNT) -> Iterator[np.ndarray]:
    """What each of ``count`` threads gets from C++ of its number v, for each text. All are compiled at once."""
    module = wp.get_module(f"exchanges_{next(MODULES)}")
    for kernel in [kernel_of(text, module) for text in texts]:
        given = wp.array(values, dtype=wp.int32, device="cpu")
        results = wp.zeros(len(values), dtype=wp.int32, device="cpu")
        wp.launch(kernel, dim=count, inputs=[given], outputs=[results], device="cpu", block_dim=THREADS)
        yield results.numpy()


def run(text: str, values: np.ndarray) -> np.ndarray:
    return next(run_each([text], values))


def kernel_of(text: str, module: wp.Module) -> wp.Kernel:
    @wp.func_native(f"return {text};")
    def body(v: wp.int32) -> wp.int32: ...

    @wp.kernel(enable_backward=False, grid_stride=False, module=module)
    def kernel(values: wp.array(dtype=wp.int32), results: wp.array(dtype=wp.int32)):
        k = wp.tid()
        results[k] = body(values[k])

    return kernel


ALL = "0xffffffffu"
LANE = "(threadIdx.x & 31)"


def right() -> None:
    """Every function, compared with numpy."""
    values = np.random.default_rng(3).integers(0, 50, COUNT, dtype=np.int32)
    warps = values.reshape(-1, LANES)
    lane = np.arange(LANES)
    low = (warps & 1) << lane
    odd = low.sum(axis=1).astype(np.uint32).astype(np.int32)[:, None]
    same = [[sum(1 << j for j in lane if row[j] == v) for v in row] for row in warps]
    expected = {
        f"__shfl_sync({ALL}, v, 5)": warps[:, [5] * LANES],
        f"__shfl_up_sync({ALL}, v, 3)": np.where(lane < 3, warps, np.roll(warps, 3, axis=1)),
        f"__shfl_down_sync({ALL}, v, 3)": np.where(lane > 28, warps, np.roll(warps, -3, axis=1)),
        f"__shfl_xor_sync({ALL}, v, 6)": warps[:, lane ^ 6],
        f"__shfl_sync({ALL}, v, 13, 8)": warps[:, (lane & ~7) + 5],
        f"__shfl_up_sync({ALL}, v, 3, 8)": np.where(lane % 8 < 3, warps, np.roll(warps, 3, axis=1)),
        f"__shfl_down_sync({ALL}, v, 3, 8)": np.where(lane % 8 > 4, warps, np.roll(warps, -3, axis=1)),
        f"__shfl_xor_sync({ALL}, v, 9, 8)": np.where(lane % 16 > 7, warps[:, lane ^ 9], warps),
        f"__ballot_sync({ALL}, v & 1)": odd,
        f"__any_sync({ALL}, v == 7)": (warps == 7).any(axis=1)[:, None],
        f"__all_sync({ALL}, v < 49)": (warps < 49).all(axis=1)[:, None],
        f"__match_any_sync({ALL}, v)": np.array(same, dtype=np.int64).astype(np.uint32).astype(np.int32),
        f"__reduce_max_sync({ALL}, v)": warps.max(axis=1)[:, None],
        f"__reduce_min_sync({ALL}, v)": warps.min(axis=1)[:, None],
        f"__reduce_add_sync({ALL}, v)": warps.sum(axis=1)[:, None],
        f"__reduce_and_sync({ALL}, v | 8)": np.bitwise_and.reduce(warps | 8, axis=1)[:, None],
        f"__reduce_or_sync({ALL}, v)": np.bitwise_or.reduce(warps, axis=1)[:, None],
        "__syncthreads_or(v == 7)": np.repeat((values.reshape(BLOCKS, THREADS) == 7).any(axis=1), WARPS)[:, None],
        # A part of the lanes, of which some do without the others.
        f"{LANE} < 8 ? __shfl_sync(0xffu, v, 2) : v": np.where(lane < 8, warps[:, [2] * LANES], warps),
        f"(__activemask() >> {LANE} & 1) ? v : -1": warps,
        # Reciprocals of zero, of a subnormal number that has no finite one, and of infinity.
        f"emulated_reciprocal(__int_as_float({LANE})) == __int_as_float(0x7f800000)": np.ones((1, LANES)),
        f"__fdividef((float){LANE}, 0.0f) == __int_as_float(0x7f800000)": (lane > 0)[None],
        "blockIdx.x * 100 + gridDim.x": np.repeat(np.arange(BLOCKS) * 100 + BLOCKS, WARPS)[:, None],
    }
    for (text, answer), given in zip(expected.items(), run_each(expected, values), strict=True):
        given = given.reshape(-1, LANES)
        np.testing.assert_array_equal(given, np.broadcast_to(answer, given.shape), err_msg=text)
    print(f"{len(expected)} functions agree")


def returned() -> None:
    """Lanes that have returned are waited for no longer and add nothing: a block whose last lanes have no work."""
    values = np.random.default_rng(4).integers(0, 50, COUNT, dtype=np.int32)
    last = slice(COUNT - LANES, COUNT - 5)
    row = values[last]
    expected = {
        f"__shfl_sync({ALL}, v, 0)": row[0],
        f"__popc(__ballot_sync({ALL}, 1))": len(row),
        f"__all_sync({ALL}, 1)": 1,
        f"__reduce_add_sync({ALL}, v)": row.sum(),
        f"__popc(__match_any_sync({ALL}, 7))": len(row),
        "(__syncwarp(), __syncthreads(), v)": row,
    }
    for (text, answer), given in zip(expected.items(), run_each(expected, values, COUNT - 5), strict=True):
        np.testing.assert_array_equal(given[last], np.broadcast_to(answer, row.shape), err_msg=text)


SHARED = """([&] {{
    __shared__ int kept[128];
    kept[threadIdx.x] = v;
    {wait}
    return kept[threadIdx.x ^ 1];
}}())"""

COPIED = """([&] {{
    __shared__ float4 kept[128];
    const float4 given[2] = {{{{1.0f, 2.0f, 3.0f, 4.0f}}, {{5.0f, 6.0f, 7.0f, 8.0f}}}};
    unsigned int place = (unsigned int)__cvta_generic_to_shared(kept + threadIdx.x);
    asm volatile("cp.async.cg.shared.global [%0], [%1], 16, %2;" :: "r"(place), "l"(given), "r"(16) : "memory");
    asm volatile("cp.async.wait_all;" ::: "memory");
    int sum = (int)kept[threadIdx.x].y;
    asm volatile("cp.async.cg.shared.global [%0], [%1], 16, %2;" :: "r"(place), "l"(given + 1), "r"(16) : "memory");
    asm volatile("cp.async.commit_group;" ::: "memory");
    {wait}
    return sum + (int)kept[threadIdx.x].x;
}}())"""


def copied(wait: str) -> None:
    """What threads copy to shared memory, and then to the same place again."""
    np.testing.assert_array_equal(run(COPIED.format(wait=wait), np.zeros(COUNT, dtype=np.int32)), 2 + 5)


BROKEN = {
    "no wait between lanes": lambda: shared(""),
    "no wait for a copy": lambda: copied("__syncwarp();"),
    "the last group is not waited for": lambda: copied('asm volatile("cp.async.wait_group 2;" ::: "memory");'),
    "shared memory that nobody has written": lambda: np.testing.assert_array_equal(
        run("([&] { __shared__ int kept[128]; return kept[threadIdx.x]; }())", np.zeros(COUNT, np.int32)), 0
    ),
    "lanes at another place": lambda: run(
        f"{LANE} ? __shfl_sync({ALL}, v, 0) : __syncthreads_or(v)", np.zeros(COUNT, np.int32)
    ),
    "masks that do not agree": lambda: run(
        f"{LANE} < 16 ? __shfl_sync({ALL}, v, 0) : __shfl_sync(0xffff0000u, v, 20)", np.zeros(COUNT, np.int32)
    ),
    "a lane outside its mask": lambda: run("__shfl_sync(0xfu, v, 0)", np.zeros(COUNT, np.int32)),
    "different exchanges": lambda: run(
        f"{LANE} ? (int)__ballot_sync({ALL}, v) : __shfl_sync({ALL}, v, 0)", np.zeros(COUNT, np.int32)
    ),
    "assembly without translation": lambda: run('([&] { asm("nop;"); return v; }())', np.zeros(COUNT, np.int32)),
}


def shared(wait: str) -> None:
    """Lanes that read what their neighbours wrote."""
    values = np.arange(1, COUNT + 1, dtype=np.int32)
    np.testing.assert_array_equal(run(SHARED.format(wait=wait), values), values[np.arange(COUNT) ^ 1])


if __name__ == "__main__":
    if sys.argv[1:]:
        BROKEN[sys.argv[1]]()
    else:
        right()
        returned()
        shared("__syncwarp();")
        shared("__syncthreads();")
        copied('asm volatile("cp.async.wait_all;" ::: "memory");')
