"""Places in lists that many threads write: one atomic for all lanes of a warp that want the same list.

A hundred thousand atomics on one address cost more than the work that they assign. On the CPU it is a plain addition, but in
:func:`number_among`.
Counters count on beyond a list's capacity: writers drop what does not fit, and the harness, which reads the
counters after the frame, throws the frame away and repeats it with more room. A counter of 32 bits that passes 2^31
continues with negative numbers: the places that it reserves from 2^30 on begin at :data:`BEYOND`, which no list reaches,
and :func:`counted` reads it.
"""

import numpy as np
import warp as wp
from numpy.typing import NDArray

BEYOND = 2**30
"""The place of everything from here on: no list of 32-bit places has more room (:func:`..common.pairs.grown`)."""

# As unsigned numbers, so that a negative place is beyond as well: written to, it would lie before the list. On the
# GPU the one lane that counts does this: after the shuffle, it made the compiler unroll the loops around it.
WITHIN = f"base = (unsigned int)base < {BEYOND}u ? base : {BEYOND};"

# Summed bit by bit, not lane by lane: numbers are short, and a vote of some lanes costs a quarter of their shuffle.
RESERVE = """
#if defined(__CUDA_ARCH__)
unsigned int active = __activemask();
int lane = threadIdx.x & 31;
unsigned int below = (1u << lane) - 1u;
{word} before = 0, sum = 0;
unsigned int rest = number;
#pragma unroll 1
for (int bit = 0; __any_sync(active, rest != 0); bit++, rest >>= 1) {{
    unsigned int with = __ballot_sync(active, rest & 1u);
    before += ({word})__popc(with & below) << bit;
    sum += ({word})__popc(with) << bit;
}}
int leader = __ffs(active) - 1;
{word} base = 0;
if (lane == leader) {{
    base = atomicAdd(({word}*)(counts.data + slot), sum);
    {within}
}}
return __shfl_sync(active, base, leader) + before;
#else
{word} base = counts.data[slot];
counts.data[slot] = base + number;
{within}
return base;
#endif
"""


@wp.func_native(RESERVE.format(word="int", within=WITHIN))
def reserve(counts: wp.array[wp.int32], slot: wp.int32, number: wp.int32) -> wp.int32: ...


@wp.func_native(RESERVE.format(word="unsigned long long", within=""))
def reserve_many(counts: wp.array[wp.int64], slot: wp.int32, number: wp.int32) -> wp.int64: ...


# Both atomics are under way at the same time.
@wp.func_native(f"""
#if defined(__CUDA_ARCH__)
unsigned int active = __activemask();
int lane = threadIdx.x & 31;
unsigned int below = (1u << lane) - 1u;
int before = 0, sum = 0;
unsigned int rest = number;
#pragma unroll 1
for (int bit = 0; __any_sync(active, rest != 0); bit++, rest >>= 1) {{
    unsigned int with = __ballot_sync(active, rest & 1u);
    before += __popc(with & below) << bit;
    sum += __popc(with) << bit;
}}
unsigned int ones = __ballot_sync(active, other);
int leader = __ffs(active) - 1, base = 0, other_base = 0;
if (lane == leader) {{
    base = atomicAdd(counts.data + slot, sum);
    other_base = atomicAdd(counts.data + other_slot, __popc(ones));
    {WITHIN}
    other_base = (unsigned int)other_base < {BEYOND}u ? other_base : {BEYOND};
}}
base = __shfl_sync(active, base, leader) + before;
return {{base, __shfl_sync(active, other_base, leader) + __popc(ones & below)}};
#else
int base = counts.data[slot], other_base = counts.data[other_slot];
counts.data[slot] = base + number;
counts.data[other_slot] = other_base + (other ? 1 : 0);
{WITHIN}
other_base = (unsigned int)other_base < {BEYOND}u ? other_base : {BEYOND};
return {{base, other_base}};
#endif
""")
def reserve_groups(
    counts: wp.array[wp.int32], slot: wp.int32, number: wp.int32, other_slot: wp.int32, other: wp.bool
) -> wp.vec2i:
    """Reserve ``number`` places in one list and, if ``other``, one in another."""


NUMBER_IN = """
#if defined(__CUDA_ARCH__)
unsigned int active = __activemask(), peers = {peers};
int lane = threadIdx.x & 31, leader = __ffs(peers) - 1, base = 0;
if (lane == leader) {{
    base = atomicAdd(counts.data + slot, __popc(peers));
    {within}
}}
return __shfl_sync(active, base, leader) + __popc(peers & ((1u << lane) - 1u));
#else
int base = {next_number};
{within}
return base;
#endif
"""


SAME_SLOT = "__match_any_sync(active, slot)"


@wp.func_native(NUMBER_IN.format(peers="active", within=WITHIN, next_number="counts.data[slot]++"))
def next_number(counts: wp.array[wp.int32], slot: wp.int32) -> wp.int32:
    """:func:`number_in`, where all lanes of a warp that call it have the same ``slot``."""


@wp.func_native(NUMBER_IN.format(peers=SAME_SLOT, within=WITHIN, next_number="counts.data[slot]++"))
def number_in(counts: wp.array[wp.int32], slot: wp.int32) -> wp.int32:
    """Raise a count by one and return what it was; lanes with the same ``slot`` share an atomic."""


@wp.func_native(
    NUMBER_IN.format(
        peers=SAME_SLOT, within=WITHIN, next_number="__atomic_fetch_add(counts.data + slot, 1, __ATOMIC_RELAXED)"
    )
)
def number_among(counts: wp.array[wp.int32], slot: wp.int32) -> wp.int32:
    """:func:`number_in`, atomic on a CPU, too, where kernels may run in several threads."""


@wp.func_native("""
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 800
unsigned int peers = __match_any_sync(__activemask(), slot);
int most = __reduce_max_sync(peers, value);
if ((threadIdx.x & 31) == __ffs(peers) - 1 && words.data[slot] < most) atomicMax(words.data + slot, most);
#elif defined(__CUDA_ARCH__)
if (words.data[slot] < value) atomicMax(words.data + slot, value);
#else
int *word = words.data + slot, known = __atomic_load_n(word, __ATOMIC_RELAXED);
while (known < value && !__atomic_compare_exchange_n(word, &known, value, true, __ATOMIC_RELAXED, __ATOMIC_RELAXED)) {}
#endif
""")
def raise_to(words: wp.array[wp.int32], slot: wp.int32, value: wp.int32):
    """Raise a word to at least ``value``; lanes with the same ``slot`` share an atomic. Atomic on a CPU, too."""


def counted(needed: NDArray[np.int64]) -> NDArray[np.int64]:
    """Counters of 32 bits as the numbers that were counted, up to 2^32: a counter passes 2^31 into the negative."""
    return needed & 0xFFFFFFFF
