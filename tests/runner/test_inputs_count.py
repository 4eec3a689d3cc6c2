"""Every file that a scene is read from counts in the key of a point, and so does what was asked of it."""

from __future__ import annotations

from dataclasses import replace

import pytest
from helpers import mesh_files as files
from helpers.tiny_runs import options
from shadowbench.harness.results.folder import ResultsFolder
from shadowbench.harness.runner.experiment import Entry
from shadowbench.harness.runner.points import describe_method, make_point
from shadowbench.harness.runner.protocol import load_command
from shadowbench.harness.runner.scene_cache import known_scene, learn_scene
from shadowbench.harness.runner.worker import Worker
from shadowbench.harness.scene.chosen_view import ChosenView
from shadowbench.harness.scene.overrides import Lighting
from shadowbench.harness.scene.readers.checks import Wanted

ENTRY = Entry("warp_bvh")


def key_of(folder, scene, view=None) -> str:
    """The key of a point on a scene, as a run makes it: from the facts that are known, else from the worker's."""
    asked = options(folder, [str(scene)], ["warp_bvh"], frames=1)
    asked = replace(asked, view=view or ChosenView())
    results = ResultsFolder(folder)
    command = load_command(asked, results, Lighting(), str(scene), make=True)
    facts = known_scene(results, command)
    if facts is None:
        facts = Worker().do(dict(command))["scene"]
        learn_scene(results, command, facts)
    return make_point("trial", asked.preset, ENTRY, facts, describe_method(ENTRY, "cpu"), 0).key


@pytest.fixture
def waves(tmp_path):
    """A folder of five numbered frames."""
    folder = tmp_path / "waves"
    folder.mkdir()
    for number in range(5):
        files.written(folder, f"wave_{number}.ply", files.ply_binary(files.QUAD + number))
    return folder


def test_every_frame_of_a_folder_counts(waves, tmp_path):
    """Only the middle frame is measured; its neighbours move what is measured with them, such as the automatic view."""
    keys = [key_of(tmp_path / "out", waves)]
    assert key_of(tmp_path / "out", waves) == keys[0]
    for number in range(5):
        file = waves / f"wave_{number}.ply"
        file.write_bytes(file.read_bytes().replace(b"comment by hand", b"comment of mine"))
        keys.append(key_of(tmp_path / "out", waves))
    assert len(set(keys)) == 6


def test_what_is_asked_of_a_file_counts(waves, tmp_path):
    asked = [Wanted(), Wanted((0, 4, 1)), Wanted((0, 4, 2)), Wanted(rate=24.0), Wanted(allow_missing=True)]
    keys = [key_of(tmp_path / "out", waves, ChosenView(wanted=wanted)) for wanted in asked]
    assert len(set(keys)) == len(asked)
