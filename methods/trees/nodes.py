"""Nodes: the boxes of both children as centre and extent, in 64 bytes, or in 48 with extents in bfloat16.

A node is four or three words of 16 bytes: (centre of child 0, its reference), (extent), (centre of child 1, its
reference), (extent); or the two centres with their references and then six extents of 16 bits, rounded up. Of two such
extents in a word, the upper one is read together with the bits of the lower one, which enlarge it by less than 2^-7: that
saves an instruction. A slab is then (centre * inverse - origin) -+ extent * |inverse|, which needs no test of the
direction's sign.

Boxes are padded when they are written. The error of the slab test of a ray o + t d, as a distance along one axis, with A
the largest coordinate of o, B that of the scene's box, u = 2^-24, and where t d lies within the scene:

    o * inverse rounded           A u          the direction, through 1 / d rounded             (A + B) u
    centre * inverse - that       (A + B) u    the direction itself, if it is h - light         (A + B) u
    -+ extent * |inverse|         (A + B) u    h's own rounding                                 B u
    both products by themselves (no fused operations)  2 B u;    the centre rounded  B u
    the extent rounded: nothing, it is enlarged by 2^-22 of itself

5 A u + 8 B u in all; :func:`padding` is more, with A = ``frame.max_coordinate``, which bounds the eye; a light that is
farther is not traced from (:mod:`.trace.walk_shadow`), and mirrored rays start in the scene (:mod:`.trace.walk_ray`).
(Ize 2013, "Robust BVH Ray Traversal", pads the ray instead.)
A component of the direction that is less than 2^-40 of the largest is replaced by that value, which moves a ray by 2^-40
of its length.
"""

from __future__ import annotations

import functools
from typing import Any

import warp as wp

from ..exact.triangle import U32
from .native import BASICS

EMPTY_EXTENT = -1.0e30
"""Extent of a child without triangles: no ray meets it."""

ROUNDED_UP = f"""
const float larger = 1.0f + 1.0f / 4194304.0f;
auto middle = [&](float l, float h) {{ return l <= h ? product(0.5f, sum(l, h)) : 0.0f; }};
auto extent = [&](float l, float h, float c, float pad) {{
    return l <= h ? sum(product(high(sum(h, -c), sum(c, -l)), larger), pad) : {EMPTY_EXTENT}f;
}};
"""

PLAIN_ROUNDED_UP = """
const float larger = 1.0f + 1.0f / 4194304.0f;
auto middle = [&](float l, float h) { return product(0.5f, sum(l, h)); };
auto extent = [&](float l, float h, float c, float pad) {
    return sum(product(high(sum(h, -c), sum(c, -l)), larger), pad);
};
"""
"""The same for boxes that are not empty, with fewer instructions."""

WRITE = {
    64: """
auto put_node = [&](float* nodes, unsigned int id, float pad, const float* a, unsigned int r, const float* b,
                    unsigned int s) {
    float ax = middle(a[0], a[3]), ay = middle(a[1], a[4]), az = middle(a[2], a[5]);
    float bx = middle(b[0], b[3]), by = middle(b[1], b[4]), bz = middle(b[2], b[5]);
    float* node = nodes + 16 * (size_t)id;
    keep(node, 0, ax, ay, az, real(r));
    keep(node, 1, extent(a[0], a[3], ax, pad), extent(a[1], a[4], ay, pad), extent(a[2], a[5], az, pad), 0.0f);
    keep(node, 2, bx, by, bz, real(s));
    keep(node, 3, extent(b[0], b[3], bx, pad), extent(b[1], b[4], by, pad), extent(b[2], b[5], bz, pad), 0.0f);
};
""",
    48: """
auto half = [&](float value) { return (bits(value) + 0xffffu) >> 16; };
auto put_node = [&](float* nodes, unsigned int id, float pad, const float* a, unsigned int r, const float* b,
                    unsigned int s) {
    float ax = middle(a[0], a[3]), ay = middle(a[1], a[4]), az = middle(a[2], a[5]);
    float bx = middle(b[0], b[3]), by = middle(b[1], b[4]), bz = middle(b[2], b[5]);
    unsigned int e0 = half(extent(a[0], a[3], ax, pad)), e1 = half(extent(a[1], a[4], ay, pad));
    unsigned int e2 = half(extent(a[2], a[5], az, pad)), f0 = half(extent(b[0], b[3], bx, pad));
    unsigned int f1 = half(extent(b[1], b[4], by, pad)), f2 = half(extent(b[2], b[5], bz, pad));
    float* node = nodes + 12 * (size_t)id;
    keep(node, 0, ax, ay, az, real(r));
    keep(node, 1, bx, by, bz, real(s));
    keep(node, 2, real(e0 | (e1 << 16)), real(e2 | (f0 << 16)), real(f1 | (f2 << 16)), 0.0f);
};
""",
}
"""``put_node(nodes, id, pad, a, r, b, s)``: boxes a and b (low, then high corner) with references r and s."""

READ = {
    64: """
    Quad a = fetch(nodes.data, 4 * (int)now), b = fetch(nodes.data, 4 * (int)now + 1);
    Quad e = fetch(nodes.data, 4 * (int)now + 2), f = fetch(nodes.data, 4 * (int)now + 3);
""",
    48: """
    Quad a = fetch(nodes.data, 3 * (int)now), e = fetch(nodes.data, 3 * (int)now + 1);
    Quad w = fetch(nodes.data, 3 * (int)now + 2), b, f;
    unsigned int wx = bits(w.x), wy = bits(w.y), wz = bits(w.z);
    b.x = real(wx << 16), b.y = w.x, b.z = real(wy << 16), f.x = w.y, f.y = real(wz << 16), f.z = w.z;
""",
}

INVERSE = """
float largest = high(size(d[0]), high(size(d[1]), size(d[2])));
float least = largest * 9.0949470e-13f + tiny;
auto inverse_of = [&](float x) { return shrink * (1.0f / (size(x) > least ? x : (x < 0.0f ? -least : least))); };
float ix = inverse_of(d[0]), iy = inverse_of(d[1]), iz = inverse_of(d[2]);
float ox = o[0] * ix, oy = o[1] * iy, oz = o[2] * iz, jx = size(ix), jy = size(iy), jz = size(iz);
"""
"""The values of a ray (o, d) that the slab test needs: ``shrink`` over its direction, and the origin times that.
``tiny`` > 0: the least part of a direction whose inverse, and a coordinate times that, float32 still holds."""

SHRINK = "const float shrink = reach.data[0] < 1.0e25f ? 1.0f : 5.4210109e-20f;"
"""For a direction of about one: a coordinate beyond 1e26 over 2^-40 would be infinite, and a box before it be missed. So the
slabs of large scenes are met at t times 2^-64."""

PLAIN = "const float shrink = 1.0f;"
"""Where ``tiny`` is in proportion to the scene, or float32 may err."""

SLABS = """
    float x = a.x * ix - ox, y = a.y * iy - oy, z = a.z * iz - oz;
    float near0 = entering(x - b.x * jx, y - b.y * jy, z - b.z * jz);
    float far0 = leaving(x + b.x * jx, y + b.y * jy, z + b.z * jz, limit);
    x = e.x * ix - ox, y = e.y * iy - oy, z = e.z * iz - oz;
    float near1 = entering(x - f.x * jx, y - f.y * jy, z - f.z * jz);
    float far1 = leaving(x + f.x * jx, y + f.y * jy, z + f.z * jz, limit);
    bool met0 = !(near0 > far0), met1 = !(near1 > far1);
    unsigned int ref0 = bits(a.w), ref1 = bits(e.w);
"""
"""Both children of a node: whether the ray meets them between 0 and ``limit``, where it enters, their references. All in
units of t times ``shrink``."""


OF_LEAF = """
        int at = (int)(now & INDEX), stop = at + (now & PAIR ? 2 : 1);
#pragma unroll 1
        for (; at < stop; at++) {
            TRIANGLE
        }
"""
"""The triangles of the leaf ``now``."""


@wp.struct
class Tree:
    """Nodes of a tree, and the reference to its root (:mod:`.native`); which triangles have holes, or
    nothing where none has."""

    nodes: wp.array(dtype=wp.vec4f)
    root: wp.array(dtype=wp.int32)
    masked: wp.array(dtype=wp.uint8)


@wp.func
def padding(reach: wp.float32, extent: wp.float32) -> wp.float32:
    """The padding of boxes. ``reach`` bounds the origins of rays, ``extent`` the scene's box."""
    return U32 * (6.0 * reach + 12.0 * extent) + 1.0e-37


@functools.cache
def make_children_of(node_bytes: int) -> Any:
    """A function of (nodes, node, o, d, farthest, reach): (entry of child 0, of child 1, bits of their references); 1e38:
    missed."""

    @wp.func_native(
        BASICS
        + SHRINK
        + "const float tiny = 1.0e-37f, limit = shrink * farthest;"
        + INVERSE
        + "unsigned int now = (unsigned int)node;"
        + READ[node_bytes]
        + SLABS
        + "return {met0 ? high(near0, 0.0f) : 1.0e38f, met1 ? high(near1, 0.0f) : 1.0e38f, real(ref0), real(ref1)};"
    )
    def children_of(
        nodes: wp.array(dtype=wp.vec4f),
        node: wp.int32,
        o: wp.vec3f,
        d: wp.vec3f,
        farthest: wp.float32,
        reach: wp.array(dtype=wp.float32),
    ) -> wp.vec4f: ...

    return children_of
