"""Rays through the cells of one grid (``walk.py``): what they test, and the same answers through one cell and through
many.
"""

from helpers.answers import answers_in, assert_same, trace
from helpers.small_scenes import make_scene, soup

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
    assert_same(answers_in(session), before)


def test_walks_through_many_cells_find_what_one_cell_holds():
    """From within the grid; the middle pixel's ray runs along an axis."""
    prepared = make_scene(*soup(5, 600, size=0.05), [(0.0, 0.0, 9.0), (0.1, 0.2, 0.3)], (0.0, 0.0, 0.05), fov=120.0)
    (one, _, expected), (many, _, got) = (
        trace(NAME, {"density": density}, prepared, 17, 17) for density in ("0.001", "100")
    )
    assert_same(got, expected)
    assert many.method.counters()["primary tests"] < one.method.counters()["primary tests"] / 4
