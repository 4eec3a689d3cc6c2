"""``advise`` as it is called: its words, where its results go, and what it prints."""

import dataclasses
import json

import pytest
from shadowbench.harness.runner.planning.experiment import Entry, find_experiment


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


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--lights", "0"], "--lights 0: must be 1 to 1024"),
        (["--moves", "camra"], "--moves 'camra': unknown; did you mean camera?"),
        (["--moves", "everything"], "--moves 'everything': unknown; known: all, camera, light, part\n"),
        (["--lights", "2", "--light", "1,2,3"], "--lights and --light: give the number of lights or their places"),
        (["--size", "9"], "--size '9': write it as WIDTHxHEIGHT"),
    ],
)
def test_a_wrong_word_is_one_line(refused_call, scene, words, said):
    assert said in refused_call("advise", scene, *words)
