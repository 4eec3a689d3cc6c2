"""The environment of a record: which version of this package, and which commit of its source."""

import importlib.metadata
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
import shadowbench
from shadowbench.harness.runner.machine import environment as machine

ROOT = Path(__file__).parents[2]


def test_the_version_of_this_package_is_recorded_under_the_name_that_it_is_installed_by() -> None:
    name = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["name"]
    assert machine.packages()[name] == shadowbench.__version__
    assert machine.packages()["numpy"] == importlib.metadata.version("numpy")


def git(folder: Path, *words: str) -> str:
    identity = ["-c", "user.name=a", "-c", "user.email=a@b.invalid"]
    command = ["git", "-C", str(folder), *identity, *words]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_a_package_in_the_repository_of_something_else_has_no_commit(tmp_path: Path) -> None:
    git(tmp_path, "init", "--quiet")
    (tmp_path / "notes").write_text("of somebody else")
    git(tmp_path, "add", "notes")
    git(tmp_path, "commit", "--quiet", "-m", "Notes")
    installed = tmp_path / "env" / "lib" / "machine.py"
    installed.parent.mkdir(parents=True)
    shutil.copy(machine.__file__, installed)
    assert machine.git_state(installed) is None
    git(tmp_path, "add", "-f", "env")
    git(tmp_path, "commit", "--quiet", "-m", "A copy")
    assert machine.git_state(installed) == {"commit": git(tmp_path, "rev-parse", "HEAD"), "dirty": False}
    (tmp_path / "notes").write_text("changed")
    assert machine.git_state(installed)["dirty"] is True
    assert machine.git_state(tmp_path.parent / "machine.py") is None, "no repository, or none that knows it"
