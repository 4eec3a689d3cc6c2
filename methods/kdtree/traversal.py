"""Traversal of the tree by a ray, nearer child first, with a short stack of the other children and the parts of the ray
in them.

The stack holds the last few of them (Horn et al. 2007). Where more are pending the oldest is forgotten, and when the
stack is empty the traversal restarts at the root. Two bit masks record for each level what remains: ``pending``, whether
the farther child is still to be visited, and ``done``, whether the nearer one need not be any more (Laine 2010). So the
same nodes are visited with the same parts of the ray, however short the stack. (A restart behind the part already
visited would not be enough: near a plane both children have the same times.)

No hit is missed. Let e be a bound on the rounding of the times at which a ray meets a plane, expressed as a distance
along the plane's axis. A child is visited for all times at which the ray is within e of it. A triangle is listed in a
leaf around each of its points (:mod:`.large`, :mod:`.small` cut boxes outwards only). A hit lies within e of a point of
its triangle, so a leaf that lists the triangle is visited. With A the largest coordinate of the ray's origin, B of the
scene, u = 2^-24, while t d lies within the scene:

    plane - origin rounded                     (A + B) u      1 / d rounded                 (A + B) u
    their product                              (A + B) u      the sum with the margin       (A + B) u
    the direction, if it is light - hit point  (A + B) u      the hit point, in float32     B u
    a triangle's closed edge, 2^-30 of it      B u

5 A u + 7 B u in all; e is 8 A u + 16 B u. A component of the direction that is less than 2^-40 of the largest is replaced
by that value, which moves a ray by 2^-40 of its length.

The traversal continues behind a leaf until the rest of the ray begins behind the closest hit: a triangle may be hit
beyond the leaf that offered it, and nearer ones may lie between.
"""

import functools
from typing import Any

import warp as wp

from ...harness.frame.alpha import Alpha
from ...harness.frame.geometry import Mesh
from ..common.bounds import box_high, box_low
from ..exact.ray_queries import SLACK, Found, RayPart, nothing_found
from ..exact.triangle import U32, largest, to_float32
from ..gpu.entries import entry
from ..rays.kernels import make_primary_kernel, make_shadow_kernel
from .nodes import LEAF, Tree, bit

STACK = 8
"""Nodes that a ray's stack holds."""

REGISTERS = 96
"""Limit per thread on a GPU: the best on balls-40k and balls-300k."""

LATEST = wp.constant(wp.float32(3.0e37))
"""Times and margins beyond the range of float32 are limited to this."""


@wp.func
def inverse_of(d: wp.float32, least: wp.float32) -> wp.float32:
    if wp.abs(d) > least:
        return 1.0 / d
    if d < 0.0:
        return -1.0 / least
    return 1.0 / least


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return 63 - __clzll((long long)word);
#else
return 63 - __builtin_clzll(word);
#endif
""")
def highest_bit(word: wp.uint64) -> wp.int32:
    """The place of the highest bit of a word that is not 0."""


@wp.func
def meeting(plane: wp.float32, o: wp.float32, inverse: wp.float32) -> wp.float32:
    """When the ray meets a plane."""
    return wp.clamp((plane - o) * inverse, -LATEST, LATEST)


@functools.cache
def make_walk(stack: int) -> Any:
    """A walk whose stack holds ``stack`` nodes, a power of two."""
    KEPT = wp.constant(stack)

    @wp.func
    def walk(test: wp.Function, tree: Tree, mesh: Mesh, alpha: Alpha, part: RayPart, query: Any) -> Found:
        """Call ``test`` for the triangles of the leaves that a ray meets: see :mod:`..rays.kernels`."""
        found = nothing_found(SLACK * wp.float32(part.end))
        stack_node = wp.zeros(shape=KEPT, dtype=wp.int32)
        stack_from = wp.zeros(shape=KEPT, dtype=wp.float32)
        stack_to = wp.zeros(shape=KEPT, dtype=wp.float32)
        o = to_float32(part.start)
        d = to_float32(part.direction)
        low = box_low(tree.box)
        high = box_high(tree.box)
        least = largest(d) * 9.094947e-13 + 1.0e-37
        inverse = wp.vec3f(inverse_of(d[0], least), inverse_of(d[1], least), inverse_of(d[2], least))
        extent = wp.max(largest(low), largest(high))
        e = U32 * (8.0 * largest(o) + 16.0 * extent) + 1.0e-37
        margin = wp.min(wp.vec3f(LATEST, LATEST, LATEST), e * wp.abs(inverse))
        first = wp.float32(0.0)
        last = found.limit
        for axis in range(wp.static(3)):
            a = meeting(low[axis], o[axis], inverse[axis])
            b = meeting(high[axis], o[axis], inverse[axis])
            first = wp.max(first, wp.min(a, b) - margin[axis])
            last = wp.min(last, wp.max(a, b) + margin[axis])
        ray_first = first
        ray_last = last
        level = wp.int32(0)
        pending = wp.uint64(0)
        done = wp.uint64(0)
        top = wp.int32(0)
        held = wp.int32(0)
        node = wp.int32(0)
        going = first <= last
        while going:
            record = entry(tree.nodes, node)
            axis = record[1] & 3
            other = record[1] >> 2
            onward = wp.bool(False)
            if axis != LEAF:
                plane = wp.cast(record[0], wp.float32)
                inverse_here = inverse[axis]
                at = meeting(plane, o[axis], inverse_here)
                # That below the plane comes first if the ray goes up.
                near = other
                far = other + 1
                if inverse_here < 0.0:
                    near = other + 1
                    far = other
                until = at + margin[axis]
                since = at - margin[axis]
                onward = True
                if until < first:
                    node = far
                elif since > last:
                    node = near
                elif (done & bit(level)) != wp.uint64(0):
                    node = far
                    first = wp.max(first, since)
                else:
                    stack_node[top] = far
                    stack_from[top] = wp.max(first, since)
                    stack_to[top] = last
                    top = (top + 1) & (KEPT - 1)
                    held = wp.min(held + 1, KEPT)
                    pending = pending | bit(level)
                    node = near
                    last = wp.min(last, until)
            else:
                k = record[0]
                stop = k + other
                while k < stop:
                    i = entry(tree.members, k)
                    k += 1
                    if i != part.own:
                        found.tests += 1
                        found = test(mesh, alpha, i, query, found)
                        if found.done:
                            k = stop
            level += 1
            while not onward and pending != wp.uint64(0) and not found.done:
                level = highest_bit(pending)
                this = bit(level)
                pending = pending - this
                done = (done & (this - wp.uint64(1))) | this
                if held > 0:
                    held -= 1
                    top = (top + KEPT - 1) & (KEPT - 1)
                    node = stack_node[top]
                    first = stack_from[top]
                    last = stack_to[top]
                    level += 1
                    onward = first <= found.limit
                else:
                    node = 0
                    first = ray_first
                    last = ray_last
                    level = 0
                    onward = True
            going = onward
        return found

    return walk


def make_kernels(stack: int = STACK) -> tuple[wp.Kernel, wp.Kernel]:
    """The kernels of primary rays and of shadow rays."""
    walk = make_walk(stack)
    return make_primary_kernel(Tree, walk, REGISTERS), make_shadow_kernel(Tree, walk, REGISTERS)
