"""The order in which triangles list their corners: duplicates list them as the first of them does.

A distance is computed from the corners in their order, so that of duplicates in another order it differs in its last bit.
Methods that compare rounded distances would then name the lower index or not, as rounding has it. With one order all their
numbers are the same bits, and the lowest index wins in every method. Nobody sees the new order of a triangle without holes:
a triangle with a lower index is hit wherever it is.
"""

import numpy as np
from numpy.typing import NDArray

from ..arrays import I32


def in_order_of_duplicates(faces: I32, weld: I32, closed: bool) -> I32:
    """``faces`` with the corners of each duplicate in the order of the first triangle with the same welded corners.
    faces [n, 3], weld [vertex_count] as :func:`.prepared.weld` gives it. In a ``closed`` scene duplicates that are
    wound the other way are only rotated, because back faces are told by how they are wound.
    """
    welded = weld[faces] if len(faces) else faces
    places = np.argsort(welded, axis=1, kind="stable")
    corners = np.ascontiguousarray(np.take_along_axis(welded, places, axis=1))
    _, first, inverse = np.unique(corners.view("V12").ravel(), return_index=True, return_inverse=True)
    first = first[inverse.ravel()]
    rows = np.nonzero((welded[first] != welded).any(axis=1))[0]
    # The k-th corner of the first is its ranks[k]-th in ascending order; that is where a duplicate's lies.
    ranks = np.argsort(places[first[rows]], axis=1, kind="stable")
    order = np.take_along_axis(places[rows], ranks, axis=1)
    if closed:
        turned = (order[:, 1] - order[:, 0]) % 3 == 1
        rows, order = rows[turned], order[turned]
    result = faces.copy()
    result[rows] = np.take_along_axis(faces[rows], order, axis=1)
    return result


def follow(values: NDArray, before: I32, after: I32) -> NDArray:
    """``values`` [n, 3, ...] of the corners in the order ``before``, in the order ``after`` of the same triangles."""
    rows = np.nonzero((before != after).any(axis=1))[0]
    places = (after[rows][:, :, None] == before[rows][:, None, :]).argmax(axis=2)
    result = values.copy()
    result[rows] = values[rows[:, None], places]
    return result
