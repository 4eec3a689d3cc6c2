"""What ``advise`` says: methods sorted by time, two sentences, and what would change the answer."""

import json

import pytest
from helpers.experiment_records import csv_of, record_of, write_records
from shadowbench.experiments import advise
from shadowbench.harness.commands.show import show
from shadowbench.harness.runner.planning import survey
from shadowbench.harness.runner.planning.experiment import Entry, find_experiment
from shadowbench.harness.runner.planning.time_estimate import guess
from shadowbench.harness.scene.overrides import Lighting

pytestmark = pytest.mark.usefixtures("unpainted")

OURS, TREE = Entry("ray_grids", {}, "ray grids"), Entry("bvh2", {}, "BVH2 rebuilt")
LOOSE = Entry("bvh2", {"precision": "float32"}, "BVH2 rebuilt, float32")


def wrong(record, count):
    record["frames"][0]["score"]["true_errors"] = count
    return record


def on(record, device, name):
    record["method"] |= {"device": device, "device_name": name}
    record["key"] += f"-{device[:3]}"
    return record


def advised(folder, monkeypatch):
    monkeypatch.chdir(folder)
    made = [record_of("advise", TREE, ms=2.0), wrong(record_of("advise", LOOSE, ms=1.0), 518),
            record_of("advise", OURS, ms=3.0)]  # fmt: skip
    files = show("advise", write_records(folder / "out", made), quiet=True)
    assert {file.name for file in files} == {"advise.csv", "advise.json", "advise.md"}
    return (folder / "out" / "advise.md").read_text(), json.loads((folder / "out" / "advise.json").read_text())


def test_the_answer_is_a_sorted_table_and_two_sentences(tmp_path, monkeypatch):
    text, said = advised(tmp_path, monkeypatch)
    two = [
        "Cloth (stand-in): the fastest exact method is BVH2 rebuilt with 2.02 ms a frame; the next, ray grids, takes 1.50 "
        "times as long.",
        "The fastest of all is BVH2 rebuilt, float32 with 1.01 ms: 518 of its answers are wrong.",
    ]
    assert " ".join(two) in text
    (scene,) = said["scenes"]
    assert scene["sentences"] == two
    assert [row["method"] for row in scene["methods"]] == ["BVH2 rebuilt, float32", "BVH2 rebuilt", "ray grids"]
    assert [row["true_errors"] for row in scene["methods"]] == [518, 0, 0]
    assert [row["exact"] for row in scene["methods"]] == [False, True, True]
    assert [row["in_each_frame"] for row in scene["methods"]] == ["rebuilds its tree"] * 2 + ["sorts its rays"]
    assert "| BVH2 rebuilt, float32 | 1.01 | 0.500 | ✗ 518 wrong | 0.0 | rebuilds its tree |" in text


def test_of_the_hybrid_it_says_whether_a_tree_was_rebuilt(tmp_path, monkeypatch):
    """It chooses by the scene and its lights."""
    grid = {"shadows": "grid", "structure": "rays in the grid, triangles streamed", "queues": True}
    tree = {"shadows": "tree", "update": "rebuild", "tree": "hploc"}
    both = "sorts its rays, rebuilds its tree"
    monkeypatch.chdir(tmp_path)
    for name, built, words in (("grid", grid, "sorts its rays"), ("tree", tree, both), ("mirror", tree | grid, both)):
        record = record_of("advise", advise._rivals.HYBRID, ms=1.0)
        record["method"]["built"] = built
        show("advise", write_records(tmp_path / name, [record, record_of("advise", TREE, ms=2.0)]), quiet=True)
        (scene,) = json.loads((tmp_path / name / "advise.json").read_text())["scenes"]
        assert [row["in_each_frame"] for row in scene["methods"]] == [words, "rebuilds its tree"]
        assert f"| {words} |" in (tmp_path / name / "advise.md").read_text()
        (row,) = (row for row in csv_of("advise", tmp_path / name) if row["label"] == "hybrid")
        assert row["in_each_frame"] == words


def test_without_records_of_crossover_it_says_how_to_get_them(tmp_path, monkeypatch):
    text, said = advised(tmp_path, monkeypatch)
    (change,) = said["what_would_change_it"]
    assert "no records of crossover on a GPU are in results/; `shadowbench run crossover` measures it" in change
    assert "What would change the answer is not known" in text


def swept(device="cuda:0", name="Imaginary GPU"):
    """The tree wins from four lights on; ray grids at every size."""
    made = []
    for count, tree in ((1, 2.0), (2, 1.9), (4, 0.5), (8, 0.5)):
        lit = Lighting(f"{count} lights", count=count)
        made += [record_of("crossover", entry, "balls-1k", lit, ms=ms) for entry, ms in ((OURS, 1.0), (TREE, tree))]
        made.append(wrong(record_of("crossover", LOOSE, "balls-1k", lit, ms=0.1), 3))
    lit = Lighting("1 lights", count=1)
    made += [
        record_of("crossover", entry, "balls-1k", lit, ms=ms, size=128) for entry, ms in ((OURS, 1.0), (TREE, 3.0))
    ]
    return [on(record, device, name) for record in made]


def test_what_would_change_it_is_read_from_crossover(tmp_path, monkeypatch):
    write_records(tmp_path / "results" / "machine" / "crossover", swept())
    write_records(tmp_path / "results" / "local" / "crossover-quick", swept("cpu", "A processor"))
    _, said = advised(tmp_path, monkeypatch)
    assert said["what_would_change_it"] == [
        "What would change the answer (crossover on Imaginary GPU, scenes of balls): from 1 to 8 lights the fastest exact "
        "method is first ray grids, from 4 BVH2 rebuilt; from 64² to 128² pixels ray grids stays the fastest exact method."
    ]


def test_records_of_another_kind_of_device_do_not_tell(tmp_path, monkeypatch):
    write_records(tmp_path / "results" / "local" / "crossover-quick", swept("cpu", "A processor"))
    _, said = advised(tmp_path, monkeypatch)
    assert "is not known" in said["what_would_change_it"][0]


@pytest.mark.parametrize("scene", ["cloth", "sibenik", "buddha"])
def test_it_takes_about_two_minutes_on_a_cpu_and_half_a_minute_on_a_gpu(scene):
    presets = find_experiment("advise").presets
    for preset, device, most in ((presets["quick"], "cpu", 150.0), (presets["paper"], "cuda:0", 40.0)):
        seconds = len(preset.methods) * guess(scene, preset, 0, device)
        assert 10.0 < seconds < most
        assert survey.duration(seconds)


def test_every_method_of_the_shortlist_says_what_it_rebuilds():
    labels = {e.label for preset in find_experiment("advise").presets.values() for e in preset.methods}
    assert labels <= set(advise._rivals.REBUILDS)
