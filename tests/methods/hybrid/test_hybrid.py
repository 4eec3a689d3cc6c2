"""The hybrid's answers are those of ray_grids, whoever takes the shadow rays; the tree is there only for who needs it."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from helpers.effect_scenes import POINT, scene
from helpers.mirror_scenes import answered, hall_of_mirrors
from helpers.small_scenes import answers_in, assert_same, make_scene, soup, trace
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Light
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


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
def test_has_the_bits_of_ray_grids_in_replays_of_the_graph_too(settings, device):
    """On the GPU: the branches of the captured graph share nothing that one of them writes."""
    session, _, got = trace(NAME, settings, two_lights(), 33, 21, device)
    wanted = trace("ray_grids", {}, two_lights(), 33, 21, device)[2]
    assert_same(got, wanted)
    for _ in range(3):
        session.poison()
        session.replay()
    assert_same(answers_in(session), wanted)


@pytest.mark.parametrize("settings", SETTINGS[:2], ids=str)
def test_mirrors_have_the_bits_of_another_method(settings, device):
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


def shells(count: int, lights: int) -> Prepared:
    """Octahedra around one another, of radii 1, 2 ...: each line from the middle crosses one triangle of each."""
    corners = np.array([(1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (0, 0, -1)], dtype=np.float32)
    faces = np.array([(x, y, z) for x in (0, 3) for y in (1, 4) for z in (2, 5)])
    points = np.concatenate([corners * np.float32(k + 1) for k in range(count)])
    around = [(0.01 * (i + 1), 0.02, 0.03) for i in range(lights)]
    return make_scene(points, np.concatenate([faces + 6 * k for k in range(count)]), around)


ENCLOSED = partial(shells, 2)

CHOICES = [
    # the scene, and the sizes of an image of few enough pixels for the grid, and of one more row or column
    (lambda: make_scene(*soup(7, 300), [(0.1, 0.2, 40.0)]), (600, 299), (600, 300)),  # 600 pixels a triangle
    (lambda: shells(1, 1), (64, 74), (64, 75)),  # an empty room
    (lambda: ENCLOSED(1), (64, 15), (64, 16)),  # 64 pixels a triangle
    (lambda: shells(3, 1), (64, 23), (64, 24)),
    (lambda: ENCLOSED(2), (64, 5), (64, 6)),  # 48 pixels a triangle over the number of lights
    (lambda: ENCLOSED(4), (64, 2), (64, 3)),
    (lambda: ENCLOSED(20), (63, 1), (64, 1)),  # never below four pixels a triangle
    (lambda: hall_of_mirrors(1), None, (2, 2)),  # a tree that mirrors need takes the shadow rays, too
]


@pytest.mark.parametrize(("scene", "most_of_grid", "least_of_tree"), CHOICES)
def test_pixels_triangles_and_lights_choose_between_grids_and_a_tree(scene, most_of_grid, least_of_tree):
    for size, wanted in ((most_of_grid, "grid"), (least_of_tree, "tree")):
        if size:
            session = Session(make_method(NAME), scene(), *size, "cpu")
            assert session.method.built()["shadows"] == wanted
            assert ({work.name for work in session.all_passes} >= TREE) == (wanted == "tree")


def layers(prepared: Prepared) -> float:
    return mean_layers(Session(make_method(NAME), prepared, 8, 4, "cpu").frame, [0])


def test_layers_are_those_that_a_ray_of_the_light_crosses():
    for count in (1, 2, 3):
        assert layers(shells(count, 1)) == pytest.approx(count, rel=1e-6)
    # Parallel rays cross an octahedron twice in its shadow, of area sqrt(3) along a diagonal; the sphere around its box
    # has 3 pi.
    octahedron = shells(1, 0).scene
    for away in (1e3, 1e9, 1e15):
        far = prepare(replace(octahedron, lights=(Light((away, away, away)),)))
        assert layers(far) == pytest.approx(2.0 / 3.0**0.5 / np.pi, rel=1e-3)
    for x in (1.0, -1.0):  # on a vertex
        assert 0.0 < layers(prepare(replace(octahedron, lights=(Light((x, 0.0, 0.0)),)))) < 1.0


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
