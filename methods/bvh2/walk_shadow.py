"""Whether anything lies between a hit point and a light: any hit counts, so the traversal ends at the first certain one.

Rays are traced from the light to the hit point: those of a warp, whose hit points are neighbours, then share the nodes
near the light. That is valid as long as the light is not farther than boxes are padded for (:mod:`.nodes`). For a light
beyond ``reach`` the same segment is traversed from the hit point. The end at which it starts only decides which boxes are
met first: triangles are tested by planes (:mod:`.records`).
"""

from __future__ import annotations

import functools
from typing import Any

import warp as wp

from .doubt_text import CONTINUE, FULL_BREAK, OF_PIXEL
from .nodes import INVERSE, OF_LEAF, PLAIN, READ, SLABS
from .records import LIGHT_UNITS
from .snippets import BASICS, STACK

EXACT_LEAF = """
Quad p = fetch(records.data, 3 * at), q = fetch(records.data, 3 * at + 1), r = fetch(records.data, 3 * at + 2);
float e0 = p.w + h[0] * p.x + h[1] * p.y + h[2] * p.z;
float e1 = q.w + h[0] * q.x + h[1] * q.y + h[2] * q.z;
float e2 = r.w + h[0] * r.x + h[1] * r.y + h[2] * r.z;
float inside = low(e0, low(e1, e2));
if (!(inside < -bound) && at != own) {
    Quad s = fetch(sides.data, at);
    float side = s.w + h[0] * s.x + h[1] * s.y + h[2] * s.z;
    if (!(side > bound)) {
        if (inside > bound && side < -bound) HIDDEN
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
const float bound = {LIGHT_UNITS}f * 5.9604645e-08f * extent.data[0] + 1.0e-36f, limit = 1.0f;
const float far = high(size(light[0]), high(size(light[1]), size(light[2])));
const bool near = far <= reach.data[0];
const wp::vec3f o = near ? light : h;
const wp::vec3f d = near ? wp::vec3f(h[0] - light[0], h[1] - light[1], h[2] - light[2])
                         : wp::vec3f(light[0] - h[0], light[1] - h[1], light[2] - h[2]);
const float tiny = reach.data[0] * 8.3e-25f + 1.0e-37f;
""",
    "float32": """
const float limit = 1.0f - 1.0e-4f, tiny = 1.0e-20f;
const wp::vec3f o = light, d = wp::vec3f(h[0] - light[0], h[1] - light[1], h[2] - light[2]);
""",
}

BEFORE = f"""
unsigned int stack[{STACK}], now = (unsigned int)root.data[0];
int held = 0;
if (now == NONE) return 0;
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


HIDDEN = "{ hidden = 1, held = 0, kept = 0; goto walked; }"
"""The end of a ray with a certain occluder: where those of the others end, so that the lanes of a warp meet. Its doubts do
not matter."""


@functools.cache
def make_shadow_walk(precision: str, node_bytes: int) -> Any:
    """A function of the hit point h and the light: 1 where something other than the triangle ``own`` lies between."""
    leaf = EXACT_LEAF if precision == "exact" else FLOAT32_LEAF
    walking = WALK.replace("READ", READ[node_bytes]).replace("SLABS", SLABS)
    walking = walking.replace("OF_LEAF", OF_LEAF.replace("TRIANGLE", leaf))
    if precision == "exact":
        entering = walking.replace("FULL", "").replace("leave(", "enter(").replace("HIDDEN", "return 1;")
        walking = walking.replace("FULL", FULL_BREAK).replace("HIDDEN", HIDDEN)
        walking = (
            f"int hidden = 0;\n{walking}walked:;\n{CONTINUE.replace('WALK', entering)}if (hidden) return 1;\n"
        )
    else:
        walking = walking.replace("FULL", "")
    walking = BEFORE + walking + "return 0;"

    @wp.func_native(BASICS + OF_PIXEL + BEGIN[precision] + PLAIN + INVERSE + walking)
    def walk(
        h: wp.vec3f,
        light: wp.vec3f,
        own: wp.int32,
        pixel: wp.int32,
        reach: wp.array(dtype=wp.float32),
        extent: wp.array(dtype=wp.float32),
        nodes: wp.array(dtype=wp.vec4f),
        root: wp.array(dtype=wp.int32),
        records: wp.array(dtype=wp.vec4f),
        sides: wp.array(dtype=wp.vec4f),
        counts: wp.array(dtype=wp.int32),
        doubts: wp.array(dtype=wp.vec2i),
    ) -> wp.int32: ...

    return walk
