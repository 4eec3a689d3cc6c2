"""Leaving a pair of a triangle and a ray to float64, from within a native snippet.

``leave(at)``, of triangle ``at``, keeps it with the ray; ``enter_kept()`` then gives each an entry of ``doubts``, and counts
on beyond the capacity (the harness then repeats the frame with more room). An entry is (triangle, :data:`OF_PIXEL`: the
pixel; :data:`CHAIN`: the ray's entry before, or -1).

Doubts are rare, and entering one takes 40 instructions and an atomic. That stays out of the loop of a traversal: where
``kept`` passes :data:`MOST_KEPT` a ray leaves the loop, enters its doubts and continues in a second one that has it.
"""

from __future__ import annotations

from ..common.reserve import WITHIN

MOST_KEPT = 14
"""A leaf, whose two triangles may add as many, is tested with at most this many kept."""

ENTER = f"""
auto enter = [&](int at) {{
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

KEEP = f"""
int doubtful[{MOST_KEPT} + 2], kept = 0;
auto leave = [&](int at) {{ doubtful[kept++] = at; }};
auto enter_kept = [&]() {{
#pragma unroll 1
    while (kept > 0) enter(doubtful[--kept]);
}};
"""

FULL_BREAK = f"if (kept > {MOST_KEPT}) break;"

CONTINUE = """
enter_kept();
if (held > 0) {
    now = stack[--held];
    WALK
}
"""
"""After a loop that keeps doubts and that :data:`FULL_BREAK` may have ended with references still ``held`` on the stack."""

OF_PIXEL = ENTER.replace("ENTRY", "doubts.data[place] = wp::vec2i(at, pixel);") + KEEP

CHAIN = (
    "int last = -1;\n"
    + ENTER.replace("ENTRY", "doubts.data[place] = wp::vec2i(at, last); last = place;")
    + KEEP
)
"""``last``: the entry that the ray added last. Each ray has its own chain."""
