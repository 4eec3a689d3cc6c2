"""Whether anything lies between a hit point and a light: any hit counts, so the traversal ends at the first certain one.

Rays are traced from the light to the hit point: those of a warp, whose hit points are neighbours, then share the nodes
near the light. That is valid as long as the light is not farther than boxes are padded for (:mod:`..nodes`). For a light
beyond ``reach`` the same segment is traversed from the hit point. The end at which it starts only decides which boxes are
met first: triangles are tested by planes (:mod:`..records.planes`).
"""

from __future__ import annotations

import functools
from typing import Any

import warp as wp

from ..native import BASICS, STACK
from ..nodes import INVERSE, OF_LEAF, PLAIN, READ, SLABS
from ..records.planes import LIGHT_UNITS
from ..undecided import CHAIN, CONTINUE, FULL_BREAK, solid_text

EXACT_LEAF = """
const auto* planes = records.data + 3 * at;
Quad p = fetch(planes, 0), q = fetch(planes, 1), r = fetch(planes, 2);
float e0 = fused(h[2], p.z, fused(h[1], p.y, fused(h[0], p.x, p.w)));
float e1 = fused(h[2], q.z, fused(h[1], q.y, fused(h[0], q.x, q.w)));
float e2 = fused(h[2], r.z, fused(h[1], r.y, fused(h[0], r.x, r.w)));
float inside = low(e0, low(e1, e2));
if (!(inside < -bound) && at != own) {
    Quad s = fetch(sides.data, at);
    float side = fused(h[2], s.z, fused(h[1], s.y, fused(h[0], s.x, s.w)));
    if (!(side > bound)) {
        if (inside > bound && side < -bound SOLID) HIDDEN
        leave(at);
    }
}
"""
"""``side``: positive where the hit point lies on the light's side of the triangle."""

FLOAT32_LEAF = """
Quad p = fetch(records.data, 3 * at), q = fetch(records.data, 3 * at + 1), r = fetch(records.data, 3 * at + 2);
float inverse = about(d[0] * p.x + d[1] * p.y + d[2] * p.z);
float s = (d[0] * q.x + d[1] * q.y + d[2] * q.z) * inverse;
float w = (d[0] * r.x + d[1] * r.y + d[2] * r.z) * inverse;
float t = p.w * inverse;
if (s >= 0.0f && w >= 0.0f && s + w <= 1.0f && t > 0.0f && t < limit && at != own) return 1;
"""

BEGIN = {
    "exact": f"""
const float bound = {LIGHT_UNITS} * 5.9604645e-08f * extent.data[0] + 1.0e-36f, limit = 1.0f;
const float far = high(size(light[0]), high(size(light[1]), size(light[2])));
const bool near = far <= reach.data[0];
const wp::vec3f o = near ? light : h;
const wp::vec3f d = near ? wp::vec3f(h[0] - light[0], h[1] - light[1], h[2] - light[2])
                         : wp::vec3f(light[0] - h[0], light[1] - h[1], light[2] - h[2]);
const float tiny = reach.data[0] * 8.3e-25f + 1.0e-37f;
const unsigned short sides_seen = reinterpret_cast<const unsigned short*>(facing.data)[own >> 1];
const int spared = sides_seen == 0x0101 || sides_seen == 0x0202 ? own | 1 : -1;
""",
    "float32": """
const float limit = 1.0f - 1.0e-4f, tiny = 1.0e-20f;
const wp::vec3f o = light, d = wp::vec3f(h[0] - light[0], h[1] - light[1], h[2] - light[2]);
""",
}

BEFORE = f"""
unsigned int stack[{STACK}], now = (unsigned int)root.data[0];
int held = 0;
if (now == NONE) NONE_THERE
"""

WALK = """
while (true) {
    if (!(now & LEAF)) {
        READ
        SLABS
        if (met0 || met1) {
            bool second = met1 && (!met0 || near1 < near0);
            if (met0 && met1) stack[held++] = second ? ref0 : ref1;
            now = second ? ref1 : ref0;
        } else {
            if (held == 0) break;
            now = stack[--held];
        }
    }
    if (now & LEAF) {
        OF_LEAF
        FULL
        if (held == 0) break;
        now = stack[--held];
    }
}
"""


UNLESS_SPARED = "if ((at | 1) != spared) {\n"
"""A leaf with the hit triangle and, at most, one that does not hide it (:mod:`..records.planes`) is left out."""

NOTHING = (-1, -1, -1)
HIDING = -2
"""What an exact walk gives is (last, first, second) of the ray's doubts (:mod:`..undecided`): without any, nothing hides the
hit point. (:data:`HIDING`, -1, -1) if a triangle certainly does."""

RETURN_NOTHING = "return {-1, -1, -1};"
RETURN_HIDING = f"return {{{HIDING}, -1, -1}};"

HIDDEN = "{ hidden = 1, held = 0, kept = 0; goto walked; }"
"""The end of a ray with a certain occluder: where those of the others end, so that the lanes of a warp meet. Its doubts do
not matter."""


def exact_walk(node_bytes: int, holes: bool) -> str:
    """The traversal of an exact ray."""
    leaf = OF_LEAF.replace("TRIANGLE", solid_text(EXACT_LEAF, holes))
    leaf = leaf.replace("#pragma", UNLESS_SPARED + "#pragma") + "}\n"
    walk = walk_text(node_bytes, leaf)
    entering = walk.replace("FULL", "").replace("leave(", "enter(").replace("HIDDEN", RETURN_HIDING)
    keeping = walk.replace("FULL", FULL_BREAK).replace("HIDDEN", HIDDEN)
    return (
        BEFORE.replace("NONE_THERE", RETURN_NOTHING)
        + f"int hidden = 0;\n{keeping}walked:;\n{CONTINUE.replace('WALK', entering)}if (hidden) {RETURN_HIDING}\n"
        + "return {last, first, second};"
    )


def float32_walk(node_bytes: int) -> str:
    """The traversal of a float32 ray."""
    walk = walk_text(node_bytes, OF_LEAF.replace("TRIANGLE", FLOAT32_LEAF)).replace("FULL", "")
    return BEFORE.replace("NONE_THERE", "return 0;") + walk + "return 0;"


def walk_text(node_bytes: int, leaf: str) -> str:
    return WALK.replace("READ", READ[node_bytes]).replace("SLABS", SLABS).replace("OF_LEAF", leaf)


@functools.cache
def make_shadow_walk(precision: str, node_bytes: int, holes: bool = False) -> Any:
    """A function of the hit point h and the light: whether something other than the triangle ``own`` lies between, as 0 or 1
    or, of an exact ray, as :data:`HIDING` says. ``holes``: hits of the triangles that are ``masked`` are left to float64."""
    if precision == "exact":

        @wp.func_native(BASICS + CHAIN + BEGIN["exact"] + PLAIN + INVERSE + exact_walk(node_bytes, holes))
        def walk(
            h: wp.vec3f,
            light: wp.vec3f,
            own: wp.int32,
            reach: wp.array(dtype=wp.float32),
            extent: wp.array(dtype=wp.float32),
            nodes: wp.array(dtype=wp.vec4f),
            root: wp.array(dtype=wp.int32),
            records: wp.array(dtype=wp.vec4f),
            sides: wp.array(dtype=wp.vec4f),
            facing: wp.array(dtype=wp.uint8),
            masked: wp.array(dtype=wp.uint8),
            counts: wp.array(dtype=wp.int32),
            doubts: wp.array(dtype=wp.vec2i),
        ) -> wp.vec3i: ...

    else:

        @wp.func_native(BASICS + BEGIN["float32"] + PLAIN + INVERSE + float32_walk(node_bytes))
        def walk(
            h: wp.vec3f,
            light: wp.vec3f,
            own: wp.int32,
            reach: wp.array(dtype=wp.float32),
            extent: wp.array(dtype=wp.float32),
            nodes: wp.array(dtype=wp.vec4f),
            root: wp.array(dtype=wp.int32),
            records: wp.array(dtype=wp.vec4f),
            sides: wp.array(dtype=wp.vec4f),
            facing: wp.array(dtype=wp.uint8),
            masked: wp.array(dtype=wp.uint8),
            counts: wp.array(dtype=wp.int32),
            doubts: wp.array(dtype=wp.vec2i),
        ) -> wp.int32: ...

    return walk
