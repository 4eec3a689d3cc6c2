"""What drawings and tables share: methods keep their looks, bars are as long as they say, gaps say why."""

import itertools

import numpy as np
import pandas as pd
import pytest
from helpers.experiment_records import record_of, write_records
from matplotlib.figure import Figure
from matplotlib.text import Text
from shadowbench.harness.frame.registry import method_names
from shadowbench.harness.report import compare, document, numbers, panels, pareto, style
from shadowbench.harness.results.table import samples
from shadowbench.harness.runner.planning.experiment import Entry, experiment_names, find_experiment
from shadowbench.methods import LOOKS

OURS, TREE = Entry("ray_grids", {}, "ours"), Entry("warp_bvh", {}, "tree")


def test_every_method_has_a_look_of_its_own_whatever_else_is_drawn_or_installed(monkeypatch):
    """A colour that no other has; a marker, too, among those that an experiment draws together."""
    assert set(method_names()) == set(LOOKS)
    looks = {name: style.look(name) for name in LOOKS}
    assert len({look["color"] for look in looks.values()}) == len(LOOKS)
    for experiment in map(find_experiment, experiment_names()):
        for preset in experiment.presets.values():
            drawn = {entry.method for entry in preset.methods}
            assert len({looks[name]["marker"] for name in drawn}) == len(drawn), experiment.name
    alone = pd.DataFrame({"label": ["x"], "method": ["ray_grids"]})
    several = pd.DataFrame({"label": ["a", "b", "x"], "method": ["warp_bvh", "warp_bvh", "ray_grids"]})
    assert panels.looks(alone)["x"] == panels.looks(several)["x"]
    assert panels.looks(several)["a"]["color"] == panels.looks(several)["b"]["color"]
    monkeypatch.setattr("shadowbench.harness.frame.registry.method_names", lambda: ["another", *looks])
    assert {name: style.look(name) for name in looks} == looks
    assert style.colours(["warp_bvh", "somebodys"])["warp_bvh"] == looks["warp_bvh"]["color"]
    assert style.look("somebodys")["color"] in style.COLOURS


@pytest.mark.parametrize(("value", "spread", "form", "text"), [
    (None, 0.0, "", "-"), (float("nan"), 0.0, "", "-"), (0.01234, 0.0, "", "0.012"), (1.234, 0.0, "", "1.23"),
    (1234.5, 0.0, "", "1,234"), (-0.0013, 0.0, "ms", "~0"), (0.0, 0.0, "ms", "0.000"), (265.4, 40.0, "", "~270"),
    (0.3865, 0.0, "", "0.387"), (3.0, 0.0, "count", "3"), (0.5, 0.0, "count", "0.500"), (-0.5, 0.01, "+", "~-0.50"),
])  # fmt: skip
def test_a_number_has_the_digits_and_the_mark_of_its_spread_and_no_exponent(value, spread, form, text):
    assert numbers.carried(value, spread, form) == text


@pytest.mark.parametrize(("low", "high", "labels"), [
    (0.3, 6.0, ["0.5", "1", "2", "5"]), (0.3, 40.0, ["0.5", "1", "2", "5", "10", "20", "50"]),
    (0.8, 1.5, ["0.8", "1", "1.2", "1.4"]), (0.2, 400.0, ["1", "10", "100"]),
    (2e-7, 5e-4, ["0.000001", "0.00001", "0.0001"]), (0.0, 0.0, None),
])  # fmt: skip
def test_logarithmic_axes_have_plain_numbers(low, high, labels):
    axes = Figure().subplots()
    axes.plot([1, 2], [low, high])
    style.plain_log(axes)
    bottom, top = axes.get_ylim()
    assert axes.get_yscale() == ("log" if labels else "linear")
    shown = [label.get_text() for label in axes.get_yticklabels() if bottom <= label.get_position()[1] <= top]
    assert labels in (None, shown)


def test_a_logarithmic_distance_has_short_numbers(tmp_path):
    table = pd.DataFrame(
        {"far": [0.1, 1e3, 1e7], "ms": [1.0, 2.0, 3.0], "label": "ours", "method": "ray_grids", "status": "ok"}
    )
    drawn = panels.lines(tmp_path / "lines.svg", table, "far", "ms", below="radii", left="ms", log_x=10).read_text()
    assert ">1e6<" in drawn or ">1e7<" in drawn
    assert "$" not in drawn
    unknown = table.assign(ms=np.nan)
    assert panels.lines(tmp_path / "none.svg", unknown, "far", "ms", below="radii", left="ms") is None
    assert not (tmp_path / "none.svg").exists(), "of nothing there is no drawing"


@pytest.mark.parametrize("limit", [9.0, 4.0])
def test_a_bar_is_as_long_as_the_time_beside_it_says(limit):
    """The parts are measured apart: on a busy machine they may add up to less than the frame, or one be negative."""
    axes = Figure().subplots()
    row = {"total_ms": 4.34, "iqr_ms": 0.1, "build_ms": 2.5, "trace_ms": -0.3, "light_build_ms": 0.0, "shadow_ms": 0.5,
           "method": "ray_grids", "text": "4.34 ms"}  # fmt: skip
    panels.stacked(axes, pd.DataFrame([row]), limit=limit)
    build, whole = 4.34 * 2.5 / 3, min(limit, 4.34)
    assert [bar.get_width() for bar in axes.patches] == pytest.approx([build, 0, 0, whole - build])
    assert max(bar.get_x() + bar.get_width() for bar in axes.patches) == pytest.approx(whole)


@pytest.mark.parametrize("cut", [np.inf, 8.0, 1.5])
@pytest.mark.parametrize("range_ms", [0.0, 30.0, 900.0, np.nan])
def test_every_bar_has_its_label_and_its_whisker_ends_on_the_axis_or_in_a_mark(monkeypatch, tmp_path, cut, range_ms):
    kept = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: kept.append(figure))
    times = {"build_ms": 1.0, "trace_ms": 1.0, "light_build_ms": 0.0, "shadow_ms": 1.0, "method": "ray_grids"}
    rows = [{**times, "label": "a", "total_ms": 10.0, "iqr_ms": range_ms, "text": "10 ✓"},
            {**times, "label": "b", "total_ms": 14.0, "iqr_ms": range_ms, "text": "14 ✗ 9"},
            {**times, "label": "c", "total_ms": np.nan, "iqr_ms": np.nan, "text": "failed"}]  # fmt: skip
    panels.bars(tmp_path / "a.png", pd.DataFrame(rows), cut=cut)
    (axes,) = kept[0].axes
    left, right = axes.get_xlim()
    assert all(left <= text.xy[0] < right for text in axes.texts)
    assert {text.get_text() for text in axes.texts} == {"10 ✓", "14 ✗ 9", "failed"}
    ends = [x for lines in axes.collections for part in getattr(lines, "get_segments", list)() for x in part[:, 0]]
    assert all(left <= x <= right for x in ends)
    half = 0.0 if np.isnan(range_ms) else range_ms / 2
    over = sum(ms + half > cut * 10.0 for ms in (10.0, 14.0))
    assert sum("cut off" in str(line.get_label()) for line in axes.lines) == over


def test_a_cross_table_keeps_the_tables_order_and_leaves_gaps():
    rows = [("z", "b", "1"), ("z", "a", "2"), ("y", "a", "3"), ("y", "a", "4")]
    table = pd.DataFrame(rows, columns=["scene", "label", "text"])
    made = document.cross_table(table, {"scene": "the scene"}, "label", "text")
    assert list(made.columns) == ["the scene", "b", "a"]
    assert document.markdown(made)[2:] == ["| z | 1 | 2 |", "| y | - | 4 |"]


def test_what_a_run_did_not_come_to_has_a_row_and_a_word_in_its_panel(tmp_path):
    records = [record_of("moving", e, s) for e, s in ((OURS, "cloth"), (TREE, "cloth"), (OURS, "buddha"))]
    table = document.complete(document.read(write_records(tmp_path, records)))
    (lost,) = table[table["status"] == document.NO_RECORD].to_dict("records")
    assert (lost["scene"], lost["label"], lost["method"]) == ("buddha", "tree", "warp_bvh")
    panels.lines(tmp_path / "a.svg", table, "triangles", "total_ms", facet="title", across=2, below="x", left="y")
    assert "tree: no record" in (tmp_path / "a.svg").read_text()


def test_the_spread_of_passes_is_that_of_their_sum(tmp_path):
    record = record_of("figure10", OURS, passes=[("a", "build", 1.0), ("b", "build", 2.0), ("c", "shadow", 9.0)])
    for step, ms in zip(record["frames"][0]["passes"], ([1.0, 3.0], [2.0, 2.0], [5.0, 5.0]), strict=True):
        step["ms"] = ms
    record["frames"][0]["stage_round"] = [0, 1]
    found = samples(write_records(tmp_path, [record]))
    assert compare.pass_spread(found, "build").tolist() == [1.0], "half the range between the rounds"
    assert compare.pass_spread(found, "build", "b").tolist() == [0.0]
    record["frames"][0]["stage_round"] = [0]
    for step in record["frames"][0]["passes"]:
        step["ms"] = step["ms"][:1]
    found = samples(write_records(tmp_path, [record]))
    assert compare.pass_spread(found, "build").isna().all(), "one sample says nothing of its spread"


def dots(monkeypatch, tmp_path, table):
    """The axes of a dot plot."""
    kept = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: kept.append(figure))
    panels.dots(tmp_path / "a.svg", table, "row", "x", "scene", below="ratio")
    (axes,) = kept[0].axes
    return axes


def test_equal_values_of_a_row_hide_no_marker(monkeypatch, tmp_path):
    table = pd.DataFrame([(row, scene, 1.0) for row in "ab" for scene in "stuv"], columns=["row", "scene", "x"])
    axes = dots(monkeypatch, tmp_path, table)
    heights = sorted(y for line in axes.lines[1:] for y in line.get_ydata())
    apart = 72 * 0.3 * min(b - a for a, b in itertools.pairwise(heights))
    assert len(heights) == len(table)
    assert apart > axes.lines[1].get_markersize(), "in points, at 0.3 inches a row"
    assert [label.get_text() for label in axes.get_yticklabels()] == ["a", "b"]


@pytest.mark.parametrize(("low", "high"), [(0.9, 1.1), (0.05, 3.0), (0.01, 1e6), (1e-3, 2e-3)])
def test_ticks_are_few_and_plain(monkeypatch, tmp_path, low, high):
    axes = dots(monkeypatch, tmp_path, pd.DataFrame({"row": ["a", "b"], "scene": "s", "x": [low, high]}))
    axes.figure.draw_without_rendering()
    left, right = axes.get_xlim()
    shown = [t.get_text() for t in axes.get_xticklabels() if left <= t.get_position()[0] <= right]
    assert 1 <= len(shown) <= 12
    assert len(set(shown)) == len(shown)


def test_nothing_on_the_front_is_beaten_and_its_names_do_not_touch(tmp_path, monkeypatch):
    rows = [
        ("a", 1.0, 900.0),
        ("b", 1.02, 800.0),
        ("c", 1.04, 700.0),
        ("d", 2.0, 0.0),
        ("e", 3.0, 0.0),
        ("f", 1.5, 800.0),
    ]
    own = pd.DataFrame(rows, columns=["name", "total_ms", "wrong_per_frame"])
    own = own.assign(method="ray_grids", title="a scene", on_frontier=pareto.front(own))
    assert set(own.loc[own["on_frontier"], "name"]) == {"a", "b", "c", "d"}
    assert pareto.front(own.sample(frac=1.0, random_state=1)).sort_index().tolist() == own["on_frontier"].tolist()
    shown, apart = [], pareto.names_apart
    monkeypatch.setattr(pareto, "names_apart", lambda axes, points: shown.append((axes, points)) or apart(axes, points))
    path = pareto.draw(tmp_path / "a.svg", own)
    ((axes, points),) = shown
    assert [name for *_, name in points] == ["a", "b", "c", "d"]
    axes.figure.draw_without_rendering()  # at its own size again, after that of the file
    boxes = [Text.get_window_extent(text) for text in axes.texts]
    assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))
    assert "stair" in path.read_text()
