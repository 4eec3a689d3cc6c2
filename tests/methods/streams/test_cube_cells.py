"""Slots of a light's rays: cell, rank and whether the point is stored in 32 bits, whatever the numbers."""

import numpy as np
import pytest
from helpers.brute_force import make_scene
from helpers.lights_of_session import lights_of_session
from helpers.streams import trial
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session

SIZE = 40, 32


@pytest.mark.parametrize("region", ["triangles", "rays"])
def test_more_rays_in_a_cell_than_a_slot_has_room_for(region, device):
    """A square that nearly fills the view, in one cell of a light far away, however narrow cells are there; a surface far
    behind it, seen beside it, spans the other cells. The cell has more rays than the 8 bits of a rank beside 23 bits of a
    cell hold."""
    square = [(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)]
    blocker = [(0.1, 0.1, 0.5), (0.2, 0.1, 0.5), (0.1, 0.2, 0.5)]
    behind = [(0.0, 0.0, -2.5e5), (1.0e6, 0.0, -2.5e5), (1.0e6, 1.0e6, -2.5e5)]
    vertices = np.array(square + blocker + behind, dtype=np.float32)
    faces = np.array([(0, 1, 2), (0, 2, 3), (4, 5, 6), (7, 8, 9)])
    prepared = make_scene(vertices, faces, [(0.0, 0.0, 1.0e6)], (0.0, 0.0, 0.9), (0.0, 0.0, 0.0), 90.0)
    moment = prepared.moment(0, *SIZE)
    session = Session(make_method("ray_grids", trial(region=region, cells=1024)), prepared, *SIZE, device)
    answers = session.answers(moment)
    (light,) = lights_of_session(session)
    bits = light.cells.bits
    most = (1 << (31 - bits)) - 1
    slots = light.cells.slot.numpy()
    hit = answers["triangle"].ravel() >= 0
    ranks = (slots[hit] >> bits) & most
    assert (ranks == most).sum() > 100
    assert light.cells.rank.numpy()[hit].max() > most
    order = light.cells.rays.numpy()[:, 3].view(np.int32)[: hit.sum()]
    assert sorted(order) == np.flatnonzero(hit).tolist()
    wanted = Session(make_method("uniform_grid", {}), prepared, *SIZE, device).answers(moment)
    for name in wanted:
        np.testing.assert_array_equal(answers[name], wanted[name])
    assert 0 < wanted["shadowed"].sum() < hit.sum()
