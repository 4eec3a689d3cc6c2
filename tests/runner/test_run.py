"""Whole runs: what a misbehaving method costs, memory, retries, scores, budgets."""

import os
import re
import shutil
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.tiny_runs import go, options, write_scene
from shadowbench.harness.commands.render import render
from shadowbench.harness.commands.run import shown
from shadowbench.harness.results.schema import read_records
from shadowbench.harness.runner import run as run_module
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.runner.progress import Silent
from shadowbench.harness.runner.run import Run
from shadowbench.harness.runner.workers.pool import GRADER, Workers, grades


@pytest.fixture(scope="module")
def troubled(package, scene, tmp_path_factory):
    """One run of every method of the package: its folder and its records by label."""
    out = tmp_path_factory.mktemp("troubled")
    names = (
        "steady talker raises late once slow_start fickle hangs exits rejects skips grows varies greedy hoards broken"
    ).split()
    entries = [Entry(name, {}, name) for name in names]
    # A second point of a method whose worker was lost is measured by a new worker.
    entries.append(Entry("hangs", {"ms": "1"}, "hangs again"))
    return out, go(options(out, [scene], entries, timeout_s=3.0))


UNSTEADY = "the timed frames gave other answers than the frame that was judged"


@pytest.mark.parametrize(
    ("label", "status", "reason"),
    [
        ("steady", "ok", ""),
        ("talker", "ok", ""),
        ("raises", "failed", "ArithmeticError: a line and another"),
        ("late", "failed", "ArithmeticError: tired"),
        ("once", "failed", f"{UNSTEADY} (frame 0: triangle, t, u, v)"),
        ("slow_start", "failed", f"{UNSTEADY} (frame 0: triangle, t)"),
        ("fickle", "failed", f"{UNSTEADY} (frame 0: shadowed)"),
        ("hangs", "timeout", "no answer within 3 s; the worker was stopped"),
        ("hangs again", "timeout", "no answer within 3 s; the worker was stopped"),
        ("exits", "failed", "the worker exited with code 3: leaving"),
        ("rejects", "rejected", "needs 1000000000 pairs, allowed are 1048576"),
        ("skips", "skipped", "only for closed scenes"),
        ("grows", "ok", ""),
        ("varies", "ok", ""),
        ("greedy", "ok", ""),
        ("hoards", "ok", ""),
        ("broken", "failed", "cannot be constructed: ImportError: libmissing.so: cannot open"),
    ],
)
def test_trouble_costs_its_own_point_only(troubled, label, status, reason):
    _, records = troubled
    assert (records[label].status, records[label].reason) == (status, reason)


def test_every_planned_point_has_one_record_and_no_journal(troubled):
    out, records = troubled
    assert len(records) == 17
    assert sorted(p.stem for p in (out / "records").iterdir()) == sorted(r.key for r in records.values())
    assert list((out / "journal").iterdir()) == []


def test_a_record_holds_every_sample(troubled):
    _, records = troubled
    frame = records["steady"].frames[0]
    assert len(frame.total_ms) == len(frame.wall_ms) == 6
    assert frame.round == [0, 0, 0, 1, 1, 1]
    assert [(p.name, p.part, len(p.ms)) for p in frame.passes] == [
        ("build", "build", 4),
        ("primary rays", "trace", 4),
        ("light 0: shadow rays", "shadow", 4),
    ]
    assert frame.counters == {"frames": 1}
    assert frame.unscored.startswith("not requested")
    assert records["steady"].stopped_by == "samples"
    assert {r["place"] for r in records["steady"].rounds} <= set(range(17))


def started(run: Run) -> set[str]:
    """The names of the workers whose process was started at least once."""
    return {name for name, worker in run.workers._remotes.items() if worker.generation}


def test_growth_is_recorded_and_over_before_timing(troubled):
    _, records = troubled
    assert records["grows"].frames[0].regrown == 2
    assert records["varies"].frames[0].regrown == 1
    assert records["steady"].frames[0].regrown == 0


def test_a_second_run_measures_nothing_and_changes_no_byte(troubled, scene):
    out, _ = troubled
    before = {p: p.read_bytes() for p in (out / "records").iterdir()}
    entries = [Entry(name, {}, name) for name in ("steady", "hangs")]
    runner = Run(options(out, [scene], entries, timeout_s=3.0), Silent())
    again = runner.go()
    assert [r.status for r in again] == ["ok", "timeout"]
    assert started(runner) == set()
    assert {p: p.read_bytes() for p in (out / "records").iterdir()} == before


def test_what_answers_otherwise_later_has_the_rounds_before_it(troubled):
    _, records = troubled
    assert [len(records[name].rounds) for name in ("once", "fickle")] == [0, 1]


def test_memory_that_numpy_allocates_is_counted(troubled):
    """320 MiB, held from frame to frame or allocated in each: no allocator of Warp's knows of it."""
    _, records = troubled
    held = {name: records[name].frames[0].memory_bytes for name in ("steady", "greedy", "hoards")}
    assert held["steady"] < 1 << 20
    assert min(held["greedy"], held["hoards"]) > 300 << 20


def test_memory_that_a_method_says_it_holds_is_counted(package, scene, tmp_path):
    """As a structure of a library on a GPU: no allocator of Warp's and no growth of the process knows of it."""
    of_a_library, wrong = Entry("of_a_library", {}, "right"), Entry("of_a_library", {"holds": "-1"}, "wrong")
    records = go(options(tmp_path / "out", [scene], [of_a_library, wrong]))
    frame = records["right"].frames[0]
    assert 5 << 20 <= frame.memory_bytes < 6 << 20
    assert frame.memory_source == "warp allocations and what the method holds besides"
    assert records["wrong"].reason == "ValueError: held_bytes() is -1: less than 0"
    (less,) = go(options(tmp_path / "less", [scene], [of_a_library], memory=1 << 20)).values()
    assert (less.status, less.reason) == ("rejected", "needs 5,242,880 bytes; the limit is 1,048,576")


def test_a_method_that_holds_more_than_it_may_is_rejected(package, scene, tmp_path):
    entries = [Entry(name, {}, name) for name in ("steady", "greedy", "hoards", "warp_bvh")]
    records = go(options(tmp_path, [scene], entries, memory=1 << 20, rounds=1))
    assert [records[e.method].status for e in entries] == ["ok", "rejected", "rejected", "ok"]
    for name in ("greedy", "hoards"):
        assert re.fullmatch(r"needs [\d,]+ bytes; the limit is 1,048,576", records[name].reason)
    less = go(options(tmp_path, [scene], ["uniform_grid"], memory=1 << 10, rounds=1))
    assert {r.status for r in less.values()} == {"rejected"}


@pytest.mark.parametrize("name", ["warp_bvh", "embree"])
def test_memory_does_not_depend_on_what_the_process_did_before(scene, tmp_path, name):
    """The first point of a process compiles kernels and loads libraries."""
    pytest.importorskip("embreex", reason="embree is what is measured")
    (alone,) = go(options(tmp_path / "alone", [scene], [Entry(name, {}, "it")], rounds=1)).values()
    other = Entry(name, {"threads": "1"} if name == "embree" else {"update": "refit"}, "before")
    after = go(options(tmp_path / "after", [scene], [other, Entry(name, {}, "it")], rounds=1))["it"]
    most = max(alone.frames[0].memory_bytes, after.frames[0].memory_bytes)
    assert most < 4 << 20, "four triangles: not the library that was loaded and the kernels that were compiled"


def test_retry_measures_failed_points_only(troubled, scene, tmp_path):
    out, first = tmp_path / "out", troubled[1]
    shutil.copytree(troubled[0], out)
    entries = [Entry(name, {}, name) for name in ("steady", "raises")]
    kept, failed = (out / "records" / f"{first[entry.label].key}.json" for entry in entries)
    before, written, earlier = kept.read_bytes(), kept.stat().st_mtime_ns, failed.stat().st_mtime_ns
    runner = Run(options(out, [scene], entries, timeout_s=3.0, retry=True), Silent())
    assert [r.status for r in runner.go()] == ["ok", "failed"]
    assert (kept.read_bytes(), kept.stat().st_mtime_ns) == (before, written)
    assert failed.stat().st_mtime_ns > earlier
    assert "raises" in started(runner)
    assert "steady" not in started(runner)


@pytest.mark.parametrize("change", [{"width": 9}, {"samples": 4}, {"frames": 1, "rounds": 1}])
def test_another_configuration_is_another_point(troubled, scene, tmp_path, change):
    from shadowbench.harness.runner.planning.planned_point import describe_method, make_point

    _, records = troubled
    entry, facts = Entry("steady", {}, "steady"), records["steady"].scene
    plain = options(tmp_path, [scene], [entry], timeout_s=3.0).preset
    other = options(tmp_path, [scene], [entry], **change).preset
    method = describe_method(entry, "cpu")
    assert make_point("trial", plain, entry, facts, method, 0).key == records["steady"].key
    assert make_point("trial", other, entry, facts, method, 0).key != records["steady"].key
    for name in ("arrays_sha256", "surfaces_sha256"):
        changed = {**facts, name: "0" * 64}
        assert make_point("trial", plain, entry, changed, method, 0).key != records["steady"].key
    rewritten = {**method, "source_sha256": "0" * 64}
    assert make_point("trial", plain, entry, facts, rewritten, 0).key != records["steady"].key


def test_a_scene_that_cannot_be_made_is_a_stated_failure(package, tmp_path):
    broken = tmp_path / "broken.obj"
    broken.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")
    good = write_scene(tmp_path / "good.obj")
    records = Run(options(tmp_path / "out", [good, str(broken)], ["steady"]), Silent())
    # The command line refuses such a file before anything starts; a file may also break in between.
    statuses = [(r.scene["name"], r.status) for r in _breaking(records, broken)]
    assert statuses == [("good", "ok"), ("broken", "failed")]


def test_a_scene_that_is_made_at_last_has_no_column_of_its_failure(package, tmp_path, monkeypatch):
    """The worker that makes it is killed, as a system without memory does; then the same command is given again."""
    scene, out = write_scene(tmp_path / "My Tetra.obj"), tmp_path / "out"
    steady, late = (Entry(name, {}, name) for name in ("steady", "late"))
    make = Workers.make

    def killed(workers, name, lighting, methods):
        worker = workers.get(GRADER)
        worker.send(do="free")
        worker.receive(120.0)
        os.kill(worker._process.pid, signal.SIGKILL)
        return make(workers, name, lighting, methods)

    with monkeypatch.context() as patch:
        patch.setattr(Workers, "make", killed)
        lost = go(options(out, [scene], [steady, late]))
    assert [r.status for r in lost.values()] == ["failed"] * 2
    assert all(r.reason.startswith("the worker was killed by signal 9") for r in lost.values())
    again = go(options(out, [scene], [steady]))
    names = [r.scene["title"] for r in read_records(out)]
    assert sorted(r.key for r in read_records(out)) == sorted([again["steady"].key, lost["late"].key])
    assert set(names) == {again["steady"].scene["title"]}, "a failure has the column of its scene"
    found = go(options(out, [scene], [steady, late], retry=True))
    assert sorted(r.key for r in read_records(out)) == sorted(r.key for r in found.values())
    assert {r.reason for r in found.values()} == {"", "ArithmeticError: tired"}


def test_answers_of_a_scoring_process_that_is_killed_are_scored_by_another(scene, tmp_path, monkeypatch, capsys):
    """Twice: unseen, before it is asked, and while it loads. After one more there is no score, and the run says so."""
    pytest.importorskip("embreex", reason="the reference needs Embree")
    ask, send, kills = Run._ask_grades, Workers.send, []

    def killed(workers, name, when):
        if kills and kills[0] == when:
            kills.pop(0)
            process = workers.get(name)._process
            process.kill()
            process.wait()

    def asking(run, job, grader):
        killed(run.workers, grader, "idle")
        ask(run, job, grader)

    def sending(workers, worker, **command):
        send(workers, worker, **command)
        if grades(worker.name) and not command.get("make"):
            killed(workers, worker.name, command["do"])

    monkeypatch.setattr(Run, "_ask_grades", asking)
    monkeypatch.setattr(Workers, "send", sending)
    for number, planned in enumerate((["idle", "load"], ["idle", "load", "grade"])):
        out, kills = tmp_path / str(number), planned.copy()
        chosen = options(out, [scene], ["warp_bvh"], score=True, frames=1)
        (measured,) = Run(chosen, Silent()).go()
        assert not kills
        assert measured.status == "ok"
        assert not list((out / "journal").iterdir())
        if len(planned) == 2:
            assert measured.frames[0].score.true_errors == 0
            continue
        assert measured.frames[0].unscored.startswith("scoring failed: the worker was killed by signal 9")
        assert Run(chosen, Silent()).go() == [measured]
        assert shown(chosen, [measured], as_json=False) == 1
        assert "1 of 1 points failed; --retry measures them again" in capsys.readouterr().err
        (again,) = Run(replace(chosen, retry=True), Silent()).go()
        assert again.frames[0].score.true_errors == 0
        assert shown(chosen, [again], as_json=False) == 0


def test_answers_of_a_method_that_goes_elsewhere_are_found(package, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("first", "second"):
        write_scene(Path(f"{name}.obj"))
    chosen = options(Path("out"), ["first.obj", "second.obj"], ["wanders"], score=True, save_answers=True)
    records = Run(chosen, Silent()).go()
    assert Path.cwd() == tmp_path
    assert [(r.status, r.reason) for r in records] == [("ok", "")] * 2
    assert [len(r.frames) for r in records] == [1, 1]
    assert all(frame.unscored is None for r in records for frame in r.frames)
    assert {f"{r.key}-0.npz" for r in records} < {path.name for path in Path("out/answers").iterdir()}
    assert render(["first.obj"], "wanders", Path("picture.png"), size="8x8") == 0
    assert (tmp_path / "picture.png").exists()


def _breaking(runner, path):
    """Run with a file that is whole when asked for its hash, and broken when a worker reads it."""
    known = run_module.known_scene
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            run_module, "known_scene", lambda folder, load: None if load["scene"] == str(path) else known(folder, load)
        )
        return runner.go()


def test_answers_are_scored_against_the_reference(scene, tmp_path):
    pytest.importorskip("embreex", reason="the reference needs Embree")
    chosen = options(tmp_path, [scene], ["warp_bvh"], width=32, height=32, score=True, save_answers=True)
    (measured,) = Run(chosen, Silent()).go()
    score = measured.frames[0].score
    assert score.primary.pixels == 32 * 32
    assert score.true_errors == 0
    assert measured.frames[0].unscored is None
    assert measured.frames[0].shadow_rays > 0
    assert list((tmp_path / "truth").glob("*.npz"))
    assert (tmp_path / "answers" / f"{measured.key}-0.npz").exists()
    assert (tmp_path / "images" / "tetra-32x32.png").stat().st_size > 1000
    assert measured.frames[0].memory_bytes > 0


def test_several_graders_give_the_scores_of_one(scene, tmp_path):
    entries = [Entry("accuracy_ladder", {"test": t}, t) for t in ("exact", "woop", "float64")]
    found = {}
    for graders in (1, 2):
        out = tmp_path / str(graders)
        chosen = options(out, [scene], entries, score=True, frames=1, wrong_maps=True)
        records = Run(chosen, Silent(), graders=graders).go()
        found[graders] = {record.method["label"]: record for record in records}
        assert len(list((out / "logs").glob("grading*"))) == graders
        assert len(list((out / "maps").glob("*-wrong.png"))) == len(entries)
        assert not list((out / "journal").iterdir())
    for label, one in found[1].items():
        assert one.frames[0].score.check == "ok", label
        assert one.frames[0].score == found[2][label].frames[0].score, label


def test_a_slow_point_keeps_to_its_budget_and_says_so(package, tmp_path):
    points = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]] * 4)
    np.savez(tmp_path / "four.npz", V=points, F=np.array([[0, 1, 2]]))
    slow = Entry("steady", {"ms": "150"}, "slow")
    chosen = options(
        tmp_path / "out", [str(tmp_path / "four.npz")], [slow], frames=4, budget_s=0.5, samples=50, most=50
    )
    (measured,) = Run(chosen, Silent()).go()
    assert measured.status == "ok"
    assert measured.stopped_by == "budget"
    assert [f.frame for f in measured.frames] == [0]
    assert measured.frames_left_out == [1, 2, 3]
    assert [len(f.total_ms) for f in measured.frames] == [1]
    assert [r["round"] for r in measured.rounds] == [0]
