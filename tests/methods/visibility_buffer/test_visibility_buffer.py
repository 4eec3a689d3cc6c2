"""The rasteriser (``visibility_buffer/raster.py``, ``visibility_buffer/shadow.py``) against the exact answers, under
every setting.
"""

import numpy as np
import pytest
from helpers.method_trials import assert_exact
from helpers.small_scenes import answers_in, assert_same, make_scene, soup, trace
from helpers.streams import trial
from shadowbench.harness.scene.prepared import Prepared

NAME = "visibility_buffer"
TILES = {"inline_pixels": 0, "inline_cells": 0}
SETTINGS = [
    {},
    {"inline_pixels": 4000, "inline_cells": 4000, "cells": 128},
    {**TILES, "cells": 8, "shares": 1},
    {"inline_rays": 2, "cells": 8},
    {"cells": 200, "inline_pixels": 30, "inline_cells": 50, "inline_rays": 5, "shares": 3},
]


def small_and_large() -> Prepared:
    """Triangles of a few pixels, and such as cover the image and reach behind the eye; lights inside and outside."""
    small, large = soup(7, 300, size=0.05), soup(8, 12, size=3.0)
    vertices = np.concatenate([small[0], large[0]])
    return make_scene(
        vertices, np.arange(len(vertices)).reshape(-1, 3), [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0), tuple(vertices[0])]
    )


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
def test_answers_are_exact_under_every_setting(settings, device):
    scene = small_and_large(), 37, 29, device
    got = assert_exact(NAME, trial(**settings), *scene)
    session, _, _ = trace(NAME, trial(**settings), *scene)
    session.poison()
    session.replay()  # on the GPU a graph, in which lights and shares run beside each other
    assert_same(answers_in(session), got)


def test_tiles_that_hold_nothing_are_left_out():
    """Most tiles of the boxes of thin triangles across the image lie beside them, or hold no hit point."""
    rng = np.random.default_rng(3)
    ends = rng.normal(size=(20, 2, 3)) * 2.0
    vertices = np.concatenate([ends, ends[:, 1:] + 0.01], axis=1).reshape(-1, 3)
    prepared = make_scene(vertices, np.arange(60).reshape(-1, 3), [(5.0, 4.0, 3.0)])
    session, _, _ = trace(NAME, trial(**TILES), prepared, 128, 128)
    counts = session.method.counters()
    for stream in ("camera", "light 0"):
        assert 0 < counts[f"{stream} chunks"] < 8 * counts[f"{stream} items"], stream  # of 32 tiles an item


def test_thin_triangles_that_a_light_sees_nearly_edge_on_are_decided_in_float32():
    """Strips of a ceiling, 16 long and 0.05 wide, 4 mm below the light: float32 does not tell on which side it is. With
    planes of zeros every one of them would leave half the floor to float64. The light stands 2 mm beside the middle one.
    """
    low = np.linspace(-3.0, 3.0, 7)
    strips = [[(x, 1.0, -8.0), (x + 0.05, 1.0, -8.0), (x + 0.05, 1.0, 8.0), (x, 1.0, 8.0)] for x in low]
    floor = [[(-8.0, -1.0, -8.0), (8.0, -1.0, -8.0), (8.0, -1.0, 8.0), (-8.0, -1.0, 8.0)]]
    faces = [(4 * k, 4 * k + a, 4 * k + a + 1) for k in range(len(low) + 1) for a in (1, 2)]
    prepared = make_scene(
        np.reshape(strips + floor, (-1, 3)), faces, [(0.052, 1.004, 0.2)], (0.0, 0.8, 6.0), (0.0, -1.0, 0.0)
    )
    session, _, got = trace(NAME, trial(**TILES), prepared, 64, 64)
    assert session.method.counters()["light 0 undecided pairs"] < 64 * 64 / 8
    _, _, wanted = trace("ray_grids", {}, prepared, 64, 64)
    assert 0.0 < got["shadowed"].mean() < 1.0
    np.testing.assert_array_equal(got["shadowed"], wanted["shadowed"])
