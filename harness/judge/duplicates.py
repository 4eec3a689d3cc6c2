"""Duplicates: triangles with the same three positions, in any order."""

import numpy as np

from ..arrays import F32, I32, Bools


def lowest_duplicates(corners: F32, single: Bools) -> I32:
    """The lowest index of a triangle with the same three positions, int32 [n]; its own for those that are ``single``.

    corners [n, 3, 3], single [n]
    """
    corners = corners + np.float32(0.0)  # -0 becomes +0
    bits = corners.view(np.uint32).astype(np.uint64)
    mixed = bits[..., 0] * np.uint64(0x9E3779B97F4A7C15)
    mixed += (bits[..., 1] ^ (mixed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed += (bits[..., 2] ^ (mixed >> np.uint64(31))) * np.uint64(0x94D049BB133111EB)
    mixed ^= mixed >> np.uint64(32)
    # A sum, so that the order of the vertices does not matter; collisions are found by comparing.
    _, first, inverse = np.unique(mixed.sum(axis=1), return_index=True, return_inverse=True)
    lowest = first[inverse.ravel()].astype(np.int32)
    rows = np.nonzero(lowest != np.arange(len(lowest)))[0]
    mine, theirs = (
        np.take_along_axis(corners[k], np.argsort(mixed[k], axis=1)[..., None], axis=1) for k in (rows, lowest[rows])
    )
    same = (mine == theirs).all(axis=(1, 2)) & ~single[rows] & ~single[lowest[rows]]
    lowest[rows[~same]] = rows[~same]  # at worst a duplicate is judged exactly instead of by this table
    return lowest
