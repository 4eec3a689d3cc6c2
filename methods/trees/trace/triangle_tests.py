"""Tests of a ray and one triangle in float32, C++ for the traversal (:mod:`.traversal`), by what records they read.

``test(at, leave)`` tests triangle ``at`` and says whether the traversal is over. An exact test accepts or rejects what
float32 decides with a bound on its error, and leaves the rest to float64 (``leave(at)``): an edge plane or a depth that
float32 does not decide, or a triangle with holes. The closest hit ``best`` is always certain: a triangle replaces it only
if it certainly lies in front, is skipped if it certainly lies behind, and is left to float64 where the two cannot be told
apart.
"""

from ..records.planes import DEPTH_UNITS, EYE_UNITS, LIGHT_UNITS
from ..records.rays import DEPTH_SLACK, PLANE_UNITS, WEIGHT_UNITS

EYE = f"""
const float unit = 5.9604645e-08f, slack = shrink * (1.0f + 1.0f / 1048576.0f);
float length = size(d[0]) + size(d[1]) + size(d[2]);
const float bound = {EYE_UNITS} * unit * length + 1.0e-36f, wide = {DEPTH_UNITS} * unit * length + 1.0e-36f;
float sure_from = seen ? 0.0f : 3.4e38f, sure_to = 0.0f;
auto test = [&](int at, auto leave) {{
    const char* record = threes(records.data, at);
    Quad p = load16(record, 0), q = load16(record, 1), r = load16(record, 2);
    float e0 = fused(d[2], p.z, fused(d[1], p.y, d[0] * p.x));
    float e1 = fused(d[2], q.y, fused(d[1], q.x, d[0] * p.w));
    float e2 = fused(d[2], r.x, fused(d[1], q.w, d[0] * q.z));
    float inside = low(e0, low(e1, e2));
    if (inside < -bound) return false;
    float depth = d[0] * r.y + d[1] * r.z + d[2] * r.w;
    float error = wide * high(size(r.y), high(size(r.z), size(r.w)));
    if (depth + error < sure_from) return false;
    if (inside > bound && depth - error > sure_to && solid(at)) {{
        best = at;
        sure_from = depth - error;
        sure_to = depth + error;
        limit = slack * high(about(sure_from), 1.2e-38f);
    }} else if (!PACKET || seen) {{
        leave(at);
    }}
    return false;
}};
"""
"""Rays from the eye. ``bound`` holds for edge planes, ``wide`` times the largest part of m for depths. Depths are 1 / t:
nearer is larger. ``sure_from`` and ``sure_to`` bound the depth of the current closest hit.
"""

RAY = f"""
const float unit = 5.9604645e-08f, floor = 1.0e-36f;
const float length = size(d[0]) + size(d[1]) + size(d[2]), long8 = 8.0f * length;
const float weight_units = {WEIGHT_UNITS / 8.0}f * unit, plane_units = {PLANE_UNITS}f * unit;
const float depth_slack = {DEPTH_SLACK}f, closer = 1.0f - 1.0f / 1048576.0f, farther = 1.0f + 1.0f / 1048576.0f;
float sure_from = 3.4e38f;
auto test = [&](int at, auto leave) {{
    const char* record = threes(records.data, at);
    Quad p = load16(record, 0), q = load16(record, 1), r = load16(record, 2);
    float x = p.x - o[0], y = p.y - o[1], z = p.z - o[2];
    float kx = y * d[2] - z * d[1], ky = z * d[0] - x * d[2], kz = x * d[1] - y * d[0];
    float det = r.y * d[0] + r.z * d[1] + r.w * d[2];
    float side = det < 0.0f ? -1.0f : 1.0f;
    float v = side * (q.z * kx + q.w * ky + r.x * kz), w = -side * (p.w * kx + q.x * ky + q.y * kz);
    det = size(det);
    float inside = low(low(v, w), 0.4f * (det - v - w));
    float thick = high(size(r.y), high(size(r.z), size(r.w))), away = high(size(x), high(size(y), size(z)));
    float bound = long8 * (away + thick) * weight_units + floor;
    if (inside < -bound) return false;
    float height = side * (x * r.y + y * r.z + z * r.w);
    float height_error = plane_units * (size(x * r.y) + size(y * r.z) + size(z * r.w)) + floor;
    float det_error = plane_units * (length * thick) + floor;
    bool steep = det > det_error;
    if (steep && height < -height_error) return false;
    height_error += depth_slack * (thick * away);
    float from = (height - height_error) * about(det + det_error) * closer;
    if (from * shrink > limit) return false;
    float to = (height + height_error) * about(det - det_error) * farther + 1.0e-37f;
    if (inside > bound && steep && height > height_error && to < sure_from && solid(at)) {{
        best = at;
        sure_from = from;
        limit = to * shrink;
    }} else {{
        leave(at);
    }}
    return false;
}};
"""
"""Rays that share no origin. ``bound`` is that of the weights. ``from`` and ``to`` bound t; the factors cover the
rounding of both and the ties of :func:`...exact.triangle.depth_key`. ``from`` is above ``limit`` only of a triangle
certainly behind the closest hit, also where the sign of ``det`` is in doubt: with the other sign t is negative. With
``long8`` the bound is infinite where a product could be.
"""

LIGHT = f"""
const float bound = {LIGHT_UNITS} * 5.9604645e-08f * tree.extent.data[0] + 1.0e-36f;
const unsigned short sides_seen = reinterpret_cast<const unsigned short*>(planes.facing.data)[own >> 1];
const int spared = sides_seen == 0x0101 || sides_seen == 0x0202 ? own | 1 : -1;
auto left_out = [&](int at) {{ return (at | 1) == spared; }};
auto test = [&](int at, auto leave) {{
    const char* edges = threes(planes.edges.data, at);
    Quad p = load16(edges, 0), q = load16(edges, 1), r = load16(edges, 2);
    float e0 = fused(h[2], p.z, fused(h[1], p.y, fused(h[0], p.x, p.w)));
    float e1 = fused(h[2], q.z, fused(h[1], q.y, fused(h[0], q.x, q.w)));
    float e2 = fused(h[2], r.z, fused(h[1], r.y, fused(h[0], r.x, r.w)));
    float inside = low(e0, low(e1, e2));
    if (inside < -bound || at == own) return false;
    Quad s = load16(planes.sides.data, at);
    float side = fused(h[2], s.z, fused(h[1], s.y, fused(h[0], s.x, s.w)));
    if (side > bound) return false;
    if (inside > bound && side < -bound && solid(at)) return true;
    leave(at);
    return false;
}};
"""
"""Shadow rays to the hit point h. ``side``: positive where h lies on the light's side of the triangle. ``left_out``: the
leaf of the triangle that was hit, with at most one other that does not hide it (:mod:`..records.planes`).
"""

TAKE_FLOAT32 = """
auto take = [&](int at, float s, float w, float t) {
    bool hit = s >= 0.0f && w >= 0.0f && s + w <= 1.0f && t > 0.0f && t < limit;
    if (ANY) return hit && at != own;
    if (hit) {
        limit = t;
        u = s;
        v = w;
        best = at;
    }
    return false;
};
"""

ORIGIN_FLOAT32 = (
    TAKE_FLOAT32
    + """
auto test = [&](int at, auto) {
    const char* record = threes(records.data, at);
    Quad p = load16(record, 0), q = load16(record, 1), r = load16(record, 2);
    float inverse = about(d[0] * p.x + d[1] * p.y + d[2] * p.z);
    float s = (d[0] * q.x + d[1] * q.y + d[2] * q.z) * inverse;
    float w = (d[0] * r.x + d[1] * r.y + d[2] * r.z) * inverse;
    return take(at, s, w, p.w * inverse);
};
"""
)
"""Rays with a common origin, without bounds."""

RAY_FLOAT32 = (
    TAKE_FLOAT32
    + """
auto test = [&](int at, auto) {
    const char* record = threes(records.data, at);
    Quad p = load16(record, 0), q = load16(record, 1), r = load16(record, 2);
    float x = p.x - o[0], y = p.y - o[1], z = p.z - o[2];
    float kx = y * d[2] - z * d[1], ky = z * d[0] - x * d[2], kz = x * d[1] - y * d[0];
    float inverse = about(r.y * d[0] + r.z * d[1] + r.w * d[2]);
    float s = (q.z * kx + q.w * ky + r.x * kz) * inverse, w = -inverse * (p.w * kx + q.x * ky + q.y * kz);
    return take(at, s, w, (x * r.y + y * r.z + z * r.w) * inverse);
};
"""
)
"""Rays that share no origin, without bounds."""

TESTS = {
    ("eye", True): EYE,
    ("ray", True): RAY,
    ("light", True): LIGHT,
    ("eye", False): ORIGIN_FLOAT32,
    ("ray", False): RAY_FLOAT32,
    ("light", False): ORIGIN_FLOAT32,
}
"""By the records that they read, and whether they are exact."""
