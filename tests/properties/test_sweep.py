"""Every hard case again, a millionth and a million times as large, and 1e5 of its own sizes from the origin.

Scales and offsets that are no powers of two round the mesh anew; the referee decides on what everyone gets. A closed
surface stays closed, wherever its vertices were rounded to.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.judged_hard_cases import CASES, judged
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.hardcases import HardCase
from shadowbench.harness.hardcases.case import Counts, Trial
from shadowbench.harness.hardcases.judge import Judged, judge_case
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.scene import Geometry

METHODS = (
    ("perspective_spherical", {}),
    ("ray_grids", {}),
    ("uniform_grid", {}),
    ("warp_bvh", {"update": "bvh_rebuild"}),
)

PLACES = ((1e-6, 0.0), (1e6, 0.0), (1.0, 1e5), (1e-6, 1e5))
"""Scale, and how many sizes of the scene from the origin."""

MOST_PIXELS = 640
"""Larger images cost the judge more than all others together, and hold nothing that grows with scale."""

SWEPT = [
    case
    for case in CASES
    if not case.name.startswith("V ")  # varied in the catalogue itself
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
        scene,
        camera=camera,
        lights=lights,
        geometry=lambda: Geometry.static(points * scale + step, geometry.faces),
    )
    prepared = prepare(moved)
    moment = prepared.moment(0, trial.moment.width, trial.moment.height)
    return replace(trial, prepared=prepared, moment=moment, stated=Counts())


@pytest.mark.parametrize(("scale", "sizes"), PLACES)
def test_no_true_error_wherever_a_case_lies(scale: float, sizes: float) -> None:
    wrong, run = {}, 0
    for case in SWEPT:
        trial = placed(judged(case.name).trial, scale, sizes)
        one = Judged(HardCase(case.name, case.title, case.breaks, lambda trial=trial: trial), trial)
        for name, settings in METHODS:
            finding = judge_case(one, make_method(name, settings), "cpu")
            run += finding.status != "outside"
            if finding.status == "error":
                wrong[case.name, name] = (finding.classes, finding.reason, finding.examples[:1])
    assert wrong == {}
    assert run > 4 * 100


def test_most_of_the_catalogue_is_swept() -> None:
    assert len(SWEPT) > 120
