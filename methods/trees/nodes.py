"""Nodes: the boxes of both children as centre and extent, in 48 bytes: how they are written, and met by a ray.

A node is three words of 16 bytes: the centre of child 0 and its reference, the same of child 1, and six extents of 16
bits (bfloat16, rounded up). Of two extents in 32 bits, the upper one is read together with the bits of the lower one,
which enlarge it by less than 2^-7: that saves an instruction. A slab is then (centre * inverse - origin) -+ extent *
|inverse|, which needs no test of the direction's sign.

Boxes are padded when they are written. The error of the slab test of a ray o + t d, as a distance along one axis, with A
the largest coordinate of o, B that of the scene's box, u = 2^-24, and where t d lies within the scene:

    o * inverse rounded           A u          the direction, through 1 / d rounded             (A + B) u
    centre * inverse - that       (A + B) u    the direction itself, if it is h - light         (A + B) u
    -+ extent * |inverse|         (A + B) u    h's own rounding                                 B u
    both products by themselves (no fused operations)  2 B u;    the centre rounded  B u
    the extent rounded: nothing, it is enlarged by 2^-22 of itself

5 A u + 8 B u in all; :func:`padding` is more, with A = ``frame.max_coordinate``, which bounds where the rays of cameras
start and is at least 8 B unless it is as large as it can be, 2^126 and B / 4; a light that is farther is not traced from
(:mod:`.trace.traversal`), and mirrored rays start in the scene. (Ize 2013, "Robust BVH Ray Traversal", pads the ray
instead.) A component of the direction that is less than 2^-40 of the largest is replaced by that value, which moves a ray
by 2^-40 of its length.
"""

from typing import Any

import warp as wp

from ...harness.frame.frame import Frame
from ...harness.frame.geometry import filled
from ..exact.triangle import U32

NODE_BYTES = 48

LARGEST = wp.constant(2.0**126)
"""``frame.max_coordinate`` is at most this."""

EMPTY_EXTENT = -1.0e30
"""Extent of a child without triangles: no ray meets it."""


@wp.struct
class Tree:
    """What rays are traced through.

    nodes   vec4f [3 * nodes]        root  int32 [1]: the reference to the root (:mod:`.native`)
    masked  uint8 [triangles]: 1 = it has holes; empty where none has
    max_coordinate  float32 [1]: of the frame
    extent  float32 [1]: the largest coordinate of the scene's box; infinite where nothing is in it
    bodies  vec4f [4 * bodies]: of a tree with two levels (:mod:`.trace.bodies`); else empty
    """

    nodes: wp.array[wp.vec4f]
    root: wp.array[wp.int32]
    masked: wp.array[wp.uint8]
    max_coordinate: wp.array[wp.float32]
    extent: wp.array[wp.float32]
    bodies: wp.array[wp.vec4f]


def empty_tree(frame: Frame, **made: wp.array) -> Any:
    """A :class:`Tree`: with what is made already, or with room for a node per triangle."""
    with wp.ScopedDevice(frame.device):
        return filled(
            Tree,
            **made or {"nodes": wp.zeros(frame.triangle_count * NODE_BYTES // 16, dtype=wp.vec4f)},
            root=wp.zeros(1, dtype=wp.int32),
            masked=frame.alpha.masked,
            max_coordinate=frame.max_coordinate,
            extent=wp.zeros(1, dtype=wp.float32),
        )


@wp.func
def padding(max_coordinate: wp.float32) -> wp.float32:
    """The padding of boxes: more than 5 + 8 / 8 units of the frame's ``max_coordinate``, or 5 + 8 * 4 of the largest."""
    units = wp.where(max_coordinate < LARGEST, 7.0, 40.0)
    return U32 * units * max_coordinate + 1.0e-37


WRITE = f"""
auto middle = [&](float l, float h) {{ return !SOME_EMPTY || l <= h ? product(0.5f, sum(l, h)) : 0.0f; }};
auto extent_of = [&](float l, float h, float c, float pad) {{
    const float larger = 1.0f + 1.0f / 4194304.0f;
    float extent = !SOME_EMPTY || l <= h ? sum(product(high(sum(h, -c), sum(c, -l)), larger), pad) : {EMPTY_EXTENT}f;
    return (bits(extent) + 0xffffu) >> 16;
}};
auto put_node = [&](float* nodes, unsigned int id, float pad, int side, const float* a, unsigned int r, const float* b,
                    unsigned int s) {{
    float ax = middle(a[0], a[3]), ay = middle(a[1], a[4]), az = middle(a[2], a[5]);
    float bx = middle(b[0], b[3]), by = middle(b[1], b[4]), bz = middle(b[2], b[5]);
    float* node = nodes + 12 * (size_t)id;
    store16(node, side, ax, ay, az, real(r));
    store16(node, !side, bx, by, bz, real(s));
    unsigned int e[6] = {{extent_of(a[0], a[3], ax, pad), extent_of(a[1], a[4], ay, pad), extent_of(a[2], a[5], az, pad),
                         extent_of(b[0], b[3], bx, pad), extent_of(b[1], b[4], by, pad), extent_of(b[2], b[5], bz, pad)}};
    auto two = [&](int k) {{ return real(side ? e[(k + 3) % 6] | (e[(k + 4) % 6] << 16) : e[k] | (e[k + 1] << 16)); }};
    store16(node, 2, two(0), two(2), two(4), 0.0f);
}};
"""
"""``put_node(nodes, id, pad, side, a, r, b, s)``: box a (low, then high corner) with reference r as child ``side``, 0 or 1,
and box b with s as the other. A choice of words costs the lanes of a warp less than a branch.
``SOME_EMPTY``: whether a box may hold nothing.
"""

MEET = """
float ix, iy, iz, ox, oy, oz, jx, jy, jz;
auto aim = [&](float x, float y, float z, float dx, float dy, float dz) {
    float largest = high(size(dx), high(size(dy), size(dz)));
    float least = largest * 9.0949470e-13f + tiny;
    auto slope = [&](float x) { return shrink * inverse_of(size(x) > least ? x : (x < 0.0f ? -least : least)); };
    ix = slope(dx), iy = slope(dy), iz = slope(dz);
    if (ANY && !(size(dx) + size(dy) + size(dz) < 8.0e37f)) ix = iy = iz = 0.0f;
    ox = x * ix, oy = y * iy, oz = z * iz, jx = size(ix), jy = size(iy), jz = size(iz);
};
aim(o[0], o[1], o[2], d[0], d[1], d[2]);
struct Children { unsigned int ref0, ref1; float near0, near1; bool met0, met1; };
auto children_of = [&](unsigned int node) {
    const char* at = threes(tree.nodes.data, node);
    Quad a = load16(at, 0), e = load16(at, 1), w = load16(at, 2), b, f;
    unsigned int wx = bits(w.x), wy = bits(w.y), wz = bits(w.z);
    b.x = real(wx << 16), b.y = w.x, b.z = real(wy << 16), f.x = w.y, f.y = real(wz << 16), f.z = w.z;
    float x = a.x * ix - ox, y = a.y * iy - oy, z = a.z * iz - oz;
    float near0 = entering(x - b.x * jx, y - b.y * jy, z - b.z * jz);
    float far0 = leaving(x + b.x * jx, y + b.y * jy, z + b.z * jz, limit);
    x = e.x * ix - ox, y = e.y * iy - oy, z = e.z * iz - oz;
    float near1 = entering(x - f.x * jx, y - f.y * jy, z - f.z * jz);
    float far1 = leaving(x + f.x * jx, y + f.y * jy, z + f.z * jz, limit);
    return Children{bits(a.w), bits(e.w), near0, near1, !(near0 > far0), !(near1 > far1)};
};
"""
"""``aim``: sets up the ray, at first (o, d). ``children_of(node)``: the references to both children, where the ray enters
them, and whether it meets them between 0 and ``limit``, in units of t times ``shrink``. ``tiny`` > 0: the least part of a
direction whose inverse, and a coordinate times that, float32 still holds. The way to a light may be so long that it
overflows, or that a GPU takes the inverse of one part for 0 and of another not: such a ray meets every box.
"""
