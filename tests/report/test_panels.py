"""What drawings and tables share: methods keep their looks, bars are as long as they say, gaps say why."""

import pandas as pd
import pytest
from helpers.experiment_records import record_of, write_records
from matplotlib.figure import Figure
from shadowbench.harness.frame.registry import method_names
from shadowbench.harness.report import compare, document, panels, style
from shadowbench.harness.results.table import samples
from shadowbench.harness.runner.planning.experiment import Entry

OURS, TREE = Entry("ray_grids", {}, "ours"), Entry("warp_bvh", {}, "tree")


def test_a_method_looks_the_same_whatever_else_is_drawn_or_installed(monkeypatch):
    looks = {name: style.look(name) for name in method_names()}
    pairs = {(look["color"], look["marker"]) for look in looks.values()}
    assert len(pairs) == len(looks), "two built-in methods look the same"
    alone = pd.DataFrame({"label": ["x"], "method": ["ray_grids"]})
    several = pd.DataFrame({"label": ["a", "b", "x"], "method": ["warp_bvh", "warp_bvh", "ray_grids"]})
    assert panels.looks(alone)["x"] == panels.looks(several)["x"]
    assert panels.looks(several)["a"]["color"] == panels.looks(several)["b"]["color"]
    monkeypatch.setattr("shadowbench.harness.frame.registry.method_names", lambda: ["another", *looks])
    assert {name: style.look(name) for name in looks} == looks
    assert style.colours(["warp_bvh"])["warp_bvh"] == looks["warp_bvh"]["color"]


def test_a_logarithmic_axis_has_plain_numbers(tmp_path):
    table = pd.DataFrame(
        {"far": [0.1, 1e3, 1e7], "ms": [1.0, 2.0, 3.0], "label": "ours", "method": "ray_grids", "status": "ok"}
    )
    drawn = panels.lines(tmp_path / "lines.svg", table, "far", "ms", below="radii", left="ms", log_x=10).read_text()
    assert ">1e6<" in drawn or ">1e7<" in drawn
    assert "$" not in drawn


def test_a_bar_is_as_long_as_the_time_beside_it_says():
    """The parts are measured apart: on a busy machine they may add up to less than the frame, or one be negative."""
    axes = Figure().subplots()
    row = {
        "total_ms": 4.34,
        "iqr_ms": 0.1,
        "build_ms": 2.5,
        "trace_ms": -0.3,
        "light_build_ms": 0.0,
        "shadow_ms": 0.5,
        "method": "ray_grids",
        "text": "4.34 ms",
    }
    panels.stacked(axes, pd.DataFrame([row]))
    assert max(bar.get_x() + bar.get_width() for bar in axes.patches) == pytest.approx(4.34)
    assert [bar.get_width() for bar in axes.patches] == pytest.approx([4.34 * 2.5 / 3, 0, 0, 4.34 * 0.5 / 3])
    axes = Figure().subplots()
    panels.stacked(axes, pd.DataFrame([row]), limit=4.0)
    assert [bar.get_width() for bar in axes.patches] == pytest.approx([4.34 * 2.5 / 3, 0, 0, 4 - 4.34 * 2.5 / 3])


def test_a_cross_table_keeps_the_tables_order_and_leaves_gaps():
    table = pd.DataFrame(
        [("z", "b", "1"), ("z", "a", "2"), ("y", "a", "3"), ("y", "a", "4")], columns=["scene", "label", "text"]
    )
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
