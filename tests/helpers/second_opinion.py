"""The referee held against the second judge: on random rays near edges, and on hard cases with all that they call for."""

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from helpers.judged_hard_cases import judged
from helpers.second_judge import Bitmap, Point, SecondJudge, Seen, dot, exactly, minus
from numpy.typing import NDArray
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.case import Trial
from shadowbench.harness.judge.referee import Referee
from shadowbench.harness.scene.prepared import valid_triangles
from shadowbench.harness.scene.scene import Light

F32 = NDArray[np.float32]

DOUBT = 1e-9
"""Radians, or a share of lengths, within which whether a hit point lies in a spot, or faces a light, is left open."""

TRACER = "uniform_grid"
"""The method whose mirrored rays are looked at. Which one does not matter: its rays are what is given."""


@dataclass
class Count:
    """What was compared: rays, hits with more than one triangle, segments, shadows among them."""

    rays: int = 0
    hits: int = 0
    ties: int = 0
    segments: int = 0
    shadows: int = 0

    def __str__(self) -> str:
        return (
            f"{self.rays} rays, {self.hits} hits, {self.ties} of them ties, {self.segments} segments, "
            f"{self.shadows} shadows"
        )


# --- random rays near edges ---------------------------------------------------------------------------------------


def random_mesh(random: np.random.Generator) -> tuple[F32, NDArray[np.int32]]:
    """A small mesh with shared vertices: on a lattice, with full mantissas, of mixed sizes, a fan, or slivers."""
    kind = random.integers(5)
    count = int(random.integers(4, 16))
    points = random.normal(size=(count, 3))
    faces = random.integers(0, count, (int(random.integers(2, 20)), 3))
    if kind == 0:
        points = random.integers(-4, 5, (count, 3)).astype(np.float64)
    elif kind == 2:
        points *= 10.0 ** random.uniform(-6, 1, (count, 3))
    elif kind == 3:
        points[1:] = points[0] + random.normal(size=(count - 1, 3)) * 10.0 ** random.uniform(-4, 0)
        ring = np.arange(1, count)
        faces = np.stack([np.zeros(count - 1, dtype=np.int64), ring, np.roll(ring, -1)], axis=1)
    elif kind == 4:
        points[1::2] = points[::2][: len(points[1::2])] + 1e-6 * random.normal(size=points[1::2].shape)
    scale = 2.0 ** int(random.choice([0, 0, 0, 0, 7, -9, 60, -60]))
    return (points * scale).astype(np.float32), faces.astype(np.int32)


def nudged(random: np.random.Generator, values: NDArray[np.float64]) -> F32:
    """Rounded to float32; every other row is then moved by up to two of its last places in each coordinate."""
    rounded = values.astype(np.float32)
    steps = random.integers(-2, 3, values.shape) * random.integers(0, 2, (len(values), 1))
    return (rounded.view(np.int32) + steps * (rounded != 0)).astype(np.int32).view(np.float32)


def near_edges(random: np.random.Generator, points: F32, faces: NDArray[np.int32], count: int) -> F32:
    """Points beside edges: of vertices, middles, thirds and anywhere between, float32 [count, 3]."""
    corners = points[faces[random.integers(0, len(faces), count)]].astype(np.float64)
    share = random.choice([0.0, 0.5, 1.0, 1 / 3, -1.0], (count, 1))
    share = np.where(share < 0, random.uniform(size=(count, 1)), share)
    return nudged(random, corners[:, 0] + share * (corners[:, 1] - corners[:, 0]))


def random_trial(random: np.random.Generator, rays: int) -> tuple[F32, NDArray[np.int32], F32, F32, F32]:
    """Points, faces, origins and directions [rays, 3] beside edges, and lights [3, 3] of a random mesh."""
    points, faces = random_mesh(random)
    size = float(np.abs(points).max()) or 1.0
    eyes = nudged(random, random.normal(size=(rays, 3)) * size * 2.0 ** random.integers(0, 12, (rays, 1)))
    touching = random.uniform(size=rays) < 0.1  # an eye on a vertex or beside an edge
    eyes[touching] = near_edges(random, points, faces, int(touching.sum()))
    targets = near_edges(random, points, faces, rays)
    ways = (targets.astype(np.float64) - eyes) * 2.0 ** random.integers(-3, 4, (rays, 1))
    ways[~ways.any(axis=1)] = size
    # The first light lies beyond an edge, seen from near another one; the second on or beside an edge; one anywhere.
    start, through = near_edges(random, points, faces, 1), near_edges(random, points, faces, 1)
    beyond = start + (through.astype(np.float64) - start) * 2.0 ** random.integers(0, 8)
    beside = near_edges(random, points, faces, 1)
    lights = np.concatenate([beyond, beside, random.normal(size=(1, 3)) * size * 3])
    return points, faces, eyes, nudged(random, ways), lights.astype(np.float32)


def compare(
    referee: Referee, second: SecondJudge, origins: F32, directions: F32, lights: F32, count: Count
) -> list[str]:
    """Where the two judges differ on rays, on their exact t, ties, and on shadow bits to lights; empty where nowhere."""
    hits, seen = referee.closest(origins, directions), second.closest(origins, directions)
    found = []
    for i, one in enumerate(seen):
        mine = (one.ties, one.t, float(one.t)) if one else ((), None, np.inf)
        ratio = hits.ratio[i]
        theirs = (hits.ties[i], None if ratio is None else Fraction(*ratio), hits.t[i])
        if mine != theirs:
            found.append(f"ray {origins[i].tolist()} {directions[i].tolist()}: {theirs} and {mine}")
    count.rays += len(seen)
    count.hits += sum(one is not None for one in seen)
    count.ties += sum(one is not None and len(one.ties) > 1 for one in seen)
    for light in lights:
        bits, own = referee.occluded(hits, light), second.shadowed(seen, light)
        for i in np.nonzero(bits.astype(bool) != own)[0]:
            found.append(
                f"from the hit of {origins[i].tolist()} {directions[i].tolist()} to {light.tolist()}: {bits[i]}"
            )
        count.segments += sum(one is not None for one in seen)
        count.shadows += sum(own)
    return found


def random_opinion(seed: int, rays: int, count: Count) -> list[str]:
    """Both judges on one random mesh with so many rays beside its edges."""
    points, faces, eyes, ways, lights = random_trial(np.random.default_rng(seed), rays)
    referee = Referee(points, faces, valid_triangles(points, faces))
    return [f"seed {seed}: {one}" for one in compare(referee, SecondJudge(points, faces), eyes, ways, lights, count)]


# --- hard cases ---------------------------------------------------------------------------------------------------


def second_of(trial: Trial) -> SecondJudge:
    mask = trial.prepared.alpha
    holes = Bitmap(mask.triangles, mask.coordinates, mask.opaque) if mask is not None else None
    return SecondJudge(trial.moment.points, trial.prepared.faces, holes)


def pixels_of(trial: Trial, most: int) -> NDArray[np.int64]:
    """All pixels of an image, or a seeded choice of ``most``."""
    pixels = np.arange(trial.moment.width * trial.moment.height)
    return pixels if len(pixels) <= most else np.sort(np.random.default_rng(1).choice(pixels, most, replace=False))


def rays_of_case(name: str, most: int, count: Count) -> list[str]:
    """Both judges on the primary rays of a case, without what limits its lights."""
    trial = judged(name).trial
    moment, pixels = trial.moment, pixels_of(trial, most)
    referee = Referee(moment.points, trial.prepared.faces, moment.valid, mask=trial.prepared.alpha)
    rays = np.array(moment.origins(pixels)), moment.directions(pixels)
    return [f"{name}: {one}" for one in compare(referee, second_of(trial), *rays, moment.lights, count)]


def answers_of_case(name: str, most: int, count: Count) -> list[str]:
    """The second judge on the answers that ``check`` expects of a case: triangles, t, u, v, bits; and its mirrored rays."""
    one = judged(name)
    trial, exact = one.trial, one.exact
    moment, pixels, second = trial.moment, pixels_of(trial, most), second_of(trial)
    origins = np.array(moment.origins(pixels))
    seen = second.closest(origins, moment.directions(pixels))
    found = [f"{name}: pixel {pixel}: {text}" for pixel, text in _unlike(second, seen, exact, pixels)]
    for i, light in enumerate(trial.prepared.scene.lights):
        bits = second.shadowed(seen, moment.lights[i]) if light.shadows else [False] * len(seen)
        for row, (pixel, bit) in enumerate(zip(pixels, bits, strict=True)):
            lit = _receives(trial, second, seen[row], i, exactly(origins[row]))
            if lit is not None and exact["shadowed"][i, pixel] != (bit and lit):
                found.append(f"{name}: pixel {pixel}, light {i}: {exact['shadowed'][i, pixel]}, not {bit and lit}")
        count.segments += sum(hit is not None for hit in seen)
        count.shadows += sum(bits)
    count.rays += len(seen)
    count.hits += sum(hit is not None for hit in seen)
    count.ties += sum(hit is not None and len(hit.ties) > 1 for hit in seen)
    if trial.prepared.scene.bounces and trial.prepared.mirror.any():
        found += [f"{name}: {text}" for text in _mirrored(trial, second, count)]
    return found


def _unlike(
    second: SecondJudge, seen: list[Seen | None], exact: dict[str, NDArray], pixels: NDArray
) -> list[tuple[int, str]]:
    found = []
    for pixel, one in zip(pixels.tolist(), seen, strict=True):
        given = exact["triangle"][pixel], exact["t"][pixel]
        if one is None:
            if given != (-1, np.inf):
                found.append((pixel, f"{given}, not a miss"))
            continue
        if given[0] != one.ties[0] or not abs(float(given[1]) - float(one.t)) <= 2.0**-24 * float(one.t) + 2.0**-149:
            found.append((pixel, f"{given}, not {one.ties} at {float(one.t)}"))
            continue
        # u and v name a point of the triangle: it lies at the hit point but for float32 rounding along the edges.
        a, b, c = second.corners[one.ties[0]].astype(np.float64)
        u, v = float(exact["u"][pixel]), float(exact["v"][pixel])
        off = (
            abs(u - float(one.weights[1])) * np.abs(b - a).max() + abs(v - float(one.weights[2])) * np.abs(c - a).max()
        )
        if not off <= 2.0**-22 * (np.abs(b - a).max() + np.abs(c - a).max() + abs(float(one.t)) * 2.0**-20):
            found.append((pixel, f"u, v = {u}, {v}, not {[float(w) for w in one.weights[1:]]}"))
    return found


def _receives(trial: Trial, second: SecondJudge, one: Seen | None, light: int, eye: Point) -> bool | None:
    """Whether a hit point has a shadow ray to a light; None where rounding may say either."""
    lamp, place = trial.prepared.scene.lights[light], exactly(trial.moment.lights[light])
    if one is None:
        return True
    if trial.prepared.scene.facing:
        flat = second.flat(one.ties[0])
        assert flat is not None
        sides = flat.side(eye), flat.side(place)
        reach = [
            math.sqrt(dot(flat.normal, flat.normal) * dot(minus(p, one.point), minus(p, one.point)))
            for p in (eye, place)
        ]
        if any(abs(side) <= DOUBT * size for side, size in zip(sides, reach, strict=True)):
            return None
        if sides[0] * sides[1] < 0:
            return False
    return _in_spot(lamp, [float(x) for x in minus(one.point, place)])


def _in_spot(lamp: Light, way: list[float]) -> bool | None:
    spot = lamp.spot
    if spot is None:
        return True
    forward = np.array(spot.direction) / np.linalg.norm(spot.direction)
    if spot.rise is None:
        angle = math.atan2(float(np.linalg.norm(np.cross(forward, way))), float(np.dot(forward, way)))
        margins = [math.radians(spot.angle) - angle]
    else:
        right = np.cross(forward, spot.up)
        right /= np.linalg.norm(right)
        f, r, u = (float(np.dot(axis, way)) for axis in (forward, right, np.cross(right, forward)))
        margins = [
            math.radians(spot.angle) - abs(math.atan2(r, f)),
            math.radians(spot.rise) - abs(math.atan2(u, math.hypot(f, r))),
        ]
    return None if min(abs(margin) for margin in margins) < DOUBT else min(margins) > 0


def _mirrored(trial: Trial, second: SecondJudge, count: Count) -> list[str]:
    """Every bounce of a method: its rays leave their mirror on the side they came from, and go where the law says; both
    judges agree on what they meet.
    """
    moment, prepared = trial.moment, trial.prepared
    session = Session(make_method(TRACER), prepared, moment.width, moment.height, "cpu")
    answers = session.answers(moment)
    referee = Referee(moment.points, prepared.faces, moment.valid, mask=prepared.alpha)
    pixels = np.arange(moment.width * moment.height)
    origins, directions, triangle = (np.array(moment.origins(pixels)), moment.directions(pixels), answers["triangle"])
    found = []
    for bounce, active in enumerate(answers["bounce_active"]):
        there = np.nonzero(active == 1)[0]
        starts, ways = (answers[f"bounce_{key}"][bounce] for key in ("origin", "direction"))
        for i in there:
            flat = second.flat(int(triangle[i]))
            assert flat is not None
            came, went = exactly(directions[i]), exactly(ways[i])
            twice = 2 * dot(flat.normal, came) / dot(flat.normal, flat.normal)
            law = [float(x - twice * n) for x, n in zip(came, flat.normal, strict=True)]
            turned = np.abs(np.array(law) - ways[i]).max() > 2.0**-22 * np.abs(law).max()
            if flat.side(exactly(starts[i])) * flat.side(exactly(origins[i])) <= 0 or turned:
                found.append(f"bounce {bounce + 1} of pixel {i} goes {ways[i].tolist()}, not {law}; {went}")
        found += [
            f"bounce {bounce + 1}: {text}"
            for text in compare(referee, second, starts[there], ways[there], moment.lights, count)
        ]
        origins, directions, triangle = starts, ways, answers["bounce_triangle"][bounce]
    return found
