"""The exact referee against a judge that shares nothing with it: random rays near edges, what is excused, hard cases.

    python tests/tools/second_opinion.py --rays 100000 --seed 1 --most 4096

``--most``: of a case with more pixels a choice of so many is compared. Prints what was compared and every difference:
each is a fault of one of the two. Where CGAL's binding for Python is installed (``pip install cgal``), its exact
predicate is asked about the random rays as well. Exit code 1 where any two differ.
"""

import argparse
import importlib.util
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # as a program it finds the tests' helpers, too

from helpers.judged_hard_cases import CASES
from helpers.second_excuses import excuses
from helpers.second_judge import SecondJudge, dot, exactly
from helpers.second_opinion import Count, answers_of_case, random_opinion, random_trial, rays_of_case
from shadowbench.harness.frame.devices import start_warp

RAYS = 100
"""Rays of one random mesh."""


def cgal_opinion(seed: int, rays: int) -> tuple[int, list[str]]:
    """How many pairs of ray and triangle CGAL was asked about, and where it and the second judge differ.

    Left out: rays whose second point float64 does not hold, and, by the contract alone no hits, rays in a plane or
    that begin in one.
    """
    from CGAL.CGAL_Kernel import Point_3, Ray_3, Triangle_3, do_intersect

    points, faces, eyes, ways, _ = random_trial(np.random.default_rng(seed), rays)
    second = SecondJudge(points, faces)
    asked, found = 0, []
    shapes = {
        k: Triangle_3(*(Point_3(*map(float, p)) for p in second.corners[k]))
        for k in second.finite.tolist()
        if second.flat(k)
    }
    for origin, way in zip(eyes.astype(np.float64), ways.astype(np.float64), strict=True):
        o, d, end = exactly(origin), exactly(way), origin + way
        if any(x + y != z for x, y, z in zip(o, d, exactly(end), strict=True)):
            continue
        ray = Ray_3(Point_3(*origin.tolist()), Point_3(*end.tolist()))
        for k, shape in shapes.items():
            flat = second.flat(k)
            assert flat is not None
            if dot(flat.normal, d) and flat.side(o):
                asked += 1
                if do_intersect(ray, shape) != (second.hit(o, d, k) is not None):
                    found.append(f"seed {seed}: ray {origin.tolist()} {way.tolist()} and triangle {k}: CGAL differs")
    return asked, found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rays", type=int, default=100_000, help="random rays; 0: none")
    parser.add_argument("--seed", type=int, default=int(time.time()), help="default: by the clock; it is printed")
    parser.add_argument("--most", type=int, default=1024, help="pixels of a case; 0: no cases")
    given = parser.parse_args()
    start_warp()
    print(f"seed {given.seed}", flush=True)
    began, count, asked, found = time.monotonic(), Count(), 0, []
    classes: dict[str, int] = {}
    external = importlib.util.find_spec("CGAL") is not None
    for seed in range(given.seed, given.seed + given.rays // RAYS):
        found += random_opinion(seed, RAYS, count)
        found += excuses(seed, RAYS // 4, classes)
        if external:
            pairs, differ = cgal_opinion(seed, RAYS // 4)
            asked, found = asked + pairs, found + differ
    print(f"random: {count}; {len(found)} differences; {time.monotonic() - began:.0f} s", flush=True)
    print(f"excused or not: {classes}")
    print(f"CGAL was asked about {asked} pairs" if external else "CGAL is not installed, and was not asked")
    count = Count()
    for case in CASES if given.most else ():
        found += rays_of_case(case.name, given.most, Count()) + answers_of_case(case.name, given.most, count)
    print(f"{len(CASES)} cases: {count}; {time.monotonic() - began:.0f} s", flush=True)
    print(f"{len(found)} differences", *found[:20], sep="\n")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
