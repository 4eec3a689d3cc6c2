"""Which parts of a mesh are closed surfaces in a frame, with eye and lights outside.

Triangles that share an edge are of one part. A part is closed if each of its edges is run through as often in one direction
as in the other. Then its triangles wind around every point off the surface a whole number of times, 0 outside their box,
however many meet at an edge and whether or not they cross. Edges are those between indices; of what these leave open, those
between welded vertices, in the frames in which the weld holds. Triangles without area count: a segment that is in no special
position does not meet them. Two triangles with the same corners that are wound in opposite directions cancel, and neither is
marked: a sheet of such pairs is seen from both sides.
"""

import functools

import numpy as np

from ..arrays import F32, F64, I32, I64, U8, Bools
from .moment import Moment
from .prepared import Prepared

CLOSED, TURNED, TOUCHED = 2, 4, 8
"""Bits of a triangle besides 1, which says that it may be hit: it is of a closed part; its corners are listed against the
part's outward winding; a method met what forbids to count the part as closed, and says so.
"""

OPEN = -1

LEAST_SHARE = 2.0**-5  # of the triangles: with fewer in closed parts, leaving some of them out gains nothing

Measured = tuple[F64, F64, Bools, Bools]


class ClosedParts:
    """The parts of a mesh that are closed, as far as that does not depend on the frame.

    of  int32 [triangle_count]: the part of each triangle that may be marked, or :data:`OPEN`      count  parts
    """

    def __init__(self, prepared: Prepared):
        self._weld = prepared.weld
        self._faces = np.ascontiguousarray(prepared.geometry.faces, dtype=np.int32).reshape(-1, 3)
        # Duplicates are prepared in one order, whatever their winding was.
        self._reversed = _odd(self._faces) != _odd(prepared.faces)
        holes = np.zeros(len(self._faces), dtype=bool)
        if prepared.alpha is not None:
            holes = np.asarray(prepared.alpha.triangles) != 0
        self.of = np.full(len(self._faces), OPEN, dtype=np.int32)
        self.count = 0
        for vertices in (np.arange(prepared.vertex_count, dtype=np.int32), self._weld):
            self._welded_from = self.count
            rows = np.nonzero(self.of == OPEN)[0]
            found, count = closed_parts(vertices[self._faces[rows]], holes[rows])
            self.of[rows] = np.where(found == OPEN, OPEN, found + self.count)
            self.count += count
        self._rows = np.nonzero(self.of != OPEN)[0]
        self._points: F32 | None = None
        self._measured: Measured

    def _measure(self, points: F32) -> Measured:
        """Lowest and highest corner of each part in a frame, which parts are closed, and which are wound inward."""
        faces, of = self._faces[self._rows], self.of[self._rows]
        corners = points[faces].astype(np.float64)
        low, high = np.full((self.count, 3), np.inf), np.full((self.count, 3), -np.inf)
        moved = (points != points[self._weld]).any(axis=1)
        apart = np.bincount(of[moved[faces].any(axis=1)], minlength=self.count) > 0
        apart[: self._welded_from] = False
        with np.errstate(invalid="ignore", over="ignore"):  # a part with a vertex that is not finite is open
            for axis in range(3):
                np.minimum.at(low[:, axis], of, corners[:, :, axis].min(axis=1))
                np.maximum.at(high[:, axis], of, corners[:, :, axis].max(axis=1))
            a, b, c = (corners[:, k] - ((low + high) / 2)[of] for k in range(3))
            volume = np.bincount(of, (a * np.cross(b, c)).sum(axis=1), minlength=self.count)
        return low, high, np.isfinite(low).all(axis=1) & np.isfinite(high).all(axis=1) & ~apart, volume < 0

    def flags(self, moment: Moment, shadows: tuple[bool, ...], opened: Bools) -> U8:
        """Bits of triangles, uint8 [triangle_count]. ``shadows``: lights with them; ``opened`` [count]: open parts."""
        flags = moment.valid.copy()
        if moment.points is not self._points:
            self._points, self._measured = moment.points, self._measure(moment.points)
        low, high, closed, inward = self._measured
        lights = moment.lights[np.array(shadows, dtype=bool)]
        for point in (moment.eye, *lights):
            closed = closed & ((point < low) | (point > high)).any(axis=1)
        rows = self._rows[(closed & ~opened)[self.of[self._rows]]]
        rows = rows[moment.valid[rows] != 0]
        flags[rows] |= np.uint8(CLOSED)
        flags[rows[self._reversed[rows] != inward[self.of[rows]]]] |= np.uint8(TURNED)
        return flags


@functools.lru_cache(maxsize=2)
def closed_parts_of(prepared: Prepared) -> ClosedParts:
    """The closed parts of a prepared mesh, found once."""
    return ClosedParts(prepared)


def enough(flags: U8) -> bool:
    """Whether enough triangles are of closed parts to leave some out."""
    return bool(np.count_nonzero(flags & CLOSED) > LEAST_SHARE * len(flags))


def closed_parts(faces: I32, holes: Bools) -> tuple[I64, int]:
    """The closed parts of ``faces`` [n, 3]: the part of each triangle that may be marked, or :data:`OPEN`, and how many
    there are. A part with a triangle that has ``holes`` [n] is open.
    """
    from scipy.sparse import coo_matrix  # here: a scene is listed without it
    from scipy.sparse.csgraph import connected_components

    count = len(faces)
    labels = np.full(count, OPEN, dtype=np.int64)
    p, q = faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel()
    sides = np.nonzero(p != q)[0]
    p, q, triangle = p[sides], q[sides], sides // 3
    if not len(sides):
        return labels, 0
    ends = np.minimum(p, q) * (int(faces.max()) + 1) + np.maximum(p, q)
    edge = np.unique(ends, return_inverse=True)[1].ravel()
    uneven = np.bincount(edge, np.where(p < q, 1, -1)) != 0
    size = count + len(uneven)
    joined = coo_matrix((np.ones(len(sides), dtype=np.int8), (triangle, count + edge)), shape=(size, size))
    parts, found = connected_components(joined, directed=False)
    found = found[:count]
    bad = np.ones(parts, dtype=bool)
    bad[found[triangle]] = False
    bad[found[triangle[uneven[edge]]]] = True
    bad[found[holes]] = True
    rows = np.nonzero(~bad[found])[0]
    rows = rows[~cancelled(faces[rows])]
    kept, labels[rows] = np.unique(found[rows], return_inverse=True)
    return labels, len(kept)


def cancelled(faces: I32) -> Bools:
    """Triangles whose corners are those of as many that are wound the other way."""
    low, middle, high = np.sort(faces, axis=1).astype(np.int64).T
    number = int(faces.max(initial=0)) + 1
    side = np.unique(low * number + middle, return_inverse=True)[1].ravel()
    same = np.unique(side * number + high, return_inverse=True)[1].ravel()
    return (np.bincount(same, np.where(_odd(faces), -1, 1))[same] == 0) & (low < middle) & (middle < high)


def _odd(faces: I32) -> Bools:
    """Whether the corners of each triangle are an odd permutation of their ascending order."""
    a, b, c = faces.T
    result: Bools = (a > b) ^ (b > c) ^ (a > c)
    return result
