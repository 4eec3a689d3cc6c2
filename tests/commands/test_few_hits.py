"""A check that checks nothing says so: verify, check and run warn where hardly a ray hits anything."""

import json
from dataclasses import replace

import pytest
from helpers.tiny_runs import options, write_scene
from shadowbench.harness.commands.check import check
from shadowbench.harness.commands.run import run
from shadowbench.harness.commands.verify import verify
from shadowbench.harness.scene.chosen_view import ChosenView
from shadowbench.harness.scene.facts import few_hits

AWAY = ((9.0, 9.0, 9.0), (20.0, 20.0, 20.0))
FEW = "hit anything, fewer than 1%: this checked misses, and little else"


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return write_scene(tmp_path_factory.mktemp("scene") / "tetra.obj")


def test_the_warning_begins_below_a_hundredth():
    assert few_hits(10, 1000) == few_hits(1, 100) == few_hits(0, 0) == ""
    assert few_hits(9, 1000) == f"warning: 9 of 1,000 rays {FEW}; choose another --camera"


@pytest.mark.parametrize("away", [False, True])
def test_verify_warns(scene, capsys, away):
    camera = tuple(",".join(map(str, place)) for place in AWAY) if away else None
    assert verify([scene], method=["uniform_grid"], device="cpu", size="16x16", camera=camera, as_json=True) == 0
    (report,) = json.loads(capsys.readouterr().out)["scenes"]
    assert (FEW in report["warning"]) == away
    assert (report["hits"] == 0) == away
    verify([scene], method=["uniform_grid"], device="cpu", size="16x16", camera=camera)
    assert ("0 of 256 rays hit anything" in " ".join(capsys.readouterr().out.split())) == away


@pytest.mark.parametrize("away", [False, True])
def test_run_warns(scene, tmp_path, capsys, away):
    asked = options(tmp_path, [scene], ["uniform_grid"], rounds=1, frames=1)
    if away:
        asked = replace(asked, view=ChosenView(AWAY))
    for _ in range(2):  # the second time from the records
        assert run(asked, as_json=True) == 0
        out = capsys.readouterr()
        warnings = json.loads(out.out)["warnings"]
        assert [FEW in text and text.startswith("tetra: 0 of 64") for text in warnings] == [True] * away


def test_check_warns_where_its_cases_hit_nothing(capsys):
    found = {}
    for case in ("P11b", "P15"):
        check("uniform_grid", device="cpu", case=[case], as_json=True)
        found[case] = json.loads(capsys.readouterr().out)["warning"]
    assert FEW in found["P11b"]
    assert found["P15"] == ""
