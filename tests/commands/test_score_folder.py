"""The command score: answers that were kept are judged, and their records get what was missing."""

import json

import pytest
from helpers import rational_brute_force as cases
from helpers.experiment_records import record_of
from helpers.right_and_wrong_methods import Right, Wrong, ball_file
from shadowbench.harness.commands.verify import score
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.warp_init import start_warp
from shadowbench.harness.judge.answer_files import save_raw
from shadowbench.harness.judge.referee import Referee
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.prepared import prepare

start_warp()  # as the commands do: what it has to say must not end up in a test's output

pytestmark = pytest.mark.usefixtures("right_and_wrong")


@pytest.fixture
def folder(tmp_path, mesh):
    """Raw answers of two points, one right and one wrong, and their unscored records."""
    prepared = prepare(resolve(mesh))
    moment = prepared.moment(0, 40, 30)
    referee = Referee(moment.points, prepared.faces, moment.valid)
    for cls in (Right, Wrong):
        answers = cases.exact_answers(prepared, moment, referee)
        cls().spoil(answers)
        key = f"point-{cls.name}"
        save_raw(tmp_path / "answers" / f"{key}-0.npz", prepared, moment, answers, mesh, extra={"key": key})
        record = {**record_of("table1", Entry(cls.name)), "key": key}
        record["frames"][0].update(total_ms=[1.25], wall_ms=[1.25], round=[0], score=None, unscored="no Embree there")
        (tmp_path / "records").mkdir(exist_ok=True)
        (tmp_path / "records" / f"{key}.json").write_text(json.dumps(record))
    return tmp_path


def read(folder, name):
    return json.loads((folder / "records" / f"point-{name}.json").read_text())


def test_score_fills_in_what_is_missing_and_nothing_else(capsys, folder):
    assert score(folder, as_json=True) == 1
    report = json.loads(capsys.readouterr().out)
    assert [row["status"] for row in report["answers"]] == ["scored", "scored"]
    (frame,) = read(folder, "right")["frames"]
    assert frame["score"]["check"] == "ok"
    assert frame["unscored"] is None
    assert frame["total_ms"] == [1.25]
    assert read(folder, "wrong")["frames"][0]["score"]["shadow"][0]["leak"] == 1
    before = (folder / "records" / "point-right.json").read_bytes()
    assert score(folder, as_json=True) == 1
    report = json.loads(capsys.readouterr().out)
    assert [row["status"] for row in report["answers"]] == ["had a score", "had a score"]
    assert (folder / "records" / "point-right.json").read_bytes() == before


def test_score_passes_where_all_is_right(capsys, folder):
    (folder / "answers" / "point-wrong-0.npz").unlink()
    assert score(folder) == 0
    assert "scored" in capsys.readouterr().out


def test_score_says_what_it_cannot_score(capsys, folder):
    (folder / "answers" / "point-right-0.npz").write_bytes(b"torn")
    (folder / "answers" / "point-wrong-0.npz").unlink()
    assert score(folder, as_json=True) == 1
    (row,) = json.loads(capsys.readouterr().out)["answers"]
    assert row["status"] == "not scored"
    assert "not a file of raw answers" in row["reason"]
    assert read(folder, "right")["frames"][0]["score"] is None


def test_answers_that_name_another_record_do_not_change_it(capsys, folder):
    other = folder / "other" / "records" / "point-right.json"
    other.parent.mkdir(parents=True)
    (folder / "records" / "point-right.json").rename(other)
    for path in (folder / "answers").glob("point-*.npz"):
        path.unlink()
    before = other.read_bytes()
    prepared = prepare(resolve(ball_file(folder)))
    moment = prepared.moment(0, 4, 3)
    answers = cases.exact_answers(prepared, moment, Referee(moment.points, prepared.faces, moment.valid))
    extra = {"key": "../other/records/point-right"}
    save_raw(folder / "answers" / "a-0.npz", prepared, moment, answers, prepared.scene.name, extra=extra)
    assert score(folder, as_json=True) == 1
    (row,) = json.loads(capsys.readouterr().out)["answers"]
    assert row["reason"].endswith("the record of other answers; remove them, or it")
    assert other.read_bytes() == before


def test_score_of_a_folder_without_answers(tmp_path):
    with pytest.raises(UserError, match="no saved answers"):
        score(tmp_path)
