"""``tests/tools/kills.py`` in short: a few kills at random moments, then resumed; and what it would find."""

import json
import shutil
from pathlib import Path

import pytest
from helpers.kills import Killed, Kills, files

pytest.importorskip("embreex", reason="scores are compared")


@pytest.mark.slow
def test_a_few_kills_leave_every_record_whole_and_nothing_behind(tmp_path: Path) -> None:
    found = Kills()
    runs = Killed(tmp_path / "runs", 1, False, found, scenes=("first",), methods=("uniform_grid",), haste=4)
    while found.count < 4:
        runs.until_finished(f"out{found.finished}", 4 - found.count)
    assert not found.findings
    assert found.finished >= 1
    assert {kind for kind, _ in found.kills} == set(runs.kinds), "each kind of process was killed"
    planted(runs)


def planted(runs: Killed) -> None:
    """What the check finds where something is wrong: a fault that is put into a copy of a whole folder."""
    whole = runs.place / "untouched"
    path = sorted((whole / "records").iterdir())[0]
    record = json.loads(path.read_text())
    frame = record["frames"][0]

    def changed(**fields) -> str:
        return json.dumps({**record, **fields})

    faults = {
        "no records here": lambda out: (out / "records" / path.name).unlink(),
        "rounds [0, 1, 2, 3, 4, 5, 0]": lambda out: (out / "records" / path.name).write_text(
            changed(rounds=[*record["rounds"], record["rounds"][0]])
        ),
        "rounds that were taken before it was killed are lost": lambda out: runs.taken.update({record["key"]: [-1.0]}),
        "its score is": lambda out: (out / "records" / path.name).write_text(
            changed(frames=[{**frame, "score": None}])
        ),
        "left behind: journal": lambda out: (out / "journal" / "some.jsonl").write_text("{}\n"),
        "missing: answers": lambda out: next((out / "answers").glob("*-0.npz")).unlink(),
        "its environment is not there": lambda out: next((out / "environments").iterdir()).unlink(),
        "left behind: tmp": lambda out: (runs.place / "tmp" / "wp_pch_1").mkdir(),
    }
    for expected, plant in faults.items():
        out = runs.place / "planted"
        shutil.copytree(whole, out)
        assert runs.faults(out) == []
        plant(out)
        assert any(expected in one for one in runs.faults(out)), expected
        runs.taken.clear()
        shutil.rmtree(out)
    assert files(whole)
