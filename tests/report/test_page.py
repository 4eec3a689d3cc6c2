"""The page of a folder of results as a file: what is gathered, what is inside, and bad input."""

import json
import re

import pytest
import shadowbench
from helpers.experiment_records import record_of, write_records
from helpers.page_results import TREE, command, shared_results
from shadowbench.harness.report import document
from shadowbench.harness.report.page.gather import columns, gather, machine_of
from shadowbench.harness.results import tidy
from shadowbench.harness.runner.planning.experiment import Entry


@pytest.fixture(scope="module")
def results():
    return shared_results()


@pytest.fixture(scope="module")
def page(results):
    return results / "page.html"


def data_of(page):
    return json.loads(re.search(r'<script id="data"[^>]*>(.*?)</script>', page.read_text(), re.DOTALL)[1])


def test_the_page_is_one_file_without_an_address_to_fetch(page):
    html = page.read_text()
    assert "default-src 'none'" in html
    assert re.findall(r"""(?:src|href)=["'](?!#|data:)""", html.split('<script id="data"')[0]) == []
    assert data_of(page)["version"] == shadowbench.__version__
    assert "Leon Sorokin" in html, "the licence of the charting library"
    assert "<b>" not in html.split('<script id="data"')[1].split("</script>")[0], "no text of a record is markup"


def test_ratios_are_those_of_compare_and_unlike_points_have_none(page):
    data = data_of(page)
    ratio, point = data["ratios"]["columns"], data["points"]["columns"]
    text = lambda column, i: column["d"][column["i"][i]] if isinstance(column, dict) else column[i]  # noqa: E731
    found = {
        (text(point["title"], p), text(point["label"], p)): ratio["ratio"][i]
        for i, p in enumerate(ratio["point"])
        if (text(ratio["folder"], i), text(ratio["base"], i)) == ("frame_time", "tree")
    }
    assert found["Buddha (stand-in)", "grids"] == pytest.approx(0.25)
    assert ("Buddha (stand-in)", "map & <b>") not in found
    assert data["paper"]["label"].startswith("paper, GTX 280")
    notices = {one["name"]: one["notices"] for one in data["folders"]}
    assert any(line.startswith("Records of 2 versions of") for line in notices["figure11"])


def rows_of(packed):
    lists = {
        name: values if isinstance(values, list) else [i if i is None else values["d"][i] for i in values["i"]]
        for name, values in packed["columns"].items()
    }
    return [dict(zip(lists, row, strict=True)) for row in zip(*lists.values(), strict=True)]


def test_numbers_have_the_digits_and_marks_of_the_tables(page, results):
    """What Markdown writes, with the same marks; a mean over fewer frames is marked, and a difference below zero is none."""
    frames = document.frames(results)
    told = document.named(frames)["ms"].fillna("-")
    rows = rows_of(data_of(page)["points"])
    assert {f"{row['folder']}/{row['key']}": row["text.total_ms"] or "-" for row in rows} == dict(told)
    assert {row["text.total_ms"] for row in rows if row["folder"] == "other/frame_time"} == {"0.707", "2.73 [1/3]"}
    assert {row["text.build_ms"] for row in rows if row["light_label"] == "one light"} == {"~0"}


def test_the_best_is_marked_where_frames_are_unlike(page):
    """As Table 1 in Markdown: over the frames that both have."""
    rows = rows_of(data_of(page)["points"])
    best = [row["label"] for row in rows if row["folder"] == "other/frame_time" and row["best"]]
    assert best == ["grids"]


def test_folders_are_told_apart_however_they_are_reached(results, tmp_path, monkeypatch):
    """Links do not collapse into what they lead to, a folder is shown once, and a tree is one table and one page."""
    tree = tmp_path / "tree"
    (tree / "cards").mkdir(parents=True)
    (tree / "cards" / "one").symlink_to(results / "frame_time")
    (tree / "cards" / "two").symlink_to(results / "other" / "frame_time")
    (tree / "again").symlink_to(tree)
    assert command(monkeypatch, tree, "--out", tmp_path / "page.html") == 0
    data = data_of(tmp_path / "page.html")
    machines = {(row["folder"], row["machine"]) for row in rows_of(data["points"])}
    assert machines == {("cards/one", "A GPU"), ("cards/two", "Another GPU")}
    table = tidy(tree)
    assert set(table["folder"]) == {"cards/one", "cards/two"}
    assert table["key"].str.startswith("cards/").all()


def test_a_site_has_an_address_for_each_experiment(results, tmp_path, monkeypatch):
    site = tmp_path / "site"
    for folder in (results / "table1", results):  # a site may be written again
        assert command(monkeypatch, folder, "--site", site) == 0
    assert data_of(site / "index.html")["addresses"]
    own = (site / "frame_time" / "index.html").read_text()
    assert 'href="../index.html#view=table&amp;t=frame_time"' in own
    assert 'src="frame_time.svg"' in own
    assert (site / "frame_time" / "frame_time.svg").is_file()
    assert own.count('class="drawing lines"') == 1, "the theme turns lines around, and no picture"
    assert 'class="drawing"' in own
    assert "../../index.html#view=table" in (site / "other" / "frame_time" / "index.html").read_text()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "file").write_text("")
    assert command(monkeypatch, results, "--site", tmp_path / "full") == 2


def test_a_site_is_not_written_into_the_documentation(results, tmp_path, monkeypatch, capsys):
    """It would be copied into itself, and its first page lost."""
    monkeypatch.chdir(tmp_path)
    manual = tmp_path / "build" / "site" / "index.html"
    manual.parent.mkdir(parents=True)
    manual.write_text("the documentation")
    for place in ("build/site", "build/site/results"):
        assert command(monkeypatch, results, "--site", place) == 2
        assert "make docs writes" in capsys.readouterr().err
    assert manual.read_text() == "the documentation"


def test_columns_keep_what_is_not_known():
    import pandas as pd

    table = pd.DataFrame(
        {"a": ["x", None, "x"], "b": [1.23456789, float("nan"), 2.0], "c": pd.array([1, None, 3], "Int64")}
    )
    assert columns(table)["columns"] == {
        "a": {"d": ["x"], "i": [0, None, 0]},
        "b": [1.23457, None, 2],
        "c": [1, None, 3],
    }


@pytest.mark.parametrize("case", ["none", "empty", "half", "out", "below", "hidden", "full"])
def test_bad_input_is_one_line(case, results, tmp_path, monkeypatch, capsys):
    folder, words, said = tmp_path / "x", [], "no records in it"
    if case == "none":
        said = "no such folder"
    elif case == "empty":
        folder.mkdir()
    elif case == "half":
        write_records(folder, [record_of("table1", TREE)])
        path = next((folder / "records").glob("*"))
        path.write_text(path.read_text()[:200])
        said = "not a record"
    elif case == "out":
        folder, words, said = results / "table1", ["--out", tmp_path], "is a folder"
    elif case == "below":
        (tmp_path / "file").write_text("")
        folder, words, said = results / "table1", ["--out", tmp_path / "file" / "x.html"], "cannot write"
    elif case == "hidden":
        folder, words, said = results / "table1", ["--out", "/proc/x.html"], "shadowbench: /proc/x.html: cannot write"
    else:
        from shadowbench.harness.commands import report

        def full(*_):
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(report, "write_text", full)
        folder, said = results / "table1", "cannot write (No space left on device)"
    assert command(monkeypatch, folder, *words) == 2
    err = capsys.readouterr().err
    assert said in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize("gpus", [[10**30], "none", [{"name": 7}]])
def test_a_damaged_environment_is_left_out_of_the_page(gpus, tmp_path, capsys):
    made = record_of("table1", Entry("ray_grids"))
    write_records(tmp_path, [made])
    (tmp_path / "environments").mkdir()
    (tmp_path / "environments" / f"{made['environment']}.json").write_text(json.dumps({"gpus": gpus}))
    assert gather("a", document.sources(tmp_path))["environments"] == {}
    assert "not the facts of an environment" in capsys.readouterr().err


def test_a_gpu_without_a_name_is_told_so():
    assert machine_of({"gpus": [{}]}) == "unknown GPU"
