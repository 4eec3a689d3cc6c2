"""A results folder may come from elsewhere: what stands in the place of its files is not written through, nor followed."""

import os
from pathlib import Path

import pytest
from helpers.tiny_runs import options
from shadowbench.harness.commands.keep import keep
from shadowbench.harness.commands.report import report
from shadowbench.harness.commands.run import run
from shadowbench.harness.commands.show import show
from shadowbench.harness.errors import UserError
from shadowbench.harness.files import write_atomic
from shadowbench.harness.results.folder import ResultsFolder
from shadowbench.harness.runner.machine import environment
from shadowbench.harness.runner.workers.pool import GRADER, Workers

PLACES = (
    "table1.svg", "cluster.jsonl", ".lock", "scenes.json", "answers/a-0.npz", "logs/uniform_grid.log", "journal/a.jsonl",
)  # fmt: skip


@pytest.mark.parametrize("place", PLACES)
def test_links_and_pipes_in_place_of_files_are_refused(tmp_path: Path, scene: str, place: str) -> None:
    victim, out = tmp_path / "victim", tmp_path / "out"
    victim.write_text("precious")
    write_atomic(out / "records" / "a.json", {})
    (tmp_path / "larger disk").mkdir()
    (out / "images").symlink_to(tmp_path / "larger disk")  # a folder may be a link
    path = out / place
    path.parent.mkdir(exist_ok=True)
    chosen = options(out, [scene], ["uniform_grid"])
    for plant in (
        lambda: path.symlink_to(victim),
        lambda: path.symlink_to(tmp_path / "nowhere"),
        lambda: os.mkfifo(path),
    ):
        plant()
        for act in (
            lambda: run(chosen),
            lambda: show("table1", out),
            lambda: report(out),
            lambda: keep([out], tmp_path / "kept"),
        ):
            with pytest.raises(UserError) as refused:
                act()
            assert str(refused.value) == f"{path}: a link, or no file at all; put a file in its place, or remove it"
        path.unlink()
    assert victim.read_text() == "precious"
    assert {one.name for one in tmp_path.iterdir()} == {"victim", "out", "larger disk"}
    with ResultsFolder(out).locked():
        pass


def test_an_environment_that_cannot_be_read_is_written_again(tmp_path: Path) -> None:
    facts = {"id": "abc", "cpu": {"model": "any"}}
    path = tmp_path / "environments" / "abc.json"
    path.parent.mkdir()
    for damage in ("", "{", "[]", '{"id": "abc"}'):
        path.write_text(damage)
        environment.keep(tmp_path, facts)
        assert environment.read_json(path) == facts


def test_a_log_that_cannot_be_written_is_one_line(tmp_path: Path, scene: str) -> None:
    workers = Workers(ResultsFolder(tmp_path), options(tmp_path, [scene], ["uniform_grid"]))
    (tmp_path / "logs" / f"{GRADER}.log").mkdir(parents=True)
    with pytest.raises(UserError, match=rf"cannot write \(.*{GRADER}.log: Is a directory\)"):
        workers.send(workers.get(GRADER), do="free")
