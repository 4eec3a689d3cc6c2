"""The hybrid's answers are those of ray_grids, whoever takes the shadow rays; the tree is there only for who needs it."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.brute_force import make_scene, soup
from helpers.effect_scenes import POINT, scene
from helpers.holed_scenes import answers_of as holed_answers
from helpers.holed_scenes import holed
from helpers.method_trials import TRIALS, assert_exact, trace
from helpers.mirror_scenes import answered, hall_of_mirrors
from helpers.tuned_trees import tuned
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.prepared import Prepared
from shadowbench.methods.hybrid.choice import mean_layers

NAME = "hybrid"
SETTINGS: list[dict[str, str]] = [
    {"shadows": "tree"},
    {"shadows": "grid"},
    {"shadows": "tree", "update": "refit"},
    {"shadows": "tree", "builder": "lbvh"},
]
WITH_TREE = {"shadows": "tree"}
TREE = {"keys", "sort", "tree"}


def two_lights() -> Prepared:
    return make_scene(*soup(7, 300), [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0)])


@pytest.mark.parametrize("trial", TRIALS)
def test_equals_brute_force_on_hard_scenes(trial, device):
    assert_exact(NAME, WITH_TREE, *TRIALS[trial], device)


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
def test_has_the_bits_of_ray_grids(settings, device):
    prepared = two_lights()
    _, _, wanted = trace("ray_grids", {}, prepared, 33, 21, device)
    _, _, got = trace(NAME, settings, prepared, 33, 21, device)
    for key, values in wanted.items():
        np.testing.assert_array_equal(got[key], values, key)


@pytest.mark.parametrize("settings", SETTINGS[:2], ids=str)
def test_effects_have_the_bits_of_other_methods(settings, device):
    prepared, _, _ = holed()
    wanted = holed_answers("ray_grids", {}, prepared, device=device)
    got = holed_answers(NAME, settings, prepared, device=device)
    for key in ("triangle", "shadowed"):
        np.testing.assert_array_equal(got[key], wanted[key], key)
    mirrors = hall_of_mirrors()
    _, wanted = answered("uniform_grid", {}, mirrors, device)
    _, got = answered(NAME, settings, mirrors, device)
    for key in ("triangle", "shadowed", "bounce_triangle", "bounce_shadowed"):
        np.testing.assert_array_equal(got[key], wanted[key], key)


def passes_of(prepared: Prepared, settings: dict[str, str]) -> set[str]:
    return {work.name for work in Session(make_method(NAME, settings), prepared, 8, 8, "cpu").all_passes}


def test_effects_decide_the_structure():
    lit, mirrored = two_lights(), hall_of_mirrors(1)
    unlit = scene((replace(POINT, shadows=False),))
    streams = Session(make_method("ray_grids"), lit, 8, 8, "cpu").all_passes
    assert passes_of(lit, WITH_TREE) >= TREE
    assert passes_of(lit, {"shadows": "grid"}) == {work.name for work in streams}
    assert not passes_of(unlit, WITH_TREE) & TREE
    assert passes_of(mirrored, {"shadows": "grid"}) & TREE == TREE


def taken(prepared: Prepared, width: int, height: int) -> str:
    session = Session(make_method(NAME), prepared, width, height, "cpu")
    names = {work.name for work in session.all_passes}
    chosen = session.method.built()["shadows"]
    assert (names >= TREE) == (chosen == "tree")
    return chosen


@pytest.mark.parametrize(("height", "wanted"), [(299, "grid"), (300, "tree")])
def test_a_tree_takes_the_shadow_rays_of_few_triangles(height, wanted):
    prepared = make_scene(*soup(7, 300), [(0.1, 0.2, 40.0)])
    assert prepared.triangle_count == 300
    assert taken(prepared, 600, height) == wanted


def shells(count: int, lights: list[tuple[float, ...]]) -> Prepared:
    """Octahedra around one another, of radii 1, 2 ...: each line from the middle crosses one triangle of each."""
    corners = np.array([(1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (0, 0, -1)], dtype=np.float32)
    faces = np.array([(x, y, z) for x in (0, 3) for y in (1, 4) for z in (2, 5)])
    points = np.concatenate([corners * np.float32(k + 1) for k in range(count)])
    return make_scene(points, np.concatenate([faces + 6 * k for k in range(count)]), lights)


@pytest.mark.parametrize(
    ("count", "height", "wanted"),
    [(1, 74, "grid"), (1, 75, "tree"), (2, 15, "grid"), (2, 16, "tree"), (3, 23, "grid"), (3, 24, "tree")],
)
def test_a_tree_takes_the_shadow_rays_of_an_enclosed_light_from_64_pixels_a_triangle_on(count, height, wanted):
    prepared = shells(count, [(0.01, 0.02, 0.03)])
    assert prepared.triangle_count == 8 * count
    frame = Session(make_method(NAME), prepared, 64, height, "cpu").frame
    assert mean_layers(frame, [0]) == pytest.approx(count, rel=1e-6)
    assert taken(prepared, 64, height) == wanted


@pytest.mark.parametrize(
    ("lights", "height", "wanted"), [(2, 5, "grid"), (2, 6, "tree"), (4, 2, "grid"), (4, 3, "tree")]
)
def test_lights_share_a_tree_from_48_pixels_a_triangle_over_their_number_on(lights, height, wanted):
    """Shells around 2 or 4 lights: a tree is built once, and each light has a grid."""
    assert taken(shells(2, [(0.01 * i, 0.02, 0.03) for i in range(lights)]), 64, height) == wanted


@pytest.mark.parametrize(("width", "wanted"), [(55, "grid"), (56, "tree")])
def test_no_number_of_lights_takes_a_tree_below_three_and_a_half_pixels_a_triangle(width, wanted):
    assert taken(shells(2, [(0.01 * i, 0.02, 0.03) for i in range(20)]), width, 1) == wanted


def test_layers_from_afar_are_those_of_parallel_rays():
    # Parallel rays cross an octahedron twice in its shadow, of area sqrt(3) along a diagonal; the sphere around its box
    # has 3 pi.
    for away in (1e3, 1e9, 1e15):
        frame = Session(make_method(NAME), shells(1, [(away, away, away)]), 8, 4, "cpu").frame
        assert mean_layers(frame, [0]) == pytest.approx(2.0 / 3.0**0.5 / np.pi, rel=1e-3)


@pytest.mark.parametrize("corner", [0, 3])
def test_layers_are_known_of_a_light_on_a_vertex(corner):
    prepared = shells(1, [(1.0, 0.0, 0.0) if corner == 0 else (-1.0, 0.0, 0.0)])
    frame = Session(make_method(NAME), prepared, 8, 4, "cpu").frame
    assert 0.0 < mean_layers(frame, [0]) < 1.0


def test_a_tree_that_mirrors_need_takes_the_shadow_rays_too():
    session = Session(make_method(NAME), hall_of_mirrors(1), 2, 2, "cpu")
    assert session.method.built()["shadows"] == "tree"


@pytest.mark.parametrize(
    ("changed", "left_out"),
    [("light/0", {"camera: resolve", "tree", "light 1: triangles", "light 1: shadow rays"}), ("camera", TREE)],
)
def test_what_did_not_move_is_not_made_again(changed, left_out):
    session = Session(make_method(NAME, WITH_TREE), two_lights(), 8, 8, "cpu")
    session.select({changed})
    run = {work.name for work in session.passes}
    assert "light 0: shadow rays" in run
    assert not run & left_out


def test_tree_and_stream_are_branches_of_one_fork():
    session = Session(make_method(NAME, WITH_TREE), two_lights(), 8, 8, "cpu")
    forked = []
    for work in session.all_passes:
        if not work.hints.parallel:
            break
        forked.append(work)
    branches = {name: {w.hints.parallel[0] for w in forked if w.name == name} for name in ("tree", "camera: resolve")}
    assert len(branches["tree"] | branches["camera: resolve"]) == 2


def test_replays_of_the_graph_repeat_the_answers(device):
    """On the GPU: the branches of the captured graph share nothing that one of them writes."""
    prepared = two_lights()
    session = Session(make_method(NAME, WITH_TREE), prepared, 33, 21, device)
    wanted = session.answers(prepared.moment(0, 33, 21))
    for _ in range(3):
        session.poison()
        session.replay()
    for key, values in session.frame.answers.to_host().items():
        np.testing.assert_array_equal(values, wanted[key], key)


def test_queues_of_both_parts_grow(device):
    prepared, width, height = TRIALS["rays at vertices"]
    _, _, roomy = trace(NAME, WITH_TREE, prepared, width, height, device)
    with tuned({"ROOM": 1}):
        session, _, tight = trace(NAME, WITH_TREE, prepared, width, height, device)
    assert session.regrown > 0
    for key, values in roomy.items():
        np.testing.assert_array_equal(tight[key], values, key)
