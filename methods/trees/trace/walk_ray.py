"""The closest hit of a ray with an origin of its own, as a mirrored one: the step of :mod:`.walk_primary`, other tests of
triangles (:mod:`..records.rays`).

Boxes are padded for origins within ``frame.max_coordinate`` (:mod:`..nodes`). Mirrored rays start at points of the
scene, moved off the surface by some roundings, and what they can meet lies in the scene: there A exceeds B by less than
2^-18 of it, and 13 u B of the 18 u B or more of padding are used.

Exact: a test accepts or rejects what float32 decides with its bound. The rest is left to float64, chained to its ray.
The current closest hit is always certain, as for primary rays: a triangle replaces it only if it certainly lies in front, is
skipped if it certainly lies behind, and is left to float64 if the intervals of their t overlap.
"""

from __future__ import annotations

import functools
from typing import Any

import warp as wp

from ..native import BASICS
from ..nodes import INVERSE, PLAIN, SHRINK
from ..records.rays import DEPTH_SLACK, PLANE_UNITS, WEIGHT_UNITS
from ..undecided import CHAIN, solid_text
from .walk_primary import EXACT_END, FLOAT32_END, single_walk

EXACT_BEGIN = f"""
const float unit = 5.9604645e-08f, floor = 1.0e-36f;
const float length = size(d[0]) + size(d[1]) + size(d[2]), long8 = 8.0f * length;
const float weight_units = {WEIGHT_UNITS / 8.0}f * unit, plane_units = {PLANE_UNITS}f * unit;
const float depth_slack = {DEPTH_SLACK}f, closer = 1.0f - 1.0f / 1048576.0f, farther = 1.0f + 1.0f / 1048576.0f;
float sure_from = 3.4e38f;
int best = -1;
"""

EXACT_LEAF = """
Quad p = fetch(records.data, 3 * at), q = fetch(records.data, 3 * at + 1), r = fetch(records.data, 3 * at + 2);
float x = p.x - o[0], y = p.y - o[1], z = p.z - o[2];
float kx = y * d[2] - z * d[1], ky = z * d[0] - x * d[2], kz = x * d[1] - y * d[0];
float det = r.y * d[0] + r.z * d[1] + r.w * d[2];
float side = det < 0.0f ? -1.0f : 1.0f;
float v = side * (q.z * kx + q.w * ky + r.x * kz), w = -side * (p.w * kx + q.x * ky + q.y * kz);
det = size(det);
float inside = low(low(v, w), 0.4f * (det - v - w));
float thick = high(size(r.y), high(size(r.z), size(r.w))), away = high(size(x), high(size(y), size(z)));
float bound = long8 * (away + thick) * weight_units + floor;
if (!(inside < -bound)) {
    float height = side * (x * r.y + y * r.z + z * r.w);
    float height_error = plane_units * (size(x * r.y) + size(y * r.z) + size(z * r.w)) + floor;
    float det_error = plane_units * (length * thick) + floor;
    bool steep = det > det_error;
    if (!(steep && height < -height_error)) {
        height_error += depth_slack * (thick * away);
        float from = (height - height_error) * about(det + det_error) * closer;
        if (!(from * shrink > limit)) {
            float to = (height + height_error) * about(det - det_error) * farther + 1.0e-37f;
            if (inside > bound && steep && height > height_error && to < sure_from SOLID) {
                best = at;
                sure_from = from;
                limit = to * shrink;
            } else {
                leave(at);
            }
        }
    }
}
"""
"""``bound`` is that of the weights. ``from`` and ``to`` bound t; the factors cover the rounding of both and the ties of
:func:`..exact.triangle.depth_key`. ``from`` is above ``limit`` only of a triangle certainly behind the closest hit, also
where the sign of ``det`` is in doubt: with the other sign t is negative. With ``long8`` the bound is infinite where a
product could be."""

FLOAT32_BEGIN = """
float u = 0.0f, v = 0.0f;
int best = -1;
"""

FLOAT32_LEAF = """
Quad p = fetch(records.data, 3 * at), q = fetch(records.data, 3 * at + 1), r = fetch(records.data, 3 * at + 2);
float x = p.x - o[0], y = p.y - o[1], z = p.z - o[2];
float kx = y * d[2] - z * d[1], ky = z * d[0] - x * d[2], kz = x * d[1] - y * d[0];
float inverse = about(r.y * d[0] + r.z * d[1] + r.w * d[2]);
float s = (q.z * kx + q.w * ky + r.x * kz) * inverse, w = -inverse * (p.w * kx + q.x * ky + q.y * kz);
float t = (x * r.y + y * r.z + z * r.w) * inverse;
if (s >= 0.0f && w >= 0.0f && s + w <= 1.0f && t > 0.0f && t < limit) {
    limit = t;
    u = s;
    v = w;
    best = at;
}
"""


@functools.cache
def make_ray_walk(precision: str, node_bytes: int, holes: bool = False) -> Any:
    """A function of a ray that gives what :func:`.walk_primary.make_walk`'s gives."""
    exact = precision == "exact"

    @wp.func_native(
        BASICS
        + CHAIN
        + (SHRINK if exact else PLAIN)
        + "unsigned int now = (unsigned int)root.data[0];\nfloat limit = 3.4e38f;\nconst float tiny = 1.0e-37f;\n"
        + INVERSE
        + (EXACT_BEGIN if exact else FLOAT32_BEGIN)
        + single_walk(solid_text(EXACT_LEAF, holes) if exact else FLOAT32_LEAF, node_bytes, exact)
        + (EXACT_END if exact else FLOAT32_END)
    )
    def walk(
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
