"""Every file that a scene is read from counts in the key of a point, and so does what was asked of it."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import mesh_files as files
from helpers.tiny_runs import options
from shadowbench.harness.commands.run import with_whole_paths
from shadowbench.harness.results.folder import ResultsFolder
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.runner.planning.planned_point import describe_method, make_point
from shadowbench.harness.runner.planning.survey import known_scene, learn_scene
from shadowbench.harness.runner.workers.executor import Worker
from shadowbench.harness.runner.workers.protocol import load_command
from shadowbench.harness.scene import catalogue, chosen_view
from shadowbench.harness.scene.chosen_view import ChosenView
from shadowbench.harness.scene.overrides import Lighting
from shadowbench.harness.scene.readers.checks import Wanted
from shadowbench.harness.scene.scene import AlphaMask

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


def test_every_mesh_of_a_declaration_counts(waves, tmp_path):
    room = files.written(tmp_path, "room.obj", b"# a room\n" + files.obj())
    stl = files.written(tmp_path, "box.stl", files.stl_binary())
    meshes = "".join(f'[[meshes]]\nfile = "{name}"\n' for name in ("room.obj", "waves/wave_%d.ply", "box.stl"))
    scene = files.written(tmp_path, "scene.toml", meshes.encode())
    keys = [key_of(tmp_path / "out", scene)]
    assert key_of(tmp_path / "out", scene) == keys[0]
    for path, old, new in [
        (room, b"# a room", b"# a hall"),
        (stl, bytes(80), b"\1" + bytes(79)),
        *((waves / f"wave_{number}.ply", b"by hand", b"by mine") for number in range(5)),
        (scene, b'file = "box.stl"', b'file  = "box.stl"'),
    ]:
        blob = path.read_bytes()
        assert old in blob
        path.write_bytes(blob.replace(old, new, 1))
        keys.append(key_of(tmp_path / "out", scene))
    assert len(set(keys)) == len(keys)


def test_what_is_behind_a_mask_of_holes_counts(tmp_path, monkeypatch):
    """A mask may be made from a texture that no file of the mesh names: its bits count."""
    path = files.written(tmp_path, "a.ply", files.ply_binary())
    bits = np.array([[1, 0], [0, 1]], dtype=np.uint8)
    plain = catalogue.resolve(path)
    coordinates = np.zeros((4, 3, 2), dtype=np.float32)

    def holed(name, scene_dir=None, wanted=None):
        return replace(plain, alpha=lambda _: AlphaMask(np.ones(4, np.uint8), coordinates, bits.copy()))

    monkeypatch.setattr(chosen_view, "resolve", holed)
    keys = [key_of(tmp_path / "one", path)]
    bits[0, 0] = 0
    keys.append(key_of(tmp_path / "two", path))
    coordinates[0, 0, 0] = 0.5
    keys.append(key_of(tmp_path / "three", path))
    assert len(set(keys)) == 3


def test_workers_in_other_folders_get_whole_paths(waves, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    files.written(tmp_path, "a.ply", files.ply_binary())
    names = ["a.ply", "waves", "waves/wave_%d.ply", "waves/*.ply", "cloth", "balls-300k"]
    whole = with_whole_paths(options(tmp_path / "out", names, ["uniform_grid"])).preset.scenes
    assert whole[:4] == tuple(str(tmp_path / name) for name in names[:4])
    assert whole[4:] == ("cloth", "balls-300k")
    monkeypatch.chdir("/")
    assert catalogue.resolve(whole[2]).geometry().frame_count == 5
