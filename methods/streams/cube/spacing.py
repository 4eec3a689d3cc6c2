"""Columns and rows of a face's cells, narrow where rays are dense.

Rays lie unevenly on a light's cube: what the camera sees closely holds most of them, in a small part of a face. In cells of
equal size most tests would be of rays that lie in the cell at the end of a triangle's row, but not in the triangle. So each
axis of a face is divided into :data:`BINS` bins of equal size, and each bin into columns (or rows) of equal size, more of
them where more rays are expected. No answer depends on it, so a rough number is enough: of many rays some are drawn by
chance, and each stands for others. Additions to the same word wait for one another.

A coordinate t in bins becomes a coordinate in cells by :func:`in_cells`, which is monotone but for its rounding. So a
triangle's bounds in bins bound its cells, if they are widened by :data:`BIN_SLACK` before and by :data:`CELL_SLACK` after.

spacing  vec2f [2 axes * 6 faces * BINS]: of each bin, the cell where it begins, and how many cells it has
edges    vec2f [6 faces * cells along a face]: where each row begins and ends, in bins
density  float32 [2 axes * 6 faces * INTERVALS]: rays expected in equal intervals of -1 to 1; on face 0 of the range that the
         scene may cover (:data:`.rectangle.RANGE`)

:class:`.cells.SpacedCells` have them; all :class:`.cells.RayCells` have one size.
"""

import warp as wp

from ...gpu.division import about_inverse
from ...gpu.entries import entry
from .cells import FACES, RayCells, SpacedCells
from .rectangle import BINS, RANGE, cells_in_use, face_rectangle

AXES, INTERVALS = wp.constant(2), wp.constant(64)

BIN_SLACK = wp.constant(wp.float32(2.0**-13))
"""Bound in bins on what rounding may move t of a ray and of a bound by, together: each by 2^-18, whether products are fused
with sums or not. Where a row begins is rounded by 2^-15.
"""

CELL_SLACK = wp.constant(wp.float32(2.0**-8))
"""The same in cells, once t is given. A cell's number, at most 8,192, is rounded by 2^-11, and so is where a bin begins."""

EVEN = wp.constant(wp.float32(0.25))
"""Part of the cells that is distributed evenly over the bins, whatever rays are expected."""

WHETHER = wp.constant(wp.uint32(2654435769))
"""2^32 over the golden ratio: its multiples, modulo 2^32, cover a line evenly."""

ONE_OF = wp.constant(wp.float32(1.0 / 128.0))
"""Part of the rays that are drawn."""


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


@wp.func
def intervals_per_unit(face: wp.int32, rectangle: wp.array(dtype=wp.int32)) -> wp.float32:
    """Intervals of a face for a unit of u or v."""
    half = 0.5 * wp.float32(INTERVALS)
    return wp.where(face == 0, half / wp.cast(rectangle[RANGE], wp.float32), half)


@wp.func
def expect_ray(pixel: wp.int32, place: wp.vec4f, cells: RayCells):
    """Expect the ray of a pixel (:func:`.cells.place_of`), if it is drawn: one evenly distributed over successive pixels."""


@wp.func
def expect_ray(pixel: wp.int32, place: wp.vec4f, cells: SpacedCells):
    if place[2] >= 0.0 and wp.float32((wp.uint32(pixel) * WHETHER) >> wp.uint32(8)) / 16777216.0 < ONE_OF:
        face = wp.int32(place[2])
        n = wp.float32(INTERVALS)
        scale = intervals_per_unit(face, cells.rectangle)
        x = wp.int32(wp.clamp(0.5 * n + place[0] * scale, 0.0, n - 0.5))
        y = wp.int32(wp.clamp(0.5 * n + place[1] * scale, 0.0, n - 0.5))
        wp.atomic_add(cells.density, face * INTERVALS + x, 1.0)
        wp.atomic_add(cells.density, (FACES + face) * INTERVALS + y, 1.0)


@wp.func
def bin_of_cells(axis: wp.int32, face: wp.int32, b: wp.int32, along: wp.int32, cells: SpacedCells) -> wp.vec2f:
    """The cell where a bin begins, and how many it has, by the rays that are expected before and in it."""
    r = face_rectangle(face, cells.rectangle)
    low = wp.where(axis == 0, r[0], r[1])
    per_unit = wp.where(axis == 0, r[2], r[3])
    scale = intervals_per_unit(face, cells.rectangle)
    first = 0.5 * wp.float32(INTERVALS) + low * scale
    width = scale / per_unit
    here = first + wp.float32(b) * width
    beyond = first + wp.float32(b + 1) * width
    last = first + wp.float32(BINS) * width
    before = wp.float32(0.0)
    inside = wp.float32(0.0)
    total = wp.float32(0.0)
    for k in range(0, INTERVALS, 4):
        place = (axis * FACES + face) * INTERVALS + k
        # Four at a time: what is loaded is on its way at once.
        rays = wp.vec4f(
            entry(cells.density, place),
            entry(cells.density, place + 1),
            entry(cells.density, place + 2),
            entry(cells.density, place + 3),
        )
        for j in range(4):
            begins = wp.float32(k + j)
            outside = wp.clamp(first - begins, 0.0, 1.0)
            before += rays[j] * (wp.clamp(here - begins, 0.0, 1.0) - outside)
            inside += rays[j] * (wp.clamp(beyond - begins, 0.0, 1.0) - outside)
            total += rays[j] * (wp.clamp(last - begins, 0.0, 1.0) - outside)
    n = wp.float32(along)
    even = n / wp.float32(BINS)
    by_rays = wp.float32(0.0)
    if total > 1.0e-20 and total < 1.0e30:
        even = EVEN * even
        by_rays = (1.0 - EVEN) * n / total
    else:
        before = 0.0
        inside = 0.0
    begins_at = wp.float32(b) * even + before * by_rays
    ends_at = wp.float32(b + 1) * even + inside * by_rays
    if b == BINS - 1:
        ends_at = n
    return wp.vec2f(begins_at, ends_at - begins_at)


@wp.kernel(enable_backward=False, grid_stride=False)
def spacing_kernel(cells: SpacedCells):
    """The spacing of the cells, where what the rays cover is known. A thread for each bin."""
    k = wp.tid()
    line = k // BINS
    along = cells_in_use(cells.rectangle, cells.cells)
    cells.spacing[k] = bin_of_cells(line // FACES, line % FACES, k % BINS, along, cells)


SPACING_THREADS = int(AXES) * int(FACES) * int(BINS)


def spacing_arrays(device: str, along: int) -> dict[str, wp.array]:
    """What :class:`.cells.SpacedCells` have besides :class:`.cells.RayCells`; at most ``along`` cells lie along a face."""
    with wp.ScopedDevice(device):
        return {
            "spacing": wp.zeros(SPACING_THREADS, dtype=wp.vec2f),
            "edges": wp.zeros(int(FACES) * along, dtype=wp.vec2f),
            "density": wp.zeros(int(AXES) * int(FACES) * int(INTERVALS), dtype=wp.float32),
        }
