"""Parts of a scene over time as one mesh of fixed topology: what vanishes or changes has NaN positions where it is not."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...arrays import I32, Floats

Piece = tuple[Floats, I32]
"""Positions [n, 3] and faces [m, 3] of a part at one frame."""


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


@dataclass(frozen=True, eq=False)
class _Layout:
    """The vertices and faces that one part has in every frame; ``padded`` if each triangle has three of its own."""

    vertices: int
    faces: I32
    padded: bool
    vanishing: bool

    def positions(self, piece: Piece | None, dtype: np.dtype) -> Floats:
        if piece is not None and not self.padded:
            return piece[0]
        result = np.full((self.vertices, 3), np.nan, dtype=dtype)
        if piece is not None:
            points, faces = piece
            result[: 3 * len(faces)] = points[faces].reshape(-1, 3)
        return result


def fixed_topology(frames: Sequence[Sequence[Piece | None]]) -> Fixed:
    """Join the parts of each frame, in order. ``frames[k][i]``: part i at frame k, or None where it is not there.

    float64 if any part is, else float32. Triangles of a padded part are in the order of its frame, so that one of them is
    not the same piece of surface in all frames.
    """
    parts = [[frame[i] for frame in frames] for i in range(len(frames[0]))]
    layouts = [_layout(part) for part in parts]
    types = {piece[0].dtype for part in parts for piece in part if piece is not None}
    dtype = np.result_type(*types) if types else np.dtype(np.float32)
    offsets = np.cumsum([0, *(layout.vertices for layout in layouts)])
    faces = [
        layout.faces + int(offset) if offset else layout.faces for layout, offset in zip(layouts, offsets, strict=False)
    ]
    return Fixed(
        _joined(faces, np.int32),
        tuple(
            _joined([layout.positions(part[k], dtype) for layout, part in zip(layouts, parts, strict=True)], dtype)
            for k in range(len(frames))
        ),
        tuple(i for i, layout in enumerate(layouts) if layout.padded),
        tuple(i for i, layout in enumerate(layouts) if layout.vanishing),
    )


def _layout(part: Sequence[Piece | None]) -> _Layout:
    there = [piece for piece in part if piece is not None]
    if not there:
        return _Layout(0, np.zeros((0, 3), dtype=np.int32), False, False)
    points, faces = there[0]
    same = all(
        len(own) == len(points) and (corners is faces or np.array_equal(corners, faces)) for own, corners in there
    )
    if same:
        return _Layout(len(points), faces, False, len(there) < len(part))
    most = max(len(corners) for _, corners in there)
    return _Layout(3 * most, np.arange(3 * most, dtype=np.int32).reshape(-1, 3), True, False)


def _joined(arrays: list[NDArray], dtype: np.dtype | type) -> NDArray:
    """The arrays [n, 3] one below the other; without a copy where there is only one."""
    full = [array for array in arrays if len(array)]
    if len(full) == 1:
        return np.ascontiguousarray(full[0], dtype=dtype)
    return np.concatenate(full, dtype=dtype, casting="unsafe") if full else np.zeros((0, 3), dtype=dtype)
