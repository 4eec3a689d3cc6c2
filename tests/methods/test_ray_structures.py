"""Structures that each ray goes through alone: exact whatever their settings, growth, errors."""

from collections.abc import Callable

import numpy as np
import pytest
from helpers.brute_force import make_scene, soup
from helpers.method_trials import TRIALS, assert_exact, assert_same, random_trial, trace
from shadowbench.harness.errors import CapacityRejected, UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.effects import Limits

Settings = dict[str, str]

DRAWN: dict[str, tuple[range, Callable[[np.random.Generator], dict[str, object]]]] = {
    "uniform_grid": (
        range(1000, 1024),
        lambda random: {"density": np.exp(random.uniform(-3, 6)), "capacity": random.integers(1, 2000)},
    ),
    "two_level_grid": (
        range(3000, 3008),
        lambda random: {
            "top_density": np.exp(random.uniform(-5, 3)),
            "leaf_density": np.exp(random.uniform(-3, 4)),
            "top_capacity": random.integers(1, 500),
            "leaf_capacity": random.integers(1, 2000),
        },
    ),
    "kdtree": (
        range(4000, 4008),
        lambda random: {
            "small": random.integers(1, 65),
            "empty": random.uniform(0.05, 1.0),
            "traversal_cost": np.exp(random.uniform(-3, 2)),
            "capacity": random.integers(1, 200),
        },
    ),
}
"""By method: seeds, and settings drawn with each. The trial is that of the last two digits."""

LEVELS = [
    {"top_density": top, "leaf_density": leaf}
    for top, leaf in (("0.12", "2.4"), ("0.001", "100"), ("20", "0.01"), ("4", "30"))
]
HARD: list[tuple[str, Settings]] = [
    *(("uniform_grid", {"density": density}) for density in ("0.01", "4", "900")),
    *(("two_level_grid", levels) for levels in LEVELS[:2]),
    ("kdtree", {}),
    ("kdtree", {"small": "1", "empty": "0.05", "traversal_cost": "0.01"}),
]
SAME: dict[str, list[Settings]] = {
    "uniform_grid": [{}, {"density": "0.5"}, {"density": "40"}, {"capacity": "3"}],
    "two_level_grid": [*LEVELS, {"top_capacity": "1", "leaf_capacity": "1"}],
}
GROWN: list[tuple[str, Settings, int, Settings]] = [
    ("uniform_grid", {"capacity": "1"}, 1, {"capacity": "1000000"}),
    ("two_level_grid", {"top_capacity": "1", "leaf_capacity": "1"}, 2,
     {"top_capacity": "90000", "leaf_capacity": "900000"}),
]  # fmt: skip
"""What does not suffice, how often it grows, and what does."""

REJECTED: list[tuple[str, Settings, int, str]] = [
    ("uniform_grid", {"capacity": "1"}, 16000, "pairs"),
    ("uniform_grid", {"density": "100"}, 16000, "cells"),
    ("two_level_grid", {"leaf_capacity": "1"}, 40000, "leaf cell"),
    ("two_level_grid", {"top_density": "900"}, 40000, "cells"),
    ("two_level_grid", {"leaf_density": "100"}, 40000, "cells"),
    ("kdtree", {"capacity": "1"}, 8000, "pairs"),
]
WRONG = [
    *(("uniform_grid", *pair) for pair in (("density", "0"), ("density", "nan"), ("capacity", "-1"), ("cells", "3"))),
    *(("two_level_grid", *pair) for pair in (
        ("top_density", "0"), ("leaf_density", "101"), ("top_capacity", "-1"), ("leaf_capacity", "-1"),
    )),
    *(("kdtree", *pair) for pair in (("small", "65"), ("empty", "0"), ("traversal_cost", "nan"), ("capacity", "-1"))),
]  # fmt: skip


@pytest.mark.parametrize(("name", "seed"), [(name, seed) for name, (seeds, _) in DRAWN.items() for seed in seeds])
def test_random_scenes_equal_brute_force(name, seed, device):
    settings = DRAWN[name][1](np.random.default_rng(seed))
    assert_exact(name, {key: str(value) for key, value in settings.items()}, *random_trial(seed % 100), device)


@pytest.mark.parametrize("trial", TRIALS)
@pytest.mark.parametrize(("name", "settings"), HARD, ids=str)
def test_hard_scenes_equal_brute_force(name, settings, trial, device):
    assert_exact(name, settings, *TRIALS[trial], device)


@pytest.mark.parametrize("name", SAME)
def test_runs_and_settings_agree_bit_for_bit(name, device):
    prepared = make_scene(*soup(7, 400), [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0)])
    reference = trace("uniform_grid", {}, prepared, 33, 21, device)[2]
    for settings in SAME[name]:
        assert_same(trace(name, settings, prepared, 33, 21, device)[2], reference, settings)


@pytest.mark.parametrize(("name", "tight", "times", "ample"), GROWN, ids=[row[0] for row in GROWN])
def test_a_capacity_that_does_not_suffice_grows_and_gives_the_same_structure(name, tight, times, ample):
    prepared = make_scene(*soup(7, 400), [(5.0, 4.0, 3.0)])
    grown, _, got = trace(name, tight, prepared, 20, 20)
    roomy, _, wanted = trace(name, ample, prepared, 20, 20)
    assert (grown.regrown, roomy.regrown) == (times, 0)
    assert grown.method.counters() == roomy.method.counters()
    assert_same(got, wanted)


@pytest.mark.parametrize(("name", "settings", "memory", "what"), REJECTED, ids=str)
def test_a_need_beyond_the_limits_is_rejected(name, settings, memory, what):
    prepared = make_scene(*soup(7, 400), [(5.0, 4.0, 3.0)])
    with pytest.raises(CapacityRejected, match=what):
        Session(make_method(name, settings), prepared, 8, 8, "cpu", limits=Limits(memory=memory)).answers(
            prepared.moment(0, 8, 8)
        )


@pytest.mark.parametrize(("name", "key", "value"), WRONG)
def test_wrong_parameters_are_one_line(name, key, value):
    with pytest.raises(UserError, match=key) as caught:
        make_method(name, {key: value})
    assert "\n" not in str(caught.value)
