"""What the rays of a light cover, as its triangles read it: a rectangle for each face, and a row for all of them.

Rows of the table, vec4f: of a face (low u, low v, bins per u, bins per v), zero if it has no ray; after the faces
(cells along a face, largest coordinate of a hit point, sum of 2^face of those with rays, 0).
"""

from __future__ import annotations

import warp as wp

from ....harness.frame.geometry import Corners
from ...gpu.entries import entry
from .aim import FACE, FACES, HIGH_U, HIGH_V, LARGEST, LOW_U, LOW_V, Cube, from_ordered
from .footprint import extent_from
from .spacing import BINS


@wp.func
def face_rectangle(face: wp.int32, rectangle: wp.array(dtype=wp.int32)) -> wp.vec4f:
    """(low u, low v, bins per u, bins per v) of a face (:mod:`.spacing`)."""
    low_u = wp.float32(-1.0)
    low_v = wp.float32(-1.0)
    high_u = wp.float32(1.0)
    high_v = wp.float32(1.0)
    if face == 0:
        low_u = from_ordered(rectangle[LOW_U])
        low_v = from_ordered(rectangle[LOW_V])
        high_u = -from_ordered(rectangle[HIGH_U])
        high_v = -from_ordered(rectangle[HIGH_V])
    n = wp.float32(BINS)
    margin = (
        1.0e-6 * wp.max(wp.max(wp.abs(low_u), wp.abs(high_u)), wp.max(wp.abs(low_v), wp.abs(high_v)))
        + 1.0e-30
    )
    return wp.vec4f(low_u, low_v, n / (high_u - low_u + margin), n / (high_v - low_v + margin))


@wp.func
def cells_in_use(rectangle: wp.array(dtype=wp.int32), cells: wp.vec3i) -> wp.int32:
    """Cells along a face: the first number where rays lie on many faces, the second where they lie on at most ``cells[2]``.
    Face 0 counts even without rays.

    In finer cells a triangle meets fewer rays that it does not cover, but the cells of every face in use are cleared and
    summed.
    """
    others = wp.int32(0)
    for k in range(1, FACES):
        if rectangle[FACE + k] == 0:
            others += 1
    return wp.where(others < cells[2], cells[1], cells[0])


@wp.func
def face_in_use(rectangle: wp.array(dtype=wp.int32), number: wp.int32) -> wp.int32:
    """Face ``number``, counted from 0, of those that hold rays; -1 if there are no more."""
    found = wp.int32(-1)
    left = wp.int32(number)
    for k in range(FACES):
        if rectangle[FACE + k] == 0:
            if left == 0:
                found = k
            left -= 1
    return found


@wp.func
def set_table(
    k: wp.int32, rectangle: wp.array(dtype=wp.int32), table: wp.array(dtype=wp.vec4f), along: wp.int32
):
    """Set row k of the table, if there is one; ``along``: cells along a face."""
    if k < FACES:
        t = wp.vec4f(0.0, 0.0, 0.0, 0.0)
        if rectangle[FACE + k] == 0:
            t = face_rectangle(k, rectangle)
        table[k] = t
    if k == FACES:
        faces = wp.int32(0)
        for face in range(FACES):
            if rectangle[FACE + face] == 0:
                faces = faces | (1 << face)
        table[k] = wp.vec4f(
            wp.float32(along), wp.cast(rectangle[LARGEST], wp.float32), wp.float32(faces), 0.0
        )


@wp.func
def last_row(table: wp.array(dtype=wp.vec4f)) -> wp.vec4f:
    """The row for all faces, which the functions below read."""
    return entry(table, FACES)


@wp.func
def cells_of(row: wp.vec4f) -> wp.int32:
    """Cells along a face."""
    return wp.int32(row[0])


@wp.func
def faces_of(row: wp.vec4f) -> wp.uint32:
    """A bit for each face with rays."""
    return wp.uint32(row[2])


@wp.func
def max_coordinate_of(row: wp.vec4f) -> wp.float32:
    """The largest coordinate of a hit point."""
    return row[1]


@wp.func
def extent_with_rays(cube: Cube, corners: Corners, row: wp.vec4f) -> wp.float32:
    """:func:`.footprint.extent_from`, enlarged so that bounds of 32 u extent cover four times what hit points are off by,
    which is at most u of their largest coordinate (:mod:`..rays.hit_points`)."""
    return extent_from(cube.middle, corners) + 0.125 * max_coordinate_of(row)
