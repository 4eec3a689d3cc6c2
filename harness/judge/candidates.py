"""The triangles that a ray may meet: the tree over a mesh, and lists of the candidates that the float64 filter leaves.
No triangle that a ray exactly meets is ever missing from its list (:mod:`.judge.filter_kernels` says why); the lists
are short, and their triangles are decided exactly elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ..arrays import F32, F64, I32, I64, Bools, Ints
from ..frame.alpha import device_alpha
from ..frame.geometry import filled
from ..scene.scene import AlphaMask
from . import filter_kernels as kernels
from .arithmetic import integers, plane_of
from .filter_kernels import LEAF, Found, Tree

BATCH = 8192  # rays decided at once: bounds the memory of candidate lists
SEGMENTS = 1 << 18  # segments of one launch
MOST = 1 << 22  # candidates of one launch, unless one ray has more


def build_tree(points: F32, faces: I32, valid: NDArray, device: str, mask: AlphaMask | None) -> Tree:
    """Sort the valid triangles by size class and Morton code, and box them bottom-up."""
    ids = np.nonzero(valid)[0].astype(np.int32)
    corners = points[faces[ids]]
    low, high = corners.min(axis=1), corners.max(axis=1)
    order = np.argsort(_keys(low, high), kind="stable") if len(ids) else np.zeros(0, dtype=np.int64)
    blocks = -(-len(ids) // LEAF)
    leaves = 1 << max(0, (blocks - 1).bit_length())
    slots = np.full(leaves * LEAF, -1, dtype=np.int32)
    slots[: len(ids)] = ids[order]
    lows = np.full((leaves * LEAF, 3), np.inf, dtype=np.float32)
    highs = -lows
    lows[: len(ids)], highs[: len(ids)] = low[order], high[order]
    low_heap = np.full((2 * leaves, 3), np.inf, dtype=np.float32)
    high_heap = -low_heap
    low_heap[leaves:] = lows.reshape(leaves, LEAF, 3).min(axis=1)
    high_heap[leaves:] = highs.reshape(leaves, LEAF, 3).max(axis=1)
    for first in (1 << level for level in reversed(range(leaves.bit_length() - 1))):
        level, below = slice(first, 2 * first), slice(2 * first, 4 * first)
        low_heap[level] = low_heap[below].reshape(first, 2, 3).min(axis=1)
        high_heap[level] = high_heap[below].reshape(first, 2, 3).max(axis=1)
    with wp.ScopedDevice(device):
        return filled(
            Tree, low=wp.array(low_heap, dtype=wp.vec3f), high=wp.array(high_heap, dtype=wp.vec3f),
            order=wp.array(slots, dtype=wp.int32), leaves=leaves, points=wp.array(points, dtype=wp.vec3f),
            triangles=wp.array(faces, dtype=wp.vec3i), alpha=device_alpha(mask, device),
        )  # fmt: skip


def in_planes(corners: F32, points: F32) -> Bools:
    """Which triangles [n, 3, 3] have a point, [3] or [n, 3], exactly in their planes, bool [n]; exact if in doubt."""
    points = np.broadcast_to(points, (len(corners), 3))
    with np.errstate(invalid="ignore", over="ignore"):
        a, b, c = (corners[:, k].astype(np.float64) - points.astype(np.float64) for k in range(3))
        value = np.einsum("ij,ij->i", a, np.cross(b, c))
        size = np.abs(a).sum(axis=1) * np.abs(b).sum(axis=1) * np.abs(c).sum(axis=1)
        doubtful = np.nonzero(np.abs(value) <= 2.0**-48 * size)[0]
    result = np.zeros(len(corners), dtype=bool)
    for k in doubtful:
        if np.isfinite(points[k]).all() and np.isfinite(corners[k]).all():
            _, ints = integers(points[k], corners[k])
            result[k] = plane_of(ints[0:3], ints[3:12])[1] == 0
    return result


def _keys(low: F32, high: F32) -> I64:
    """Sort keys: large triangles come first, so that they do not enlarge the boxes of small ones."""
    low, high = low.astype(np.float64), high.astype(np.float64)
    bottom, extent = low.min(axis=0), float((high.max(axis=0) - low.min(axis=0)).max()) or 1.0
    share = (high - low).max(axis=1) / extent
    size_class = np.clip(-np.log2(np.maximum(share, 2.0**-20)), 0, 7).astype(np.int64)
    cells = np.clip(((low + high) / 2 - bottom) / extent * 1023, 0, 1023).astype(np.int64)
    code = np.zeros(len(low), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return (size_class << 30) | code


@dataclass(frozen=True, eq=False)
class Lists:
    """The candidates of n rays: all in one array, those of a ray in a row.

    found  int32 [all];  counts int32 [n]
    """

    found: I32
    counts: I32

    def __getitem__(self, ray: int) -> I32:
        start = self.starts[ray]
        return self.found[start : start + self.counts[ray]]

    def __len__(self) -> int:
        return len(self.counts)

    @cached_property
    def starts(self) -> I64:
        """The place of the first candidate of each ray."""
        return np.cumsum(self.counts, dtype=np.int64) - self.counts

    @property
    def of(self) -> NDArray[np.intp]:
        """The ray of each candidate."""
        return np.repeat(np.arange(len(self)), self.counts)

    def without(self, left_out: Bools) -> Lists:
        """The lists without some candidates [all]."""
        kept = np.bincount(self.of[~left_out], minlength=len(self)).astype(np.int32)
        return Lists(self.found[~left_out], kept)

    def some(self, rays: Ints, first: int, most: int) -> tuple[NDArray[np.intp], I32]:
        """Of some rays, each with more than ``first`` candidates, at most so many from that one on: ray and triangle."""
        counts = np.minimum(self.counts[rays] - first, most)
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        return np.repeat(rays, counts), self.found[np.repeat(self.starts[rays] + first, counts) + within]


@dataclass(frozen=True, eq=False)
class Segments:
    """Segments from hit points to lights, by the numbers of both: int32 [n] each."""

    row: I32
    light: I32

    @staticmethod
    def where(wanted: Bools) -> Segments:
        """Those that are wanted of each light to each hit point, bool [lights, hits]: light by light."""
        light, row = np.nonzero(wanted)
        return Segments(row.astype(np.int32), light.astype(np.int32))

    def __len__(self) -> int:
        return len(self.row)

    def __getitem__(self, part: slice | NDArray) -> Segments:
        return Segments(self.row[part], self.light[part])


class Candidates:
    """Finds candidates in one mesh at one moment, on a device. ``farthest``: the largest coordinate of a valid vertex."""

    def __init__(self, points: F32, faces: I32, valid: NDArray, device: str, mask: AlphaMask | None = None) -> None:
        self.device = device
        self._tree = build_tree(points, faces, valid, device, mask)
        self._corners = points[faces] if len(faces) else np.zeros((0, 3, 3), dtype=np.float32)
        self.farthest = float(np.abs(self._corners[valid != 0]).max(initial=0.0))

    def along(self, origins: F32, directions: F32, nearest: bool) -> Iterator[tuple[range, Lists]]:
        """Batches of rows and the triangles that each ray may hit; with ``nearest``, none beyond a certain hit."""
        for start in range(0, len(directions), BATCH):
            stop = min(start + BATCH, len(directions))
            o = wp.array(origins[start:stop].astype(np.float64), dtype=wp.vec3d, device=self.device)
            d = wp.array(directions[start:stop].astype(np.float64), dtype=wp.vec3d, device=self.device)
            best = wp.empty(stop - start, dtype=wp.float64, device=self.device)
            inputs = [o, d, int(nearest)]
            for part, lists, least in self._collected(kernels.collect_hits, inputs, range(stop - start), [best]):
                beyond = least > best.numpy()[part.start : part.stop][lists.of]
                yield range(start + part.start, start + part.stop), lists.without(beyond)

    def between(
        self, starts: F64, own: I32, lights: F32, segments: Segments, every: bool, margin: F64 | None = None
    ) -> Iterator[tuple[slice, Lists, I32]]:
        """Batches of segments, and for each the triangles that may meet it, open, and one that certainly does, or -1.

        starts    exact points rounded once to float64 [n, 3];  own  a triangle of each to leave out [n]
        segments  from which start to which of the lights [k, 3] each leads
        every     list the candidates of all segments; without it those with a certain occluder have none
        margin    scene units [n]: also collect all triangles within this distance of the segment, and some beyond it

        A triangle whose plane contains the light meets no open segment to it, and is never among them.
        """
        if not len(starts):
            return
        largest = np.abs(starts).max(axis=1)
        shared = [
            wp.array(starts, dtype=wp.vec3d, device=self.device),
            wp.array(largest * 2.0**-52, dtype=wp.float64, device=self.device),
            wp.array(own, dtype=wp.int32, device=self.device),
            wp.array(np.zeros(len(starts)) if margin is None else margin, dtype=wp.float64, device=self.device),
            wp.array(lights.astype(np.float64), dtype=wp.vec3d, device=self.device),
            float(max(self.farthest, largest.max()) * 2.0**-48),
            int(every),
        ]
        for first in range(0, len(segments), SEGMENTS):
            batch = segments[first : first + SEGMENTS]
            inputs = [
                *shared,
                *(wp.array(part, dtype=wp.int32, device=self.device) for part in (batch.row, batch.light)),
            ]
            found = wp.empty(len(batch), dtype=wp.int32, device=self.device)
            for part, lists, _ in self._collected(kernels.collect_between, inputs, range(len(batch)), [found]):
                certain = found.numpy()[part.start : part.stop].copy()
                if not every:
                    lists = lists.without(certain[lists.of] >= 0)
                held = self._hold(lists.found, batch.light[part.start : part.stop][lists.of], lights)
                yield slice(first + part.start, first + part.stop), lists.without(held), certain

    def _hold(self, triangles: I32, which: I32, lights: F32) -> Bools:
        """Which triangles [n] have in their planes the lights of the given numbers [n]."""
        pairs, place = np.unique(which * np.int64(len(self._corners)) + triangles, return_inverse=True)
        light, triangle = np.divmod(pairs, max(1, len(self._corners)))
        return in_planes(self._corners[triangle], lights[light])[place]

    def _collected(
        self, kernel: wp.Kernel, inputs: Sequence, rays: range, outputs: Sequence, room: int = 0
    ) -> Iterator[tuple[range, Lists, F64]]:
        """The candidates of rays by a kernel, and where each is met earliest; in halves if more than :data:`MOST`."""
        with wp.ScopedDevice(self.device):
            pairs, count = wp.empty(room or MOST, dtype=wp.vec2i), wp.zeros(1, dtype=wp.int64)
            least = wp.empty(len(pairs), dtype=wp.float64)
            found = filled(Found, pairs=pairs, least=least, count=count)
        self._launch(kernel, len(rays), [rays.start, *inputs], [found, *outputs])
        total = int(count.numpy()[0])
        if total <= len(pairs):
            ray, triangle = pairs[:total].numpy().T
            order = np.argsort(ray, kind="stable")  # the triangles of a ray stay in the order of the tree
            counts = np.bincount(ray - rays.start, minlength=len(rays)).astype(np.int32)
            yield rays, Lists(triangle[order], counts), least[:total].numpy()[order]
            return
        del pairs, least, found  # before others come in their place
        if len(rays) == 1:
            yield from self._collected(kernel, inputs, rays, outputs, room=total)
        else:
            for half in (rays[: len(rays) // 2], rays[len(rays) // 2 :]):
                yield from self._collected(kernel, inputs, half, outputs)

    def _launch(self, kernel: wp.Kernel, n: int, inputs: Sequence, outputs: Sequence) -> None:
        wp.launch(kernel, dim=n, inputs=[self._tree, *inputs], outputs=list(outputs), device=self.device)
