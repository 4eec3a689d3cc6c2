"""Columns and rows of a face's cells, narrow where rays are dense.

Rays lie unevenly on a light's cube: what the camera sees closely holds most of them, in a small part of a face. In cells of
equal size most tests would be of rays that lie in the cell at the end of a triangle's row, but not in the triangle. So each
axis of a face is divided into :data:`BINS` bins of equal size, and each bin into columns (or rows) of equal size, more of
them where more rays are expected (:mod:`.density`). No answer depends on it.

A coordinate t in bins becomes a coordinate in cells by :func:`in_cells`, which is monotone but for its rounding. So a
triangle's bounds in bins bound its cells, if they are widened by :data:`BIN_SLACK` before and by :data:`CELL_SLACK` after.

spacing  vec2f [2 axes * 6 faces * BINS]: of each bin, the cell where it begins, and how many cells it has
edges    vec2f [6 faces * cells along a face]: where each row begins and ends, in bins

:class:`.cells.SpacedCells` have them; all :class:`.cells.RayCells` have one size.
"""

import warp as wp

from ...gpu.division import about_inverse
from ...gpu.entries import entry
from .cells import RayCells, SpacedCells
from .faces import FACES

AXES, BINS = wp.constant(2), wp.constant(32)

BIN_SLACK = wp.constant(wp.float32(2.0**-13))
"""Bound in bins on what rounding may move t of a ray and of a bound by, together: each by 2^-18, whether products are fused
with sums or not. Where a row begins is rounded by 2^-15."""

CELL_SLACK = wp.constant(wp.float32(2.0**-8))
"""The same in cells, once t is given. A cell's number, at most 8,192, is rounded by 2^-11, and so is where a bin begins."""


@wp.func
def first_bin(axis: wp.int32, face: wp.int32) -> wp.int32:
    """The place of the first bin of an axis (0: columns, 1: rows) of a face."""
    return (axis * FACES + face) * BINS


@wp.func
def in_cells(cells: RayCells, axis: wp.int32, face: wp.int32, t: wp.float32, along: wp.int32) -> wp.float32:
    """A coordinate t in bins, clamped to the face, in cells; there are ``along`` on the face."""
    n = wp.float32(BINS)
    return wp.clamp(t, 0.0, n) * (wp.float32(along) / n)


@wp.func
def in_cells(cells: SpacedCells, axis: wp.int32, face: wp.int32, t: wp.float32, along: wp.int32) -> wp.float32:
    inside = wp.clamp(t, 0.0, wp.float32(BINS))
    b = wp.min(wp.int32(inside), BINS - 1)
    begun = entry(cells.spacing, first_bin(axis, face) + b)
    return begun[0] + (inside - wp.float32(b)) * begun[1]


@wp.func
def edge_of_row(spacing: wp.array(dtype=wp.vec2f), face: wp.int32, row: wp.int32, along: wp.int32) -> wp.float32:
    """Where a row begins, in bins; the last one begins at ``along``."""
    if row == along:
        return wp.float32(BINS)
    x = wp.float32(row)
    first = first_bin(1, face)
    b = wp.int32(0)
    half = wp.int32(BINS // 2)
    while half > 0:
        if entry(spacing, first + b + half)[0] <= x:
            b += half
        half = half // 2
    begun = entry(spacing, first + b)
    return wp.float32(b) + wp.clamp((x - begun[0]) / begun[1], 0.0, 1.0)


@wp.func
def set_edges(thread: wp.int32, threads: wp.int32, cells: RayCells, along: wp.int32):
    """Set where the rows of all faces begin and end, by so many threads."""


@wp.func
def set_edges(thread: wp.int32, threads: wp.int32, cells: SpacedCells, along: wp.int32):
    k = wp.int32(thread)
    while k < FACES * along:
        face = k // along
        row = k - face * along
        cells.edges[k] = wp.vec2f(
            edge_of_row(cells.spacing, face, row, along), edge_of_row(cells.spacing, face, row + 1, along)
        )
        k += threads


@wp.func
def row_between(cells: RayCells, face: wp.int32, row: wp.int32, along: wp.int32) -> wp.vec2f:
    """Where a row begins and ends, in bins."""
    height = wp.float32(BINS) * about_inverse(wp.float32(along))
    begins = wp.float32(row) * height
    return wp.vec2f(begins, begins + height)


@wp.func
def row_between(cells: SpacedCells, face: wp.int32, row: wp.int32, along: wp.int32) -> wp.vec2f:
    return entry(cells.edges, face * along + row)
