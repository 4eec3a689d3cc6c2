"""How long the exact referee takes to decide disputed pixels of a large frame: printed, never asserted.

    python tests/tools/referee_speed.py [SCENE ...] [--pixels 1000]      default: conference, the largest room

The pixels are hard ones: where the shadow of the first light, or the triangle seen, changes from one pixel to the next
one. Each is given a wrong answer (a miss, the triangle of another pixel, the opposite bit), so that it is not only
decided but its class is found too, with every triangle along its ray. Embree must be installed; it finds the places.
"""

import argparse
import os
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from shadowbench.harness.frame.devices import start_warp
from shadowbench.harness.judge.classify import neighbours
from shadowbench.harness.judge.referee import Referee
from shadowbench.harness.judge.reference import Reference, embree_reference, processor
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.moment import Moment
from shadowbench.harness.scene.prepared import prepare

SIDE = 1024


def borders(reference: Reference, count: int) -> np.ndarray:
    """A seeded choice of pixels whose right neighbour has another shadow bit or sees another triangle."""
    bits = reference.shadowed[0].reshape(SIDE, SIDE)
    seen = reference.triangle.reshape(SIDE, SIDE)
    edge = np.zeros((SIDE, SIDE), dtype=bool)
    edge[:, :-1] = (bits[:, :-1] != bits[:, 1:]) | (seen[:, :-1] != seen[:, 1:])
    there = np.nonzero(edge.ravel())[0]
    return np.sort(np.random.default_rng(0).choice(there, min(count, len(there)), replace=False))


def decided(referee: Referee, moment: Moment, reference: Reference, pixels: np.ndarray) -> dict[str, int]:
    """Decide pixels and find the classes of wrong answers to them; how many triangles and bits were classed wrong."""
    hits = referee.closest(moment.eye, moment.directions(pixels))
    given = np.roll(reference.triangle[pixels], 1)
    given[::7] = -1
    wrong = int((referee.classify_primary(hits, given) > 1).sum())
    bits = 0
    for light, row in zip(moment.lights, reference.shadowed, strict=True):
        bits += int((referee.classify_shadow(hits, light, 1 - row[pixels]) > 1).sum())
    return {"triangles": wrong, "bits": bits}


def timed(what: str, work: Callable[[], Any]) -> Any:
    """Do it, and print how long it took."""
    wall, busy = time.perf_counter(), time.process_time()
    found = work()
    print(f"  {what:<42} {time.perf_counter() - wall:6.2f} s  ({time.process_time() - busy:.2f} s of processors)")
    return found


def report(scene: str, count: int) -> None:
    """Measure one scene and print it."""
    prepared = prepare(resolve(scene))
    moment = prepared.moment(0, SIDE, SIDE)
    reference = embree_reference(prepared, moment)
    pixels = borders(reference, count)
    print(f"{scene}: {prepared.triangle_count:,} triangles, {SIDE}x{SIDE}, {len(moment.lights)} lights")
    # Kernels are compiled, or taken from the cache, before anything is timed.
    decided(Referee(moment.points, prepared.faces, moment.valid), moment, reference, pixels[:8])
    referee = timed("tree of the referee", lambda: Referee(moment.points, prepared.faces, moment.valid))
    found = timed(f"{len(pixels):,} disputed pixels", lambda: decided(referee, moment, reference, pixels))
    near = neighbours(pixels, SIDE, SIDE)
    timed(f"... with their neighbours, {len(near):,} pixels", lambda: decided(referee, moment, reference, near))
    print(f"  of the answers planted there {found['triangles']:,} triangles and {found['bits']:,} bits are wrong")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", nargs="*", default=["conference"])
    parser.add_argument("--pixels", type=int, default=1000)
    arguments = parser.parse_args()
    start_warp()
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    print(f"{processor()['model']}, {cores} cores")
    for scene in arguments.scene:
        report(scene, arguments.pixels)


if __name__ == "__main__":
    main()
