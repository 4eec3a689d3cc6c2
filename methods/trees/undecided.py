"""Leaving a pair of a triangle and a ray to float64, from within a native snippet.

``leave(at)``, of triangle ``at``, keeps it with the ray. After the traversal ``first`` and ``second`` are two of these
triangles, or -1; most rays that have doubts have no more. Each other one is an entry of ``doubts``: (triangle, the ray's
entry before, or -1), and ``last`` is the ray's last entry. ``counts`` counts all pairs, on beyond the capacity (the harness
then repeats the frame with more room).

Doubts are rare, and entering one takes 40 instructions and an atomic whose answer is waited for. That stays out of the loop
of a traversal: where ``kept`` passes :data:`MOST_KEPT` a ray leaves the loop, enters its doubts and continues in a second
one that has it.
"""

from __future__ import annotations

from ..gpu.reserve import WITHIN

MOST_KEPT = 14
"""A leaf, whose two triangles may add as many, is tested with at most this many kept."""

SOLID = {False: "", True: "&& masked.data[at] == 0"}
"""By whether triangles have holes: in place of ``SOLID`` in a leaf's text, what float32 needs to be certain of a hit on
triangle ``at``. Of a triangle with holes float64 decides whether the hit counts, so that each of its hits is a doubt."""


def solid_text(text: str, holes: bool) -> str:
    """The text of a leaf, where triangles have ``holes`` or none has."""
    return text.replace("SOLID", SOLID[holes])


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
        doubts.data[place] = wp::vec2i(at, last);
        last = place;
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
if (kept > 0) {
    first = doubtful[--kept];
    if (kept > 0) second = doubtful[--kept];
    number(second < 0 ? 1 : 2);
    enter_kept();
}
if (held > 0) {
    now = stack[--held];
    WALK
}
"""
"""After a loop that keeps doubts and that :data:`FULL_BREAK` may have ended with references still ``held`` on the stack."""

CHAIN = (
    """
int last = -1, first = -1, second = -1;
auto number = [&](int more) {
#if defined(__CUDA_ARCH__)
    atomicAdd(counts.data, more);
#else
    counts.data[0] += more;
#endif
};
"""
    + ENTER
    + KEEP
)
