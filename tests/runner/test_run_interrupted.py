"""Folders that cannot be written, pictures of a scene that has changed, what a killed run was writing."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.tiny_runs import go, options, write_scene
from shadowbench.harness.errors import UserError
from shadowbench.harness.results.folder import ResultsFolder
from shadowbench.harness.results.journal import Journal
from shadowbench.harness.runner import run as run_module
from shadowbench.harness.runner.progress import Silent
from shadowbench.harness.runner.run import Run


def test_a_full_folder_keeps_what_was_measured_and_goes_on(package, scene, tmp_path, monkeypatch):
    chosen = options(tmp_path / "out", [scene], ["steady"])
    calls, real = [], os.fsync

    def full(handle):
        calls.append(handle)
        if len(calls) == 4:  # environment, scenes.json, prepared; then the first round
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(handle)

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(UserError, match=r"cannot write \(No space left on device\); finished measurements are kept"):
        Run(chosen, Silent()).go()
    (journal,) = (tmp_path / "out" / "journal").glob("*.jsonl")
    assert [e["event"] for e in Journal(journal).events] == ["prepared"]
    (measured,) = Run(chosen, Silent()).go()
    assert measured.status == "ok"
    assert [r["round"] for r in measured.rounds] == [0, 1]


def test_a_run_that_ends_between_its_rounds_and_its_records_loses_nothing(package, scene, tmp_path, monkeypatch):
    """The next one, in another environment, takes no round: the record has the environment of those that were taken."""
    chosen = options(tmp_path / "out", [scene], ["steady"])

    def interrupted(run, job):
        raise KeyboardInterrupt

    first, again = Run(chosen, Silent()), Run(chosen, Silent())
    with monkeypatch.context() as patch:
        patch.setattr(Run, "_close", interrupted)
        with pytest.raises(KeyboardInterrupt):
            first.go()
    monkeypatch.setattr(run_module, "environment", lambda: {"id": "0123456789abcdef"})
    (measured,) = again.go()
    assert (again.environment, measured.environment) == ("0123456789abcdef", first.environment)
    assert [(one["round"], one["run"]) for one in measured.rounds] == [(0, first.name), (1, first.name)]
    assert not list((tmp_path / "out" / "journal").iterdir())


def test_a_folder_that_is_a_file_or_in_use_is_refused(tmp_path, scene):
    occupied = tmp_path / "file"
    occupied.write_text("")
    with pytest.raises(UserError, match=r"cannot write there .*; choose another --out"):
        Run(options(occupied / "out", [scene], ["steady"]), Silent()).go()
    (tmp_path / "part").mkdir()
    (tmp_path / "part" / "records").write_text("")
    with pytest.raises(UserError, match=r"part/records: a file where a folder is needed; .*another --out"):
        Run(options(tmp_path / "part", [scene], ["steady"]), Silent()).go()
    with ResultsFolder(tmp_path / "used").locked(), pytest.raises(UserError, match="another run is writing there"):
        Run(options(tmp_path / "used", [scene], ["steady"]), Silent()).go()


def test_another_scene_of_the_same_name_gets_a_picture_of_its_own(tmp_path):
    """As where an original takes the place of its stand-in in a folder that has records of the stand-in."""
    scene, out = tmp_path / "tetra.obj", tmp_path / "out"
    write_scene(scene)
    picture = out / "images" / "tetra-8x8.png"
    go(options(out, [str(scene)], ["warp_bvh"]))
    first, when = picture.read_bytes(), picture.stat().st_mtime_ns
    go(options(out, [str(scene)], ["warp_bvh", "uniform_grid"]))
    assert picture.stat().st_mtime_ns == when
    scene.write_text("v 0 0 0\nv 5 0 0\nv 0 1 0\nf 1 2 3\n")
    go(options(out, [str(scene)], ["warp_bvh"]))
    assert picture.read_bytes() != first


def test_files_that_a_killed_run_was_writing_are_removed_and_no_others(tmp_path):
    folder = ResultsFolder(tmp_path)
    (tmp_path / "records").mkdir()
    others = (".gitignore .notes.original .a.json.abcdefgh a.json.abcdefgh.partial .a.json.abcdefgh.partial.d/").split()
    for name in others:
        (tmp_path / "records" / name).mkdir() if name[-1] == "/" else (tmp_path / "records" / name).touch()

    def partial_files(place: Path) -> int:
        return len(list(place.glob(".a.json.*.partial")))

    def killed_as_it_writes(place: Path) -> None:
        program = "from shadowbench.harness.files import replacing; from pathlib import Path; import os, signal\n"
        program += f"with replacing(Path({str(place / 'a.json')!r})): os.kill(os.getpid(), signal.SIGKILL)"
        subprocess.run([sys.executable, "-c", program])
        assert partial_files(place) == 1

    killed_as_it_writes(tmp_path)
    killed_as_it_writes(tmp_path / "records")
    with folder.locked():
        assert partial_files(tmp_path) == 0
        assert {path.name for path in (tmp_path / "records").iterdir()} == {name.strip("/") for name in others}
        killed_as_it_writes(tmp_path)
    assert partial_files(tmp_path) == 0, "a worker was killed, and the run went on to its end"
