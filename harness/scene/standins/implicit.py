"""A closed mesh of the surface where a signed distance is zero, for stand-ins of scanned statues. Surface nets (Gibson
1998, "Constrained elastic surface nets"): one vertex in each lattice cell that the surface passes, one quad for each
lattice edge that it crosses. Only lattice points near the surface are evaluated.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ...arrays import F32, F64, I32, I64, Floats
from .shapes import Mesh

# Lattice axes 0, 1, 2 are y, z, x: a cyclic order, so that the orientation of quads holds.
AXES = (1, 2, 0)
COARSEST = 16  # edge of the largest blocks of lattice points, in points


def polygonise(
    distance: Callable[[F32], F32], low: Sequence[float], high: Sequence[float], spacing: float, slack: float = 1.3
) -> Mesh:
    """The zero set of ``distance`` (negative inside) within a box that holds all of it, as one closed mesh.
    ``distance`` takes points float32 [n, 3] in metres and may exceed the true distance by the factor ``slack``. Every
    edge of the result has exactly two faces, the second in the opposite direction.
    """
    origin = np.asarray(low, dtype=np.float64)[list(AXES)]
    extent = np.asarray(high, dtype=np.float64)[list(AXES)] - origin
    blocks = np.ceil(extent / (spacing * COARSEST)).astype(np.int64)
    shape = blocks * COARSEST + 2
    strides = np.array([shape[1] * shape[2], shape[2], 1])

    def evaluate(lattice: Floats | I64) -> F32:
        points = np.empty((len(lattice), 3), dtype=np.float32)
        points[:, AXES] = (origin + spacing * lattice).astype(np.float32)
        return distance(points)

    lattice = _points_near(evaluate, blocks, spacing * slack)
    value = evaluate(lattice)
    flat = (lattice + 1) @ strides
    number = np.full(int(shape.prod()), -1, dtype=np.int32)
    number[flat] = np.arange(len(flat), dtype=np.int32)
    beyond = [number[flat + stride] for stride in strides]
    _part_touching_sheets(value, beyond, spacing)
    return _net(value, lattice, flat, beyond, strides, number, origin, spacing)


def _points_near(evaluate: Callable[[NDArray], F32], blocks: I64, reach: float) -> I64:
    """Lattice points [n, 3] within about two spacings of the surface, by halving blocks that may meet it."""
    halves = np.indices((2, 2, 2)).reshape(3, -1).T
    corner = np.indices(tuple(blocks)).reshape(3, -1).T * COARSEST
    size = COARSEST
    while size > 1:
        # Two ends of an edge that crosses the surface lie within one spacing of it; one more spacing is for
        # _part_touching_sheets, which moves points from outside to inside.
        bound = (np.sqrt(3.0) / 2 * (size - 1) + 2.0) * reach
        corner = corner[np.abs(evaluate(corner + (size - 1) / 2)) < bound]
        size //= 2
        corner = (corner[:, None] + halves * size).reshape(-1, 3)
    return corner


def _part_touching_sheets(value: F32, beyond: list[I32], spacing: float) -> None:
    """Where the surface crosses all four sides of a lattice square, move its outer corners just inside. Such a square
    would give an edge with four faces. Points only ever go inside, so this comes to an end.
    """
    while True:
        inside = value < 0
        crossed = [(end >= 0) & (inside[end] != inside) for end in beyond]
        for b, c in ((0, 1), (1, 2), (2, 0)):
            corner = np.flatnonzero(crossed[b] & crossed[c])
            right, up = beyond[b][corner], beyond[c][corner]
            across = beyond[c][right]
            bad = (across >= 0) & (inside[across] == inside[corner])
            if bad.any():
                square = np.concatenate([corner[bad], right[bad], up[bad], across[bad]])
                value[square] = np.minimum(value[square], np.float32(-0.05 * spacing))
                break
        else:
            return


def _net(
    value: F32, lattice: I64, flat: I64, beyond: list[I32], strides: I64, number: I32, origin: F64, spacing: float
) -> Mesh:
    """Vertices at the mean of each cell's crossings, and two triangles for each crossed edge."""
    cells, crossings, outward = [], [], []
    for a in range(3):
        start = np.flatnonzero(beyond[a] >= 0)
        end = beyond[a][start]
        crossed = (value[start] < 0) != (value[end] < 0)
        start, end = start[crossed], end[crossed]
        first, second = value[start].astype(np.float64), value[end].astype(np.float64)
        place = lattice[start].astype(np.float64)
        # Kept off the lattice points, where vertices of neighbouring cells would fall together.
        place[:, a] += np.clip(first / (first - second), 0.02, 0.98)
        b, c = strides[(a + 1) % 3], strides[(a + 2) % 3]
        # The four cells that share the edge, counter-clockwise seen against the axis.
        cells.append(flat[start][:, None] - np.array([b + c, c, 0, b]))
        crossings.append(place)
        outward.append(first < 0)
    around, place, front = np.concatenate(cells), np.concatenate(crossings), np.concatenate(outward)

    used = np.zeros(len(number), dtype=bool)
    used[around.ravel()] = True
    present = np.flatnonzero(used)
    number[present] = np.arange(len(present), dtype=np.int32)
    quads = number[around]
    share = np.bincount(quads.ravel(), minlength=len(present))
    vertices = np.empty((len(present), 3))
    for a in range(3):
        total = np.bincount(quads.ravel(), weights=np.repeat(place[:, a], 4), minlength=len(present))
        vertices[:, AXES[a]] = origin[a] + spacing * total / share

    quads[~front] = quads[~front, ::-1]
    p = vertices[quads]
    short = ((p[:, 0] - p[:, 2]) ** 2).sum(axis=1) <= ((p[:, 1] - p[:, 3]) ** 2).sum(axis=1)
    # Split along the shorter diagonal: 0-2 where short, else 1-3.
    order = np.where(short[:, None], [0, 1, 2, 0, 2, 3], [1, 2, 3, 1, 3, 0])
    faces = np.take_along_axis(quads, order, axis=1).reshape(-1, 3)
    return Mesh(vertices, np.ascontiguousarray(faces, dtype=np.int32))
