"""Packets (``coherent_grid/packets.py``) of every size against the exact answers."""

import numpy as np
import pytest
from helpers.method_trials import assert_exact
from helpers.small_scenes import make_scene, soup, trace
from shadowbench.harness.frame.registry import make_method

NAME = "coherent_grid"


@pytest.mark.parametrize("seed", range(6))
def test_answers_are_exact_with_any_view_and_density(seed):
    """Wide views have packets that are not coherent; eyes lie inside and far outside."""
    random = np.random.default_rng(seed)
    vertices, faces = soup(seed, 60, size=float(np.exp(random.uniform(-3, 1))))
    eye = tuple(random.normal(size=3) * [0.3, 3.0, 300.0][seed % 3])
    angle = [150.0, 90.0, 0.6][seed % 3]
    prepared = make_scene(vertices, faces, [(5.0, 4.0, 3.0)], eye, (0.0, 0.0, 0.0), angle)
    settings = {"side": ["64", "5"][seed % 2], "density": ["5", "300"][seed // 2 % 2]}
    assert_exact(NAME, settings, prepared, 31, 22)


def test_a_packet_tests_a_triangle_once_and_ends_behind_its_hits():
    """A wall of one triangle before a crowd: packets that see only the wall test it alone, in whichever cells it lies."""
    crowd = 0.3 * soup(3, 200, size=0.2)[0] - [0.0, 0.0, 3.0]
    wall = np.array([[-50.0, -50.0, 2.0], [50.0, -50.0, 2.0], [0.0, 80.0, 2.0]])
    vertices = np.concatenate([wall, crowd])
    faces = np.arange(len(vertices)).reshape(-1, 3)
    prepared = make_scene(vertices, faces, [(5.0, 4.0, 9.0)], (0.0, 0.0, 3.0), (0.0, 0.0, 0.0), 40.0)
    session, _, got = trace(NAME, {"side": "4", "density": "300"}, prepared, 16, 16)
    assert (got["triangle"] == 0).all()
    assert session.method.counters()["primary tests"] == 16 * 16


def test_a_gpu_is_refused_in_one_line():
    assert make_method(NAME).applies(make_scene(*soup(7, 3), []).scene, "cuda:0") == "runs on cpu only"
