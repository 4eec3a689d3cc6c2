"""A second run into a folder that was damaged: what it measures and draws again."""

import json
import os
from pathlib import Path

import pytest
from helpers.experiment_records import record_of
from helpers.tiny_runs import go, options, write_scene
from shadowbench.harness.results.folder import ResultsFolder
from shadowbench.harness.results.schema import read_records
from shadowbench.harness.runner.planning.experiment import Entry


@pytest.fixture(scope="module")
def finished(scene, tmp_path_factory):
    """A run that has ended: its options, its folder and its record."""
    out = tmp_path_factory.mktemp("finished")
    chosen = options(out, [str(scene)], ["warp_bvh"])
    (record,) = go(chosen).values()
    return chosen, out, record


@pytest.mark.slow
@pytest.mark.parametrize("damage", [lambda whole: None, lambda whole: whole[: len(whole) // 2]])
def test_a_picture_that_is_gone_or_damaged_is_drawn_again(finished, damage):
    chosen, out, first = finished
    picture = out / "images" / "tetra-8x8.png"
    whole = picture.read_bytes()
    left = damage(whole)
    picture.unlink()
    if left is not None:
        picture.write_bytes(left)
    (again,) = go(chosen).values()
    assert again == first, "nothing is measured anew"
    assert picture.read_bytes() == whole
    assert not list((out / "journal").iterdir())


@pytest.mark.parametrize("text", ["", "{", "[]", "[1]", "{}", '{"status": "ok"}', '{"key": "a", "status": "ok"}'])
def test_what_is_no_whole_record_is_measured_again(tmp_path, text):
    path = tmp_path / "records" / "a.json"
    path.parent.mkdir()
    path.write_text(text)
    assert ResultsFolder(tmp_path).record("a") is None
    whole = record_of("table1", Entry("warp_bvh"))
    path.write_text(json.dumps({**whole, "key": "a"}))
    assert ResultsFolder(tmp_path).record("a").key == "a"
    path.write_text(json.dumps({**whole, "key": "a", "point": {**whole["point"], "width": "abc"}}))
    assert ResultsFolder(tmp_path).record("a") is None


def test_a_file_of_an_odd_name_is_measured_and_read_again(tmp_path):
    """Bytes that are no text, a code of a terminal, HTML."""
    scene = write_scene(Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff\x1b[31m<b>.obj")))
    (record,) = go(options(tmp_path / "out", [scene], ["warp_bvh"])).values()
    assert record.status == "ok", record.reason
    (read,) = read_records(tmp_path / "out")
    assert (read.key, read.scene) == (record.key, record.scene)
    assert read.scene["title"] == read.scene["source"]["file"] == r"\udcff\x1b[31m<b>.obj"
