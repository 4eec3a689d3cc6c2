"""Parts of a scene over time as one mesh of fixed topology: what vanishes or changes has NaN positions where it is not."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...arrays import I32, Floats

Piece = tuple[Floats, I32]  # positions [n, 3] and faces [m, 3] of a part at one frame


@dataclass(frozen=True, eq=False)
class Fixed:
    """A mesh of fixed topology.

    frames    positions [vertex_count, 3] of each frame
    padded    the parts whose topology changes: triangles with vertices of their own, as many as the part has at most
    vanishing the other parts that some frames do not have
    """

    faces: I32
    frames: tuple[Floats, ...]
    padded: tuple[int, ...]
    vanishing: tuple[int, ...]


def fixed_topology(frames: Sequence[Sequence[Piece | None]]) -> Fixed:
    """Join the parts of each frame, in order. ``frames[k][i]``: part i at frame k, or None where it is not there.
    float64 if any part is, else float32. Triangles of a padded part are in the order of its frame, so that one of them
    is not the same piece of surface in all frames."""
    there = [[piece for piece in part if piece is not None] for part in zip(*frames, strict=True)]
    padded = [any(not _alike(piece, own[0]) for piece in own) for own in there]
    types = {piece[0].dtype for own in there for piece in own}
    dtype = np.result_type(*types) if types else np.dtype(np.float32)
    faces: list[I32] = []
    counts: list[int] = []
    for own, loose in zip(there, padded, strict=True):
        most = 3 * max((len(corners) for _, corners in own), default=0)
        corners = np.arange(most, dtype=np.int32).reshape(-1, 3) if loose or not own else own[0][1]
        faces.append(corners + sum(counts) if sum(counts) else corners)
        counts.append(most if loose or not own else len(own[0][0]))

    def positions(frame: Sequence[Piece | None]) -> Floats:
        return _joined([_filled(*of, dtype) for of in zip(frame, counts, padded, strict=True)], dtype)

    return Fixed(
        _joined(faces, np.int32),
        tuple(map(positions, frames)),
        tuple(i for i, loose in enumerate(padded) if loose),
        tuple(i for i, own in enumerate(there) if 0 < len(own) < len(frames) and not padded[i]),
    )


def _alike(piece: Piece, other: Piece) -> bool:
    same = piece[1] is other[1] or np.array_equal(piece[1], other[1])
    return same and len(piece[0]) == len(other[0])


def _filled(piece: Piece | None, count: int, padded: bool, dtype: np.dtype) -> Floats:
    """Positions [count, 3] of a part at a frame, NaN where it is not; of a padded one those of the corners in turn."""
    if piece is not None and not padded:
        return piece[0]
    result = np.full((count, 3), np.nan, dtype=dtype)
    if piece is not None:
        points, faces = piece
        result[: 3 * len(faces)] = points[faces].reshape(-1, 3)
    return result


def _joined(arrays: list[NDArray], dtype: np.dtype | type) -> NDArray:
    """The arrays [n, 3] one below the other; without a copy where there is only one."""
    full = [array for array in arrays if len(array)]
    if len(full) == 1:
        return np.ascontiguousarray(full[0], dtype=dtype)
    return np.concatenate(full, dtype=dtype, casting="unsafe") if full else np.zeros((0, 3), dtype=dtype)
