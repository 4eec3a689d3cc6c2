"""What of a file was left out or approximated: one line when it is loaded, in the record, the report and the page."""

import json

import pytest
from helpers import mesh_files as files
from shadowbench.harness import errors
from shadowbench.harness.commands.report import report
from shadowbench.harness.commands.run import plan_run, run
from shadowbench.harness.results import tidy
from shadowbench.harness.scene.catalogue import resolve

FEW = {"rounds": 1, "samples": 3, "frames": 1}
LEFT_OUT = "lines left out; materials left out"


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A file with materials and lines."""
    text = files.obj() + b"usemtl red\nl 1 2\nusemtl blue\n"
    return str(files.written(tmp_path_factory.mktemp("scene"), "house.obj", text))


def test_one_line_says_so_when_it_is_loaded(scene, capsys):
    errors.note.cache_clear()
    for _ in range(2):
        assert resolve(scene).source.left_out == LEFT_OUT
    assert capsys.readouterr().err == f"shadowbench: note: house.obj: {LEFT_OUT}\n"


def test_it_stands_in_the_record_the_report_and_the_page(scene, tmp_path, capsys):
    asked = plan_run("table1", "quick", "cpu", [scene], ["uniform_grid"], out=tmp_path, size="8x8", overrides=FEW)
    assert run(asked) == 0
    line = f"house.obj, as read: {LEFT_OUT}."
    assert line in " ".join(capsys.readouterr().out.split())
    (file,) = (tmp_path / "records").glob("*.json")
    assert json.loads(file.read_text())["scene"]["source"]["left_out"] == LEFT_OUT
    assert set(tidy(tmp_path)["left_out"]) == {LEFT_OUT}
    assert line in (tmp_path / "table1.md").read_text()
    report(tmp_path, tmp_path / "page.html")
    assert line in (tmp_path / "page.html").read_text()
