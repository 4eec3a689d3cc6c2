"""The commands verify, explain and score, on small meshes and methods made for the purpose."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from helpers import exact_answers as cases
from helpers import misbehaving_methods
from helpers.experiment_records import record_of
from helpers.right_and_wrong_methods import Point, Right, Wrong, ball_file
from helpers.tiny_runs import options
from shadowbench.harness.commands import answering
from shadowbench.harness.commands.check import check
from shadowbench.harness.commands.explain import explain
from shadowbench.harness.commands.run import run as measure
from shadowbench.harness.commands.verify import score, verify
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame import registry
from shadowbench.harness.frame.devices import start_warp
from shadowbench.harness.judge.answer_files import save_raw
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.chosen_view import ChosenView
from shadowbench.harness.scene.facts import few_hits, never_hit
from shadowbench.harness.scene.prepared import prepare

start_warp()  # as the commands do: what it has to say must not end up in a test's output

pytestmark = pytest.mark.usefixtures("right_and_wrong")


def run(capsys, *names: str, scenes: list[str], **options) -> tuple[int, dict]:
    code = verify(scenes, list(names), size="24x18", device="cpu", as_json=True, **options)
    return code, json.loads(capsys.readouterr().out)


def test_a_wrong_method_fails_unless_it_says_so(capsys, mesh):
    code, report = run(capsys, "right", "wrong", "honest", "lazy", scenes=[mesh])
    (scene,) = report["scenes"]
    rows = {row["method"]: row for row in scene["methods"]}
    bits = {name: row["score"]["shadow"][0] for name, row in rows.items()}
    assert (code, report["passed"]) == (1, False)
    assert {name: row["counts_against"] for name, row in rows.items()} == {
        "right": False, "wrong": True, "honest": False, "lazy": True,
    }  # fmt: skip
    assert (rows["right"]["status"], rows["right"]["score"]["check"]) == ("ok", "ok")
    assert bits["right"]["scored"] > 50
    assert (bits["wrong"]["leak"], bits["honest"]["leak"]) == (1, 1)
    assert rows["honest"]["known_inexact"] == "it leaks, and says so"
    assert bits["lazy"]["invalid"] == 24 * 18, "unwritten bits are found"
    assert (scene["triangles"], len(scene["sha256"])) == (len(cases.ball_on_floor().geometry().faces), 64)


def test_what_is_being_verified_is_said_on_a_terminal(capsys, mesh, tmp_path, monkeypatch):
    odd = shutil.copy(mesh, tmp_path / "a{b}.ply")
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    assert verify([str(odd)], ["right"], size="24x18", device="cpu") == 0
    assert f"{odd}: right ..." in capsys.readouterr().err


def test_one_method_does_not_hide_another(capsys, mesh):
    code, report = run(capsys, "crashing", "greedy", "choosy", "right", scenes=[mesh, mesh], everything=True)
    assert (code, len(report["scenes"])) == (1, 2)
    rows = {row["method"]: row for row in report["scenes"][1]["methods"]}
    assert (rows["crashing"]["status"], rows["crashing"]["reason"]) == ("failed", "RuntimeError: no such luck")
    assert (rows["greedy"]["status"], rows["greedy"]["reason"]) == ("rejected", "needs 12 pairs")
    assert (rows["choosy"]["status"], rows["choosy"]["reason"]) == ("skipped", "only spheres")
    assert rows["right"]["score"]["check"] == "ok"
    assert rows["right"]["score"]["primary"]["judged"] == 24 * 18, "every pixel is decided"
    assert run(capsys, "greedy", "choosy", scenes=[mesh])[0] == 0


@pytest.mark.parametrize("columns", ["80", "200"])
def test_tables_show_what_is_wrong_and_are_as_wide_as_asked(capsys, mesh, monkeypatch, columns):
    """A pipe has no width of its own: COLUMNS counts, else 80."""
    monkeypatch.setenv("COLUMNS", columns)
    assert verify([mesh], ["perspective_spherical", "choosy", "honest"], size="24x18", device="cpu") == 0
    table, mark, notes = capsys.readouterr().out.partition("* honest")
    assert max(map(len, table.partition("choosy on")[0].splitlines())) <= 80
    assert max(map(len, notes.splitlines())) <= int(columns)
    assert all(text in table for text in ("ball.ply", "failed*", "skipped: only spheres", "reference"))
    row = next(line for line in table.splitlines() if line.startswith("perspective_spherical "))
    assert row.split()[-1] == "ok"
    assert f"{mark}{notes}".startswith("* honest declares itself inexact: it leaks, and says so")
    assert "leak: a shadowed point called lit" in notes


@pytest.mark.parametrize(
    ("broken", "words"),
    [(slice(None), "warning: none of 12 triangles can ever be hit"), (slice(0, 1), "of 12 triangles can never be hit")],
)
def test_triangles_that_cannot_be_hit_are_reported(tmp_path, capsys, broken, words):
    box = trimesh.creation.box()
    vertices = box.vertices.copy()
    vertices[broken] = np.nan
    path = tmp_path / "broken.obj"
    corners = "".join("v {} {} {}\n".format(*vertex) for vertex in vertices)
    path.write_text(corners + "".join("f {} {} {}\n".format(*face) for face in box.faces + 1))
    assert verify([str(path)], ["right"], device="cpu", size="8x8") == 0
    assert words in " ".join(capsys.readouterr().out.split())
    code, report = run(capsys, "right", scenes=[str(path)])
    assert code == 0
    assert words in report["scenes"][0]["warning"]


@pytest.mark.parametrize(("change", "message"), [
    ({"scene": ["nosuch"]}, "nosuch"), ({"method": ["rihgt"]}, "did you mean right"),
    ({"size": "40"}, "WIDTHxHEIGHT"), ({"frame": 1}, "frames 0 to 0"), ({"device": "cuda:7"}, "cuda:7"),
    ({"setting": ["right.x=1"]}, "right has no parameter"),
])  # fmt: skip
def test_a_wrong_call_is_one_line(mesh, change, message):
    arguments = {"scene": [mesh], "method": ["right"], "size": "24x18", "device": "cpu", **change}
    with pytest.raises(UserError, match=message):
        verify(**arguments)


CHANGED = "repeat {} of the same frame gave different answers: {}"


@pytest.mark.parametrize(("method", "limit", "status", "reason"), [
    ("steady", 1 << 20, "ok", ""), ("once", None, "failed", CHANGED.format(1, "triangle, t, u, v")),
    ("slow_start", None, "failed", CHANGED.format(1, "triangle, t")),
    ("fickle", None, "failed", CHANGED.format(8, "shadowed")),
    ("greedy", 1 << 20, "rejected", "the limit is 1,048,576"),
    ("hoards", 1 << 20, "rejected", "the limit is 1,048,576"), ("greedy", None, "ok", ""),
])  # fmt: skip
def test_methods_that_misbehave_are_found(monkeypatch, capsys, scene, method, limit, status, reason):
    known = {cls.name: Point(cls) for cls in misbehaving_methods.CLASSES}
    monkeypatch.setattr(registry, "_entry_points", lambda: known)
    monkeypatch.setattr(answering, "REPEATS", 8)
    away = ("0.2,0.2,5", "0.2,0.2,9")  # every ray misses, as these methods answer
    code = verify([scene], [method], size="8x8", device="cpu", camera=away, memory_limit=limit, as_json=True)
    (row,) = json.loads(capsys.readouterr().out)["scenes"][0]["methods"]
    assert row["status"] == status
    assert row["reason"].endswith(reason)
    assert code == (status == "failed")


# --- where hardly a ray hits anything ---

AWAY = ((9.0, 9.0, 9.0), (20.0, 20.0, 20.0))
FEW = "hit anything, fewer than 1%: this checked misses, and little else"


def test_the_warning_begins_below_a_hundredth():
    assert few_hits(10, 1000) is few_hits(1, 100) is few_hits(0, 0) is None
    assert str(few_hits(9, 1000)) == f"warning: 9 of 1,000 rays {FEW}; choose another --camera"


def test_triangles_that_are_never_hit_are_a_warning_only_where_all_are():
    assert never_hit(3, 3) is None
    some, every = never_hit(3, 1), never_hit(3, 0)
    assert (some.warns, every.warns) == (False, True)
    assert str(some).startswith("2 of 3 triangles can never be hit")
    assert str(every) == f"warning: {every.fact}: this checked misses, and nothing else"


@pytest.mark.parametrize("away", [False, True])
def test_verify_warns(scene, capsys, away):
    camera = tuple(",".join(map(str, place)) for place in AWAY) if away else None
    assert verify([scene], method=["uniform_grid"], device="cpu", size="16x16", camera=camera, as_json=True) == 0
    (report,) = json.loads(capsys.readouterr().out)["scenes"]
    assert ((FEW in report["warning"]), (report["hits"] == 0)) == (away, away)
    verify([scene], method=["uniform_grid"], device="cpu", size="16x16", camera=camera)
    assert ("0 of 256 rays hit anything" in " ".join(capsys.readouterr().out.split())) == away


def test_run_warns(scene, tmp_path, capsys):
    asked = replace(options(tmp_path, [scene], ["uniform_grid"], rounds=1, frames=1), view=ChosenView(AWAY))
    for _ in range(2):  # the second time from the records
        assert measure(asked, as_json=True) == 0
        (warning,) = json.loads(capsys.readouterr().out)["warnings"]
        assert FEW in warning
        assert warning.startswith("tetra: 0 of 64")


def test_check_warns_where_its_cases_hit_nothing(capsys):
    found = {}
    for case in ("P11b", "P15"):
        check("uniform_grid", device="cpu", case=[case], as_json=True)
        found[case] = json.loads(capsys.readouterr().out)["warning"]
    assert FEW in found["P11b"]
    assert found["P15"] == ""


# --- explain ------------------------------------------------------------------------------------------------


def shadowed_pixel(mesh: str) -> tuple[int, int]:
    """Where the wrong method leaks."""
    prepared = prepare(resolve(mesh))
    pixel = int(np.argmax(cases.exact_answers(prepared, prepared.moment(0, 24, 18))["shadowed"][0]))
    return pixel % 24, pixel // 24


def test_explain_shows_every_answer_and_the_exact_one(capsys, mesh):
    x, y = shadowed_pixel(mesh)
    names = ["right", "wrong", "choosy"]
    code = explain(mesh, f"{x},{y}", names, "cpu", "24x18", as_json=True)
    facts = json.loads(capsys.readouterr().out)
    assert code == 1
    exact = facts["exact"]
    assert exact["ties"][0] == exact["triangle"] >= 0
    assert int(exact["t_ratio"][0]) / int(exact["t_ratio"][1]) == exact["t"]
    assert exact["edge_in_bounds"] > 0
    assert exact["shadows"][0]["bit"] == 1
    assert exact["shadows"][0]["occluder"] != exact["triangle"]
    rows = {row["method"]: row for row in facts["answers"]}
    assert rows["reference"]["triangle"] == exact["triangle"]
    assert (rows["right"]["class"], rows["right"]["shadow_classes"]) == ("ok", ["ok"])
    assert (rows["wrong"]["class"], rows["wrong"]["shadow_classes"]) == ("ok", ["leak"])
    assert rows["choosy"]["reason"] == "only spheres"
    assert explain(mesh, f"{x},{y}", ["right", "honest"], "cpu", "24x18") == 0
    text = capsys.readouterr().out
    assert f"exact: triangle {exact['triangle']}" in text
    assert "0 leak" in text


def test_explain_follows_a_mirrored_ray(capsys, mesh, tmp_path):
    declared = tmp_path / "mirrors.toml"
    declared.write_text(f'mesh = "{mesh}"\n[mirror]\nshare = 1.0\nbounces = 2\n')
    x, y = shadowed_pixel(mesh)
    names = ["uniform_grid", "ray_grids"]
    assert explain(str(declared), f"{x},{y}", names, "cpu", "24x18", as_json=True) == 0
    facts = json.loads(capsys.readouterr().out)
    assert [found["bounce"] for found in facts["bounces"]] == [1, 2]
    (row,) = facts["bounces"][0]["answers"]
    assert row["method"] == "uniform_grid"  # the other holds no mirrored rays
    assert (row["triangle"], row["class"]) == (row["exact"]["triangle"], "ok")
    assert row["triangle"] != facts["exact"]["triangle"]
    assert explain(str(declared), f"{x},{y}", names, "cpu", "24x18") == 0
    assert "bounce 1, each method's own ray:" in capsys.readouterr().out


def test_explain_a_miss(capsys, mesh):
    assert explain(mesh, "0,0", ["right"], "cpu", "24x18") == 0
    assert "exact: a miss" in capsys.readouterr().out


def test_explain_needs_a_pixel_of_the_image(mesh):
    for pixel in ("24,0", "0,18", "1", "1,2,3", "-1,0", "a,b"):
        with pytest.raises(UserError, match="--pixel"):
            explain(mesh, pixel, ["right"], "cpu", "24x18")


# --- score: answers that were kept are judged, and their records get what was missing ---


@pytest.fixture
def folder(tmp_path, mesh):
    """Raw answers of two points, one right and one wrong, and their unscored records."""
    prepared = prepare(resolve(mesh))
    moment = prepared.moment(0, 40, 30)
    for cls in (Right, Wrong):
        answers = cases.exact_answers(prepared, moment)
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
    assert (frame["total_ms"], read(folder, "wrong")["frames"][0]["score"]["shadow"][0]["leak"]) == ([1.25], 1)
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
    answers = cases.exact_answers(prepared, moment)
    extra = {"key": "../other/records/point-right"}
    save_raw(folder / "answers" / "a-0.npz", prepared, moment, answers, prepared.scene.name, extra=extra)
    assert score(folder, as_json=True) == 1
    (row,) = json.loads(capsys.readouterr().out)["answers"]
    assert row["reason"].endswith("the record of other answers; remove them, or it")
    assert other.read_bytes() == before


def test_score_of_a_folder_without_answers(tmp_path):
    with pytest.raises(UserError, match="no saved answers"):
        score(tmp_path)
