"""Which wrong answers rounding excuses, in rational arithmetic from docs/accuracy.md, and what the referee says of them.

A miss is excused where the ray passes, within 16 units of 2^-24 of the largest coordinate of its origin and of the point
where it does, an edge of every triangle that it hits; or where it hits it so near to its origin. A shadow that is left
out is excused where the segment passes an edge of its occluder so near, or ends so near to its plane. Only rays with one
hit and segments with one occluder are looked at, and none whose distance is within :data:`MARGIN` of the bound.
"""

from fractions import Fraction

import numpy as np
from helpers.second_judge import Flat, Point, SecondJudge, along, dot, exactly, minus
from helpers.second_opinion import random_mesh
from numpy.typing import NDArray
from shadowbench.harness.judge.referee import Referee
from shadowbench.harness.judge.verdict import Verdict
from shadowbench.harness.scene.prepared import valid_triangles

UNITS = Fraction(16, 2**24)
MARGIN = Fraction(1, 1000)


def within(square: Fraction, bound: Fraction) -> bool | None:
    """Whether a squared distance lies within a bound; None where it is too near to it to compare."""
    if square <= (bound * (1 - MARGIN)) ** 2:
        return True
    return None if square <= (bound * (1 + MARGIN)) ** 2 else False


def largest(p: Point) -> Fraction:
    return max(abs(x) for x in p)


def edges_within(flat: Flat, o: Point, way: Point, most: Fraction | None) -> bool | None:
    """Whether a ray, or a segment of ``most`` times its direction, passes an edge of a triangle within the bound."""
    answers: list[bool | None] = []
    square = dot(way, way)
    for k in range(3):
        p, q = flat.corners[k], flat.corners[(k + 1) % 3]
        edge, start = minus(q, p), minus(p, o)
        steep = dot(edge, edge) - dot(edge, way) ** 2 / square
        share = Fraction(0)
        if steep:
            share = -(dot(start, edge) - dot(start, way) * dot(edge, way) / square) / steep
        nearest = along(start, min(max(share, Fraction(0)), Fraction(1)), edge)
        t = dot(nearest, way) / square
        if t < 0 or (most is not None and t > most):
            answers.append(None)  # beyond an end: the nearest point is another one
            continue
        passed = along(o, t, way)
        apart = minus(nearest, minus(passed, o))
        answers.append(within(dot(apart, apart), UNITS * max(largest(o), largest(passed))))
    return True if True in answers else None if None in answers else False


def beside_edges(random: np.random.Generator, rays: int) -> tuple[NDArray, NDArray, NDArray, NDArray, NDArray]:
    """A random mesh, eyes, directions and a light, as far beside edges as the bound is wide, and farther."""
    points, faces = random_mesh(random)
    size = float(np.abs(points).max()) or 1.0
    eyes = (random.normal(size=(rays, 3)) * 2 * size).astype(np.float32)
    corners = points[faces[random.integers(0, len(faces), rays)]].astype(np.float64)
    targets = corners[:, 0] + random.uniform(size=(rays, 1)) * (corners[:, 1] - corners[:, 0])
    away = np.abs(eyes).max(axis=1, keepdims=True) * 2.0**-20 * 10.0 ** random.uniform(-2, 1.5, (rays, 1))
    targets += random.normal(size=(rays, 3)) * away
    return points, faces, eyes, (targets - eyes).astype(np.float32), targets[0].astype(np.float32)


def excuses(seed: int, rays: int, counts: dict[str, int]) -> list[str]:
    """Where the referee excuses what the words do not, or the reverse; ``counts`` of what was compared by its class."""
    points, faces, eyes, ways, beside = beside_edges(np.random.default_rng(seed), rays)
    referee, second = Referee(points, faces, valid_triangles(points, faces)), SecondJudge(points, faces)
    hits, seen = referee.closest(eyes, ways), second.closest(eyes, ways)
    found = []

    def compared(what: str, wanted: bool | None, verdict: int, error: Verdict) -> None:
        if wanted is None:
            return
        counts[f"{what} {wanted}"] = counts.get(f"{what} {wanted}", 0) + 1
        if verdict != (Verdict.EDGE if wanted else error):
            found.append(f"seed {seed}: {what}: excused {wanted}, but {Verdict(int(verdict)).name}")

    misses = referee.classify_primary(hits, np.full(rays, -1))
    for i, one in enumerate(seen):
        o, d = exactly(eyes[i]), exactly(ways[i])
        if one is None or sum(second.hit(o, d, k) is not None for k in second.finite.tolist()) != 1:
            continue
        flat = second.flat(one.ties[0])
        assert flat is not None
        near = within(one.t**2 * dot(d, d), UNITS * max(largest(o), largest(one.point)))
        at_edge = edges_within(flat, o, d, None)
        compared(
            "miss",
            True if True in (near, at_edge) else None if None in (near, at_edge) else False,
            misses[i],
            Verdict.TRUE,
        )
    # A light behind a point beside an edge, as seen from the first hit.
    first = next((i for i, one in enumerate(seen) if one is not None), 0)
    start = np.float64([float(x) for x in seen[first].point]) if seen[first] else eyes[0]  # type: ignore[union-attr]
    light = (start + 2 * (beside - start)).astype(np.float32)
    leaks = referee.classify_shadow(hits, light, np.zeros(rays, dtype=np.uint8))
    place = exactly(light)
    for i, one in enumerate(seen):
        if one is None:
            continue
        blockers = [k for k in second.finite.tolist() if second.blocks(one.point, place, k)]
        if len(blockers) != 1:
            continue
        flat = second.flat(blockers[0])
        assert flat is not None
        way, square = minus(place, one.point), dot(flat.normal, flat.normal)
        # Which point a plane is passed at, near an end, the words leave open: between the hit point and the light.
        sizes = UNITS * largest(one.point), UNITS * max(largest(one.point), largest(place))
        ends = []
        for p in (one.point, place):
            away = flat.side(p) ** 2 / square
            ends.append(True if within(away, sizes[0]) else None if within(away, sizes[1]) is not False else False)
        answers = [edges_within(flat, one.point, way, Fraction(1)), *ends]
        compared("leak", True if True in answers else None if None in answers else False, leaks[i], Verdict.LEAK)
    return found
