"""The streamed dual against the exact answers, under all settings: every answer as ``camera/resolve.py`` writes
it.
"""

import numpy as np
import pytest
from helpers.method_trials import assert_exact, random_trial
from helpers.small_scenes import answers_in, assert_same, make_scene, soup, trace
from helpers.streams import trial


@pytest.mark.parametrize("seed", range(12))
def test_answers_are_exact_under_random_knobs(seed, device):
    random = np.random.default_rng(1000 + seed)
    settings = trial(
        cells=[8, 64, 200, 512][seed % 4],
        inline_pixels=random.integers(0, 60),
        chunk=random.integers(1, 100),
        inline_rays=random.integers(0, 60),
        inline_cells=random.integers(0, 100),
        lights_at_once=1 + seed % 4,
        shares=1 + seed // 4 % 3,
        region=["triangles", "rays"][seed // 3 % 2],
        overlaps=["true", "false"][seed // 2 % 2],
        groups=["stream", "split"][seed // 5 % 2],
        spacing=["rays", "even"][seed % 5 // 2 % 2],
    )
    scene = random_trial(seed)
    got = assert_exact("ray_grids", settings, *scene, device)
    session, _, _ = trace("ray_grids", settings, *scene, device)
    session.poison()
    session.replay()  # on the GPU a graph, in which lights run beside each other
    assert_same(answers_in(session), got)


def test_few_pairs_are_undecided_however_far_the_eye():
    """Bounds grow with the triangles' coordinates, not with the eye's: what float64 decides stays the exception."""
    vertices, faces = soup(7, 400, size=0.2)
    prepared = make_scene(vertices, faces, [(5.0, 4.0, 3.0)], (0.0, 0.0, 300.0), (0.0, 0.0, 0.0), 0.6)
    session, _, got = trace("ray_grids", {}, prepared, 64, 64)
    rays = int((got["triangle"] >= 0).sum())
    assert rays > 1000
    assert session.method.counters()["light 0 undecided pairs"] < 0.02 * rays
