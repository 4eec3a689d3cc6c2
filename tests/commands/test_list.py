"""``list``: what each method is, the parameters of one, the triangles of scenes; and what a listing must not import."""

import json
import subprocess
import sys

import pytest
from shadowbench.harness.frame import registry
from shadowbench.harness.scene.names import TRIANGLES

SLOW = {"warp", "pandas", "matplotlib", "scipy", "embreex"}
LOADED = """
import sys
from shadowbench.harness.cli import main
try:
    main()
except SystemExit as end:
    assert not end.code, end.code
print(sorted(set(sys.modules) & {names}), file=sys.stderr)
"""


def loaded(names, *words) -> str:
    """Which of the packages a command has imported."""
    done = subprocess.run([sys.executable, "-c", LOADED.format(names=names), *words], capture_output=True, text=True)
    return done.stderr.splitlines()[-1]


@pytest.mark.parametrize(("words", "names"), [
    (["--version"], SLOW | {"numpy", "trimesh", "rich"}), (["list", "methods"], SLOW | {"pxr", "trimesh"}),
    (["list", "experiments"], SLOW | {"pxr", "trimesh"}), (["list", "scenes"], SLOW | {"trimesh"}),
])  # fmt: skip
def test_a_short_answer_imports_nothing_slow(words, names):
    assert loaded(names, *words) == "[]"


def test_methods_are_a_table_with_a_sentence_each(call, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    code, text, _ = call("list", "methods")
    assert code == 0
    lines = text.splitlines()
    assert len(lines) < 40
    assert " ".join(text.split()).count("Rays in grid cells, with the triangles streamed over them") == 1
    assert [name for name in registry.method_names() if not any(line.startswith(f"{name} ") for line in lines)] == []
    assert "origin = " not in text, "parameters are asked for"


def test_of_a_named_method_the_parameters_are_listed(call):
    code, text, _ = call("list", "methods", "warp_bvh")
    assert code == 0
    assert "update = " in text
    assert "Warp's bounding volume hierarchies" in " ".join(text.split())
    assert "kdtree" not in text
    (row,) = json.loads(call("list", "methods", "warp_bvh", "--json")[1])
    assert (row["name"], "update" in row["parameters"]) == ("warp_bvh", True)


def test_a_method_lists_every_kind_of_device_that_a_setting_lets_it_run_on(call):
    (row,) = json.loads(call("list", "methods", "driver", "--json")[1])
    assert set(row["devices"]) == {"cpu", "cuda"}


def test_experiments_have_a_sentence_each_and_a_named_one_its_presets(call, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    text = call("list", "experiments")[1]
    assert "Where one structure becomes faster than another" in text
    assert "256x256" not in text, "presets are asked for"
    assert "quick: 64x64 to 256x256" in call("list", "experiments", "crossover")[1], "of several sizes the range"


def test_scenes_have_their_triangle_counts_and_stand_ins_are_told(call):
    rows = {row["name"]: row for row in json.loads(call("list", "scenes", "--json")[1])}
    assert {name: rows[name]["triangles"] for name in TRIANGLES} == TRIANGLES
    assert "stand-in" in rows["cloth"]["stand_in"]
    assert rows["bunny"]["stand_in"] is None
    assert "warp-lang" in rows["bunny"]["about"]
    assert "balls-300k" in rows["balls-N"]["about"]


@pytest.mark.parametrize(
    ("kind", "told"), [("methods", "warp_bvh"), ("scenes", "174,114 triangles"), ("experiments", "table1")]
)
def test_lists_are_as_wide_as_the_terminal(call, kind, told, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    text = call("list", kind)[1]
    assert told in " ".join(text.split())
    assert max(map(len, text.splitlines())) <= 80


@pytest.mark.parametrize(("text", "said"), [
    ("One thing. Another.", "One thing."),
    ("By Wald et al. 2006, on\nthe CPU.\n\nMore.", "By Wald et al. 2006, on the CPU."),
    ("No full stop", "No full stop"),
])  # fmt: skip
def test_the_first_sentence_of_a_docstring(text, said):
    assert registry.first_sentence(text) == said


def test_what_was_left_out_is_said_beside_the_notes(call):
    code, text, err = call("list", "scenes", "bunny", "--rate", "25", "--json")
    assert code == 0, err
    (row,) = json.loads(text)
    assert row["about"].startswith("a real mesh, bunny.usd of the warp-lang package; ")
    assert row["about"].endswith("--rate does nothing, because there is one frame")
