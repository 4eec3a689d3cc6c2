"""Triangles of closed surfaces that face away from the light are left out, and no answer changes."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from helpers.launched import launched
from helpers.second_judge import Flat, exactly
from helpers.small_scenes import answers_in, assert_same
from shadowbench.harness.frame.geometry import Corners
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases import find_case
from shadowbench.harness.hardcases.case import view
from shadowbench.harness.hardcases.closed_parts import half_turned
from shadowbench.harness.hardcases.shapes import ball, joined, plane, triangles
from shadowbench.harness.scene.closed import CLOSED, TURNED
from shadowbench.harness.scene.scene import Light
from shadowbench.methods.streams.occlusion.closed import turned_away

LIGHTS = ((-3.0, 0.5, 5.0), (3.0, 1.25, 2.0))


def session_of(trial, name="ray_grids", settings=None, device="cpu"):
    moment = trial.moment
    return Session(make_method(name, settings or {}), trial.prepared, moment.width, moment.height, device)


def traced(trial, name="ray_grids", settings=None, device="cpu"):
    """The answers, whether closed surfaces were looked at, and how many pairs of all lights were left to float64: of
    triangles that are left out there are none.
    """
    session = session_of(trial, name, settings, device)
    answers, counters = session.answers(trial.moment), session.method.counters()
    undecided = sum(counters.get(f"light {light} undecided pairs", 0) for light in range(len(LIGHTS)))
    return answers, session.effects.closed, undecided


def balls():
    """Two balls over one large triangle: what is undecided are pairs of neighbours on the balls."""
    ground = triangles((-20, -20, 0), (20, -20, 0), (0, 30, 0))
    mesh = joined(ground, *(ball(0.75, (x, 0.5, 1), 24, 32) for x in (-1, 1)))
    return view(mesh, list(LIGHTS), (0, 0, 8), (0, 0, -1), 0.25, (160, 160))


@pytest.mark.parametrize(("method", "settings"), [
    ("ray_grids", {}), ("ray_grids", {"trial": "groups=split+inline_rays=4"}), ("ray_grids", {"occluders": "last"}),
    ("hybrid", {"shadows": "grid"}),
])  # fmt: skip
def test_half_of_a_closed_surface_is_left_out(method, settings, device):
    answers, closed, undecided = traced(balls(), method, settings, device)
    given = {"occluders": settings.get("occluders", "none"), "trial": settings.get("trial", ""), "closed": "false"}
    expected, open_, of_all = traced(balls(), settings=given, device=device)
    assert (closed, open_) == (True, False)
    assert_same(answers, expected)
    assert 0 < undecided < of_all
    assert_same(traced(balls(), "hybrid", {"shadows": "tree"})[0], expected, "of a tree, which holds all triangles")


def test_a_part_that_the_eye_sees_from_its_back_is_opened_and_stays_so():
    trial = half_turned()
    session = session_of(trial)
    session.answers(trial.moment)
    assert (session.regrown, session.effects.closed) == (1, False)
    session.answers(trial.moment)
    assert session.regrown == 1


def test_the_other_parts_stay_closed():
    """Boxes on a floor, of which the eye sees one exactly at an edge."""
    trial = find_case("S70").make()
    session = session_of(trial)
    assert_same(session.answers(trial.moment), traced(trial, settings={"closed": "false"})[0])
    assert (session.regrown, session.effects.closed) == (1, True)
    flags = session.frame.flags.numpy()
    assert 0 < np.count_nonzero(flags & CLOSED) < len(flags) - 2


def test_a_part_that_a_light_leaves_is_looked_at_again():
    """While a light is in its box a surface counts as open. When only the light moves, it counts as closed, and that its
    faces are seen from the back must be found, though no hit changes.
    """
    trial = half_turned()
    inside, outside = Light((0.75, 0.75, 1.0)), [Light((x, 0.5, -4.0)) for x in range(5)]
    moments = [trial.prepared.moment(0, 16, 16, lights=(first, *outside[1:])) for first in (inside, outside[0])]
    session = session_of(trial)
    for moment in moments:
        session.advance(moment)
    assert session.regrown == 1
    expected, _, _ = traced(replace(trial, moment=moments[1]), settings={"closed": "false"})
    assert_same(answers_in(session), expected)


def test_a_scene_without_closed_surfaces_is_planned_as_ever():
    trial = view(plane(2, 0.0, 8.0), list(LIGHTS), (0, 0, 8), (0, 0, -1), 0.5)
    session = session_of(trial)
    session.answers(trial.moment)
    assert not session.effects.closed
    assert session.frame.flags.size == 0
    closed = session_of(balls())
    closed.answers(balls().moment)
    assert [work.name for work in closed.planned] == [work.name for work in session.planned]


@wp.kernel(enable_backward=False)
def away_kernel(
    flags: wp.array(dtype=wp.uint8), light: wp.array(dtype=wp.vec3f), corners: wp.array2d(dtype=wp.vec3f),
    away: wp.array(dtype=wp.bool),
):  # fmt: skip
    i = wp.tid()
    away[i] = turned_away(flags[i], light[i], Corners(corners[i, 0], corners[i, 1], corners[i, 2]))


def test_what_is_left_out_certainly_faces_away():
    """Lights in the plane of the triangle but for rounding, in units from 1e-38 to 1e36."""
    random = np.random.default_rng(3)
    count = 2000
    corners = random.normal(size=(count, 3, 3))
    weights = random.normal(size=(count, 2))
    edges = corners[:, 1:] - corners[:, :1]
    light = corners[:, 0] + (weights[:, :, None] * edges).sum(axis=1)
    height = random.choice([-1, 1], (count, 1)) * 10.0 ** random.uniform(-9, 0, (count, 1))
    light += np.cross(edges[:, 0], edges[:, 1]) * height
    unit = 10.0 ** random.choice([0.0, 0.0, 12.0, -14.0, -20.0, 20.0, -37.0, 36.0], count)[:, None]
    light, corners = (light * unit).astype(np.float32), (corners * unit[:, :, None]).astype(np.float32)
    flags = random.choice([1, 1 | CLOSED, 1 | CLOSED | TURNED], count).astype(np.uint8)
    (found,) = launched(away_kernel, count, [flags, light, corners], [count])
    assert not found[flags == 1].any()
    sides = [np.sign(Flat.of(corners[i]).side(exactly(light[i]))) for i in range(count)]
    exact = np.array(sides, dtype=int) * np.where(flags & TURNED, -1, 1)
    assert (exact[found] < 0).all()
    assert found[(flags != 1) & (exact < 0) & (unit[:, 0] == 1.0)].mean() > 0.5
