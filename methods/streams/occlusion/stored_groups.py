"""Groups of rows of a light's larger triangles (:func:`.groups.set_group`), as they are read: rows and occluder."""

from __future__ import annotations

from typing import Any

import warp as wp

from ...gpu.entries import entry
from ...gpu.prefetch import shared_entry
from ..cube.footprint import Sides, cells_of_row
from ..rays.sort import span_of
from .planes import Occluder


@wp.func
def rays_of_row(
    which: wp.int32,
    limits: wp.int32,
    r: wp.int32,
    sides: Sides,
    along: wp.int32,
    cells: Any,
) -> wp.vec2i:
    """First ray and end in row r of a group, cut to the triangle; ``which``, ``limits``: the first words of the group."""
    y = (which >> 16) + r
    face = which & 15
    ends = cells_of_row(sides, face, y, limits & 65535, limits >> 16, along, cells)
    if ends[1] < ends[0]:
        return wp.vec2i(0, 0)
    return span_of(cells.offset, face, ends[0], ends[1], y, along)


@wp.func
def shared_rays_of_row(group: wp.int32, r: wp.int32, along: wp.int32, cells: Any) -> wp.vec2i:
    """:func:`rays_of_row` of a group in shared memory; none beyond its rows."""
    head = shared_entry(True, group, wp.vec4f())
    which = wp.cast(head[0], wp.int32)
    span = wp.vec2i(0, 0)
    if r < ((which >> 4) & 63):
        sides = Sides()
        sides.line0 = shared_entry(True, group + 16, wp.vec4f())
        sides.line1 = shared_entry(True, group + 32, wp.vec4f())
        sides.line2 = shared_entry(True, group + 48, wp.vec4f())
        span = rays_of_row(which, wp.cast(head[1], wp.int32), r, sides, along, cells)
    return span


@wp.func
def shared_occluder(occluder: Occluder, group: wp.int32, loaded: wp.int32) -> Occluder:
    """The occluder of a group in shared memory, unless that is the one ``loaded`` before."""
    o = occluder
    other = group != loaded
    head = shared_entry(other, group, wp.vec4f(0.0, 0.0, wp.cast(occluder.i, wp.float32), occluder.bound))
    o.i = wp.cast(head[2], wp.int32)
    o.bound = head[3]
    o.sure = head[3]
    o.e0 = shared_entry(other, group + 64, occluder.e0)
    o.e1 = shared_entry(other, group + 80, occluder.e1)
    o.e2 = shared_entry(other, group + 96, occluder.e2)
    o.plane = shared_entry(other, group + 112, occluder.plane)
    return o


@wp.func
def stored_occluder(groups: wp.array2d(dtype=wp.vec4f), at: wp.int32) -> Occluder:
    """The occluder of a group."""
    head = entry(groups, at, 0)
    o = Occluder()
    o.i = wp.cast(head[2], wp.int32)
    o.bound = head[3]
    o.sure = head[3]
    o.e0 = entry(groups, at, 4)
    o.e1 = entry(groups, at, 5)
    o.e2 = entry(groups, at, 6)
    o.plane = entry(groups, at, 7)
    return o
