"""``shadowbench report`` of Table 1 and ``shadowbench show``: tables, bars and notes; the same records, the same files."""

import re

import pandas as pd
import pytest
from helpers.experiment_records import METHODS, SCENES, record, score, write_records
from shadowbench.experiments import table1
from shadowbench.harness.commands.show import show
from shadowbench.harness.errors import UserError
from shadowbench.harness.report import document, numbers, panels
from shadowbench.harness.report import paper_table1 as paper
from shadowbench.harness.results.record import Record
from shadowbench.harness.results.schema import checked, newest
from shadowbench.harness.results.table import table_of


@pytest.fixture
def records():
    return [record(scene, method) for scene in SCENES for method in METHODS]


def table_from(records):
    """The points of records, in the order of tables."""
    return document.named(document.in_order(table_of([checked(Record, made) for made in records])))


def row_of(made):
    (row,) = table_from([made]).to_dict("records")
    return row


def points_of(folder, records):
    """The points of Table 1, from a folder with these records."""
    return table1.read(write_records(folder, records))


def best(table):
    """Row by scene of what is marked as fastest."""
    return dict(table.loc[table["best"], ["title", "row"]].to_numpy())


def test_a_time_never_stands_without_its_error(records, tmp_path):
    fairy = records[: len(METHODS)]
    for made, kind in zip(fairy, ("ok", "wrong", "unscored", "excused"), strict=True):
        for frame in made["frames"]:
            if kind == "wrong":
                frame["score"] = score(256, wrong=4)
            if kind == "unscored":
                frame.update(score=None, unscored="no truth here")
            if kind == "excused":
                frame["score"] = {**score(256), "check": "failed", "excused_share": 0.02}
    table = points_of(tmp_path, fairy)
    (title,) = table["title"].unique()
    cells = table1.frame_table(table).set_index("method")[title]
    ends = dict(zip(METHODS, ("✓", "✗ 12", "unscored", "✗ 2.00% excused"), strict=True))
    for method, (label, _) in METHODS.items():
        assert cells[label].strip("*").endswith(" " + ends[method]), "errors are summed over frames"
    answers = table.set_index("row")["error"]
    assert answers[METHODS["uniform_grid"][0]] == "✗ 12 wrong"
    assert any("no truth here" in note for note in table1.notes(table))


def test_frames_without_truth_are_never_counted_as_right(records):
    records[0]["frames"][1].update(score=None, unscored="the truth took too long")
    row = row_of(records[0])
    assert pd.isna(row["true_errors"])
    assert row["error"] == numbers.UNSCORED
    assert row["unscored"].startswith("2 of 3 frames scored")
    records[0]["frames"][0]["score"] = score(256, wrong=2)
    assert row_of(records[0])["error"] == "✗ 2 wrong", "a known error is shown all the same"


@pytest.mark.usefixtures("unpainted")
def test_points_that_were_not_measured_stand_there_with_their_reason(records, tmp_path):
    for made, status in zip(records[:4], ("skipped", "failed", "timeout", "rejected"), strict=True):
        made.update(status=status, reason=f"because of {status}", frames=[])
    write_records(tmp_path, records)
    table1.draw(tmp_path, quiet=True)
    text = (tmp_path / "table1.md").read_text()
    for status in ("skipped", "failed", "timeout", "rejected"):
        assert f"| {status} |" in text
        assert f"{status}: because of {status} (Fairy Forest (stand-in))" in text


@pytest.mark.usefixtures("unpainted")
def test_the_fastest_right_answer_is_marked_and_a_wrong_one_never(records, tmp_path):
    marked = best(points_of(tmp_path / "right", records))
    assert len(marked) == len(SCENES)
    fastest = min((r for r in records if r["scene"]["name"] == "fairy"), key=lambda r: row_of(r)["total_ms"])
    assert marked["Fairy Forest (stand-in)"] == fastest["method"]["label"]
    fastest["frames"][0]["score"] = score(256, wrong=1)
    again = points_of(tmp_path / "wrong", records)
    assert best(again)["Fairy Forest (stand-in)"] not in ("", fastest["method"]["label"])
    table1.draw(tmp_path / "wrong", quiet=True)
    text = (tmp_path / "wrong" / "table1.md").read_text()
    assert f": {fastest['method']['label']} on " in text, "it is fastest on other scenes"


@pytest.mark.parametrize("width", [220, 80])
@pytest.mark.usefixtures("unpainted")
def test_the_terminal_table_has_every_method_scene_and_printed_number(records, width, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(width))
    table1.draw(write_records(tmp_path, records))
    text = capsys.readouterr().out
    flat = " ".join(text.split())
    for scene, (title, *_) in SCENES.items():
        assert title in flat
        for word in " ".join(paper.ROWS[scene].cells if scene in paper.ROWS else ()).split():
            assert word in flat
    for label, _ in METHODS.values():
        assert label in flat
    assert "GTX 280" in flat
    assert "Only 1024x1024 can be compared with the paper" in flat
    assert max(map(len, text.splitlines())) <= width


def test_the_papers_footnotes_stand_where_its_numbers_do(tmp_path):
    text = " ".join(table1.notes(points_of(tmp_path / "fairy", [record("fairy", "warp_bvh")])))
    assert "[#] Fairy" in text
    own = points_of(tmp_path / "own", [record("bunny", "warp_bvh")])
    assert "paper's numbers" not in " ".join(table1.notes(own))


def test_two_sizes_are_told_apart_and_never_in_one_cell(tmp_path):
    both = [record(scene, method, size) for size in (256, 64) for scene in ("cloth", "bunny") for method in METHODS]
    table = points_of(tmp_path, both)
    titles = {f"{title}, {size}x{size}" for size in (64, 256) for title in ("Cloth (stand-in)", "Bunny (file)")}
    assert set(table["title"]) == titles
    shown = table1.frame_table(table)
    assert set(shown.columns) == {"method", *titles}
    assert shown.iloc[: len(METHODS)].notna().all(axis=None)
    assert set(best(table)) == titles


def test_settings_and_originals_have_entries_of_their_own(tmp_path):
    plain = record("sibenik", "warp_bvh")
    refit = record("sibenik", "warp_bvh", seed=1, key="refit")
    refit["method"]["settings"] = {"update": "refit"}
    original = record("sibenik", "warp_bvh", seed=2, key="original")
    original["scene"].update(title="Sibenik", stand_in=None)
    table = points_of(tmp_path, [plain, refit, original])
    assert set(table["row"]) == {"Warp Mesh, rebuilt", "Warp Mesh, rebuilt, update refit"}
    shown = table1.frame_table(table).iloc[:2]
    assert dict(shown.isna().sum()) == {"method": 0, "Sibenik": 1, "Sibenik Cathedral (stand-in)": 0}
    table1.draw(tmp_path, quiet=True)
    assert "update refit" in (tmp_path / "table1.svg").read_text()


def test_a_declared_row_does_not_repeat_its_settings(tmp_path):
    entry = next(entry for entry in table1.METHODS if len(entry.settings) > 1)
    made = record("sibenik", "warp_bvh")
    made["method"].update(name=entry.method, label=entry.label, settings={**entry.settings, "tile": "32"})
    (row,) = points_of(tmp_path, [made])["row"]
    assert row == f"{entry.label}, tile 32"


def test_two_devices_are_two_rows(tmp_path):
    other = record("bunny", "warp_bvh", seed=1)
    other["key"] += "-gpu"
    other["method"].update(device="cuda:0", device_name="Imaginary GPU")
    table = points_of(tmp_path, [record("bunny", "warp_bvh"), other])
    assert set(table["row"]) == {"Warp Mesh, rebuilt, cpu", "Warp Mesh, rebuilt, cuda:0"}
    assert "on Imaginary CPU and Imaginary GPU" in document.where(table)


def test_bars_are_compact_and_drawn_only_where_there_is_something(records, tmp_path):
    table1.draw(write_records(tmp_path / "all", records), quiet=True)
    text = (tmp_path / "all" / "table1.svg").read_text()
    assert len(text) < 200_000
    for label, _ in METHODS.values():
        assert label in text
    for word in ("build", "trace", "light build", "shadow", "ms per frame", "(stand-in)", "✓"):
        assert word in text
    records[0].update(status="failed", frames=[])
    assert "table1.svg" not in {file.name for file in table1.draw(write_records(tmp_path, records[:1]), quiet=True)}
    assert not (tmp_path / "table1.svg").exists()


@pytest.mark.parametrize(("device", "submitted", "apart"), [
    ("cpu", None, True), ("cuda:0", None, False), ("cuda:0", [0.1], True),
])  # fmt: skip
def test_parts_that_were_measured_apart_are_said_to_be_so(tmp_path, device, submitted, apart):
    """Only differences between graphs that stop earlier add up to the whole."""
    made = record("bunny", "warp_bvh")
    made["method"]["device"] = device
    for frame in made["frames"] if submitted else ():
        frame["submitted_ms"] = submitted
    table1.draw(write_records(tmp_path, [made]), quiet=True)
    drawn = " ".join(re.findall(">([^<>]+)</text>", (tmp_path / "table1.svg").read_text()))  # in lines
    assert (panels.WHOLE in drawn) == apart
    assert "whisker: interquartile range" in drawn
    assert (table1.APART in (tmp_path / "table1.md").read_text()) == apart


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


def test_a_bar_that_dwarfs_the_others_is_cut_and_keeps_its_number(tmp_path):
    records = [record("bunny", method) for method in METHODS]
    for frame in records[0]["frames"]:
        frame["total_ms"] = [12345.0] * 10
    table1.draw(write_records(tmp_path, records), quiet=True)
    text = (tmp_path / "table1.svg").read_text()
    assert "bar cut off" in text
    assert "12,345 ✓" in text
    assert ">10000<" not in text, "the axis is that of the other bars"


def test_frames_left_out_are_named_and_the_best_is_so_over_the_frames_that_both_have(records, tmp_path):
    """A mean over the first frame alone is another number than one over three."""
    title = records[0]["scene"]["title"]
    whole = points_of(tmp_path / "whole", records)
    fastest = best(whole)[title]
    assert not any("left out" in note for note in table1.notes(whole))
    other = next(r for r in records if r["scene"]["title"] == title and r["method"]["label"] != fastest)
    other["frames_left_out"] = [f["frame"] for f in other["frames"][1:]]
    del other["frames"][1:]
    # Its one frame is faster than the mean of the three of the fastest, and slower than the first of them.
    (first,) = (r for r in records if r["scene"]["title"] == title and r["method"]["label"] == fastest)
    for i, frame in enumerate(first["frames"]):
        frame["total_ms"] = [10.0 + 10 * i] * 10
    other["frames"][0]["total_ms"] = [11.0] * 10
    short = points_of(tmp_path / "short", records)
    assert best(short)[title] == fastest
    (note,) = [note for note in table1.notes(short) if "left out" in note]
    assert f"{title}, {other['method']['label']}" in note


def test_times_of_two_runs_stand_apart_and_none_is_best(records, tmp_path):
    for made in records:
        made["rounds"] = [{"round": 0, "run": "b" if made["method"]["name"] == "warp_bvh" else "a"}]
    assert not best(points_of(tmp_path, records))
    table1.draw(tmp_path, quiet=True)
    text = (tmp_path / "table1.md").read_text()
    assert "were measured in 2 runs, which are not compared" in text


@pytest.fixture
def two_scenes():
    return [record(scene, method) for scene in ("fairy", "bunny") for method in METHODS]


def test_only_the_newest_record_of_a_point_is_shown(tmp_path):
    old = record("bunny", "warp_bvh", key="old", rounds=[{"round": 0, "noted": 100.0}])
    new = record("bunny", "warp_bvh", seed=1, key="new", rounds=[{"round": 0, "noted": 200.0}])
    other = record("bunny", "embree", rounds=[{"round": 0, "noted": 1.0}])
    write_records(tmp_path, [new, old, other])
    chosen, older = newest(tmp_path)
    assert ({made.key for made in chosen}, older) == ({"new", other["key"]}, 1)
    table1.draw(tmp_path, quiet=True)
    assert (
        "older records of these points, or of other scenes of their names: 1." in (tmp_path / "table1.md").read_text()
    )


def test_show_draws_again_and_says_what_is_wrong_with_a_folder(two_scenes, tmp_path, capsys):
    write_records(tmp_path, two_scenes)
    first = [file.read_bytes() for file in show("table1", tmp_path)]
    assert "Table 1: build, trace and shadow times" in capsys.readouterr().out
    assert [file.read_bytes() for file in show("table1", tmp_path, quiet=True)] == first
    assert capsys.readouterr().out == ""
    for name, folder, said in (
        ("tabel1", tmp_path, "did you mean table1"),
        ("table1", tmp_path / "elsewhere", "no such folder"),
        ("table1", tmp_path / "records", "no records"),
        ("figure2", tmp_path, "its records belong to table1, not to figure2; run shadowbench show table1 "),
    ):
        with pytest.raises(UserError, match=said):
            show(name, folder)


def test_a_folder_that_can_only_be_read_is_drawn_elsewhere(two_scenes, tmp_path):
    folder, out = write_records(tmp_path / "kept", two_scenes), tmp_path / "out"
    table1.draw(folder, quiet=True)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    for path in (folder / "table1.md", folder):
        path.chmod(0o555)
    files = show("table1", folder, quiet=True, out=out)
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
    assert {file.parent for file in files} == {out}
    for name in ("table1.csv", "table1.md", "table1.svg"):
        assert (out / name).read_bytes() == before[folder / name]
    assert sorted(path.name for path in out.iterdir()) == ["table1.csv", "table1.md", "table1.svg"], "no link stays"
    folder.chmod(0o755)
    (folder / "records" / "torn.json").write_text("{")
    with pytest.raises(UserError, match=re.escape(str(folder / "records" / "torn.json"))):
        show("claims", folder, quiet=True, out=out)
    (folder / "records" / "torn.json").unlink()
    with pytest.raises(UserError, match="has records of its own"):
        show("table1", folder, quiet=True, out=folder)
