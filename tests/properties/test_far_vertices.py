"""A few vertices very far from the rest of a mesh: lights are placed by them, and the rest is as right as without them."""

import numpy as np
import pytest
from helpers.played_stories import Judging, fresh
from helpers.stories import Story
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.shapes import ball, joined, quad
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene

SIZE = (24, 20)

METHODS = ("ray_grids", "visibility_buffer", "perspective_spherical", "hybrid", "bvh2", "uniform_grid")


def far_vertices(distance: float, directional: bool) -> Story:
    """A ball over a floor, and a triangle far away on either side."""
    beyond = np.array([[1, 0, 0], [1, 0.25, 0], [1, 0, 0.25]]) * distance
    floor = quad((-3, 0, -3), (3, 0, -3), (3, 0, 3), (-3, 0, 3))
    one = np.array([[0, 1, 2]])
    points, faces = joined(floor, ball(0.5, (0, 0.6, 0)), (beyond, one), (-beyond, one))
    scale = 1.0 if directional else distance * 2.0**20
    light = Light((0.3 * scale, scale, 0.2 * scale), directional=directional)
    camera = Camera((0.3, 1.7, 3.1), (0.1, 0.4, 0.0))
    prepared = prepare(Scene("far", "Far", lambda: Geometry.static(points, faces), camera, (light,)))
    return Story(prepared, ["far"], [prepared.moment(0, *SIZE)])


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("directional", [True, False], ids=["sun", "point"])
@pytest.mark.parametrize("exponent", [26, 40])
def test_far_vertices_cost_no_shadow(name: str, directional: bool, exponent: int, device: str) -> None:
    story = far_vertices(2.0**exponent, directional)
    answers = fresh(
        lambda: Session(make_method(name, {}), story.prepared, *SIZE, device, light_count=1), story.moments[0]
    )
    judging = Judging(story)
    assert judging.wrong(0, answers) == ""
    assert judging.judged(0).exact["shadowed"][0].sum() > 10
