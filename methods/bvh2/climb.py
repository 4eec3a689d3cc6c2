"""Climbing a radix tree of sorted keys from its leaves without building it first (Apetrei 2014, section 3).

A node is a range of leaves [l, r]. Its parent joins it to the range on that side where the keys differ less, seen by
the difference of the keys at both ends; equal differences are told apart by the places themselves, as if each key
went on with the bits of its place (Karras 2012, section 4). So a tree of keys of b bits and up to 2^24 triangles is at
most b + 24 deep, also where all keys are one.

The parent of a left child [l, r] and of the right child [r + 1, s] has the flag r. Whoever comes first leaves the far end
of its range and the difference there, and stops; who comes second goes on with both. The tree ends before the first
triangle that is left out (:mod:`.keys`).

On the GPU an exchange of a flag releases what was written before it, and acquires what the first arrival wrote.
"""

from __future__ import annotations

CLIMB = """
typedef unsigned long long Flag;
const Flag EMPTY = ~0ull;
auto gap = [&](int k) {
    if (k < 0 || k + 1 >= count || keys.data[k + 1] == last) return NONE;
    return (unsigned int)(keys.data[k] ^ keys.data[k + 1]);
};
auto is_left = [&](int l, int r, unsigned int before, unsigned int after) {
    if (before == NONE || after == NONE) return before == NONE;
    return before != after ? after < before : (unsigned int)(r ^ (r + 1)) < (unsigned int)((l - 1) ^ l);
};
auto far_end = [&](int end, unsigned int difference) { return ((Flag)difference << 32) | (unsigned int)end; };
#if defined(__CUDA_ARCH__)
auto exchange = [&](int k, Flag value) {
    Flag before;
    asm volatile("atom.acq_rel.gpu.global.exch.b64 %0, [%1], %2;"
                 : "=l"(before) : "l"((Flag*)flags.data + k), "l"(value) : "memory");
    return before;
};
auto peek = [&](int k) {
    Flag value;
    asm volatile("ld.acquire.gpu.global.u64 %0, [%1];" : "=l"(value) : "l"((Flag*)flags.data + k) : "memory");
    return value;
};
#else
auto exchange = [&](int k, Flag value) {
    Flag before = flags.data[k];
    flags.data[k] = value;
    return before;
};
auto peek = [&](int k) { return (Flag)flags.data[k]; };
#endif
auto box_of = [&](int k, float* box) {
    wp::vec3i face = triangles.data[values.data[k]];
    const float* a = (const float*)(points.data + face[0]);
    const float* b = (const float*)(points.data + face[1]);
    const float* c = (const float*)(points.data + face[2]);
    for (int axis = 0; axis < 3; axis++) {
        box[axis] = low(a[axis], low(b[axis], c[axis]));
        box[axis + 3] = high(a[axis], high(b[axis], c[axis]));
    }
};
"""
