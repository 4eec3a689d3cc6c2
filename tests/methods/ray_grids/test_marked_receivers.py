"""Receivers that ray_grids marks where it places the rays are those that the harness marks for other methods."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.effect_scenes import BEHIND, scene
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.scene import Light, Spot

SIZE = 160, 120
SPOTS = {
    "narrow": Light((1.5, 3.0, 1.0), spot=Spot((-1.5, -3.0, -1.0), 12.0)),
    "half": Light((0.3, 0.4, 0.2), spot=Spot((-0.2, -1.0, 0.1), 90.0)),
    "more than half": Light((0.1, 0.2, 0.9), spot=Spot((0.3, 1.0, 0.1), 130.0)),
    "far": Light((3.0e6, 9.0e6, 1.0e6), spot=Spot((-3.0, -9.0, -1.0), 5.0e-6)),
    "rectangle": Light((0.4, 2.5, 1.2), spot=Spot((-0.2, -1.0, -0.4), 25.0, rise=8.0, up=(0.0, 0.0, 1.0))),
    # The floor lies in the plane that bounds the cone: rounding decides each of its points.
    "edge on the floor": Light((1.5, -1.2, 1.0), spot=Spot((0.0, -1.0, 0.0), 90.0)),
}


def marked(method: str, lights, facing: bool, device: str) -> tuple[np.ndarray, Session]:
    prepared = scene(lights, facing=facing)
    session = Session(make_method(method, {}), prepared, *SIZE, device)
    session.answers(prepared.moment(0, *SIZE))
    return session.frame.receivers.numpy(), session


@pytest.mark.parametrize("facing", [False, True])
@pytest.mark.parametrize("name", SPOTS)
def test_the_same_receivers_as_by_the_pass_of_the_harness(name, facing, device):
    lights = (SPOTS[name], BEHIND)
    wanted, by_harness = marked("uniform_grid", lights, facing, device)
    for method in ("ray_grids", "visibility_buffer"):
        found, session = marked(method, lights, facing, device)
        np.testing.assert_array_equal(found[0], wanted[0])
        assert "light 0: receivers" not in [work.name for work in session.all_passes]
    assert "light 0: receivers" in [work.name for work in by_harness.all_passes]
    assert 0 < wanted[0].sum() < (by_harness.frame.answers.triangle.numpy() >= 0).sum()
