"""Organic bodies from blended round cones and ellipsoids, for the animated stand-ins. A :class:`Body` is a list of
:class:`Blob` united smoothly, one after the other (polynomial smooth minimum, Quilez); its surface is meshed by
:mod:`.scene.standins.implicit`, projected onto the zero set and roughened. Lengths in metres.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import F32, F64, I64
from .implicit import polygonise
from .shapes import Mesh, rotation

Point = Sequence[float] | F64

Turn = tuple[Sequence[float], float]  # axis and degrees
CHUNK = 2048  # number of points evaluated at a time: blobs far from all of them are left out


@dataclass(frozen=True)
class Blob:
    """One piece of a body: a round cone from ``start`` to ``end``, or (``axes`` given) an ellipsoid at ``start``.

    radii  of the round cone at start and end; unused for an ellipsoid
    axes   radii of the ellipsoid along its own x, y, z; ``turn``: of those from the world's
    blend  width of the smooth union with the previous blobs, 0 for a sharp union
    cut    True: subtracted instead of added
    group  a name for :meth:`Body.shares`
    """

    start: tuple[float, ...]
    end: tuple[float, ...]
    radii: tuple[float, float] = (0.0, 0.0)
    axes: tuple[float, ...] | None = None
    turn: Turn | None = None
    blend: float = 0.0
    cut: bool = False
    group: str = ""

    def distance(self, points: F32) -> F32:
        """Approximate signed distance of points [3, n]: nearly exact outside, never too negative inside."""
        if self.axes is None:
            return self._cone(points)
        arm = [points[i] - np.float32(self.start[i]) for i in range(3)]
        if self.turn is not None:
            matrix = rotation(*self.turn).astype(np.float32)  # columns are the blob's axes
            arm = [arm[0] * matrix[0, i] + arm[1] * matrix[1, i] + arm[2] * matrix[2, i] for i in range(3)]
        scaled = [arm[i] / np.float32(self.axes[i]) for i in range(3)]
        twice = [scaled[i] / np.float32(self.axes[i]) for i in range(3)]
        share = np.sqrt(_dot(scaled, scaled))
        slope = share / np.maximum(np.sqrt(_dot(twice, twice)), np.float32(1e-6))
        return (share - 1) * np.where(share < 1, np.float32(min(self.axes)), slope)

    def _cone(self, points: F32) -> F32:
        start, end = np.array(self.start, dtype=np.float32), np.array(self.end, dtype=np.float32)
        along = end - start
        arm = [points[i] - start[i] for i in range(3)]
        length = max(float(along[0] ** 2 + along[1] ** 2 + along[2] ** 2), 1e-12)
        share = _dot(arm, along) / np.float32(length)
        np.minimum(np.maximum(share, 0, out=share), 1, out=share)
        off = [arm[i] - share * along[i] for i in range(3)]
        first, second = np.float32(self.radii[0]), np.float32(self.radii[1])
        return np.sqrt(_dot(off, off)) - (first + share * (second - first))


def _dot(a: Sequence[F32] | F32, b: Sequence[F32] | F32) -> F32:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def limb(start: Point, end: Point, first: float, second: float, blend: float = 0.02, group: str = "") -> Blob:
    """A round cone."""
    return Blob(tuple(start), tuple(end), (first, second), blend=blend, group=group)


def ball(middle: Point, axes: Point | float, turn: Turn | None = None, blend: float = 0.03, **given: Any) -> Blob:
    """An ellipsoid, or a sphere where ``axes`` is one number. ``given``: ``cut`` and ``group`` of :class:`Blob`."""
    radii = (axes,) * 3 if isinstance(axes, (int, float)) else tuple(axes)
    return Blob(tuple(middle), tuple(middle), axes=radii, turn=turn, blend=blend, **given)


def chain(points: Iterable[Point], radii: Sequence[float], blend: float = 0.01, group: str = "") -> list[Blob]:
    """Round cones from point to point."""
    line = list(points)
    return [limb(line[i], line[i + 1], radii[i], radii[i + 1], blend, group=group) for i in range(len(line) - 1)]


def both(blobs: Iterable[Blob]) -> list[Blob]:
    """Each blob and its mirror image in z."""
    pairs = []
    for blob in blobs:
        turn = blob.turn
        if turn is not None:  # a mirrored turn goes the other way about the mirrored axis
            turn = ((-turn[0][0], -turn[0][1], turn[0][2]), turn[1])
        start, end = (*blob.start[:2], -blob.start[2]), (*blob.end[:2], -blob.end[2])
        pairs += [blob, replace(blob, start=start, end=end, turn=turn)]
    return pairs


def curve(knots: Sequence[Point] | F64, per_span: int) -> F64:
    """A Catmull-Rom curve through knots [n, d], ``per_span`` points per span, shape [(n - 1) per_span + 1, d]."""
    line = np.asarray(knots, dtype=np.float64)
    line = np.concatenate([2 * line[:1] - line[1:2], line, 2 * line[-1:] - line[-2:-1]])
    s = (np.arange(per_span) / per_span)[None, :, None]
    a, b, c, d = (line[i : len(line) - 3 + i, None] for i in range(4))
    spans = b + 0.5 * s * ((c - a) + s * ((2 * a - 5 * b + 4 * c - d) + s * (3 * (b - c) + d - a)))
    return np.concatenate([spans.reshape(-1, line.shape[1]), line[-2:-1]])


class Body:
    """Blobs united in the order given."""

    def __init__(self, blobs: Iterable[Blob]):
        self.blobs = list(blobs)
        self._start = np.array([blob.start for blob in self.blobs])
        self._along = np.array([blob.end for blob in self.blobs]) - self._start
        self._length = np.maximum((self._along**2).sum(axis=1), 1e-12)
        self._least = np.array([min(blob.axes or blob.radii) for blob in self.blobs])
        self._most = np.array([max(blob.axes or blob.radii) for blob in self.blobs])
        self._cut = np.array([blob.cut for blob in self.blobs])
        self._blend = np.array([blob.blend for blob in self.blobs])

    def distance(self, points: F32) -> F32:
        """Smooth signed distance [n] of points [n, 3]."""
        result = np.empty(len(points), dtype=np.float32)
        order = np.argsort(_curve_index(points), kind="stable")
        for begin in range(0, len(points), CHUNK):
            chosen = order[begin : begin + CHUNK]
            part = np.ascontiguousarray(points[chosen].T)
            field = np.full(len(chosen), 1e3, dtype=np.float32)
            for i in self._relevant(part):
                field = _united(field, self.blobs[i], part)
            result[chosen] = field
        return result

    def _relevant(self, points: F32) -> NDArray[np.intp]:
        """The blobs that can matter to points [3, n]: no other reaches within its blend of the least distance."""
        low, high = points.min(axis=1).astype(np.float64), points.max(axis=1).astype(np.float64)
        radius = 0.5 * np.sqrt(((high - low) ** 2).sum())
        arm = 0.5 * (low + high) - self._start
        share = np.clip((arm * self._along).sum(axis=1) / self._length, 0, 1)
        off = np.sqrt(((arm - share[:, None] * self._along) ** 2).sum(axis=1))
        nearest = np.where(self._cut, np.inf, off - self._least).min()
        beyond = off - self._most - 2 * radius - np.where(self._cut, max(nearest, 0.0), nearest)
        near = np.flatnonzero(beyond < self._blend.max())
        return near[beyond[near] < self._blend[near[beyond[near] < self._blend[near]]].max() + 0.01]

    def mesh(self, spacing: float) -> Mesh:
        """The surface, in cells of about ``spacing``, each vertex projected onto the zero set."""
        reach = (self._most + 4 * spacing)[:, None]
        ends = np.stack([self._start, self._start + self._along])
        low, high = (ends - reach).min(axis=(0, 1)), (ends + reach).max(axis=(0, 1))
        mesh = polygonise(self.distance, list(low), list(high), spacing, slack=1.15)
        step = self.distance(mesh.vertices.astype(np.float32)).astype(np.float64)
        step = np.clip(step, -0.5 * spacing, 0.5 * spacing)
        return Mesh(mesh.vertices - normals(mesh) * step[:, None], mesh.faces)

    def shares(self, points: F64, groups: Iterable[str], width: float) -> dict[str, F64]:
        """How far points [n, 3] belong to the blobs whose group starts with a name: 0 to 1 across ``width``."""
        given = np.ascontiguousarray(points.T, dtype=np.float32)
        adding = [blob for blob in self.blobs if not blob.cut]
        distances = np.stack([blob.distance(given) for blob in adding])
        result = {}
        for group in groups:
            mine = np.array([blob.group.startswith(group) for blob in adding])
            inner, outer = distances[mine].min(axis=0), distances[~mine].min(axis=0)
            s = np.clip(0.5 + (outer - inner) / np.float32(2 * width), 0, 1).astype(np.float64)
            result[group] = s * s * (3 - 2 * s)
        return result


def _curve_index(points: F32) -> I64:
    """Index of each point [n, 3] on a Morton curve through 128 cubes per side, so that neighbours in order are near."""
    low = points.min(axis=0)
    size = max(float((points.max(axis=0) - low).max()), 1e-9) / 127.0
    cube = ((points - low) / np.float32(size)).astype(np.int64)
    index = np.zeros(len(points), dtype=np.int64)
    for bit in range(7):
        for axis in range(3):
            index |= ((cube[:, axis] >> bit) & 1) << (3 * bit + axis)
    return index


def _united(field: F32, blob: Blob, points: F32) -> F32:
    """The field with one more blob: smooth minimum, or smooth maximum with the complement for a cut."""
    value = blob.distance(points)
    width = np.float32(max(blob.blend, 1e-6))
    if blob.cut:
        mix = np.maximum(width - np.abs(field + value), 0) / width
        return np.maximum(field, -value) + mix * mix * width * np.float32(0.25)
    mix = np.maximum(width - np.abs(field - value), 0) / width
    return np.minimum(field, value) - mix * mix * width * np.float32(0.25)


def normals(mesh: Mesh) -> F64:
    """Unit normals of the vertices, shape [vertex_count, 3], weighted by the area of the triangles around."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)
    total = np.empty_like(mesh.vertices)
    for axis in range(3):
        weights = np.repeat(across[:, axis], 3)
        total[:, axis] = np.bincount(mesh.faces.ravel(), weights, len(mesh.vertices))
    length = np.sqrt(total[:, 0] ** 2 + total[:, 1] ** 2 + total[:, 2] ** 2)
    return total / np.maximum(length, 1e-30)[:, None]


def scales(mesh: Mesh, size: float, height: float, seed: int) -> F64:
    """Height of a skin of rounded scales about ``size`` wide at the vertices, shape [vertex_count]."""
    from scipy.spatial import cKDTree  # here: a scene is listed without it

    seeds = spread_points(mesh.vertices, size, seed)
    near = cKDTree(seeds).query(mesh.vertices)[0]
    bump = 1.0 - np.minimum(near / (0.75 * size), 1.0) ** 2
    return height * bump


def spread_points(points: F64, spacing: float, seed: int) -> F64:
    """Some of the points, shuffled and thinned to at most one in each cube of side ``spacing``."""
    order = np.random.default_rng(seed).permutation(len(points))
    cube = np.floor(points[order] / spacing).astype(np.int64) + 1024
    key = (cube[:, 0] * 4096 + cube[:, 1]) * 4096 + cube[:, 2]
    first = np.unique(key, return_index=True)[1]
    return points[order[np.sort(first)]]
