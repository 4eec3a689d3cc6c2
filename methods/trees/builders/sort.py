"""Sorting keys with their triangles on the GPU, in place in a captured graph: a radix sort with one sweep per digit.

Adinets & Merrill, "Onesweep: A Faster Least Significant Digit Radix Sort for GPUs" (2022): the digits of all keys are
counted once; then each pass reads and writes every key once. A block takes the next tile, ranks its keys by digit within
the block, and learns how many keys of each digit lie in the tiles before by looking back over the counts that their
blocks published: a count of their own, or of all up to them (Merrill & Garland 2016). It is stable: triangles with one
key stay in their order.

Who writes the keys counts their digits. The first pass leaves out keys that stand for nothing; the others read and write
what is left.

Warp's own sort, which takes scratch memory each time and copies an odd number of passes back, sorts on the CPU.
"""

import functools
from typing import Any

import numpy as np
import warp as wp

from ....harness.frame.geometry import filled
from ..constants import MANY_KEYS, SORT_THREADS, TILES_AT_ONCE

DIGIT = 8
DIGITS = 1 << DIGIT

COUNT = f"""
#if defined(__CUDA_ARCH__)
__shared__ int found[4 * {DIGITS}];
for (int k = threadIdx.x; k < passes * {DIGITS}; k += blockDim.x) found[k] = 0;
__syncthreads();
const unsigned int keys[2] = {{(unsigned int)first, (unsigned int)second}};
for (unsigned int key : keys) {{
    if (key == (unsigned int)nothing) continue;
    for (int pass = 0; pass < passes; pass++)
        atomicAdd(found + pass * {DIGITS} + ((key >> pass * {DIGIT}) & {DIGITS - 1}), 1);
}}
__syncthreads();
for (int k = threadIdx.x; k < passes * {DIGITS}; k += blockDim.x)
    if (found[k]) atomicAdd(state.data + k, found[k]);
#endif
"""

SWEEP = (
    f"""
#if defined(__CUDA_ARCH__)
constexpr unsigned int ALL = 0xffffffffu, OWN = 1u << 30, UPTO = 2u << 30, NUMBER = OWN - 1u;
constexpr int WARPS = {SORT_THREADS} / 32;
__shared__ int of_warp[WARPS][{DIGITS}];
__shared__ int base[{DIGITS}];
__shared__ int sums[2][WARPS];
__shared__ unsigned int kept[{SORT_THREADS} * ITEMS];
__shared__ int taken;
int thread = threadIdx.x, lane = thread & 31, warp = thread >> 5;
"""
    + """
if (pass_ > 0) count = held.data[0];
if (thread == 0) taken = atomicAdd(state.data + 4 * DIGITS + pass_, 1);
for (int k = 0; k < WARPS; k++) of_warp[k][thread] = 0;
__syncthreads();
int tile = taken, first = tile * SORT_THREADS * ITEMS + warp * 32 * ITEMS + lane;
if (pass_ > 0 && tile * SORT_THREADS * ITEMS >= count) return;
unsigned int key[ITEMS];
int rank[ITEMS], shift = pass_ * DIGIT;
#pragma unroll
for (int k = 0; k < ITEMS; k++) key[k] = first + 32 * k < count ? source.keys.data[first + 32 * k] : (unsigned int)nothing;
#pragma unroll
for (int k = 0; k < ITEMS; k++) {
    int digit = (key[k] >> shift) & (DIGITS - 1), before = 0;
    bool some = key[k] != (unsigned int)nothing;
    unsigned int peers = __match_any_sync(ALL, some ? digit : DIGITS);
    int leader = __ffs(peers) - 1;
    if (some && lane == leader) {
        before = of_warp[warp][digit];
        of_warp[warp][digit] = before + __popc(peers);
    }
    rank[k] = __shfl_sync(ALL, before, leader) + __popc(peers & ((1u << lane) - 1u));
    __syncwarp();
}
__syncthreads();
// From here a thread is a digit.
int own = 0;
for (int k = 0; k < WARPS; k++) {
    int here = of_warp[k][thread];
    of_warp[k][thread] = own;
    own += here;
}
volatile unsigned int* told = (volatile unsigned int*)state.data + 4 * DIGITS + 32 + (size_t)pass_ * tiles * DIGITS;
if (tile < tiles - 1) told[tile * DIGITS + thread] = (tile ? OWN : UPTO) | (unsigned int)own;
// Keys of smaller digits, of all tiles and of this one.
int number = state.data[pass_ * DIGITS + thread], smaller = number, inner = own;
for (int step = 1; step < 32; step <<= 1) {
    int other = __shfl_up_sync(ALL, smaller, step), other_inner = __shfl_up_sync(ALL, inner, step);
    if (lane >= step) smaller += other, inner += other_inner;
}
if (lane == 31) sums[0][warp] = smaller, sums[1][warp] = inner;
__syncthreads();
smaller -= number;
inner -= own;
int here = 0, all_keys = 0;
for (int k = 0; k < WARPS; k++) {
    if (k < warp) smaller += sums[0][k], inner += sums[1][k];
    all_keys += sums[0][k], here += sums[1][k];
}
if (pass_ == 0 && tile == 0 && thread == 0) held.data[0] = all_keys;
for (int k = 0; k < WARPS; k++) of_warp[k][thread] += inner;
int value[ITEMS], earlier = 0;
#pragma unroll
for (int k = 0; k < ITEMS; k++) value[k] = first + 32 * k < count ? source.values.data[first + 32 * k] : 0;
for (int back = tile - 1; back >= 0; back -= TILES_AT_ONCE) {
    unsigned int said[TILES_AT_ONCE];
#pragma unroll
    for (int k = 0; k < TILES_AT_ONCE; k++) said[k] = back - k < 0 ? UPTO : told[(back - k) * DIGITS + thread];
    bool all = false;
#pragma unroll
    for (int k = 0; k < TILES_AT_ONCE; k++) {
        while (!all && said[k] < OWN) said[k] = told[(back - k) * DIGITS + thread];
        if (!all) earlier += said[k] & NUMBER;
        all = all || said[k] >= UPTO;
    }
    if (all) break;
}
if (tile && tile < tiles - 1) told[tile * DIGITS + thread] = UPTO | (unsigned int)(earlier + own);
base[thread] = smaller + earlier - inner;
__syncthreads();
// Through shared memory in the order of digits, so that neighbours are written together.
#pragma unroll
for (int k = 0; k < ITEMS; k++) {
    rank[k] += of_warp[warp][(key[k] >> shift) & (DIGITS - 1)];
    if (key[k] != (unsigned int)nothing) kept[rank[k]] = key[k];
}
__syncthreads();
int place[ITEMS];
#pragma unroll
for (int k = 0; k < ITEMS; k++) {
    int at = thread + SORT_THREADS * k;
    unsigned int sorted = kept[at];
    place[k] = at < here ? base[(sorted >> shift) & (DIGITS - 1)] + at : -1;
    if (place[k] >= 0) target.keys.data[place[k]] = sorted;
}
__syncthreads();
#pragma unroll
for (int k = 0; k < ITEMS; k++)
    if (key[k] != (unsigned int)nothing) kept[rank[k]] = value[k];
__syncthreads();
#pragma unroll
for (int k = 0; k < ITEMS; k++)
    if (place[k] >= 0) target.values.data[place[k]] = kept[thread + SORT_THREADS * k];
#endif
"""
)


@wp.struct
class Pairs:
    """keys, values int32 [count]: what is sorted, and what goes with it."""

    keys: wp.array[wp.int32]
    values: wp.array[wp.int32]


@wp.func_native(COUNT)
def count_digits(first: wp.int32, second: wp.int32, nothing: wp.int32, passes: wp.int32, state: wp.array[wp.int32]):
    """Count the digits of two keys for all passes at once. Called by all threads of a block, on a GPU."""


@functools.cache
def make_sweep_kernel(items: int) -> Any:
    """One pass: a block of :data:`SORT_THREADS` for each tile of ``items`` keys per thread."""
    sizes = f"constexpr int DIGIT = {DIGIT}, DIGITS = {DIGITS}, ITEMS = {items};"
    tuned = f"constexpr int SORT_THREADS = {SORT_THREADS}, TILES_AT_ONCE = {TILES_AT_ONCE};"

    @wp.func_native(sizes + tuned + SWEEP)
    def sweep(
        count: wp.int32,
        pass_: wp.int32,
        tiles: wp.int32,
        nothing: wp.int32,
        source: Pairs,
        state: wp.array[wp.int32],
        held: wp.array[wp.int32],
        target: Pairs,
    ): ...

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique")
    def sweep_kernel(
        count: wp.int32,
        pass_: wp.int32,
        tiles: wp.int32,
        nothing: wp.int32,
        source: Pairs,
        state: wp.array[wp.int32],
        held: wp.array[wp.int32],
        target: Pairs,
    ):
        sweep(count, pass_, tiles, nothing, source, state, held, target)

    return sweep_kernel


def passes_of(bits: int) -> int:
    """One for each digit."""
    return -(-bits // DIGIT)


class Sort:
    """Sorts ``count`` pairs by keys of so many ``bits``. Keys that are ``nothing``, no smaller than any other, are left out.

    unsorted  what is to be sorted: the same memory each time
    sorted    the result; held int32 [1]: how many there are
    state     int32: digits' counts [4, 256] (:func:`count_digits`), tickets [32], and the counts that tiles publish
              [passes, tiles, 256]; zeros before the digits are counted. Empty on a CPU
    """

    def __init__(self, count: int, bits: int, nothing: int, device: str):
        self.count, self.bits, self.nothing = count, bits, nothing
        self.device = wp.get_device(device)
        self.passes = passes_of(bits)
        self.items = 8 if count < MANY_KEYS else 16
        self.tiles = -(-count // (SORT_THREADS * self.items))
        words = 4 * DIGITS + 32 + self.passes * self.tiles * DIGITS
        with wp.ScopedDevice(device):
            self.keys, self.values = (wp.zeros(2 * count, dtype=wp.int32) for _ in range(2))
            self.state = wp.zeros(words if self.device.is_cuda else 0, dtype=wp.int32)
            self.held = wp.zeros(1, dtype=wp.int32)
        parts = slice(0, count), slice(count, 2 * count)
        self._halves = [filled(Pairs, keys=self.keys[part], values=self.values[part]) for part in parts]
        self.sorted = self._halves[0]
        self.unsorted = self._halves[self.passes % 2 if self.device.is_cuda else 0]

    def launch(self) -> None:
        """Sort what is in ``unsorted``, with its digits counted."""
        if self.device.is_cpu:
            wp.utils.radix_sort_pairs(self.keys, self.values, self.count, 0, self.bits)
            self.held.numpy()[0] = np.searchsorted(self.keys.numpy()[: self.count], self.nothing)
            return
        for k in range(self.passes):
            source, target = self._halves[(self.passes + k) % 2], self._halves[(self.passes + k + 1) % 2]
            inputs = [self.count, k, self.tiles, self.nothing, source, self.state]
            wp.launch(
                make_sweep_kernel(self.items), SORT_THREADS * self.tiles, inputs, [self.held, target],
                device=self.device, block_dim=SORT_THREADS,
            )  # fmt: skip
