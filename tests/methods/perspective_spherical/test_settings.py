"""No knob of the paper's method that is meant for speed changes an answer, also where lists are split
(``split_lists.py``) and tiles of the light are small (``light/tiles.py``): drawn at random, compared bit for bit.
"""

import numpy as np
import pytest
from helpers.exact_answers import assert_right, exact_answers
from helpers.method_trials import box
from helpers.paper_knobs import answers_of, drawn
from helpers.small_scenes import assert_same, make_scene, soup
from shadowbench.methods.perspective_spherical.parameters import LIGHT_MAPS, TRIANGLE_TESTS


@pytest.mark.parametrize("light_map", LIGHT_MAPS)
@pytest.mark.parametrize("seed", range(6))
def test_every_map_has_the_exact_answers(seed, light_map, device):
    random = np.random.default_rng(1000 + seed)
    width, height = int(random.integers(1, 40)), int(random.integers(1, 40))
    vertices, faces = soup(seed, int(random.integers(1, 50)), size=float(np.exp(random.uniform(-3, 1.5))))
    eye = random.normal(size=3) * (3 if seed % 2 else 0.3)
    lights = [tuple(random.normal(size=3) * 10.0 ** random.uniform(-4, 7)) for _ in range(2)]
    # At a vertex, on a surface, at the eye, far away along an axis of the world.
    lights += [tuple(vertices[0]), tuple(vertices[:3].mean(axis=0)), tuple(eye), (0.0, -1e3, 0.0)]
    prepared = make_scene(vertices, faces, lights, tuple(eye), (0.0, 0.0, 0.0), 90.0)
    settings = drawn(random, light_map=light_map)
    _, moment, got = answers_of(prepared, width, height, settings, device)
    assert_right(got, exact_answers(prepared, moment), settings)


@pytest.mark.slow
@pytest.mark.parametrize("triangle_test", TRIANGLE_TESTS)
@pytest.mark.parametrize("seed", range(2))
def test_no_knob_changes_a_bit_of_any_triangle_test(seed, triangle_test, device):
    random = np.random.default_rng(seed)
    vertices, faces = soup(100 + seed, 250, size=float(np.exp(random.uniform(-2, 1))))
    # Corners shared and split: edges and vertices in view, and slivers.
    vertices = np.round(vertices * 8) / 8 if seed % 2 else vertices * [1, 1, 1e-3]
    lights = [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0), (-2e3, 1e3, 4e3)]
    prepared = make_scene(vertices, faces, lights)
    width, height = int(random.integers(20, 50)), int(random.integers(20, 50))
    reference = None
    for _ in range(5):
        settings = drawn(random, triangle_test=triangle_test)
        _, _, got = answers_of(prepared, width, height, settings, device)
        reference = reference or got
        assert_same(got, reference, settings)


def test_inexact_tests_differ_from_the_exact_one_at_edges_only():
    vertices, faces = soup(9, 400)
    prepared = make_scene(vertices, faces, [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0)])
    _, _, exact = answers_of(prepared, 200, 200, {})
    for name in TRIANGLE_TESTS[1:]:
        session, _, got = answers_of(prepared, 200, 200, {"triangle_test": name})
        assert session.method.built()["triangle test"] == name
        for answer in ("triangle", "shadowed"):
            assert (got[answer] != exact[answer]).mean() < 1e-3, (name, answer)


@pytest.mark.parametrize("name", ["exact", "edge_planes"])
def test_no_ray_leaks_between_welded_triangles_aimed_at_their_edges(name):
    """Split vertices, pixels exactly on edges and corners, from inside: every ray must hit."""
    vertices, faces = box(16)
    prepared = make_scene(vertices, faces, [(0.0, 0.0, 0.0)], eye=(0.0, 0.0, 0.0), target=(0.0, 0.0, -1.0), fov=90.0)
    _, _, got = answers_of(prepared, 33, 33, {"triangle_test": name})
    assert (got["triangle"] >= 0).all()
    assert (got["shadowed"] == 0).all()


def test_lights_moved_between_frames_equal_fresh_ones_under_other_knobs():
    vertices, faces = soup(70, 150)
    here, there = (make_scene(vertices, faces, [p]) for p in ((1.0, 2.0, 3.0), (-40.0, 2.0, 0.1)))
    settings = {"light_map": "cube", "triangle_chunk": "4", "clamp": "view", "balancing": "algorithm-1"}
    session, moment, first = answers_of(here, 32, 32, settings)
    moved = session.answers(there.moment(0, 32, 32))
    assert_same(session.answers(moment), first, "again")
    assert_same(moved, answers_of(there, 32, 32, {})[2], "fresh")


def test_what_float32_accepts_beside_an_edge_is_listed_in_every_tile():
    """Hit points 1e-5 off the plane through the light and an edge, at x = 300 where float32 cannot tell.

    Rounded they lie on it, and the plain planes accept them: then every grid must offer the triangle, also where
    the border between two tiles lies between the hit points and the edge (all of these numbers of tiles but 150).
    """
    x = 300.0
    vertices = [[x, -1, -1], [x, 1, -1], [x + 2, 0, -1], [x - 5, -5, -2], [x + 7, -5, -2], [x + 1, 9, -2]]
    vertices += [[-x, 0, 9], [-x, 1, 9], [-x, 0, 8]]  # keeps the scene where it is
    prepared = make_scene(
        vertices, [[0, 1, 2], [3, 4, 5], [6, 7, 8]], [(x, 0.0, 0.0)], (x, 0.3, 0.5), (x - 4e-6, 0.3, -0.5), 0.3
    )
    seen = set()
    for tiles in (150, 156, 167, 178, 189):
        settings = {"triangle_test": "edge_planes", "light_tiles": str(tiles), "aimed": "false"}
        _, _, got = answers_of(prepared, 5, 5, settings)
        assert (got["triangle"].reshape(5, 5)[:, 2] == 1).all()
        seen.add(tuple(got["shadowed"][0].reshape(5, 5)[:, 2].tolist()))
    assert seen == {(1, 1, 1, 1, 1)}
    _, _, exact = answers_of(prepared, 5, 5, {})
    assert (exact["shadowed"][0].reshape(5, 5)[:, 2] == 0).all()
