"""Rays through the cells of one grid: what they test, and frame after frame."""

from helpers.brute_force import make_scene, soup
from helpers.method_trials import assert_same, trace

NAME = "uniform_grid"


def test_counted_tests_are_those_of_the_cells_walked():
    """One cell: every ray that enters it tests every triangle, and counting changes no answer."""
    vertices, faces = soup(5, 30, size=0.1)
    prepared = make_scene(vertices, faces, [(0.0, 0.0, 9.0)], (0.0, 0.0, 0.05), fov=120.0)
    session, _, before = trace(NAME, {"density": "0.001"}, prepared, 16, 16)
    primary, _ = session.method.tests_per_pixel()
    assert (primary == 30).all()
    counters = session.method.counters()
    assert counters["primary tests"] == 30 * 256
    assert 0 < counters["shadow tests"] < 30 * 256
    assert_same(session.frame.answers.to_host(), before)
