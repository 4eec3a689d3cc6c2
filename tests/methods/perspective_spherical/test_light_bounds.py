"""Boxes of triangles on a light's sphere, right and wrong on purpose; and light frames in float32 that stay right."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.brute_force import make_scene, soup
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases import find_case
from shadowbench.harness.hardcases.judge import Judged, judge_case

WORLD = {"aimed": "false", "clamp": "none"}
LOST = {
    "S01": {"exact": False, "seam": False, "vertices": True},
    "S02z": {"exact": False, "seam": True, "vertices": True},
    "S05z": {"exact": False, "seam": True, "vertices": True},
}
"""By case and bounds: whether shadows are lost. A seam, a pole inside a triangle, an arc that bulges."""


@pytest.mark.parametrize("name", sorted(LOST))
@pytest.mark.parametrize("bounds", ["exact", "seam", "vertices"])
def test_bounds_by_vertices_lose_shadows_and_say_so(name, bounds):
    case = find_case(name)
    # Tiles so small that a box too small by a little misses some of them.
    settings = {"light_bounds": bounds, "light_tiles": "512", **WORLD}
    method = make_method("perspective_spherical", settings)
    assert bool(method.known_inexact) == (bounds != "exact")
    finding = judge_case(Judged(case, case.make()), method, "cpu")
    assert (finding.status == "error") == LOST[name][bounds], finding.classes
    assert set(finding.classes) <= {"ok", "leak", "tie", "near_tie", "edge"}, "a box too small only loses"


def test_settings_that_mean_nothing_are_refused():
    with pytest.raises(UserError, match="needs light_map=azimuth-elevation"):
        make_method("perspective_spherical", {"light_bounds": "seam", "light_map": "cube"})
    with pytest.raises(UserError, match="needs aimed=true"):
        make_method("perspective_spherical", {"precision": "float32-centred", "aimed": "false"})


def pairs(prepared, **settings: str) -> tuple[dict[str, int], np.ndarray]:
    session = Session(make_method("perspective_spherical", settings), prepared, 64, 64, "cpu")
    answers = session.answers(prepared.moment(0, 64, 64))
    return session.method.counters(), answers["shadowed"]


@pytest.mark.parametrize("radii", [3.0, 1e3, 1e5, 1e7])
def test_a_centred_frame_keeps_its_tiles_at_any_distance(radii):
    """Plain float32 directions from a far light fall together, and every triangle is widened over all of them."""
    vertices, faces = soup(4, 400, size=0.1)
    prepared = make_scene(vertices, faces, [(0.48 * radii, 0.6 * radii, 0.64 * radii)])
    double, right = pairs(prepared)
    centred, bits = pairs(prepared, precision="float32-centred")
    plain, same = pairs(prepared, precision="float32")
    assert (bits == right).all()
    assert (same == right).all()
    assert centred["light 0 tiles with rays"] > 0.95 * double["light 0 tiles with rays"] > 100
    # A few more: distances of the centred frame have the bound of float32.
    assert centred["light 0 pairs"] < 1.25 * double["light 0 pairs"]
    if radii >= 1e7:
        assert plain["light 0 tiles with rays"] < 0.5 * double["light 0 tiles with rays"]
        assert plain["light 0 pairs"] > 2 * double["light 0 pairs"]


def test_a_light_among_the_hit_points_is_not_taken_for_the_light():
    vertices, faces = soup(4, 400, size=0.1)
    lights = [(0.1, 0.0, 0.2), (0.5, 0.9, 0.4), tuple(vertices[0])]
    prepared = make_scene(vertices, faces, lights)
    assert (pairs(prepared, precision="float32-centred")[1] == pairs(prepared)[1]).all()
