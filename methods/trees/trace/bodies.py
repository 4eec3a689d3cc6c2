"""Two levels: a tree of bodies in the scene, and a tree of each body's triangles where the body was when that was made.

A body moves as a whole, so that its tree is kept. What turns the scene, as it is now, to where the body was is affine: a
point p comes to R p + s, with the float32 numbers of R and s as they stand (:class:`..nodes.Tree`, ``bodies``). A ray that
comes to a leaf of the first level is taken there, goes through the body's boxes with the same t, and comes back. Triangles
are tested in the scene, by the records of this frame: what a body's tree decides is which of them, and never an answer.

**What boxes of bodies are padded by.** Let u = 2^-24. Let Q bound the coordinates of where rays start and be at least 8 B,
with B the largest coordinate of the scene's box, now or when the trees were made; and let the rows of R be of length 1 to
within u. A vertex comes to within some distance of where it was when the tree was made; that is measured in every frame, and
boxes are padded by it. An affine map takes a triangle to the triangle of its corners, so the whole of it lies in its padded
boxes. What is left is the rounding of the ray, as a distance along one axis. A row of R times a vector is a sum of terms
whose sizes add up to the vector's length at most (Cauchy and Schwarz), which is 3^0.5 of its largest part; and points of the
scene are at most 1.125 Q from where a ray starts, along an axis:

    the start R o + s: three products 1.733 Q u, the first two sums 2 * 1.733 Q u, the last                      7.3 Q u
    the direction R d: two roundings or three of each term; at the point that it leads to, 3 * 3^0.5 * 1.125     5.9 Q u
    the direction itself, if it is h - light, and h's own rounding, both turned: 3^0.5 (1.125 + 0.125)           2.2 Q u
    the slabs (:mod:`..nodes`, without the line above) of a start of at most 2.08 Q and boxes of 0.125 Q:
    4 * 2.08 + 6 * 0.125                                                                                         9.1 Q u

24.5 Q u: :data:`RAY_UNITS`. Fused products and sums only round less. Where Q is as large as it can be (``LARGEST`` of
:mod:`..nodes`, and B is 4 Q), the start could overflow: there only bodies that have not moved are taken, whose rays stay as
they are, and 4 + 6 * 4 for the slabs and 3^0.5 * 9 for the direction make 43.6 Q u: :data:`MOST_RAY_UNITS`.
"""

from __future__ import annotations

from ..native import STACK

BACK = 0x7FFFFFFF
"""What stands on the stack below a body's nodes: the ray comes back into the scene. No node and no leaf has this number."""

RAY_UNITS = 25.0
MOST_RAY_UNITS = 44.0

ROOM = {1: STACK, 2: 192}
"""Entries of a stack, by the number of levels. A tree of bodies is an LBVH of at most 24 + 24 levels with two entries each,
and a tree of triangles of 64 + 24 with one (:mod:`..builders.lbvh`, :mod:`..builders.sah`); and there is the way back.
"""

ONE_LEVEL = f"""
constexpr bool BODIES = false, inside = true;
constexpr unsigned int BACK = {BACK}u;
auto next = [&]() {{ return pop(); }};
auto go_in = []() {{}};
auto go_out = []() {{ return false; }};
auto come_back = []() {{}};
"""

TWO_LEVELS = f"""
constexpr bool BODIES = true;
constexpr unsigned int BACK = {BACK}u;
bool inside = false, away = false;
auto next = [&]() {{
    unsigned int ref = pop();
    if (ANY || inside) return ref;
    return real(pop()) > limit ? BACK : ref;
}};
auto go_in = [&]() {{
    int at = 4 * (int)(now & INDEX);
    Quad x = load16(tree.bodies.data, at), y = load16(tree.bodies.data, at + 1), z = load16(tree.bodies.data, at + 2);
    auto along = [&](Quad row, float a, float b, float c) {{ return fused(row.z, c, fused(row.y, b, row.x * a)); }};
    float dx = along(x, d[0], d[1], d[2]), dy = along(y, d[0], d[1], d[2]), dz = along(z, d[0], d[1], d[2]);
    aim(along(x, o[0], o[1], o[2]) + x.w, along(y, o[0], o[1], o[2]) + y.w, along(z, o[0], o[1], o[2]) + z.w, dx, dy, dz);
    push(BACK);
    now = bits(load16(tree.bodies.data, at + 3).x);
    inside = away = true;
}};
auto go_out = [&]() {{
    inside = false;
    return false;
}};
auto come_back = [&]() {{
    if (away) aim(o[0], o[1], o[2], d[0], d[1], d[2]);
    away = false;
}};
"""

LEVELS = {1: ONE_LEVEL, 2: TWO_LEVELS}
"""C++ before the traversal, by the number of levels. ``go_in`` takes the ray from a leaf of the first level, ``now``, to the
root of its body's tree; ``go_out`` leaves that; ``come_back`` takes the ray back where a node of the first level needs it.
``next`` pops; of the first level a closest hit's stack holds where the ray enters each box, too, below its reference, so
that no ray is taken to a body behind what it has hit.
"""
