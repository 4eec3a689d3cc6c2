"""The paper's method against float64 brute force under drawn settings; capacities; moved frames."""

import numpy as np
import pytest
from helpers.brute_force import make_scene, soup
from helpers.method_trials import TRIALS, assert_exact, assert_same, random_trial
from helpers.paper_knobs import answers_of
from shadowbench.harness.errors import CapacityRejected
from shadowbench.harness.scene.effects import Limits

NAME = "perspective_spherical"


@pytest.mark.parametrize("seed", range(24))
def test_random_scenes_equal_brute_force(seed, device):
    random = np.random.default_rng(seed)
    settings = {
        "tile": random.integers(1, 20),
        "slices": random.integers(1, 20),
        "light_tiles": random.integers(1, 150),
        "light_slices": random.integers(1, 20),
        "depth_lists": ["spans", "nearest"][seed % 2],
        "aimed": ["true", "false"][seed // 2 % 2],
        "r": random.integers(1, 300),
    }
    assert_exact(NAME, {key: str(value) for key, value in settings.items()}, *random_trial(seed), device)


@pytest.mark.parametrize("trial", TRIALS)
def test_hard_scenes_equal_brute_force(trial, device):
    assert_exact(NAME, {}, *TRIALS[trial], device)


def test_extreme_sizes_change_no_bit():
    prepared = make_scene(*soup(7, 300), [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0)])
    reference = answers_of(prepared, 45, 31, {})[2]
    for settings in (
        {"tile": "1", "slices": "1"},
        {"tile": "33", "slices": "7", "light_tiles": "1", "light_slices": "1", "r": "1"},
        {"depth_lists": "nearest", "aimed": "false", "light_tiles": "300", "r": "1000"},
    ):
        assert_same(answers_of(prepared, 45, 31, settings)[2], reference, settings)


def test_capacities_grow_and_the_frame_is_repeated():
    prepared = make_scene(*soup(3, 200), [(2.0, 3.0, 4.0)])
    roomy = answers_of(prepared, 64, 64, {})[2]
    session, _, tight = answers_of(prepared, 64, 64, {"pair_capacity": "1", "row_capacity": "1", "tile": "2"})
    assert session.regrown >= 1
    assert_same(tight, roomy)


def test_a_need_beyond_the_memory_limit_is_rejected():
    prepared = make_scene(*soup(3, 200), [(2.0, 3.0, 4.0)])
    with pytest.raises(CapacityRejected, match=r"needs [\d,]+ \(triangle, cell\) pairs"):
        answers_of(prepared, 64, 64, {"pair_capacity": "1"}, limits=Limits(memory=64 * 64))


def test_two_runs_agree_bit_for_bit_and_a_moved_frame_equals_a_fresh_one():
    vertices, faces = soup(5, 200)
    near = make_scene(vertices, faces, [(1.0, 2.0, 3.0)])
    far = make_scene(vertices * 0.5, faces, [(0.1, 0.2, 0.3)])
    session, moment, first = answers_of(near, 32, 32, {})
    moved = far.moment(0, 32, 32)
    session.answers(moved)
    assert_same(session.answers(moment), first)
    assert_same(session.answers(moved), answers_of(far, 32, 32, {})[2])
