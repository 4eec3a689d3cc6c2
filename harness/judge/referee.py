"""The exact referee: closest hits, tie sets and shadow bits for the same float32 inputs, and the class of an answer.

A float64 filter with a proven error bound (:mod:`.judge.filter_kernels`) leaves a few candidate triangles per ray; integer
arithmetic (:mod:`.judge.arithmetic`) decides among them. The class says whether the rounding of a float32 triangle test
can excuse a wrong answer; :func:`.judge.arithmetic.edge_bound` defines how near an edge the ray must be.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..scene.scene import AlphaMask
from . import arithmetic as exact
from .candidates import BATCH, Candidates
from .decisions import Decisions, integers_of
from .distances import edge_distance, plane_distance, triangle_distance
from .hits import Exact, Hits
from .holes import Holes
from .planes import beside_off_the_eye
from .verdict import Verdict

PAIRS = 1 << 17
"""Pairs of rays and candidates that are processed together: bounds the memory of a classification."""


class Referee:
    """Judges rays against one mesh at one moment.

    points  float32 [vertex_count, 3];  faces int32 [triangle_count, 3];  valid uint8 [triangle_count]
    device  where the filter runs; the answers do not depend on it
    mask    holes in triangles (:mod:`.scene.alpha`), checked; None: all are opaque
    """

    def __init__(
        self,
        points: NDArray[np.float32],
        faces: NDArray[np.int32],
        valid: NDArray,
        device: str = "cpu",
        mask: AlphaMask | None = None,
    ) -> None:
        self.points = np.ascontiguousarray(points, dtype=np.float32).reshape(-1, 3)
        self.faces = np.ascontiguousarray(faces, dtype=np.int32).reshape(-1, 3)
        self.valid = np.asarray(valid).astype(bool)
        self.device = device
        self.holes = Holes(mask)
        self._decisions = Decisions(self.points, self.faces, self.holes)
        self._candidates = Candidates(self.points, self.faces, self.valid, device, mask)

    @cached_property
    def duplicate_of(self) -> NDArray[np.int32]:
        """The lowest index of a valid triangle with the same three positions, int32 [triangle_count].

        A triangle with holes has no duplicates.
        """
        corners = self.points[self.faces] + np.float32(0.0)  # -0 becomes +0
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
            np.take_along_axis(corners[k], np.argsort(mixed[k], axis=1)[..., None], axis=1)
            for k in (rows, lowest[rows])
        )
        same = (mine == theirs).all(axis=(1, 2)) & self.valid[rows] & self.valid[lowest[rows]]
        same &= ~self.holes.masked(rows) & ~self.holes.masked(lowest[rows])
        lowest[rows[~same]] = rows[~same]  # at worst a duplicate is judged exactly instead of by this table
        return lowest

    # --- exact answers ---

    def closest(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Hits:
        """Exact closest hits. ``origins`` float32 [3] or [n, 3]; ``directions`` float32 [n, 3]."""
        directions = np.asarray(directions, dtype=np.float32).reshape(-1, 3)
        origins = np.broadcast_to(np.asarray(origins, dtype=np.float32), directions.shape)
        n = len(directions)
        hits = Hits(origins, directions, np.full(n, -1, np.int32), np.full(n, np.inf), [None] * n, [()] * n)
        for rows, candidates in self._candidates.along(origins, directions, nearest=True):
            for i, triangles in zip(rows, candidates, strict=True):
                found = self._decisions.hits(origins[i], directions[i], triangles)
                if found:
                    hits.put(i, found)
        return hits

    def answers(
        self,
        origins: NDArray[np.float32],
        directions: NDArray[np.float32],
        lights: NDArray[np.float32],
        wanted: Sequence[bool] | NDArray[np.bool_],
    ) -> Exact:
        """Exact closest hits, and occluders for the ``wanted`` lights."""
        hits = self.closest(origins, directions)
        occluders = np.full((len(lights), len(hits)), -1, dtype=np.int32)
        for i in np.nonzero(np.asarray(wanted, dtype=bool))[0]:
            occluders[i] = self.occluders(hits, lights[i])
        return Exact(hits, occluders)

    def all_hits(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> list[list[tuple[float, int]]]:
        """Every exact hit of each ray as (t, triangle), unordered."""
        result: list[list[tuple[float, int]]] = []
        for rows, candidates in self._candidates.along(origins, directions, nearest=False):
            for i, triangles in zip(rows, candidates, strict=True):
                found = self._decisions.hits(origins[i], directions[i], triangles)
                result.append([(over / under, k) for over, under, k in found])
        return result

    def occluders(self, hits: Hits, light: NDArray[np.float32]) -> NDArray[np.int32]:
        """One triangle that meets the open segment from each exact hit point to ``light``; -1 where none does.

        At a miss -1. Triangles that contain the exact hit point do not meet the open segment.
        """
        result = np.full(len(hits), -1, dtype=np.int32)
        rows = np.nonzero(hits.triangle >= 0)[0]
        for part in np.array_split(rows, max(1, -(-len(rows) // BATCH))):
            some = hits.take(part)
            candidates, sure = self._candidates.between(self.hit_points(some), some.triangle, light, every=False)
            result[part] = sure
            for i, certain, triangles in zip(part, sure, candidates, strict=True):
                if certain < 0 and len(triangles):
                    met = self._between(hits, int(i), light, triangles)
                    result[i] = met[0] if met else -1
        return result

    def occluded(self, hits: Hits, light: NDArray[np.float32]) -> NDArray[np.uint8]:
        """Exact shadow bits: 1 shadowed, 0 lit or a miss."""
        return (self.occluders(hits, light) >= 0).astype(np.uint8)

    def hit_points(self, hits: Hits) -> NDArray[np.float64]:
        """Exact hit points rounded once to float64, shape [n, 3]; NaN at a miss."""
        points = np.full((len(hits), 3), np.nan)
        for i, ratio in enumerate(hits.ratio):
            if ratio is not None:
                scale, ints = integers_of(hits.origins[i], hits.directions[i])
                over, under = ratio
                shift = under << scale if scale > 0 else under
                grow = 1 if scale > 0 else 1 << -scale
                points[i] = [(ints[j] * under + ints[3 + j] * over) * grow / shift for j in range(3)]
        return points

    # --- classes ---

    def classify_primary(self, hits: Hits, triangle: NDArray[np.integer]) -> NDArray[np.int8]:
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

    def classify_shadow(
        self, hits: Hits, light: NDArray[np.float32], bits: NDArray[np.integer], exact_bits: NDArray | None = None
    ) -> NDArray[np.int8]:
        """The class [n] of a shadow bit that a method gave for each exact hit point (misses must be 0).

        ``exact_bits``: the exact bits, where they are known.
        """
        if exact_bits is None:
            exact_bits = self.occluded(hits, light)
        verdicts = np.full(len(hits), Verdict.OK, dtype=np.int8)
        verdicts[(bits != 0) & (bits != 1) | (hits.triangle < 0) & (bits != 0)] = Verdict.INVALID
        wrong = np.nonzero((verdicts == Verdict.OK) & (bits != exact_bits))[0]
        for part in np.array_split(wrong, max(1, -(-len(wrong) // BATCH))):
            acne = part[exact_bits[part] == 0]
            leak = part[exact_bits[part] == 1]
            verdicts[acne] = self._classify_acne(hits.take(acne), light)
            verdicts[leak] = self._classify_leak(hits.take(leak), light)
        return verdicts

    def _classify_wrong(self, hits: Hits, given: NDArray[np.integer]) -> NDArray[np.int8]:
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

    def _passed_over(
        self,
        o: NDArray[np.float64],
        d: NDArray[np.float64],
        triangle: NDArray[np.integer],
        at: NDArray[np.float64],
        reached: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """Which hits (triangle, at) before ``reached`` cannot be missed by rounding: far from edges, eye and the given
        triangle."""
        distance, _, bound = self.ray_to(o, d, triangle, edges_only=True)
        _, clear = self.holes.within(triangle, self.corners(triangle), o, d, bound)
        with np.errstate(invalid="ignore"):
            close = np.minimum(reached - at, at) * np.linalg.norm(d, axis=1) <= bound
        return (at < reached) & ~close & (distance > bound) & ~clear

    def _classify_acne(self, hits: Hits, light: NDArray[np.float32]) -> NDArray[np.int8]:
        """EDGE where some triangle off the hit point passes within the bound of the segment, else ACNE."""
        verdicts = np.full(len(hits), Verdict.ACNE, dtype=np.int8)
        if not len(hits):
            return verdicts
        p = self.hit_points(hits)
        margin = exact.EDGE_UNITS * exact.UNIT * np.maximum(np.abs(p).max(axis=1), self._candidates.tree.reach)
        candidates, _ = self._candidates.between(p, hits.triangle, light, every=True, margin=margin)
        for index, k in _rounds(candidates, verdicts, Verdict.ACNE):
            own = np.array([j in hits.ties[i] for i, j in zip(index, k.tolist(), strict=True)], dtype=bool)
            index, k = index[~own], k[~own]
            far = np.broadcast_to(light.astype(np.float64), (len(index), 3))
            corners = self.corners(k)
            away, share = triangle_distance(p[index], far, corners)
            bound = exact.edge_bound(p[index], p[index] + share[:, None] * (far - p[index]))
            near = away <= bound
            for j in np.nonzero(self.holes.masked(k))[0]:
                near[j] = near[j] or bool(self._between(hits, index[j], light, k[j : j + 1], holes=False))
            opaque, _ = self.holes.within(k, corners, p[index], far - p[index], bound)
            verdicts[index[near & opaque]] = Verdict.EDGE
        return verdicts

    def _classify_leak(self, hits: Hits, light: NDArray[np.float32]) -> NDArray[np.int8]:
        """EDGE where every occluder is met within the bound of its edge, or has an end at its plane, else LEAK."""
        verdicts = np.full(len(hits), Verdict.EDGE, dtype=np.int8)
        if not len(hits):
            return verdicts
        p = self.hit_points(hits)
        candidates, _ = self._candidates.between(p, hits.triangle, light, every=True)
        for index, k in _rounds(candidates, verdicts, Verdict.EDGE):
            corners = self.corners(k)
            far = np.broadcast_to(light.astype(np.float64), (len(index), 3))
            away, share = edge_distance(p[index], far, corners)
            ends = plane_distance(p[index], corners), plane_distance(far, corners)
            bound = exact.edge_bound(p[index], p[index] + share[:, None] * (far - p[index]))
            _, clear = self.holes.within(k, corners, p[index], far - p[index], bound)
            for j in np.nonzero((np.minimum.reduce([away, *ends]) > bound) & ~clear)[0]:
                i = index[j]
                if verdicts[i] == Verdict.EDGE and self._between(hits, i, light, k[j : j + 1]):
                    verdicts[i] = Verdict.LEAK
        return verdicts

    # --- parts ---

    def _between(
        self, hits: Hits, i: int, light: NDArray[np.float32], triangles: NDArray[np.int32], holes: bool = True
    ) -> list[int]:
        """The triangles that exactly meet the open segment from hit point i to the light (:class:`.Decisions`)."""
        o, d = hits.origins[i], hits.directions[i]
        return self._decisions.between(o, d, hits.ratio[i], light, triangles, holes)

    def corners(self, triangles: NDArray[np.integer]) -> NDArray[np.float64]:
        """The corners of triangles, float64 [n, 3, 3]."""
        return self.points[self.faces[triangles]].astype(np.float64)

    def ray_to(
        self, o: NDArray[np.float64], d: NDArray[np.float64], triangles: NDArray[np.integer], edges_only: bool = False
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
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


def _rounds(
    candidates: list[NDArray[np.int32]], verdicts: NDArray[np.int8], undecided: Verdict
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.int32]]]:
    """Pairs (ray, candidate) of the rays that are still ``undecided``: first a few per ray, then more for the remaining
    rays.

    Most rays are decided by one of their first candidates; a ray may have as many as there are triangles.
    """
    first, step = 0, 8
    rows = np.array([i for i, found in enumerate(candidates) if len(found)], dtype=np.intp)
    while len(rows):
        for part in np.array_split(rows, max(1, -(-len(rows) * step // PAIRS))):
            found = [candidates[i][first : first + step] for i in part]
            yield np.repeat(part, [len(one) for one in found]), np.concatenate(found)
        first, step = first + step, 8 * step
        rows = np.array([i for i in rows if verdicts[i] == undecided and len(candidates[i]) > first], dtype=np.intp)
