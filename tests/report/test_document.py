"""What stands below the tables of a report."""

import json

import pandas as pd
import pytest
from helpers.experiment_records import record_of, write_records
from shadowbench.harness.commands.show import show
from shadowbench.harness.report import numbers
from shadowbench.harness.report.document import effort, names
from shadowbench.harness.report.numbers import carry
from shadowbench.harness.runner.planning.experiment import Entry


@pytest.mark.parametrize(("taken", "light", "told"), [
    (3, "", ""),
    (1, "", " The budget was spent before the last round: Cloth, grid: 1 of 3."),
    (1, "two lights", " The budget was spent before the last round: Cloth, grid, two lights: 1 of 3."),
])  # fmt: skip
def test_points_that_the_budget_left_without_rounds_are_named(taken, light, told):
    row = {"title": "Cloth", "label": "grid", "light_label": light, "rounds": taken, "point.rounds": 3,
           "point.budget_s": 5.0}  # fmt: skip
    assert effort(pd.DataFrame([row])) == "3 rounds, at most 5 s of samples per point." + told
    assert effort(pd.DataFrame([row]).drop(columns=["point.rounds"])) == ""


def noisy(experiment, label, ms, **changes):
    """A record of two rounds of which the second took twice as long."""
    made = record_of(experiment, Entry("ray_grids", {}, label), ms=ms)
    rounds = [{"round": i, "spent_s": 1.0, **changes} for i in range(2)]
    one = made["frames"][0]
    one |= {"total_ms": [ms, 2 * ms], "wall_ms": [ms, 2 * ms], "round": [0, 1], "stage_round": [0, 1]}
    for step in one["passes"]:
        step["ms"] = [step["ms"][0], 2 * step["ms"][0]]
    return {**made, "rounds": rounds}


@pytest.mark.parametrize(("cores", "of"), [(2, "2 cores"), (1, "1 core")])
def test_the_first_line_tells_of_a_busy_machine(tmp_path, capsys, monkeypatch, cores, of):
    monkeypatch.setenv("COLUMNS", "200")  # the line is not broken, whatever the terminal
    loads = {"quiet": 1.0, "busy": 5.0}
    made = [noisy("table1", label, 9.0, clock={"load": load}) for label, load in loads.items()]
    for one in made:
        one["method"]["device"] = "cpu"
    write_records(tmp_path, made)
    (tmp_path / "environments").mkdir()
    facts = json.dumps({"cpu": {"usable_cores": cores}})
    (tmp_path / "environments" / f"{made[0]['environment']}.json").write_text(facts)
    show("table1", tmp_path)
    said = f"2 of 4 rounds were disturbed, the worst by load 5.0 on {of}"
    assert capsys.readouterr().out.splitlines()[0].rstrip(".").endswith(said)
    assert said in (tmp_path / "table1.md").read_text()


def test_a_table_says_whether_a_card_has_ray_tracing_units(tmp_path, capsys):
    made = [noisy("frame_time", label, ms) for label, ms in (("ray grids", 1.0), ("mesh rebuilt", 3.0))]
    write_records(tmp_path / "untold", made)
    show("frame_time", tmp_path / "untold")
    assert "ray tracing units" not in capsys.readouterr().out
    made[1]["method"]["built"] = {"api": "OptiX 9.0", "ray tracing units": "none"}
    write_records(tmp_path / "told", made)
    show("frame_time", tmp_path / "told")
    line = f"Ray tracing units of {made[1]['method']['device_name']}: none."
    assert line in capsys.readouterr().out.replace("\n", " ")
    assert line in (tmp_path / "told/frame_time.md").read_text()
    adapter = {"api": "Vulkan", "adapter": "llvmpipe (LLVM 15, 256 bits)"}
    made[1]["method"]["built"] = {**adapter, "ray tracing units": "none", "slangpy": "0.43.1"}
    write_records(tmp_path / "vulkan", made)
    show("frame_time", tmp_path / "vulkan")
    assert "Ray tracing units of llvmpipe (LLVM 15, 256 bits): none." in (tmp_path / "vulkan/frame_time.md").read_text()


def test_a_finding_names_the_least_and_the_greatest_and_lists_no_range():
    """With the digits that the spread of a mean carries; a name that fewer scenes have is left out."""
    rows = [("a", 2.345, 0.3), ("a", 2.345, 0.3), ("b", 0.5, 0.0), ("b", 0.5, 0.0), ("c", 9.0, 0.0)]
    table = pd.DataFrame(rows, columns=["label", "ratio", "ratio_spread"])
    told = numbers.ends(table, "ratio", "label", "{} takes {} times as long", ", {} {}", "nothing")
    assert told == "b takes 0.500 times as long, a ~2.3"
    assert numbers.ends(table[:2], "ratio", "label", "{} {}", ", {} {}", "nothing") == "a ~2.3"
    assert numbers.ends(table[:0], "ratio", "label", "{} {}", ", {} {}", "nothing") == "nothing"
    assert numbers.listed(["a", "b", "c"]) == "a, b and c"


def test_a_finding_names_all_whose_means_read_the_same():
    """Which of two is a hair ahead is no finding."""
    table = pd.DataFrame({"label": ["a", "b", "c", "d"], "ratio": [1.0001, 1.0, 2.0001, 2.0]})
    told = numbers.ends(table, "ratio", "label", "{} takes {}", ", {} {}", "nothing")
    assert told == "b or a takes 1.00, d or c 2.00"
    assert numbers.ends(table[:2], "ratio", "label", "{} takes {}", ", {} {}", "nothing") == "b or a takes 1.00"


def test_points_that_nothing_names_are_named_where_pyarrow_holds_the_texts():
    """pyarrow joins no empty column of unknown type to a text."""
    pytest.importorskip("pyarrow")
    columns = {"title": "str", "label": object, "light_label": object}
    table = pd.DataFrame({name: pd.Series([], dtype=kind) for name, kind in columns.items()})
    assert names(table).tolist() == []
    assert carry(pd.Series([float("nan")]), pd.Series([0.1])).add(" ms").isna().all()
