"""A camera and lights of the command line: every command that traces a scene sees them, and a record holds them."""

import json
from dataclasses import replace

import pytest
from helpers.experiment_records import record_of, write_records
from helpers.tiny_runs import options
from shadowbench.harness.commands.explain import explain
from shadowbench.harness.commands.run import plan_run
from shadowbench.harness.commands.show import show
from shadowbench.harness.commands.verify import verify
from shadowbench.harness.errors import UserError
from shadowbench.harness.results.folder import ResultsFolder
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.runner.planning.survey import known_scene, learn_scene
from shadowbench.harness.runner.workers.executor import Worker
from shadowbench.harness.runner.workers.protocol import load_command
from shadowbench.harness.scene.chosen_view import ChosenView
from shadowbench.harness.scene.overrides import Lighting

VIEW = ChosenView(((3.0, 2.0, 1.0), (0.0, 0.5, 0.0)), 30.0, ((0.0, 9.0, 0.0), (4.0, 1.0, 0.0)))
AWAY = ("9,9,9", "20,20,20")
"""A camera that looks away from the tetrahedron."""


def test_what_is_given_goes_through_json():
    assert ChosenView.read(json.loads(json.dumps(VIEW.facts()))) == VIEW
    assert ChosenView.read(None) == ChosenView.read(ChosenView().facts()) == ChosenView()
    assert VIEW.changes
    assert not ChosenView().changes


def test_a_worker_loads_the_scene_as_it_is_to_be_seen(scene, tmp_path):
    plain = options(tmp_path, [scene], ["warp_bvh"])
    folder, facts = ResultsFolder(tmp_path), {}
    for name, chosen in (("plain", plain), ("seen", replace(plain, view=VIEW))):
        command = load_command(chosen, folder, Lighting(), scene, make=True)
        assert known_scene(folder, command) is None
        facts[name] = Worker().do(dict(command))["scene"]
        learn_scene(folder, command, facts[name])
    assert facts["seen"]["camera"] != facts["plain"]["camera"]
    assert tuple(facts["seen"]["camera"]["eye"]) == VIEW.camera[0]
    assert facts["seen"]["camera"]["fov"] == 30.0
    assert [tuple(light["position"]) for light in facts["seen"]["lights"]] == list(VIEW.lights)
    assert facts["seen"]["view"].startswith("camera 3,2,1 to 0,0.5,0; field of view 30 degrees; light 0,9,0;")
    assert "view" not in facts["plain"]
    assert facts["seen"]["arrays_sha256"] == facts["plain"]["arrays_sha256"]


def test_a_run_checks_the_camera_before_it_starts(scene, tmp_path):
    chosen = plan_run("table1", "quick", "cpu", scenes=[scene], out=tmp_path, view=VIEW)
    assert chosen.described(scene).lights[1].position == VIEW.lights[1]
    with pytest.raises(UserError, match="eye and target must be finite and different"):
        plan_run("table1", "quick", "cpu", [scene], out=tmp_path, view=ChosenView(((1.0, 2.0, 3.0),) * 2))


def test_a_table_names_the_view(tmp_path, capsys):
    made = record_of("table1", Entry("ray_grids", {}, "ray grids"))
    made["scene"]["view"] = VIEW.text()
    write_records(tmp_path, [made])
    show("table1", tmp_path)
    assert "camera 3,2,1 to 0,0.5,0" in capsys.readouterr().out


def test_verify_and_explain_look_from_there(scene, capsys):
    arguments = {"method": ["warp_bvh"], "device": "cpu", "size": "8x8", "as_json": True}
    for camera in (None, AWAY):
        assert verify([scene], camera=camera, light=["0,9,0", "9,0,0"], **arguments) == 0
        (row,) = json.loads(capsys.readouterr().out)["scenes"][0]["methods"]
        assert (sum(light["scored"] for light in row["score"]["shadow"]) > 0) == (camera is None)
        assert len(row["score"]["shadow"]) == 2
    explain(scene, "4,4", camera=AWAY, **arguments)
    assert json.loads(capsys.readouterr().out)["exact"]["triangle"] == -1
