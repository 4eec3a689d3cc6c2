"""Errors against time: the front, and names that do not touch."""

import itertools

import pandas as pd
from matplotlib.text import Text
from shadowbench.harness.report import pareto

ROWS = [("a", 1.0, 900.0), ("b", 1.02, 800.0), ("c", 1.04, 700.0), ("d", 2.0, 0.0), ("e", 3.0, 0.0), ("f", 1.5, 800.0)]


def table():
    own = pd.DataFrame(ROWS, columns=["name", "total_ms", "wrong_per_frame"])
    return own.assign(method="ray_grids", title="a scene", on_frontier=pareto.front(own))


def test_nothing_on_the_front_is_beaten_in_both():
    own = table()
    assert set(own.loc[own["on_frontier"], "name"]) == {"a", "b", "c", "d"}
    assert pareto.front(own.sample(frac=1.0, random_state=1)).sort_index().tolist() == own["on_frontier"].tolist()


def test_names_of_near_points_do_not_touch(tmp_path, monkeypatch):
    shown, apart = [], pareto.names_apart
    monkeypatch.setattr(pareto, "names_apart", lambda axes, points: shown.append((axes, points)) or apart(axes, points))
    path = pareto.draw(tmp_path / "a.svg", table())
    ((axes, points),) = shown
    assert [name for *_, name in points] == ["a", "b", "c", "d"]
    axes.figure.draw_without_rendering()  # at its own size again, after that of the file
    boxes = [Text.get_window_extent(text) for text in axes.texts]
    assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))
    assert "stair" in path.read_text()
