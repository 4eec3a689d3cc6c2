"""The exact referee: closest hits, tie sets and shadow bits for the same float32 inputs, and the class of an answer.

A float64 filter with a proven error bound (:mod:`.judge.filter_kernels`) leaves a few candidate triangles per ray; integer
arithmetic (:mod:`.judge.arithmetic`) decides among them. The class says whether the rounding of a float32 triangle test
can excuse a wrong answer; :func:`.judge.arithmetic.edge_bound` defines how near an edge the ray must be.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..arrays import F32, F64, I8, I32, U8, Bools, Ints
from ..scene.scene import AlphaMask
from . import arithmetic as exact
from .candidates import BATCH, Candidates, Lists, Segments
from .decisions import Decisions, Exact, Hits, Holes
from .distances import beside_off_the_eye, edge_distance, plane_distance, triangle_distance
from .verdict import Verdict

PAIRS = 1 << 17  # pairs of rays and candidates that are processed together: bounds the memory of a classification


class Referee:
    """Judges rays against one mesh at one moment.

    points  float32 [vertex_count, 3];  faces int32 [triangle_count, 3];  valid uint8 [triangle_count]
    device  where the filter runs; the answers do not depend on it
    mask    holes in triangles (:mod:`.scene.alpha`), checked; None: all are opaque
    """

    def __init__(
        self, points: F32, faces: I32, valid: NDArray, device: str = "cpu", mask: AlphaMask | None = None
    ) -> None:
        self.points = np.ascontiguousarray(points, dtype=np.float32).reshape(-1, 3)
        self.faces = np.ascontiguousarray(faces, dtype=np.int32).reshape(-1, 3)
        self.valid = np.asarray(valid).astype(bool)
        self.device = device
        self.holes = Holes(mask)
        self._decisions = Decisions(self.points, self.faces, self.holes)
        self._candidates = Candidates(self.points, self.faces, self.valid, device, mask)

    def is_of(self, points: F32, faces: NDArray, valid: NDArray, device: str, mask: AlphaMask | None) -> bool:
        """Whether this is the referee of a mesh on a device. A mesh with holes is another one."""
        arrays = ((self.points, points), (self.faces, faces), (self.valid, np.asarray(valid).astype(bool)))
        whole = self.device == device and self.holes.mask is None and mask is None
        return whole and all(np.array_equal(one, other, equal_nan=one is self.points) for one, other in arrays)

    @cached_property
    def duplicate_of(self) -> I32:
        """The lowest valid triangle at the same three positions, int32 [triangle_count]; itself if it has holes."""
        single = ~self.valid | self.holes.masked(np.arange(len(self.faces)))
        return lowest_duplicates(self.points[self.faces], single)

    # --- exact answers ---

    def closest(self, origins: F32, directions: F32) -> Hits:
        """Exact closest hits. ``origins`` float32 [3] or [n, 3]; ``directions`` float32 [n, 3]."""
        directions = np.asarray(directions, dtype=np.float32).reshape(-1, 3)
        origins = np.broadcast_to(np.asarray(origins, dtype=np.float32), directions.shape)
        n = len(directions)
        hits = Hits(origins, directions, np.full(n, -1, np.int32), np.full(n, np.inf), [None] * n, [()] * n)
        for rows, candidates in self._candidates.along(origins, directions, nearest=True):
            part = slice(rows.start, rows.stop)
            for i, found in zip(rows, self._decisions.hits(origins[part], directions[part], candidates), strict=True):
                if found:
                    hits.put(i, found)
        return hits

    def answers(self, origins: F32, directions: F32, lights: F32, wanted: Sequence[bool] | Bools) -> Exact:
        """Exact closest hits, and occluders for the ``wanted`` lights."""
        hits = self.closest(origins, directions)
        return Exact(hits, self._occluders(hits, lights, np.asarray(wanted, dtype=bool)))

    def all_hits(self, origins: F32, directions: F32) -> list[list[tuple[float, int]]]:
        """Every exact hit of each ray as (t, triangle), unordered."""
        result: list[list[tuple[float, int]]] = []
        for rows, candidates in self._candidates.along(origins, directions, nearest=False):
            part = slice(rows.start, rows.stop)
            for found in self._decisions.hits(origins[part], directions[part], candidates):
                result.append([(over / under, k) for over, under, k in found])
        return result

    def occluders(self, hits: Hits, light: F32) -> I32:
        """One triangle that meets the open segment from each exact hit point to ``light``; -1 where none does. At a
        miss -1. Triangles that contain the exact hit point do not meet the open segment.
        """
        return self._occluders(hits, light[None], np.ones(1, dtype=bool))[0]

    def _occluders(self, hits: Hits, lights: F32, wanted: Bools) -> I32:
        """:meth:`occluders` of each ``wanted`` light, int32 [lights, n]; -1 for the others."""
        result = np.full((len(lights), len(hits)), -1, dtype=np.int32)
        for segments, candidates, sure in self._segments(
            hits, lights, wanted[:, None] & (hits.triangle >= 0), every=False
        ):
            result[segments.light, segments.row] = sure
            for k in np.nonzero(candidates.counts)[0].tolist():
                row, light = segments.row[k], segments.light[k]
                met = self._between(hits, row, lights[light], candidates[k])
                result[light, row] = met[0] if met else -1
        return result

    def occluded(self, hits: Hits, light: F32) -> U8:
        """Exact shadow bits: 1 shadowed, 0 lit or a miss."""
        return (self.occluders(hits, light) >= 0).astype(np.uint8)

    # --- classes ---

    def classify_primary(self, hits: Hits, triangle: Ints) -> I8:
        """The class [n] of the closest triangle that a method gave for each ray of ``hits``."""
        verdicts = np.full(len(hits), Verdict.OK, dtype=np.int8)
        wrong = []
        for i, (given, right) in enumerate(zip(triangle.tolist(), hits.triangle.tolist(), strict=True)):
            if given == right:
                continue
            if given < -1 or given >= len(self.faces) or (given >= 0 and not self.valid[given]):
                verdicts[i] = Verdict.INVALID
            elif given in hits.ties[i]:
                verdicts[i] = Verdict.TIE
            else:
                wrong.append(i)
        for start in range(0, len(wrong), BATCH):
            rows = np.array(wrong[start : start + BATCH])
            verdicts[rows] = self._classify_wrong(hits.take(rows), triangle[rows])
        return verdicts

    def classify_shadow(self, hits: Hits, light: F32, bits: Ints) -> I8:
        """The class [n] of a shadow bit that a method gave for each exact hit point (misses must be 0)."""
        every = np.ones((1, len(hits)), dtype=bool)
        return self.classify_shadows(hits, light[None], bits[None], self.occluders(hits, light)[None], every)[0]

    def classify_shadows(self, hits: Hits, lights: F32, bits: NDArray, occluders: NDArray, wanted: Bools) -> I8:
        """The classes [lights, n] of the ``wanted`` shadow bits; OK elsewhere.

        bits, occluders, wanted  [lights, n]: as a method gave them, an exact occluder or -1, and bool
        """
        verdicts = np.full(bits.shape, Verdict.OK, dtype=np.int8)
        verdicts[wanted & ((bits != 0) & (bits != 1) | (hits.triangle < 0) & (bits != 0))] = Verdict.INVALID
        valid = wanted & (verdicts == Verdict.OK)
        self._classify_acne(hits, lights, valid & (bits != 0) & (occluders < 0), verdicts)
        leaks = valid & (bits == 0) & (occluders >= 0)
        light, row = np.nonzero(leaks)
        for part in np.array_split(np.arange(len(row)), max(1, -(-len(row) // PAIRS))):
            leak = self._unexcused(hits, row[part], lights[light[part]], occluders[light[part], row[part]])
            verdicts[light[part][leak], row[part][leak]] = Verdict.LEAK
        self._classify_leak(hits, lights, leaks & (verdicts == Verdict.OK), verdicts)
        return verdicts

    def _classify_wrong(self, hits: Hits, given: Ints) -> I8:
        """EDGE, NEAR_TIE or TRUE for answers outside the tie set.

        The given triangle must be hit, or be passed within the bound; every triangle hit before it must have
        been missed within the bound, or lie no nearer than the bound. What lies at the eye is right only if it is
        exactly so: a triangle passed there counts where the ray meets its plane.
        """
        o, d = hits.origins.astype(np.float64), hits.directions.astype(np.float64)
        speed = np.linalg.norm(d, axis=1)
        reached = np.full(len(hits), np.inf)  # t of the given triangle; inf where a miss was given
        possible = np.ones(len(hits), dtype=bool)
        rows = np.nonzero(given >= 0)[0]
        distance, t, bound = self.ray_to(o[rows], d[rows], given[rows])
        opaque, _ = self.holes.within(given[rows], self.corners(given[rows]), o[rows], d[rows], bound)
        for i, near, nearest_t, limit, seen in zip(rows, distance, t, bound, opaque, strict=True):
            exactly = self._decisions.through(hits.origins[i], hits.directions[i], given[i])
            at = exactly[0] if exactly else nearest_t
            passes = bool(exactly) or near <= limit
            if passes and not exactly and at * speed[i] <= limit:
                at = self._decisions.on_plane(hits.origins[i], hits.directions[i], given[i])
                passes = beside_off_the_eye(o[i], d[i], at, self.corners(given[[i]]))
            reached[i] = at
            possible[i] = passes and seen
        verdicts = np.where(possible, Verdict.EDGE, Verdict.TRUE).astype(np.int8)
        rows = np.nonzero(possible & (given >= 0) & (hits.triangle >= 0))[0]
        apart = np.abs(reached[rows] - hits.t[rows]) * speed[rows]
        met = o[rows] + hits.t[rows, None] * d[rows]
        verdicts[rows[apart <= exact.edge_bound(o[rows], met)]] = Verdict.NEAR_TIE
        # The closest hit alone decides most rays. The hits behind it matter only where it is excused.
        rows = np.nonzero((verdicts == Verdict.EDGE) & (hits.triangle >= 0))[0]
        skipped = self._passed_over(o[rows], d[rows], hits.triangle[rows], hits.t[rows], reached[rows])
        verdicts[rows[skipped]] = Verdict.TRUE
        rows = rows[~skipped]
        every = self.all_hits(hits.origins[rows], hits.directions[rows])
        pairs = [(i, k, at) for i, found in zip(rows, every, strict=True) for at, k in found]
        if pairs:
            index, k, at = (np.array(column) for column in zip(*pairs, strict=True))
            verdicts[index[self._passed_over(o[index], d[index], k, at, reached[index])]] = Verdict.TRUE
        return verdicts

    def _passed_over(self, o: F64, d: F64, triangle: Ints, at: F64, reached: F64) -> Bools:
        """Which hits (triangle, at) before ``reached`` rounding cannot miss: far from edges, eye and given triangle."""
        distance, _, bound = self.ray_to(o, d, triangle, edges_only=True)
        _, clear = self.holes.within(triangle, self.corners(triangle), o, d, bound)
        with np.errstate(invalid="ignore"):
            close = np.minimum(reached - at, at) * np.linalg.norm(d, axis=1) <= bound
        return (at < reached) & ~close & (distance > bound) & ~clear

    def _classify_acne(self, hits: Hits, lights: F32, wanted: Bools, verdicts: I8) -> None:
        """EDGE where some triangle off the hit point passes within the bound of the segment, else ACNE."""
        margin = exact.EDGE_UNITS * exact.UNIT * np.maximum(np.abs(hits.points).max(axis=1), self._candidates.farthest)
        for segments, candidates, _ in self._segments(hits, lights, wanted, every=True, margin=margin):
            found = np.full(len(segments), Verdict.ACNE, dtype=np.int8)
            for index, k in _rounds(candidates, found, Verdict.ACNE):
                row, light = segments.row[index], segments.light[index]
                own = np.array([j in hits.ties[i] for i, j in zip(row.tolist(), k.tolist(), strict=True)], dtype=bool)
                index, k, row, light = index[~own], k[~own], row[~own], light[~own]
                near, far, corners = hits.points[row], lights[light].astype(np.float64), self.corners(k)
                away, share = triangle_distance(near, far, corners)
                bound = exact.edge_bound(near, near + share[:, None] * (far - near))
                passed = away <= bound
                for j in np.nonzero(self.holes.masked(k))[0]:
                    met = self._between(hits, row[j], lights[light[j]], k[j : j + 1], holes=False)
                    passed[j] = passed[j] or bool(met)
                opaque, _ = self.holes.within(k, corners, near, far - near, bound)
                found[index[passed & opaque]] = Verdict.EDGE
            verdicts[segments.light, segments.row] = found

    def _classify_leak(self, hits: Hits, lights: F32, wanted: Bools, verdicts: I8) -> None:
        """EDGE where every occluder is met within the bound of its edge, or has an end at its plane, else LEAK."""
        for segments, candidates, _ in self._segments(hits, lights, wanted, every=True):
            found = np.full(len(segments), Verdict.EDGE, dtype=np.int8)
            for index, k in _rounds(candidates, found, Verdict.EDGE):
                row, light = segments.row[index], segments.light[index]
                for j in np.nonzero(self._unexcused(hits, row, lights[light], k))[0]:
                    if found[index[j]] == Verdict.EDGE and self._between(hits, row[j], lights[light[j]], k[j : j + 1]):
                        found[index[j]] = Verdict.LEAK
            verdicts[segments.light, segments.row] = found

    def _unexcused(self, hits: Hits, row: Ints, lights: F32, k: I32) -> Bools:
        """Which triangles [n], if they meet the segments from hit points to lights [n, 3], rounding cannot miss: met beyond
        the bound from their edges, with both ends beyond it from their planes.
        """
        near, far, corners = hits.points[row], lights.astype(np.float64), self.corners(k)
        away, share = edge_distance(near, far, corners)
        ends = plane_distance(near, corners), plane_distance(far, corners)
        bound = exact.edge_bound(near, near + share[:, None] * (far - near))
        _, clear = self.holes.within(k, corners, near, far - near, bound)
        return (np.minimum.reduce([away, *ends]) > bound) & ~clear

    # --- parts ---

    def _segments(
        self, hits: Hits, lights: F32, wanted: Bools, every: bool, margin: F64 | None = None
    ) -> Iterator[tuple[Segments, Lists, I32]]:
        """:meth:`.Candidates.between` of the ``wanted`` segments from exact hit points to lights, bool [lights, n]."""
        segments = Segments.where(wanted)
        if not len(segments):
            return
        points = np.nan_to_num(hits.points)  # of misses, from which no segment leads
        for part, candidates, sure in self._candidates.between(points, hits.triangle, lights, segments, every, margin):
            yield segments[part], candidates, sure

    def _between(self, hits: Hits, i: int | np.integer, light: F32, triangles: I32, holes: bool = True) -> list[int]:
        """The triangles that exactly meet the open segment from hit point i to the light (:class:`.Decisions`)."""
        o, d = hits.origins[i], hits.directions[i]
        return self._decisions.between(o, d, hits.ratio[i], light, triangles, holes)

    def corners(self, triangles: Ints) -> F64:
        """The corners of triangles, float64 [n, 3, 3]."""
        return self.points[self.faces[triangles]].astype(np.float64)

    def ray_to(self, o: F64, d: F64, triangles: Ints, edges_only: bool = False) -> tuple[F64, F64, F64]:
        """Distance of rays from triangles (or their edges), the t at which it is smallest, and the bound; each [n]."""
        corners = self.corners(triangles)
        if not len(corners):
            return np.zeros(0), np.zeros(0), np.zeros(0)
        reach = np.linalg.norm(corners - o[:, None], axis=2).max(axis=1)
        length = 2 * reach / np.linalg.norm(d, axis=1)
        measure = edge_distance if edges_only else triangle_distance
        distance, share = measure(o, o + length[:, None] * d, corners)
        t = share * length
        return distance, t, exact.edge_bound(o, o + t[:, None] * d)


def _rounds(candidates: Lists, verdicts: I8, undecided: Verdict) -> Iterator[tuple[NDArray[np.intp], I32]]:
    """Pairs (ray, candidate) of the rays that are still ``undecided``: first a few per ray, then more for the remaining
    rays. Most rays are decided by one of their first candidates; a ray may have as many as there are triangles.
    """
    first, step = 0, 8
    rows = np.nonzero(candidates.counts)[0]
    while len(rows):
        for part in np.array_split(rows, max(1, -(-len(rows) * step // PAIRS))):
            yield candidates.some(part, first, step)
        first, step = first + step, 8 * step
        rows = rows[(verdicts[rows] == undecided) & (candidates.counts[rows] > first)]


def lowest_duplicates(corners: F32, single: Bools) -> I32:
    """The lowest triangle at the same positions, int32 [n]; itself if ``single`` [n]. corners [n, 3, 3]"""
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
