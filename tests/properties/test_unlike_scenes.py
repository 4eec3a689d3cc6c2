"""Scenes of unlike sizes, drawn by a seed: triangles of 1e-6 to 1e18, slivers, sheets that nearly touch, duplicates with
their corners in other orders, axes of their own scale; eyes and lights on them, in their planes or beside these by little.
"""

import numpy as np
import pytest
from helpers.judged_hard_cases import EVERYTHING, EXACT_SETTINGS
from numpy.typing import NDArray
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.hardcases.case import HardCase, Trial, spot_light, view
from shadowbench.harness.hardcases.judge import Judged, judge_case
from shadowbench.harness.hardcases.shapes import float32_of
from shadowbench.harness.scene.scene import Light

F64 = NDArray[np.float64]
Random = np.random.Generator

METHODS = ("bvh2", "ray_grids", "uniform_grid")
SEEDS = range(1000 if EVERYTHING else 12)
KINDS = ("lattice", "ordinary", "unlike", "giant", "edges through 0", "slivers", "sheets")


def magnitude(random: Random, least: float, most: float, shape: tuple[int, ...] = ()) -> F64:
    return 10.0 ** random.uniform(least, most, shape)


def corners(random: Random) -> F64:
    """Triangles, float32 numbers [n, 3, 3]."""
    kind, n = random.choice(KINDS), int(random.integers(2, 12))
    found = random.normal(size=(n, 3, 3))
    if kind == "lattice":
        found = random.integers(-4, 5, (n, 3, 3)).astype(np.float64)
    elif kind in ("unlike", "giant"):
        found *= magnitude(random, *((-6, 12) if kind == "unlike" else (0, 18)), (n, 1, 1))
    elif kind == "edges through 0":
        way, third = random.integers(-9, 10, (2, n, 1, 3)).astype(np.float64)
        found = np.concatenate([-way, 2 * way, third], axis=1) * 2.0 ** random.integers(10, 60, (n, 1, 1))
    elif kind == "slivers":
        middle, way = random.normal(size=(2, n, 1, 3))
        way *= magnitude(random, 0, 6)
        aside = middle + random.normal(size=(n, 1, 3)) * magnitude(random, -7, 0, (n, 1, 1))
        found = np.concatenate([middle - way, middle + way, aside], axis=1)
    elif kind == "sheets":
        one = random.normal(size=(1, 3, 3)) * magnitude(random, 0, 6)
        found = one + random.normal(size=(n, 1, 3)) * magnitude(random, -12, 0, (n, 1, 1))
    for i in np.nonzero(random.uniform(size=n) < 0.2)[0]:  # edges in common
        found[i, :2] = found[random.integers(n), random.permutation(3)[:2]]
    if random.uniform() < 0.3:
        found = np.concatenate([found, found[:1, random.permutation(3)]])[random.permutation(n + 1)]
    if random.uniform() < 0.3:
        found = found * np.array([1, 1, 2.0 ** -random.integers(5, 61)])[random.permutation(3)]
    return float32_of(found)


def beside(random: Random, found: F64) -> F64:
    """A point of an edge: any, or the nearest to 0."""
    p, q = found[random.integers(len(found))][random.permutation(3)[:2]]
    square = (q - p) @ (q - p)
    near = random.uniform() < 0.5 and square > 0
    return p + (q - p) * (np.clip(p @ (p - q) / square, 0, 1) if near else random.uniform())


def place(random: Random, found: F64, size: float) -> F64:
    """On a triangle, or beside it by little; anywhere in its plane; beside an edge; or anywhere."""
    kind, a, b, c = random.integers(5), *found[random.integers(len(found))][random.permutation(3)]
    weights = ((1, 0, 0), (0.5, 0.5, 0), (0.5, 0.25, 0.25), tuple(random.dirichlet((1, 1, 1))))[random.integers(4)]
    point = np.array(weights) @ (a, b, c)
    if kind == 1:
        point = point + random.normal(size=3) * np.abs(point).max() * magnitude(random, -14, 0)
    elif kind == 2:
        point = a + random.integers(-2, 3) * (b - a) + random.integers(-2, 3) * (c - a)
    elif kind == 3:
        point = beside(random, found) + random.normal(size=3) * size * magnitude(random, -8, 1)
    elif kind == 4:
        point = random.normal(size=3) * size * magnitude(random, -6, 8)
    return float32_of(point)


def unlike(seed: int) -> Trial:
    """Half of the scenes have an occluder near an end of a shadow segment."""
    random = np.random.default_rng(seed)
    found = corners(random)
    sizes = np.abs(found).max(axis=(1, 2))
    size = float(random.choice([1.0, sizes.min() or 1.0, np.median(sizes) or 1.0]))
    eye, target = place(random, found, size), beside(random, found)
    towards = target - eye if np.abs(target - eye).max() > 0 else random.normal(size=3)
    points = [place(random, found, size) for _ in range(random.integers(1, 4))]
    if random.uniform() < 0.5:
        share = magnitude(random, -14, -1)
        way = points[0] - target
        middle = target + way * (share if random.uniform() < 0.5 else 1 - share)
        arms = random.normal(size=(2, 3)) * np.abs(way).max() * magnitude(random, -6, 3)
        found = np.concatenate([found, [middle + arms[0], middle + arms[1], middle - arms.sum(axis=0)]], axis=None)
    lights: list[Light] = []
    for point in points:
        aim, x = beside(random, found.reshape(-1, 3, 3)) - point, tuple(point.tolist())
        spot = random.uniform() < 0.15 and np.abs(aim).max() > 0
        angle = float(random.choice([45.0, 90.0, random.uniform(1, 179)]))
        lights.append(spot_light(x, tuple(aim.tolist()), angle, None, (0.0, 1.0, 0.0)) if spot else Light(x))
    mesh = found.reshape(-1, 3), np.arange(len(found.reshape(-1, 3))).reshape(-1, 3)
    return view(mesh, lights, eye, towards, float(magnitude(random, -7, 0)), turn=int(random.integers(3)))


@pytest.mark.parametrize("seed", SEEDS)
def test_unlike_scenes_have_no_true_error(seed: int, device: str) -> None:
    trial = unlike(seed)
    judged = Judged(HardCase("unlike", "", "", lambda: trial, excusable=1.0), trial)
    for name in METHODS:
        finding = judge_case(judged, make_method(name, EXACT_SETTINGS.get(name, {})), device)
        assert finding.status == "ok", (name, finding.classes, finding.reason, finding.examples[:1])
