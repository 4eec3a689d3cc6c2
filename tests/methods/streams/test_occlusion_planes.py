"""A light in the plane of a large triangle: its rays are decided by planes, not one by one in float64."""

import pytest
from helpers.answers import trace
from helpers.exact_answers import assert_right, exact_answers
from helpers.method_trials import box
from helpers.small_scenes import make_scene
from helpers.streams import trial
from shadowbench.harness.hardcases.shapes import joined, quad

SIZE = 64


def room(light):
    """A cube from -2 to 2, and a square in the plane x = 0 within it."""
    square = quad(*((0, y, z) for y, z in ((-1.5, -1.5), (1.5, -1.5), (1.5, 1.25), (-1.5, 1.25))))
    return make_scene(*joined(box(1, 2.0), square), [light], eye=(1.7, 0.9, 1.8), fov=95.0)


@pytest.mark.parametrize("groups", ["stream", "split"])
@pytest.mark.parametrize(
    "light",
    [(0.0, 0.2, -0.3), (0.0, 1.75, 0.1), (2.0**-30, 0.2, -0.3), (-(2.0**-30), 1.75, 0.1)],
    ids=["in the square", "beside it", "nearly in it", "nearly beside it"],
)
def test_few_pairs_are_left_to_float64(light, groups, device):
    prepared = room(light)
    session, moment, answers = trace("ray_grids", trial(groups=groups), prepared, SIZE, SIZE, device)
    assert_right(answers, exact_answers(prepared, moment))
    assert (answers["triangle"] >= 0).all()
    # A light nearly in the square sees both of its triangles through each of its points.
    on_square = int((answers["triangle"] >= 12).sum()) if light[0] else 0
    assert session.method.counters()["light 0 undecided pairs"] < 1.1 * on_square + 0.05 * SIZE * SIZE
