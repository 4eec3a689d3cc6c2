"""Where a grid lies: its cells (``grids/build.py``) are as many as there is room for, whatever the shape of the
scene.
"""

import numpy as np
import pytest
from helpers.answers import trace
from helpers.small_scenes import make_scene, soup

NAME = "uniform_grid"


@pytest.mark.parametrize("extent", [(1, 1, 1), (1, 1, 0), (1, 0, 0), (1000, 1, 1), (1, 1000, 1e-3), (1e-6, 1e-6, 1)])
def test_cells_never_exceed_what_was_made_room_for(extent):
    vertices, faces = soup(9, 200, size=0.1)
    flat = vertices * np.asarray(extent) + np.eye(3)[np.arange(len(vertices)) % 3] * 1e-4
    session, _, _ = trace(NAME, {"density": "5"}, make_scene(flat, faces, [(0.0, 0.0, 5.0)]), 4, 4)
    counters = session.method.counters()
    assert 100 <= counters["cells"] <= 1000
