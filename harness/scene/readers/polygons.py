"""Triangulation of polygons, n corners to n - 2 triangles in their order; and parts over time as one mesh of fixed
topology: what vanishes or changes has NaN positions where it is not.

A fan about the first corner is right for a convex polygon, and for any other that its first corner sees all of. Where it
is not, the fan about another corner may be; else the polygon's ears are clipped (mapbox_earcut).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...arrays import F64, I32, I64, Bools, Floats, Ints
from .checks import broken

_BLOCK = 1 << 16  # corners that are triangulated at a time
_CORNERS = 8  # how many corners of a polygon are tried for a fan
_STRAIGHT = 1e-6  # sine of the largest angle that counts as none, for corners on one line that float32 has rounded

Piece = tuple[Floats, I32]  # positions [n, 3] and faces [m, 3] of a part at one frame


def polygon_sizes(path: Path, counts: Ints, where: str = "") -> None:
    """Raise :class:`UserError` if a polygon has fewer than 3 corners. Dropping it would shift the triangle indices.

    where  what is written before the face
    """
    small = np.flatnonzero(np.asarray(counts) < 3)
    if len(small):
        problem = f"{where}face {small[0]} has {counts[small[0]]} vertices"
        raise broken(path, problem, "a face needs at least 3: remove it")


def triangulate(points: Floats, counts: Ints, corners: Ints) -> I32:
    """The triangles of polygons, int32 [sum(counts - 2), 3].

    points   [vertex_count, 3]; may hold NaN: such a polygon is a fan
    counts   number of corners of each polygon, at least 3
    corners  the vertex indices of all polygons, one after the other, below 2^31. If one is out of range, all polygons are
             fans: the caller refuses the file

    It works in blocks and needs little memory beside its result.
    """
    if (counts == 3).all():
        return corners.astype(np.int32, copy=False).reshape(-1, 3)
    known = corners.min() >= 0 and corners.max() < len(points)
    faces = np.empty((int(counts.sum()) - 2 * len(counts), 3), dtype=np.int32)
    starts = np.cumsum(counts, dtype=np.int64) - counts
    triangles = starts - 2 * np.arange(len(counts))
    for polygons in _alike(counts):
        size = counts[polygons[0]]
        own = corners[starts[polygons][:, None] + np.arange(size)]
        places = triangles[polygons][:, None] + np.arange(size - 2)
        faces[places] = own[:, _fan(size)]
        wrong = _wrong_fans(points[own]) if known and size > 3 else np.zeros(len(own), dtype=bool)
        if wrong.any():
            cut = _cut(points[own[wrong]].astype(np.float64))
            faces[places[wrong]] = own[wrong][np.arange(wrong.sum())[:, None, None], cut]
    return faces


def _fan(size: int) -> I64:
    """The triangles of a polygon about its first corner, [size - 2, 3]."""
    corner = np.arange(1, size - 1)
    return np.stack([0 * corner, corner, corner + 1], axis=1)


def _alike(counts: Ints) -> Iterator[I64]:
    """The polygons in groups of one size and of about :data:`_BLOCK` corners."""
    order = np.argsort(counts, kind="stable")
    sizes, firsts = np.unique(counts[order], return_index=True)
    for size, group in zip(sizes.tolist(), np.split(order, firsts[1:]), strict=True):
        yield from np.array_split(group, min(len(group), -(-len(group) * size // _BLOCK)))


def _wrong_fans(points: Floats) -> Bools:
    """Whether a triangle of a polygon's fan is turned against the polygon's normal (Newell's). [polygons]

    points  the corners, [polygons, corners, 3]
    """
    with np.errstate(invalid="ignore", over="ignore"):
        arms = points[:, 1:].astype(np.float64) - points[:, :1]
        areas = np.cross(arms[:, :-1], arms[:, 1:])
        normal = areas.sum(axis=1, keepdims=True)
        lengths = np.sqrt((arms * arms).sum(axis=2))
        noise = _STRAIGHT * lengths[:, :-1] * lengths[:, 1:] * np.sqrt((normal * normal).sum(axis=2))
        return ((areas * normal).sum(axis=2) < -noise).any(axis=1)


def _cut(points: F64) -> I64:
    """The triangles of polygons of one size, [polygons, corners - 2, 3], by the places of their corners.

    points  the corners, [polygons, corners, 3]
    """
    many, size, _ = points.shape
    about_first = _fan(size)
    cut = np.tile(about_first, (many, 1, 1))
    left = np.arange(many)
    for corner in range(1, min(size, _CORNERS)):
        wrong = _wrong_fans(np.roll(points[left], -corner, axis=1))
        cut[left[~wrong]] = (about_first + corner) % size
        left = left[wrong]
    for polygon in left:
        clipped = _clipped(_flat(points[polygon]))
        if clipped is not None:
            cut[polygon] = clipped
    return cut


def _flat(points: F64) -> F64:
    """A polygon's corners [n, 3] seen along the axis that its normal is nearest to, counterclockwise, [n, 2]."""
    own = points - points[0]
    own /= np.abs(own).max()
    normal = np.cross(own[1:-1], own[2:]).sum(axis=0)
    axis = int(np.abs(normal).argmax())
    seen = [(axis + 1) % 3, (axis + 2) % 3]
    return np.ascontiguousarray(own[:, seen if normal[axis] > 0 else seen[::-1]])


def _clipped(flat: F64) -> I64 | None:
    """The triangles of a polygon by clipping its ears, int64 [n - 2, 3]; None if it crosses itself so that there are fewer.

    mapbox_earcut leaves out corners on a line and coincident ones. The rings that these leave between the triangles and
    the polygon have no area; their fans are added, so that no corner is lost and none lies on another triangle's edge.
    """
    from mapbox_earcut import triangulate_float64  # imported here because most files have no such polygon

    count = len(flat)
    cut = triangulate_float64(flat, np.array([count], dtype=np.uint32)).astype(np.int64).reshape(-1, 3)
    e, f = flat[cut[:, 1]] - flat[cut[:, 0]], flat[cut[:, 2]] - flat[cut[:, 0]]
    if (e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]).sum() < 0.0:  # all are turned the same way, those without area too
        cut = cut[:, [0, 2, 1]]
    if len(cut) < count - 2:
        rings = [np.array(ring)[_fan(len(ring))] for ring in _rings_left(cut, count)]
        cut = np.concatenate([cut, *rings])
    return cut if len(cut) == count - 2 else None


def _rings_left(cut: I64, count: int) -> list[list[int]]:
    """The closed rings between the outline of triangles and the polygon 0, 1 ... ``count`` - 1 that they are cut from.
    None passes a corner twice: a ring that does is several that touch there.
    """
    inner = {(int(t[i]), int(t[(i + 1) % 3])) for t in cut for i in range(3)}
    outline = {edge for edge in inner if edge[::-1] not in inner}
    polygon = {(i, (i + 1) % count) for i in range(count)}
    left: dict[int, list[int]] = {}
    for start, end in sorted((polygon - outline) | {edge[::-1] for edge in outline - polygon}):
        left.setdefault(start, []).append(end)
    rings = []
    while left:
        at, passed = next(iter(left)), list[int]()
        while at in left:
            passed.append(at)
            at = left[at].pop()
            if not left[passed[-1]]:
                del left[passed[-1]]
            if at in passed:
                first = passed.index(at)
                rings.append(passed[first:])
                del passed[first:]
    return rings


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
    is not the same piece of surface in all frames.
    """
    there = [[piece for piece in part if piece is not None] for part in zip(*frames, strict=True)]
    padded = [any(not _same_faces(piece, own[0]) for piece in own) for own in there]
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


def _same_faces(piece: Piece, other: Piece) -> bool:
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
