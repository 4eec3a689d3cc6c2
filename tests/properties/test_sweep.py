"""Every hard case again, a millionth and a million times as large, and 1e5 of its own sizes from the origin.

Scales and offsets that are no powers of two round the mesh anew; the referee decides on what everyone gets. A closed
surface stays closed, wherever its vertices were rounded to. The exact methods take turns over cases and places.
"""

import collections
import functools
from dataclasses import replace

import numpy as np
import pytest
from helpers.judged_hard_cases import CASES, EVERYTHING, exact_methods, judged
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.hardcases import HardCase
from shadowbench.harness.hardcases.case import CASES as BY_MODULE
from shadowbench.harness.hardcases.case import Counts, Trial
from shadowbench.harness.hardcases.judge import Judged, judge_case
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.scene import Geometry

PLACES = ((1e-6, 0.0), (1e6, 0.0), (1.0, 1e5), (1e-6, 1e5))
"""Scale, and how many sizes of the scene from the origin."""

METHODS = exact_methods()

MOST_PIXELS = 640
"""Larger images cost the judge more than all others together, and hold nothing that grows with scale."""

VARIED = {case.name for case in BY_MODULE["structures"]}
VARIED |= {case.name for case in BY_MODULE["reported"] if "#" in case.name}  # of threads, not those found by search
VARIED |= {case.name for case in BY_MODULE["eyes"] if case.name.startswith("O")}  # parallel rays
"""They have variants of their own in the catalogue, as those whose name begins with V."""


@functools.cache
def swept() -> list[HardCase]:
    """The cases that are swept: found when a test asks, as all cases have to be made."""
    return [
        case
        for case in CASES
        if not case.name.startswith("V ")
        and case.name not in VARIED
        and (moment := judged(case.name).trial.moment).width * moment.height <= MOST_PIXELS
    ]


def placed(trial: Trial, scale: float, sizes: float) -> Trial:
    """The same trial scaled, then carried off, in float64; nothing is stated of it any more."""
    scene = trial.prepared.scene
    geometry = scene.geometry()
    points = np.asarray(geometry.positions(0), dtype=np.float64)
    finite = points[np.isfinite(points).all(axis=1) & (np.abs(points) < 1e30).all(axis=1)]
    size = np.ptp(finite, axis=0).max() if len(finite) else 1.0
    step = np.array([0.8, -0.5, 0.33]) * sizes * size * scale

    def at(point):
        return tuple((np.asarray(point, dtype=np.float64) * scale + step).tolist())

    camera = replace(scene.camera, eye=at(scene.camera.eye), target=at(scene.camera.target))
    lights = tuple(
        light if light.directional else replace(light, position=at(light.position)) for light in scene.lights
    )
    moved = replace(
        scene, camera=camera, lights=lights, geometry=lambda: Geometry.static(points * scale + step, geometry.faces)
    )
    prepared = prepare(moved)
    moment = prepared.moment(0, trial.moment.width, trial.moment.height)
    return replace(trial, prepared=prepared, moment=moment, stated=Counts())


def methods_at(case: int, place: int) -> tuple[tuple[str, dict[str, str]], ...]:
    """The methods that answer a case in a place: one, in turn, so that a new method costs nothing; or all.

    A case lies in one of the four places, in turn; in all of them where :data:`.judged_hard_cases.EVERYTHING` holds.
    What is exact in a place is worked out anew, which takes longer than any method.
    """
    if EVERYTHING:
        return METHODS
    return (METHODS[(case // len(PLACES) + place) % len(METHODS)],) if case % len(PLACES) == place else ()


def moved_case(name: str, place: int) -> Judged:
    one = judged(name)
    trial = placed(one.trial, *PLACES[place])
    return Judged(HardCase(name, one.case.title, one.case.breaks, lambda: trial), trial)


@pytest.mark.parametrize("place", range(len(PLACES)), ids=lambda place: "{:g}-{:g}".format(*PLACES[place]))
def test_no_true_error_wherever_a_case_lies(place: int) -> None:
    wrong, run = {}, collections.Counter[str]()
    for number, case in enumerate(swept()):
        if not methods_at(number, place):
            continue
        one = moved_case(case.name, place)
        for name, settings in methods_at(number, place):
            finding = judge_case(one, make_method(name, settings), "cpu")
            run[name] += finding.status != "outside"
            if finding.status == "error":
                wrong[case.name, name] = (finding.classes, finding.reason, finding.examples[:1])
    assert wrong == {}
    assert set(run) == {name for name, _ in METHODS}
    assert min(run.values()) > (0.6 if EVERYTHING else 0.15) * len(swept()) / len(METHODS)


def test_most_of_the_catalogue_is_swept() -> None:
    assert len(swept()) > 120


def test_rays_along_walls_are_decided_by_digits_that_float64_does_not_have() -> None:
    """Walls 1e13 long whose common edges the rays pass at sines of 1e-8: in float64 22 of them meet the other wall
    (docs/accuracy.md).
    """
    one = moved_case("P31 1e+07", 1)
    for name in ("ray_grids", "bvh2"):
        assert judge_case(one, make_method(name), "cpu").classes == {}
