"""Leaving a pair of a triangle and a ray to float64, from within a native snippet.

``leave(at)``, of triangle ``at``, takes an entry of ``doubts`` and continues to count beyond the capacity (the harness then
repeats the frame with more room). An entry is (triangle, :data:`OF_PIXEL`: the pixel; :data:`CHAIN`: the ray's entry
before, or -1).
"""

from __future__ import annotations

from ..common.reserve import WITHIN

LEAVE = f"""
auto leave = [&](int at) {{
#if defined(__CUDA_ARCH__)
    unsigned int among = __activemask();
    int lane = threadIdx.x & 31, leader = __ffs(among) - 1, base = 0;
    if (lane == leader) {{
        base = atomicAdd(counts.data, __popc(among));
        {WITHIN}
    }}
    int place = __shfl_sync(among, base, leader) + __popc(among & ((1u << lane) - 1u));
#else
    int base = counts.data[0]++;
    {WITHIN}
    int place = base;
#endif
    if (place < doubts.shape[0]) {{
        ENTRY
    }}
}};
"""

OF_PIXEL = LEAVE.replace("ENTRY", "doubts.data[place] = wp::vec2i(at, pixel);")

CHAIN = "int last = -1;\n" + LEAVE.replace("ENTRY", "doubts.data[place] = wp::vec2i(at, last); last = place;")
"""``last``: the entry that the ray added last. Each ray has its own chain."""
