"""Embree as a method: nearly brute force, the traps of embreex, threads that change nothing."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.brute_force import make_scene, soup
from helpers.method_trials import assert_misses, assert_nearly, hard_trials, lattice, random_trial, trace
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.effects import Effects

NAME = "embree"
TRIALS = {name: (prepared, width, height) for name, prepared, width, height in hard_trials()}
INEXACT_TRIALS = (
    *("rays at vertices", "rays at diagonals", "axis-parallel rays", "eye in a box", "eye on a wall"),
    *("duplicates", "eye far away"),
)
"""Ties, which Embree breaks by its own order, and rays exactly at vertices, which it may lose."""


@pytest.mark.parametrize("robust", ["true", "false"])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_nearly_equals_brute_force(scale, robust):
    vertices, faces = soup(21, 150, size=0.2)
    lights = [
        (2.0 * scale, 3.0 * scale, 4.0 * scale),
        (0.1 * scale, 0.0, 0.2 * scale),
        (0.0, 1e5 * scale, 0.0),
    ]
    prepared = make_scene(vertices * scale, faces, lights, (0.0, 0.5 * scale, 3.0 * scale))
    assert_nearly(NAME, {"robust": robust}, prepared, 41, 29)


@pytest.mark.parametrize("seed", range(6))
def test_random_scenes(seed):
    # The last two lights lie on a triangle up to rounding: whether it counts is not for float32 to say.
    assert_nearly(NAME, {}, *random_trial(seed + 300), share=0.02, lights=2)


@pytest.mark.parametrize("trial", TRIALS)
def test_survives_hard_scenes(trial):
    prepared, width, height = TRIALS[trial]
    if trial in INEXACT_TRIALS:
        assert_misses(trace(NAME, {}, prepared, width, height)[2])
    else:
        assert_nearly(NAME, {}, prepared, width, height, share=0.03)


@pytest.mark.parametrize("height", [0.0, 0.1, 1000.0])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_lit_plane_does_not_shadow_itself(scale, height):
    """The offset must exceed the rounding of the query, also where the plane's own coordinate is zero or large."""
    vertices, faces = lattice(8, scale)
    vertices = vertices + [0.0, 0.0, height * scale]
    lights = [(0.1 * scale, 0.2 * scale, (height + 1) * scale), (30.0 * scale, 0.0, (height + 1e-2) * scale)]
    eye = (0.0, 0.0, (height + 1.5) * scale)
    prepared = make_scene(vertices, faces, lights, eye, (0.0, 0.0, height * scale))
    got = trace(NAME, {}, prepared, 32, 32)[2]
    assert (got["triangle"] >= 0).sum() > 500
    assert got["visibility"].sum() == 0


def test_a_surface_at_the_light_does_not_count():
    vertices, faces = lattice(4)
    above = vertices + [0.0, 0.0, 1.0]
    both = np.concatenate([vertices, above]), np.concatenate([faces, faces + len(vertices)])
    lights = [(0.1, 0.2, 1.0), (0.1, 0.2, 1.001)]
    got = trace(NAME, {}, make_scene(*both, lights, (0.0, 0.0, 0.9)), 16, 16)[2]
    below = got["triangle"] < len(faces)
    assert below.all()
    assert (got["visibility"][0] == 0).all()
    assert (got["visibility"][1] == 1).all()


def test_threads_and_runs_agree_bit_for_bit():
    prepared = make_scene(*soup(7, 300), [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0)])
    reference = None
    for threads in ("1", "1", "2", "7", "0"):
        got = trace(NAME, {"threads": threads}, prepared, 97, 61)[2]
        reference = reference or got
        for key, value in reference.items():
            np.testing.assert_array_equal(got[key], value, f"{key}, {threads} threads")


def test_the_build_pass_commits_and_each_frame_starts_anew():
    prepared = make_scene(*soup(7, 50), [(5.0, 4.0, 3.0)])
    session, _, _ = trace(NAME, {}, prepared, 8, 8)
    before = session.method._scene
    session.passes[0].launch()
    assert session.method._scene is not before
    assert session.method._scene.is_committed
    assert [step.part for step in session.passes] == ["build", "trace", "shadow"]


def test_a_light_without_shadows_has_no_pass_and_no_bit():
    prepared = make_scene(*soup(7, 50), [(5.0, 4.0, 3.0), (1.0, 2.0, 3.0)])
    session = Session(make_method(NAME), prepared, 16, 16, "cpu", effects=Effects(shadows=(False, True)))
    got = session.answers(prepared.moment(0, 16, 16))
    assert [step.effect for step in session.passes] == [None, None, "shadows/1"]
    assert (got["visibility"][0] == 0).all()
    assert got["visibility"][1].sum() > 0


def test_runs_on_cpu_only_and_says_what_it_built():
    method = make_method(NAME, {"threads": "3"})
    prepared = make_scene(*soup(7, 5), [(5.0, 4.0, 3.0)])
    assert method.applies(prepared.scene, "cpu") is None
    assert "cpu only" in method.applies(prepared.scene, "cuda:0")
    built = method.built()
    assert (built["robust"], built["threads"]) == (True, 3)
    assert built["embreex"].startswith("4.")


@pytest.mark.parametrize(("key", "value"), [("threads", "-1"), ("robust", "perhaps"), ("leaf_size", "3")])
def test_wrong_parameters_are_one_line(key, value):
    with pytest.raises(UserError, match=key) as caught:
        make_method(NAME, {key: value})
    assert "\n" not in str(caught.value)
