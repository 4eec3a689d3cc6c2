"""``tests/tools/versions.py``: versions in turns, and a version whose answers differ."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
WRONG = """
right = Session.answers


def wrong(self, moment):
    answers = right(self, moment)
    answers["triangle"][0] += 1
    return answers


Session.answers = wrong
"""


def versions(*arguments: str) -> subprocess.CompletedProcess[str]:
    program = str(ROOT / "tests" / "tools" / "versions.py")
    command = [sys.executable, program, "--device", "cpu", "--rounds", "2", "--samples", "2", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def planted(tmp_path_factory) -> Path:
    """A version whose first answer is wrong."""
    folder = tmp_path_factory.mktemp("planted")
    for part in ("harness", "methods", "experiments"):
        shutil.copytree(ROOT / part, folder / part, ignore=shutil.ignore_patterns("__pycache__"))
    with (folder / "harness" / "frame" / "session.py").open("a") as module:
        module.write(WRONG)
    return folder


@pytest.mark.slow
def test_a_version_and_a_variant_are_timed_in_turns(tmp_path):
    out = tmp_path / "times.json"
    done = versions(
        "--version", f"now={ROOT}", "--variant", "now:trial=cells=64", "--scene", "balls-300@16", "--out", str(out)
    )
    assert done.returncode == 0, done.stdout + done.stderr
    rows = json.loads(out.read_text())
    assert [(row["name"], row["settings"]) for row in rows] == [
        ("now", {}),
        ("now:trial=cells=64", {"trial": "cells=64"}),
    ]
    assert all(len(row["ms"]["balls-300@16"]) == 2 and min(row["ms"]["balls-300@16"]) > 0 for row in rows)
    assert "!" not in done.stdout


@pytest.mark.slow
def test_other_answers_are_marked(planted):
    done = versions("--version", f"now={ROOT}", "--version", f"planted={planted}", "--scene", "balls-300@16:count=2")
    assert done.returncode == 1
    assert done.stdout.count("!") == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--version", "a=nothing", "--scene", "fairy"], "no folder and no commit"),
        (["--version", "a=.", "--variant", "b:trial=cells=8", "--scene", "fairy"], "is not VERSION:SETTING=VALUE of a"),
        (["--version", "a=.", "--scene", "nothing"], "a, nothing: UserError: no scene or file 'nothing'"),
        (["--version", "a=.", "--scene", "bunny@16:colour=1"], "'colour' is no change of a scene"),
    ],
)
def test_what_cannot_be_measured_is_one_line(arguments, said, monkeypatch):
    monkeypatch.chdir(ROOT)
    done = versions(*arguments)
    assert done.returncode in (1, 2)
    assert said in done.stderr
    assert "Traceback" not in done.stderr
