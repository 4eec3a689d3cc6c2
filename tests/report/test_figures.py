"""Tables and pictures: what a person sees must say what was measured, how wrong it was, and what it stands for."""

from __future__ import annotations

import csv
import io

import numpy as np
import pandas as pd
import pytest
from helpers.table1_records import METHODS, SCENES, record, score, write_records
from matplotlib.figure import Figure
from rich.console import Console
from shadowbench.experiments.table1 import drawing as table1
from shadowbench.experiments.table1 import sheet
from shadowbench.harness.commands.show import show
from shadowbench.harness.errors import UserError
from shadowbench.harness.report import document, style
from shadowbench.harness.report import paper_table1 as paper
from shadowbench.harness.results.newest import newest
from shadowbench.harness.results.record import Record
from shadowbench.harness.results.schema import checked
from shadowbench.harness.results.table import table_of


def test_the_papers_numbers_are_as_printed():
    assert paper.cells("fairy") == ("124 / 33.11", "65 / 125 [#]", "24 / 285.7", "8.73 / 32.43", "82.18 ms")
    assert paper.cells("cloth")[0] == "39 / n/a*"
    assert paper.numbers("cloth", "hbvh") == {"build": 39.0}
    assert paper.numbers("fairy", "kd_tree") == {"build": 65.0, "trace": 125.0}
    assert paper.numbers("buddha", "with_shadows") == {"total": 114.57}
    assert paper.numbers("buddha", "grid") == {}
    assert set(paper.cells("bunny")) == {"-"}
    assert [row.triangles for row in paper.ROWS.values()] == ["174k", "82k", "252k", "284k", "92k", "1.09M"]
    assert paper.LABEL == "paper, GTX 280, 1024x1024"


@pytest.fixture
def records():
    return [record(scene, method) for scene in SCENES for method in METHODS]


def table_from(records):
    """The points of records, in the order of tables."""
    return document.named(document.in_order(table_of([checked(Record, made) for made in records])))


def row_of(made):
    (row,) = table_from([made]).to_dict("records")
    return row


def printed(made: sheet.Sheet, width: int) -> str:
    console = Console(width=width, file=io.StringIO(), force_terminal=False)
    table1.show(made, console)
    return console.file.getvalue()


def test_a_time_never_stands_without_its_error(records):
    words = {"ok": [], "wrong": [], "unscored": []}
    for made, kind in zip(records[:3], words, strict=False):
        for frame in made["frames"]:
            if kind == "wrong":
                frame["score"] = score(256, wrong=4)
            if kind == "unscored":
                frame.update(score=None, unscored="no truth here")
        words[kind] = sheet.cell(row_of(made)).lines
    assert words["ok"][1].endswith(" ✓")
    assert words["wrong"][1].endswith("✗ 12 wrong"), "errors are summed over frames"
    assert words["unscored"][1].endswith(" unscored")
    failed = score(256)
    failed.update(check="failed", excused_share=0.02)
    records[4]["frames"][0]["score"] = failed
    assert sheet.cell(row_of(records[4])).lines[1].endswith("✗ 2.00% excused")


def test_frames_without_truth_are_never_counted_as_right(records):
    records[0]["frames"][1].update(score=None, unscored="the truth took too long")
    row = row_of(records[0])
    assert pd.isna(row["true_errors"])
    assert row["error"] == style.UNSCORED
    assert row["unscored"].startswith("2 of 3 frames scored")
    records[0]["frames"][0]["score"] = score(256, wrong=2)
    assert row_of(records[0])["error"] == "✗ 2 wrong", "a known error is shown all the same"


def test_points_that_were_not_measured_stand_there_with_their_reason(records):
    for made, status in zip(records[:4], ("skipped", "failed", "timeout", "rejected"), strict=True):
        made.update(status=status, reason=f"because of {status}", frames=[])
    made = sheet.sheet(table_from(records))
    text = printed(made, 200)
    for status in ("skipped", "failed", "timeout", "rejected"):
        assert f"{status} [" in text
        assert any(f"{status}: because of {status}" in note for note in made.notes)


def test_the_fastest_right_answer_is_marked_and_a_wrong_one_never(records):
    line = sheet.sheet(table_from(records)).lines[0]
    best = [cell.best for cell in line.cells]
    assert sum(best) == 1
    times = {made["key"]: row_of(made)["total_ms"] for made in records if made["scene"]["name"] == "fairy"}
    (fastest,) = (made for made in records if made["key"] == min(times, key=times.get))
    fastest["frames"][0]["score"] = score(256, wrong=1)
    again = sheet.sheet(table_from(records)).lines[0]
    assert [cell.best for cell in again.cells] != best
    assert not again.cells[best.index(True)].best
    assert again.cells[best.index(True)].bad


@pytest.mark.parametrize("width", [220, 80])
def test_the_terminal_table_has_every_method_scene_and_printed_number(records, width):
    text = printed(sheet.sheet(table_from(records)), width)
    flat = " ".join(text.split())
    for scene, (title, triangles, _) in SCENES.items():
        assert title.split(" (")[0] in flat
        assert f"{triangles:,}" in flat
        for entry in paper.cells(scene):
            assert entry in flat
    assert "GTX 280" in flat
    assert "(stand-in)" in flat
    assert "not to be held against the paper" in flat
    assert max(map(len, text.splitlines())) <= width


def test_at_the_papers_size_nothing_warns_of_the_size():
    table = table_from([record("fairy", "warp_bvh", size=1024)])
    assert not any("not to be held" in note for note in sheet.sheet(table).notes)


def test_the_spread_is_over_repeats_and_never_over_frames(records):
    made = records[0]
    for i, frame in enumerate(made["frames"]):
        frame["total_ms"] = [10.0 * (i + 1)] * 10
    row = row_of(made)
    assert row["iqr_ms"] == 0
    assert row["between_ms"] == 0
    made["frames"][0]["total_ms"] = [10.0] * 5 + [13.0] * 5
    assert row_of(made)["between_ms"] == pytest.approx(1.0), (
        "a mean over three frames, one of which moved by 3"
    )


def test_rates_count_primary_and_shadow_rays(records):
    made = records[-1]
    frame = made["frames"][0]
    frame.update(shadow_rays=1000, total_ms=[2.0] * 10)
    for step in frame["passes"]:
        step["ms"] = [0.5] * 10
    row = row_of(made)
    assert row["primary_mrays_per_s"] == pytest.approx(256 * 256 / 0.5e-3 / 1e6)
    assert row["shadow_mrays_per_s"] == pytest.approx(1000 / 0.5e-3 / 1e6)
    assert row["frame_mrays_per_s"] == pytest.approx((256 * 256 + 1000) / 2e-3 / 1e6)
    frame.update(shadow_rays=None, score=None)
    assert np.isnan(row_of(made)["shadow_mrays_per_s"])


def test_errors_of_the_reference_have_their_own_note(records):
    table = table_from(records[:1])
    assert list(table["reference_errors"]) == [9], (
        "one wrong pixel and two wrong bits in each of three frames"
    )
    assert any("Embree" in note and "Fairy Forest (stand-in) 9" in note for note in sheet.sheet(table).notes)


def test_draw_writes_a_tidy_csv_a_markdown_table_and_bars(records, tmp_path, capsys):
    records[1].update(status="rejected", reason="needs 9 pairs", frames=[])
    write_records(tmp_path, records)
    files = table1.draw(tmp_path, quiet=True)
    assert capsys.readouterr().out == ""
    assert [file.name for file in files] == ["table1.csv", "table1.md", "table1.svg"]
    with open(tmp_path / "table1.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    own = [row for row in rows if row["origin"] == "this run"]
    assert len(own) == len(records)
    assert {row["scene"] for row in own} == set(SCENES)
    for row in own:
        if row["status"] == "ok":
            parts = [float(row[f"{part}_ms"]) for part in ("build", "trace", "light_build", "shadow")]
            assert sum(parts) == pytest.approx(float(row["total_ms"]), rel=0.05)
            assert row["true_errors"] == "0"
        else:
            assert row["reason"] == "needs 9 pairs"
            assert row["total_ms"] == ""
    theirs = [row for row in rows if row["origin"] == paper.LABEL]
    assert len(theirs) == 5 * len([scene for scene in SCENES if scene in paper.ROWS])
    ours = next(row for row in theirs if row["scene"] == "fairy" and row["method"] == "Our Method")
    assert (ours["build_ms"], ours["trace_ms"], ours["unscored"]) == (
        "8.73",
        "32.43",
        "the paper states no errors",
    )
    text = (tmp_path / "table1.md").read_text()
    table = [line for line in text.splitlines() if line.startswith("|")]
    assert len({line.count("|") for line in table[: 2 + len(SCENES)]}) == 1, "every row has every column"
    assert "8.73 / 32.43" in text
    assert r"39 / n/a\*" in text
    assert r"- \* Cloth model" in text
    assert "stand-in" in text


def test_the_same_records_give_the_same_bytes(records, tmp_path):
    write_records(tmp_path, records)
    first = [file.read_bytes() for file in table1.draw(tmp_path, quiet=True)]
    assert [file.read_bytes() for file in table1.draw(tmp_path, quiet=True)] == first


def test_only_the_newest_record_of_a_point_is_shown(tmp_path):
    old = record("bunny", "warp_bvh", key="old", rounds=[{"round": 0, "noted": 100.0}])
    new = record("bunny", "warp_bvh", seed=1, key="new", rounds=[{"round": 0, "noted": 200.0}])
    other = record("bunny", "embree", rounds=[{"round": 0, "noted": 1.0}])
    write_records(tmp_path, [new, old, other])
    chosen, older = newest(tmp_path)
    assert {made.key for made in chosen} == {"new", other["key"]}
    assert older == 1
    table1.draw(tmp_path, quiet=True)
    assert "1 older record" in (tmp_path / "table1.md").read_text()


def test_settings_and_originals_have_entries_of_their_own(tmp_path):
    plain = record("sibenik", "warp_bvh")
    refit = record("sibenik", "warp_bvh", seed=1, key="refit")
    refit["method"]["settings"] = {"update": "refit"}
    original = record("sibenik", "warp_bvh", seed=2, key="original")
    original["scene"].update(title="Sibenik", stand_in=None)
    write_records(tmp_path, [plain, refit, original])
    table = document.read(tmp_path)
    made = sheet.sheet(table)
    assert made.columns == ("Warp Mesh, rebuilt", "Warp Mesh, rebuilt, update refit")
    assert [line.title for line in made.lines] == ["Sibenik", "Sibenik Cathedral (stand-in)"]
    assert [[cell.lines[0] for cell in line.cells].count("-") for line in made.lines] == [1, 0]
    path = table1.bars(sheet.with_columns(table), tmp_path / "bars.svg")
    assert "update refit" in path.read_text()


def test_two_devices_are_two_columns():
    other = record("bunny", "warp_bvh", seed=1)
    other["key"] += "-gpu"
    other["method"].update(device="cuda:0", device_name="Imaginary GPU")
    made = sheet.sheet(table_from([record("bunny", "warp_bvh"), other]))
    assert made.columns == ("Warp Mesh, rebuilt, cpu", "Warp Mesh, rebuilt, cuda:0")
    assert "Imaginary CPU, Imaginary GPU" in made.title


def test_bars_are_compact_and_drawn_only_where_there_is_something(records, tmp_path):
    text = table1.bars(sheet.with_columns(table_from(records)), tmp_path / "bars.svg").read_text()
    assert len(text) < 200_000
    for label, _ in METHODS.values():
        assert label in text
    for word in ("build", "trace", "light build", "shadow", "ms per frame", "(stand-in)", "✓"):
        assert word in text
    records[0].update(status="failed", frames=[])
    assert "table1.svg" not in {
        file.name for file in table1.draw(write_records(tmp_path, records[:1]), quiet=True)
    }
    assert not (tmp_path / "table1.svg").exists()


def test_a_method_keeps_its_colour_whoever_else_is_drawn():
    alone, together = style.colours(["warp_bvh"]), style.colours([*METHODS, "somebodys"])
    assert alone["warp_bvh"] == together["warp_bvh"]
    assert len({together[name] for name in METHODS}) == len(METHODS)


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "-"), (float("nan"), "-"), (0.01234, "0.012"), (1.234, "1.23"), (1234.5, "1,234")],
)
def test_numbers_have_no_exponents(value, text):
    assert style.number(value) == text


def test_show_draws_again_and_says_what_is_wrong_with_a_folder(records, tmp_path, capsys):
    write_records(tmp_path, records)
    files = show("table1", tmp_path)
    assert "Table 1 on Imaginary CPU" in capsys.readouterr().out
    assert all(file.exists() for file in files)
    with pytest.raises(UserError, match="did you mean table1"):
        show("tabel1", tmp_path)
    with pytest.raises(UserError, match="no such folder"):
        show("table1", tmp_path / "elsewhere")
    with pytest.raises(UserError, match="no records"):
        show("table1", tmp_path / "records")


def test_a_folder_that_can_only_be_read_is_drawn_elsewhere(records, tmp_path):
    folder, out = write_records(tmp_path / "kept", records), tmp_path / "out"
    table1.draw(folder, quiet=True)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    for path in (folder / "table1.md", folder):
        path.chmod(0o555)
    files = show("table1", folder, quiet=True, out=out)
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
    assert {file.parent for file in files} == {out}
    for name in ("table1.csv", "table1.md", "table1.svg"):
        assert (out / name).read_bytes() == before[folder / name]
    assert sorted(path.name for path in out.iterdir()) == ["table1.csv", "table1.md", "table1.svg"], (
        "no link stays"
    )
    folder.chmod(0o755)
    with pytest.raises(UserError, match="has records of its own"):
        show("table1", folder, quiet=True, out=folder)


def test_a_scene_that_nothing_can_hit_is_told_beside_its_tick(tmp_path, capsys):
    """Misses are then the right answer, and a plain tick would say more than was checked."""
    blind, partly = (record(scene, "warp_bvh") for scene in ("cloth", "fairy"))
    blind["scene"]["invalid_triangles"] = blind["scene"]["triangles"]
    partly["scene"]["invalid_triangles"] = 4
    write_records(tmp_path, [blind, partly])
    table1.draw(tmp_path)
    for text in (" ".join(capsys.readouterr().out.split()), (tmp_path / "table1.md").read_text()):
        assert "Cloth (stand-in): warning: none of 92,210 triangles can ever be hit" in text
        assert "4 of 174,117 triangles can never be hit" in text
    said = document.errors(table_from([blind]))
    assert "warning: none of 92,210 triangles" in said


def test_records_of_another_experiment_are_not_drawn(tmp_path):
    write_records(tmp_path, [record("cloth", "warp_bvh")])
    with pytest.raises(
        UserError, match=r"its records belong to table1, not to figure2; run shadowbench show table1 "
    ):
        show("figure2", tmp_path)


def test_a_bar_that_dwarfs_the_others_is_cut_and_keeps_its_number(tmp_path):
    records = [record("bunny", method) for method in METHODS]
    for frame in records[0]["frames"]:
        frame["total_ms"] = [12345.0] * 10
    text = table1.bars(sheet.with_columns(table_from(records)), tmp_path / "bars.svg").read_text()
    assert "bar cut off" in text
    assert "12,345 ✓" in text
    assert ">10000<" not in text, "the axis is that of the other bars"


def test_frames_left_out_for_the_budget_are_named_and_nothing_is_best_over_different_frames(records):
    """A mean over the first frame alone is another number than one over three."""
    title = records[0]["scene"]["title"]

    def line(made):
        return next(line for line in made.lines if line.title.startswith(title))

    whole = sheet.sheet(table_from(records))
    assert any(cell.best for cell in line(whole).cells)
    assert not any("left out" in note for note in whole.notes)
    records[0]["frames_left_out"] = [f["frame"] for f in records[0]["frames"][1:]]
    del records[0]["frames"][1:]
    short = sheet.sheet(table_from(records))
    assert not any(cell.best for cell in line(short).cells)
    (note,) = [note for note in short.notes if "left out" in note]
    assert "(1 of 3)" in note


@pytest.mark.parametrize(
    ("low", "high", "labels"),
    [
        (0.3, 6.0, ["0.5", "1", "2", "5"]),
        (0.3, 40.0, ["0.5", "1", "2", "5", "10", "20", "50"]),
        (0.2, 400.0, ["1", "10", "100"]),
        (2e-7, 5e-4, ["0.000001", "0.00001", "0.0001"]),
        (0.0, 0.0, None),
    ],
)
def test_logarithmic_axes_have_plain_numbers(low: float, high: float, labels: list[str] | None) -> None:
    axes = Figure().subplots()
    axes.plot([1, 2], [low, high])
    style.plain_log(axes)
    bottom, top = axes.get_ylim()
    assert axes.get_yscale() == ("log" if labels else "linear")
    if not labels:
        return
    shown = [label.get_text() for label in axes.get_yticklabels() if bottom <= label.get_position()[1] <= top]
    assert shown == labels


def test_one_round_says_nothing_of_the_time_between_rounds(records):
    table = table_from(records)
    assert "at most (" in sheet.between_rounds(table)
    assert sheet.between_rounds(table.assign(rounds=1)) == "Between rounds: not known of one round."


def test_times_of_two_runs_stand_apart_and_none_is_best(records):
    for made in records:
        made["rounds"] = [{"round": 0, "run": "b" if made["method"]["name"] == "warp_bvh" else "a"}]
    made = sheet.sheet(table_from(records))
    assert not any(cell.best for line in made.lines for cell in line.cells)
    assert any(
        "Cloth (stand-in) was measured in 2 runs, which are not compared" in note for note in made.notes
    )
