"""``tests/tools/answer_hashes.py``: what is kept, and a changed bit."""

import json
import subprocess
import sys

import pytest
from shadowbench.harness.frame.session import Session
from tools import answer_hashes

ASKED = ["--scene", "balls-300@16", "--cases", "M01", "--method", "bvh2:threads=1", "--method", "kdtree"]


@pytest.fixture
def kept(tmp_path):
    """A file of what is found now."""
    path = tmp_path / "cpu-16.json"
    assert answer_hashes.main([*ASKED, "--file", str(path), "--keep"]) == 0
    return path


def test_the_same_answers_have_the_kept_hashes(kept, capsys):
    frames = json.loads(kept.read_text())["frames"]
    assert {"balls-300@16 #0", "case M01"} <= frames.keys()
    assert {part.partition("=")[0] for part in frames["case M01"][0].split()} >= {"triangle", "bounce_t"}
    assert answer_hashes.main([*ASKED, "--file", str(kept)]) == 0
    assert ": 0 differ from cpu-16.json, 0 are not in it" in capsys.readouterr().out


@pytest.mark.slow
def test_kernels_that_are_compiled_as_for_users_have_the_same_hashes(kept):
    """In a process of its own: tests compile with other flags (``conftest.py``)."""
    asked = [*ASKED[:4], "--method", "bvh2:threads=1", "--file", str(kept)]
    done = subprocess.run([sys.executable, answer_hashes.__file__, *asked], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert ": 0 differ from cpu-16.json, 0 are not in it" in done.stdout


def test_a_changed_bit_is_named(kept, monkeypatch, capsys):
    right = Session.answers

    def wrong(self, moment):
        answers = right(self, moment)
        answers["u"][5] = -answers["u"][5]
        return answers

    monkeypatch.setattr(Session, "answers", wrong)
    assert answer_hashes.main([*ASKED, "--file", str(kept)]) == 1
    assert "balls-300@16 #0, bvh2:threads=1: u\n" in capsys.readouterr().out


def test_a_row_that_is_not_kept_is_counted(kept, capsys):
    assert answer_hashes.main([*ASKED, "--method", "bvh2:builder=lbvh,threads=2", "--file", str(kept)]) == 0
    frames = len(json.loads(kept.read_text())["frames"])
    assert f": 0 differ from cpu-16.json, {frames} are not in it" in capsys.readouterr().out
