"""What grids, trees and libraries that trace rays are held to, whatever their settings: answers, growth, moving scenes,
errors.
"""

import functools
from collections.abc import Callable

import numpy as np
import pytest
import warp as wp
from helpers.method_trials import TRIALS, assert_exact, assert_misses, assert_nearly, moving, random_trial
from helpers.small_scenes import Answers, assert_same, make_scene, soup, trace
from helpers.streams import trial
from helpers.tuned_trees import tuned
from shadowbench.harness.errors import CapacityRejected, UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.effects import Limits

Settings = dict[str, str]

EXACT_BVH = {"update": "bvh_rebuild"}
DRAWN: dict[str, Callable[[np.random.Generator], dict[str, object]]] = {
    "uniform_grid": lambda random: {"density": np.exp(random.uniform(-3, 6)), "capacity": random.integers(1, 2000)},
    "two_level_grid": lambda random: {
        "top_density": np.exp(random.uniform(-5, 3)), "leaf_density": np.exp(random.uniform(-3, 4)),
        "top_capacity": random.integers(1, 500), "leaf_capacity": random.integers(1, 2000),
    },
    "kdtree": lambda random: {
        "small": random.integers(1, 65), "empty": random.uniform(0.05, 1.0),
        "traversal_cost": np.exp(random.uniform(-3, 2)), "capacity": random.integers(1, 200),
    },
    "warp_bvh": lambda random: {
        **EXACT_BVH, "leaf_size": random.integers(1, 6), "constructor": random.choice(["default", "median", "lbvh"])
    },
}  # fmt: skip
"""By method: settings as they are drawn."""

LEVELS = [
    {"top_density": top, "leaf_density": leaf}
    for top, leaf in (("0.12", "2.4"), ("0.001", "100"), ("20", "0.01"), ("4", "30"))
]
HARD: list[tuple[str, Settings]] = [
    *(("uniform_grid", {"density": density}) for density in ("0.01", "900")),
    *(("two_level_grid", levels) for levels in LEVELS[:2]),
    ("kdtree", {}),
    ("kdtree", {"small": "1", "empty": "0.05", "traversal_cost": "0.01"}),
    *(("coherent_grid", {"side": side}) for side in ("3", "8")),
    ("perspective_spherical", {}),
    ("warp_bvh", EXACT_BVH),
    *(("bvh2", settings) for settings in ({}, {"update": "refit"})),
    ("ray_grids", {}),
    ("visibility_buffer", trial(inline_pixels=0, inline_cells=0)),
    ("hybrid", {"shadows": "tree"}),
    *(("accuracy_ladder", {"test": test}) for test in ("exact", "float64")),
]
SAME: list[tuple[str, Settings]] = [
    *(("uniform_grid", s) for s in ({}, {"density": "0.5"}, {"density": "40"}, {"capacity": "3"})),
    *(("two_level_grid", s) for s in (*LEVELS, {"top_capacity": "1", "leaf_capacity": "1"})),
    *(("coherent_grid", {"side": side}) for side in ("1", "4", "64")),
    ("perspective_spherical", {"tile": "1", "slices": "1", "aimed": "false", "light_tiles": "300", "r": "1000"}),
    ("perspective_spherical", {"tile": "33", "slices": "7", "light_tiles": "1", "light_slices": "1", "r": "1"}),
]

MESHES = [
    *({"update": update} for update in ("rebuild", "refit", "static")),
    {"constructor": "sah"}, {"constructor": "median", "leaf_size": "1"}, {"constructor": "lbvh"},
    {"update": "refit", "constructor": "cubql"},
]  # fmt: skip
NEARLY: list[tuple[str, Settings]] = [
    *(("embree", {"robust": robust}) for robust in ("true", "false")),
    *(("warp_bvh", settings) for settings in MESHES),
]
"""In float32, without a bound that holds for every ray."""

LOST = {
    *("rays at vertices", "rays at diagonals", "axis-parallel rays", "eye in a box", "eye on a wall"),
    *("duplicates", "eye far away"),
}
"""Ties, which libraries break by their own order, and rays exactly at vertices, which they may lose."""

FLOOR = "teapot in a stadium"
"""Its floor, on which Warp's own t is wrong by a hundredth of the distance."""

GROWN: list[tuple[str, Settings, int, Settings]] = [
    ("uniform_grid", {"capacity": "1"}, 1, {"capacity": "1000000"}),
    ("two_level_grid", {"top_capacity": "1", "leaf_capacity": "1"}, 2,
     {"top_capacity": "90000", "leaf_capacity": "900000"}),
    ("coherent_grid", {"capacity": "1"}, 1, {"capacity": "1000000"}),
    ("perspective_spherical", {"pair_capacity": "1", "row_capacity": "1", "tile": "2"}, 2,
     {"pair_capacity": "100000", "row_capacity": "100000", "tile": "2"}),
]  # fmt: skip
"""What does not suffice, how often it grows, and what does."""

BOXES = {"inline_pixels": 0, "inline_cells": 0}
QUEUES: list[tuple[str, Settings, Settings]] = [
    ("bvh2", {}, {"ROOM": 1}),
    ("hybrid", {"shadows": "tree"}, {"shadows": "tree", "ROOM": 1}),
    ("visibility_buffer", trial(**BOXES), trial(**BOXES, items=1, chunks=1, undecided=1)),
]
"""Room that suffices, and less. ROOM: a constant of trees (:mod:`helpers.tuned_trees`)."""

REJECTED: list[tuple[str, Settings, int, str]] = [
    ("uniform_grid", {"capacity": "1"}, 16000, "pairs"),
    ("uniform_grid", {"density": "100"}, 16000, "cells"),
    ("two_level_grid", {"leaf_capacity": "1"}, 40000, "leaf cell"),
    ("two_level_grid", {"top_density": "900"}, 40000, "cells"),
    ("two_level_grid", {"leaf_density": "100"}, 40000, "cells"),
    ("kdtree", {"capacity": "1"}, 8000, "pairs"),
    ("shadow_map", {"size": "1024"}, 1 << 20, "choose a smaller size"),
    ("visibility_buffer", trial(cells=1024), 2**20, "map of .* texels"),
    ("visibility_buffer", trial(**BOXES, cells=8, items=1, shares=1), 3 * 2**10, "needs .* work items"),
    ("perspective_spherical", {"pair_capacity": "1"}, 1000, r"needs [\d,]+ \(triangle, cell\) pairs"),
]
WRONG: dict[str, tuple[str, ...]] = {
    "uniform_grid": ("density=0", "density=nan", "capacity=-1", "cells=3"),
    "two_level_grid": ("top_density=0", "leaf_density=101", "top_capacity=-1", "leaf_capacity=-1"),
    "kdtree": ("small=65", "empty=0", "traversal_cost=nan", "capacity=-1"),
    "shadow_map": ("size=32", "size=many", "shape=round", "bias=big", "filter=blurred", "amount=nan"),
    "ray_grids": ("occluders=first",),
    "embree": ("threads=-1", "robust=perhaps", "leaf_size=3", "quality=best", "update=often", "rays=packet8",
               "build_threads=-1", "update=refit quality=low"),
    "warp_bvh": ("update=often", "constructor=bsp", "leaf_size=-1", "update=bvh_rebuild constructor=cubql",
                 "origin=epsilon", "origin=plain update=bvh_rebuild"),
    "perspective_spherical": ("k=0", "light_map=flat", "clamp=tight", "r=0", "cull=all", "light_bounds=seam light_map=cube",
                              "precision=float32-centred aimed=false"),
}  # fmt: skip


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("name", DRAWN)
def test_random_scenes_have_the_exact_answers(name, seed, device):
    settings = DRAWN[name](np.random.default_rng(seed))
    assert_exact(name, {key: str(value) for key, value in settings.items()}, *random_trial(seed), device)


@pytest.mark.parametrize("scene", TRIALS)
@pytest.mark.parametrize(("name", "settings"), HARD, ids=str)
def test_hard_scenes_have_the_exact_answers(name, settings, scene, device):
    assert_exact(name, settings, *TRIALS[scene], "cpu" if name == "coherent_grid" else device)


@pytest.mark.parametrize(("name", "settings"), SAME, ids=str)
def test_runs_and_settings_agree_bit_for_bit(name, settings, device):
    prepared = make_scene(*soup(7, 400), [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0)])
    reference = trace("uniform_grid", {}, prepared, 33, 21, device)[2]
    assert_same(trace(name, settings, prepared, 33, 21, "cpu" if name == "coherent_grid" else device)[2], reference)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(("name", "settings"), NEARLY, ids=str)
def test_a_library_is_nearly_right(name, settings, scale):
    vertices, faces = soup(21, 150, size=0.2)
    lights = [(2.0 * scale, 3.0 * scale, 4.0 * scale), (0.1 * scale, 0.0, 0.2 * scale), (0.0, 1e5 * scale, 0.0)]
    prepared = make_scene(vertices * scale, faces, lights, (0.0, 0.5 * scale, 3.0 * scale))
    got = assert_nearly(name, settings, prepared, 41, 29)
    assert_same(trace(name, settings, prepared, 41, 29)[2], got, "again")


@pytest.mark.parametrize("scene", TRIALS)
@pytest.mark.parametrize(("name", "settings"), [NEARLY[0], *NEARLY[2:5]], ids=str)
def test_a_library_survives_hard_scenes(name, settings, scene):
    prepared, width, height = TRIALS[scene]
    if scene in LOST or (scene == FLOOR and name == "warp_bvh"):
        assert_misses(trace(name, settings, prepared, width, height)[2])
    else:
        assert_nearly(name, settings, prepared, width, height, share=0.03)


GRID: tuple[str, Settings] = ("uniform_grid", {})
SINGLE: tuple[str, Settings] = ("embree", {"rays": "single"})
REPLAYED: list[tuple[str, Settings, tuple[str, Settings]]] = [
    *((name, {}, GRID) for name in ("uniform_grid", "two_level_grid", "kdtree", "coherent_grid", "perspective_spherical")),
    *(("bvh2", settings, GRID) for settings in ({}, {"builder": "lbvh"}, {"update": "refit"})),
    *(("warp_bvh", {"update": update}, GRID) for update in ("rebuild", "refit", "bvh_rebuild")),
    *(("embree", {"update": update}, SINGLE) for update in ("rebuild", "refit")),
]  # fmt: skip
"""What is played, and whose fresh answers it must have."""


@functools.cache
def fresh(name: str, settings: tuple[tuple[str, str], ...], broken: bool, frame: int, device: str) -> Answers:
    prepared = moving(broken)
    return Session(make_method(name, dict(settings)), prepared, 24, 16, device).answers(prepared.moment(frame, 24, 16))


@pytest.mark.parametrize("broken", [False, True])
@pytest.mark.parametrize(("name", "settings", "other"), REPLAYED, ids=str)
def test_moving_geometry_replayed_equals_a_fresh_start(name, settings, other, broken, device):
    """As one graph on CUDA: no frame may see anything of the one before. A triangle that is left out in a frame is back in
    the next, also in a tree that was made without it. A Mesh of Warp may lose a pixel or two.
    """
    device = "cpu" if name in ("embree", "coherent_grid") else device
    prepared = moving(broken)
    session = Session(make_method(name, settings), prepared, 24, 16, device)
    for k in (0, 1, 2, 3, 0):
        moment = prepared.moment(k, 24, 16)
        session.load(moment)
        session.frame.answers.poison()
        session.run_complete()
        session.frame.answers.poison()
        session.replay()
        got = session.frame.answers.to_host()
        wanted = fresh(other[0], tuple(other[1].items()), broken, k, device)
        if settings in ({"update": "rebuild"}, {"update": "refit"}) and name == "warp_bvh":
            assert max((got[key] != wanted[key]).sum() for key in ("triangle", "shadowed")) <= 2, k
        else:
            assert_same(got, wanted, f"frame {k}")


@pytest.mark.parametrize(("name", "tight", "times", "ample"), GROWN, ids=[row[0] for row in GROWN])
def test_a_capacity_that_does_not_suffice_grows_and_gives_the_same_structure(name, tight, times, ample):
    prepared = make_scene(*soup(7, 400), [(5.0, 4.0, 3.0)])
    grown, _, got = trace(name, tight, prepared, 20, 20)
    roomy, _, wanted = trace(name, ample, prepared, 20, 20)
    assert (grown.regrown, roomy.regrown, grown.method.counters()) == (times, 0, roomy.method.counters())
    assert_same(got, wanted)


@pytest.mark.parametrize(("name", "settings", "tight"), QUEUES, ids=[row[0] for row in QUEUES])
def test_queues_grow_and_the_frame_is_repeated(name, settings, tight, device, monkeypatch):
    """Rays at the middles of fans leave more pairs than there is room for; triangles through every cell fill queues of
    groups. Whatever the memory of the queues held before: they are not cleared.
    """
    empty, regrown = wp.empty, {}
    for scene in ("rays at vertices", "triangles through every cell"):
        prepared, width, height = TRIALS[scene]
        _, _, roomy = trace(name, settings, prepared, width, height, device)
        with tuned(tight) as given, monkeypatch.context() as patch:
            patch.setattr(wp, "empty", lambda *of, **named: filled_with(0x7B7B7B7B, empty(*of, **named)))
            session, _, found = trace(name, given, prepared, width, height, device)
        assert_same(found, roomy)
        regrown[scene] = session.regrown
    assert regrown["rays at vertices"] > 0


def filled_with(value, array):
    array.fill_(value)
    return array


@pytest.mark.parametrize(("name", "settings", "memory", "what"), REJECTED, ids=str)
def test_a_need_beyond_the_limits_is_rejected(name, settings, memory, what):
    prepared = make_scene(*soup(7, 400), [(5.0, 4.0, 3.0)])
    with pytest.raises(CapacityRejected, match=what):
        trace(name, settings, prepared, 8, 8, limits=Limits(memory=memory))


@pytest.mark.parametrize(("name", "given"), [(name, given) for name, rows in WRONG.items() for given in rows])
def test_wrong_parameters_are_one_line(name, given):
    settings = dict(pair.split("=") for pair in given.split())
    with pytest.raises(UserError, match="|".join(settings)):
        make_method(name, settings)
