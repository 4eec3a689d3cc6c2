"""``advise`` as it is called; the tables of ``plan``; the compiled kernels on the disk, shown and cleared by ``cache``."""

import dataclasses
import io
import json
import os
import subprocess
import sys

import pytest
import warp as wp
from rich.console import Console
from shadowbench.harness.commands.cache import cache
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.devices import CACHE
from shadowbench.harness.report.terminal import GAP, table_blocks
from shadowbench.harness.runner.planning.experiment import Entry, find_experiment

NAMES = ["pass", "first frame", "camera", *(f"light {i}" for i in range(5)), "geometry", "nothing"]
ROWS = [
    ["light 0: clear counts", 'read by "light 0: shadow rays"', *["(shadow counts/0)"] * 6, "points", "."],
    ["mirrors: triangles", "output shadowed/0/1", *["light rectangle/0"] * 6, "light triangles/0", "."],
]


def printed(width: int) -> list[list[str]]:
    """The lines of each block, at a width."""
    blocks = []
    for table in table_blocks(NAMES, ROWS, width):
        console = Console(file=io.StringIO(), width=width, markup=False, highlight=False)
        console.print(table)
        blocks.append(console.file.getvalue().splitlines())
    return blocks


@pytest.mark.parametrize("width", [60, 80, 120, 160, 400])
def test_words_stay_whole_and_every_column_is_there_once(width):
    words = {word for row in [NAMES, *ROWS] for cell in row for word in cell.split()}
    blocks = printed(width)
    shown = [line for lines in blocks for line in lines]
    assert all(len(line) <= width for line in shown)
    assert {word for line in shown for word in line.split()} == words
    headings = [line for lines in blocks for line in lines[:1]]
    assert [heading.split()[0] for heading in headings] == ["pass"] * len(blocks)
    later = " ".join(" ".join(heading.split()[1:]) for heading in headings)
    assert later == " ".join(NAMES[1:])


def test_what_fits_is_one_table_without_broken_lines():
    (lines,) = printed(400)
    assert len(lines) == 1 + len(ROWS)
    assert len(printed(80)) > 1


def test_a_column_that_is_wider_than_the_terminal_is_a_table_of_its_own():
    (table,) = table_blocks(["pass", "first"], [["a", "x" * 50]], 20)
    assert [column.width for column in table.columns] == [4, 50]
    assert 4 + 50 + 2 * GAP > 20


def test_plan_breaks_no_word_at_80_columns(call, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    command = ("plan", "fairy", "--method", "perspective_spherical", "--size", "16x16", "--device", "cpu")
    code, out, _ = call(*command)
    assert code == 0
    assert "declared closed: no" in out
    words = out.split()
    for word in ("rectangle/0", "shadowed/0", "triangles", "geometry", "nothing", "camera"):
        assert word in words
    assert max(map(len, out.splitlines())) <= 80


def test_camera_lights_and_frame_are_taken(call, refused_call, scene):
    asked = ("plan", scene, "--method", "uniform_grid", "--size", "8x8", "--device", "cpu", "--json")
    code, out, _ = call(*asked, "--camera", "1,2,3", "0,0.5,0", "--light", "4,5,6", "--light", "7,8,9", "--frame", "0")
    assert code == 0
    found = json.loads(out)
    assert found["declared"]["camera"] == "fixed, from 1,2,3 to 0,0.5,0"
    assert [one.split(", ")[-1] for one in found["declared"]["lights"]] == ["at 4,5,6", "at 7,8,9"]
    assert set(found["changes"]) == {"camera", "light 0", "light 1", "geometry", "nothing"}
    assert found["frame"] == 0
    assert f"--frame 3: {scene} has frames 0 to 0" in refused_call(*asked, "--frame", "3")


@pytest.fixture
def short(tmp_path, monkeypatch):
    """A shortlist of two methods at a tiny size, and an empty folder to work in."""
    monkeypatch.chdir(tmp_path)
    presets = find_experiment("advise").presets
    few = (Entry("uniform_grid", {}, "uniform grid"), Entry("ray_grids", {}, "ray grids"))
    tiny = dataclasses.replace(presets["quick"], methods=few, samples=2, most=2, rounds=1)
    monkeypatch.setitem(presets, "quick", tiny)


@pytest.mark.slow
def test_it_measures_and_answers_then_only_answers(call, scene, short, tmp_path):
    asked = ("advise", scene, "--size", "8x8", "--device", "cpu", "--lights", "2", "--moves", "light")
    code, out, err = call(*asked)
    assert code == 0
    text = " ".join(out.split())
    assert ", 2 lights, a light moves: the fastest exact method is" in text
    assert ", 2 lights, a light moves, fastest first" in text
    assert "What would change the answer is not known" in text
    assert "This may take" in err, "the time is stated before it begins"
    folder = tmp_path / "results" / "local" / "advise-tetra-cpu-8x8-2-lights-a-light-moves"
    assert len(list((folder / "records").glob("*.json"))) == 2

    code, out, err = call(*asked, "--json")
    assert (code, err) == (0, "")
    answer = json.loads(out)["answer"]
    (one,) = answer["scenes"]
    assert {row["method"] for row in one["methods"]} == {"uniform grid", "ray grids"}
    assert all(row["true_errors"] == 0 and row["total_ms"] > 0 for row in one["methods"])
    assert len(one["sentences"]) == 2


@pytest.mark.parametrize(("words", "said"), [
    (["--lights", "0"], "--lights 0: must be 1 to 1024"),
    (["--moves", "camra"], "--moves 'camra': unknown; did you mean camera?"),
    (["--moves", "everything"], "--moves 'everything': unknown; known: all, camera, light, part\n"),
    (["--lights", "2", "--light", "1,2,3"], "--lights and --light: give the number of lights or their places"),
    (["--size", "9"], "--size '9': write it as WIDTHxHEIGHT"),
])  # fmt: skip
def test_a_wrong_word_is_one_line(refused_call, scene, words, said):
    assert said in refused_call("advise", scene, *words)


@pytest.fixture
def kernels(tmp_path, monkeypatch):
    """A folder as Warp leaves it: two versions, and what is not of it."""
    place = tmp_path / "warp" / "1.19.0"
    for folder in (
        place / "wp_a_1234",
        place / "lto",
        place.parent / "1.18.0" / "wp_b",
        place / "mine",
        tmp_path / "wp_c",
    ):
        folder.mkdir(parents=True)
        (folder / "kernel.o").write_bytes(bytes(1000))
    (place / "wp_link").symlink_to(tmp_path / "wp_c")
    (place / "wp_file").write_text("")
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(place))
    return place


def test_it_shows_and_clears_compiled_modules_alone(kernels, capsys):
    assert cache("show", as_json=True) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown == {"folder": str(kernels), "modules": 3, "bytes": 3000, "cleared": False}
    assert cache("clear") == 0
    assert f"3 compiled modules, 0 MB, removed from {kernels}" in capsys.readouterr().out
    assert sorted(path.name for path in kernels.iterdir()) == ["mine", "wp_file", "wp_link"]
    assert list((kernels.parent / "1.18.0").iterdir()) == []
    assert (kernels.parents[1] / "wp_c" / "kernel.o").is_file()
    cache("show")
    assert capsys.readouterr().out.startswith("0 compiled modules")


def test_a_folder_that_was_chosen_is_not_left(kernels, monkeypatch, capsys):
    """Its neighbours are not Warp's."""
    chosen = kernels.parents[1] / "chosen"
    (chosen / "wp_d").mkdir(parents=True)
    (chosen.parent / "1.0.0" / "wp_e").mkdir(parents=True)
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(chosen))
    cache("clear")
    assert capsys.readouterr().out.startswith("1 compiled modules")
    assert (chosen.parent / "1.0.0" / "wp_e").is_dir()


def test_another_action_is_refused():
    with pytest.raises(UserError, match="give show or clear"):
        cache("empty")


def test_a_home_that_cannot_be_written_is_one_line():
    """Below /proc nobody makes a folder, root included."""
    environment = {name: value for name, value in os.environ.items() if name not in ("XDG_CACHE_HOME", CACHE)}
    ended = subprocess.run(
        [sys.executable, "-m", "shadowbench", "plan", "balls-1k", "--method", "embree"],
        env={**environment, "HOME": "/proc"}, capture_output=True, text=True,
    )  # fmt: skip
    assert (ended.returncode, ended.stderr.count("\n")) == (2, 1)
    assert f"set {CACHE} to a folder that can be written" in ended.stderr
