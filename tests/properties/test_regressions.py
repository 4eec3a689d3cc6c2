"""What fuzzing found once, replayed for ever: examples frozen with hexadecimal floats. And fuzzing itself, tried."""

import json
import random
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.lattice_examples import LENGTH, METHODS, Example, decode, true_errors
from tools import fuzz

FROZEN = sorted(fuzz.REGRESSIONS.glob("*.json"))


@pytest.mark.parametrize("path", FROZEN, ids=lambda path: path.stem)
def test_frozen_example(path: Path) -> None:
    facts = json.loads(path.read_text())
    assert true_errors(Example.thawed(facts), (facts["method"],)) == {}


def test_a_short_run_finds_nothing(tmp_path: Path, capsys) -> None:
    assert fuzz.fuzz(25, 1, 600.0, tmp_path, METHODS, "cpu") == 0
    assert "seed 1: 25 examples" in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == []


def test_it_runs_as_a_program() -> None:
    """As ``make fuzz`` calls it, without a test runner that knows where the helpers are."""
    call = [sys.executable, fuzz.__file__, "--method", "no such method"]
    done = subprocess.run(call, capture_output=True, text=True, timeout=60, check=False)
    assert "no such method; choose from" in done.stderr, done.stderr
    assert done.returncode == 2


def test_an_error_is_found_made_small_and_frozen(tmp_path: Path, monkeypatch, capsys) -> None:
    """A planted error that needs one triangle in two and one light: the frozen example has little else."""

    def fails(example: Example, names=METHODS, device="cpu") -> dict[str, str]:
        wrong = len(example.faces) >= 2 and "warp_bvh" in names
        return {"warp_bvh": "planted"} if wrong else {}

    monkeypatch.setattr(fuzz, "true_errors", fails)
    source = random.Random(4)
    before = next(one for one in iter(lambda: decode(source.randbytes(LENGTH)), None) if len(one.faces) > 6)
    least = fuzz.shrunk(before, lambda one: bool(fails(one)))
    assert len(least.faces) == 2
    assert len(least.lights) == 1
    assert len(least.points) <= 6
    path = fuzz.freeze(least, "warp_bvh", "planted", tmp_path)
    again = Example.thawed(json.loads(path.read_text()))
    assert again.faces.tolist() == least.faces.tolist()
    assert again.settings == {"warp_bvh": least.settings["warp_bvh"]}
    assert fuzz.fuzz(1000, 4, 60.0, tmp_path, METHODS, "cpu") == fuzz.MOST_FINDINGS
    assert "frozen as" in capsys.readouterr().out
