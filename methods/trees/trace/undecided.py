"""Triangles that a traversal leaves to float64, kept with the ray or entered in a list.

Most rays leave none, and most others one or two. After the traversal ``first`` and ``second`` are two of a ray's
undecided triangles, or -1. Each other one is an entry of ``pairs``: (triangle, the ray's entry before, or -1), and
``last`` is the ray's last entry. ``count`` counts all of them, on beyond the capacity (the harness then repeats the frame
with more room).

Entering one takes 40 instructions and an atomic whose answer is waited for. That comes after the loop. Where a single ray
has kept more than :data:`MOST_KEPT` it leaves the loop, enters them and continues in a second one that enters each; a leaf,
whose two triangles may add as many, is tested with at most that many kept. In a packet, whose lanes stay together, a lane
enters what is more at once.
"""

import warp as wp

from ...gpu.reserve import WITHIN
from ..constants import MOST_KEPT


@wp.struct
class Undecided:
    """Where a launch enters its undecided triangles. count int32 [1]; pairs vec2i [capacity], shared with other launches."""

    count: wp.array[wp.int32]
    pairs: wp.array[wp.vec2i]


ENTER = f"""
auto never = []() {{ return false; }};
auto enter = [&](int at) {{
#if defined(__CUDA_ARCH__)
    unsigned int among = __activemask();
    int lane = threadIdx.x & 31, leader = __ffs(among) - 1, base = 0;
    if (lane == leader) {{
        base = atomicAdd(undecided.count.data, __popc(among));
        {WITHIN}
    }}
    int place = __shfl_sync(among, base, leader) + __popc(among & ((1u << lane) - 1u));
#else
    int base = undecided.count.data[0]++;
    {WITHIN}
    int place = base;
#endif
    if (place < undecided.pairs.shape[0]) {{
        undecided.pairs.data[place] = wp::vec2i(at, last);
        last = place;
    }}
}};
"""

KEPT = f"int kept[{MOST_KEPT} + 2], number = 0;\n"

HANDED_OVER = """
if (number > 0) {
    first = kept[--number];
    if (number > 0) second = kept[--number];
#if defined(__CUDA_ARCH__)
    atomicAdd(undecided.count.data, second < 0 ? 1 : 2);
#else
    undecided.count.data[0] += second < 0 ? 1 : 2;
#endif
#pragma unroll 1
    while (number > 0) enter(kept[--number]);
}
"""

TRAVERSED = {
    "float32": "bool found = traverse([](int) {}, []() { return false; });",
    "packet": f"""{ENTER}{KEPT}
auto leave = [&](int at) {{
    if (number < {MOST_KEPT}) kept[number++] = at;
    else enter(at);
}};
bool found = traverse(leave, never);
{HANDED_OVER}""",
    "exact": f"""{ENTER}{KEPT}
bool found = traverse([&](int at) {{ kept[number++] = at; }}, [&]() {{ return number > {MOST_KEPT}; }});
if (found) held = number = 0;
{HANDED_OVER}
if (held > 0) {{
    now = pop();
    found = traverse(enter, never);
}}
""",
}
"""How ``traverse(leave, full)`` is run: ``leave(at)`` takes an undecided triangle, ``full()`` says that no more can be
kept.
"""
