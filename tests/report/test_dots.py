"""Dot plots: each marker has a line of its own, rows are named, and an axis has plain ticks that do not overlap."""

import itertools
from pathlib import Path

import pandas as pd
import pytest
from matplotlib.figure import Figure
from shadowbench.harness.report import panels


def drawn(monkeypatch, tmp_path: Path, table: pd.DataFrame, **changes) -> Figure:
    """The figure of a dot plot."""
    kept = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: kept.append(figure))
    panels.dots(tmp_path / "a.svg", table, "row", "x", "scene", below="ratio", **changes)
    return kept[0]


def test_equal_values_of_a_row_hide_no_marker(monkeypatch, tmp_path):
    table = pd.DataFrame([(row, scene, 1.0) for row in "ab" for scene in "stuv"], columns=["row", "scene", "x"])
    (axes,) = drawn(monkeypatch, tmp_path, table).axes
    heights = sorted(y for line in axes.lines[1:] for y in line.get_ydata())
    apart = 72 * 0.3 * min(b - a for a, b in itertools.pairwise(heights))
    assert len(heights) == len(table)
    assert apart > axes.lines[1].get_markersize(), "in points, at 0.3 inches a row"
    assert [label.get_text() for label in axes.get_yticklabels()] == ["a", "b"]


@pytest.mark.parametrize(("low", "high"), [(0.9, 1.1), (0.05, 3.0), (0.01, 1e6), (1e-3, 2e-3)])
def test_ticks_are_few_and_plain(monkeypatch, tmp_path, low, high):
    table = pd.DataFrame({"row": ["a", "b"], "scene": "s", "x": [low, high]})
    (axes,) = drawn(monkeypatch, tmp_path, table).axes
    axes.figure.draw_without_rendering()
    left, right = axes.get_xlim()
    shown = [t.get_text() for t in axes.get_xticklabels() if left <= t.get_position()[0] <= right]
    assert 1 <= len(shown) <= 12
    assert len(set(shown)) == len(shown)
