"""The closest hit of a primary ray: traversal of the tree with a stack, for one ray or for the 32 rays of a warp
together.

A packet of rays has one stack and visits the union of the nodes that its rays visit: the warp votes which child comes
first (Wald et al. 2001; Guenther et al. 2007). So all lanes read the same nodes and triangles. It gives the answers of
single rays, which is how the CPU walks.

Exact: an edge plane or a depth that float32 does not decide, or a triangle with holes, leaves the pair to float64, and the
traversal continues without it. The current closest hit is always certain: a triangle replaces it only if it certainly lies
in front. Of two hits whose depths overlap within their bounds the second is left to float64.
"""

from __future__ import annotations

import functools
from typing import Any

import warp as wp

from ..native import BASICS, STACK
from ..nodes import INVERSE, OF_LEAF, PLAIN, READ, SHRINK, SLABS
from ..records.planes import DEPTH_UNITS, EYE_UNITS
from ..undecided import CHAIN, CONTINUE, FULL_BREAK, solid_text

EXACT_BEGIN = f"""
const float unit = 5.9604645e-08f, slack = shrink * (1.0f + 1.0f / 1048576.0f);
float length = size(d[0]) + size(d[1]) + size(d[2]);
const float bound = {EYE_UNITS} * unit * length + 1.0e-36f, wide = {DEPTH_UNITS} * unit * length + 1.0e-36f;
float sure_from = seen ? 0.0f : 3.4e38f, sure_to = 0.0f;
int best = -1;
"""

EXACT_LEAF = """
Quad p = fetch(records.data, 3 * at), q = fetch(records.data, 3 * at + 1), r = fetch(records.data, 3 * at + 2);
float e0 = fused(d[2], p.z, fused(d[1], p.y, d[0] * p.x));
float e1 = fused(d[2], q.y, fused(d[1], q.x, d[0] * p.w));
float e2 = fused(d[2], r.x, fused(d[1], q.w, d[0] * q.z));
float inside = low(e0, low(e1, e2));
if (!(inside < -bound)) {
    float depth = d[0] * r.y + d[1] * r.z + d[2] * r.w;
    float error = wide * high(size(r.y), high(size(r.z), size(r.w)));
    if (!(depth + error < sure_from)) {
        if (inside > bound && depth - error > sure_to SOLID) {
            best = at;
            sure_from = depth - error;
            sure_to = depth + error;
            limit = slack * high(about(sure_from), 1.2e-38f);
        } else if (REAL) {
            leave(at);
        }
    }
}
"""
"""``bound`` holds for edge planes, ``wide`` times the largest part of m for depths. Depths are 1 / t: nearer is larger.
``sure_from`` and ``sure_to`` bound the depth of the current closest hit."""

EXACT_END = """
return {real((unsigned int)first), real((unsigned int)second), real((unsigned int)last), real((unsigned int)best)};
"""

FLOAT32_BEGIN = """
float u = 0.0f, v = 0.0f;
int best = -1;
"""

FLOAT32_LEAF = """
Quad p = fetch(records.data, 3 * at), q = fetch(records.data, 3 * at + 1), r = fetch(records.data, 3 * at + 2);
float inverse = about(d[0] * p.x + d[1] * p.y + d[2] * p.z);
float s = (d[0] * q.x + d[1] * q.y + d[2] * q.z) * inverse;
float w = (d[0] * r.x + d[1] * r.y + d[2] * r.z) * inverse;
float t = p.w * inverse;
if (s >= 0.0f && w >= 0.0f && s + w <= 1.0f && t > 0.0f && t < limit) {
    limit = t;
    u = s;
    v = w;
    best = at;
}
"""

FLOAT32_END = "return {limit, u, v, real((unsigned int)best)};"

HELD = f"""
unsigned int stack[{STACK}];
int held = 0;
"""

SINGLE = """
while (now != NONE) {
    bool done = true;
    if (!(now & LEAF)) {
        READ
        SLABS
        if (met0 || met1) {
            bool second = met1 && (!met0 || near1 < near0);
            if (met0 && met1) stack[held++] = second ? ref0 : ref1;
            now = second ? ref1 : ref0;
            done = false;
        }
    } else {
        OF_LEAF
        FULL
    }
    if (done) {
        if (held == 0) break;
        now = stack[--held];
    }
}
"""
"""One step per iteration, down to a child or through a leaf, so that the lanes of a warp meet after each."""

PACKET = (
    f"""
__shared__ unsigned int stacks[4 * {STACK}];
volatile unsigned int* stack = stacks + {STACK} * (threadIdx.x >> 5);
const unsigned int ALL = 0xffffffffu;
bool leader = (threadIdx.x & 31) == 0;
int held = 0;
if (!seen) limit = -1.0f;
"""
    + """
while (now != NONE) {
    while (!(now & LEAF)) {
        READ
        SLABS
        unsigned int some0 = __ballot_sync(ALL, met0), some1 = __ballot_sync(ALL, met1);
        if (some0 && some1) {
            unsigned int for1 = __ballot_sync(ALL, met1 && (!met0 || near1 < near0));
            bool second = 2 * __popc(for1) > __popc(some0 | some1);
            if (leader) stack[held] = second ? ref0 : ref1;
            __syncwarp();
            held++;
            now = second ? ref1 : ref0;
        } else if (some0) {
            now = ref0;
        } else if (some1) {
            now = ref1;
        } else {
            if (held == 0) goto walked;
            now = stack[--held];
            __syncwarp();
        }
    }
    {
        OF_LEAF
    }
    if (held == 0) break;
    now = stack[--held];
    __syncwarp();
}
walked:;
"""
)
"""Blocks of 128 threads. A lane outside the image has a limit that no box is before."""


def walk_text(text: str, triangle: str, node_bytes: int, full: str = "") -> str:
    """:data:`SINGLE` or :data:`PACKET` with the test of a triangle, for a layout of nodes. ``full``: after each leaf."""
    text = text.replace("FULL", full)
    leaf = OF_LEAF.replace("TRIANGLE", triangle)
    return text.replace("READ", READ[node_bytes]).replace("SLABS", SLABS).replace("OF_LEAF", leaf)


def single_walk(triangle: str, node_bytes: int, exact: bool) -> str:
    """The loop of a ray with a stack of its own; ``now`` and ``limit`` are the root and how far the ray goes."""
    if not exact:
        return HELD + walk_text(SINGLE, triangle, node_bytes)
    keeping = walk_text(SINGLE, triangle, node_bytes, FULL_BREAK)
    entering = walk_text(SINGLE, triangle.replace("leave(", "enter("), node_bytes)
    return f"{HELD}{keeping}\n{CONTINUE.replace('WALK', entering)}"


@functools.cache
def make_walk(precision: str, packets: bool, node_bytes: int, holes: bool = False) -> Any:
    """A function of a ray that gives (t, u, v, bits of the closest triangle or of -1); exact: the bits of (first, second,
    last, triangle), with what it left (:mod:`..undecided`).

    ``seen`` is False in a lane without a ray; ``packets`` walks as one only where a warp does, on the GPU. ``holes``: an
    exact walk leaves hits of the triangles that are ``masked`` to float64.
    """
    exact = precision == "exact"
    triangle = solid_text(EXACT_LEAF, holes) if exact else FLOAT32_LEAF

    single = "if (!seen) now = NONE;" + single_walk(triangle.replace("REAL", "true"), node_bytes, exact)
    walking = single
    if packets:
        together = walk_text(PACKET, triangle.replace("REAL", "seen").replace("leave(", "enter("), node_bytes)
        walking = f"\n#if defined(__CUDA_ARCH__)\n{together}\n#else\n{single}\n#endif\n"

    @wp.func_native(
        BASICS
        + CHAIN
        + (SHRINK if exact else PLAIN)
        + "unsigned int now = (unsigned int)root.data[0];\nfloat limit = 3.4e38f;\nconst float tiny = 1.0e-37f;\n"
        + INVERSE
        + (EXACT_BEGIN if exact else FLOAT32_BEGIN)
        + walking
        + (EXACT_END if exact else FLOAT32_END)
    )
    def walk(
        seen: wp.bool,
        o: wp.vec3f,
        d: wp.vec3f,
        nodes: wp.array(dtype=wp.vec4f),
        root: wp.array(dtype=wp.int32),
        records: wp.array(dtype=wp.vec4f),
        reach: wp.array(dtype=wp.float32),
        masked: wp.array(dtype=wp.uint8),
        counts: wp.array(dtype=wp.int32),
        doubts: wp.array(dtype=wp.vec2i),
    ) -> wp.vec4f: ...

    return walk
