"""Whole runs: what a misbehaving method costs, memory, retries, scores, budgets."""

import os
import re
import shutil
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.kept import kept, session_folder
from helpers.tiny_runs import go, options, write_scene
from shadowbench.harness.commands.render import render
from shadowbench.harness.commands.run import shown
from shadowbench.harness.results.schema import read_records
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.runner.progress import Silent
from shadowbench.harness.runner.run import Run
from shadowbench.harness.runner.workers.pool import GRADER, Workers, grades


@pytest.fixture(scope="module")
def troubled(package, scene):
    """One run of every method of the package: its folder and its records by label. No test may write there."""
    out = session_folder() / "troubled"
    alike = "talker late once slow_start fickle rejects skips grows varies broken".split()
    entries = [Entry("steady", {"like": name}, name) for name in alike]
    entries += [Entry(name, {}, name) for name in ("steady", "raises", "hangs", "exits", "greedy", "hoards")]
    # A second point of a method whose worker was lost is measured by a new worker.
    entries += [Entry("hangs", {"ms": "1"}, "hangs again"), Entry("of_a_library", {}, "of_a_library")]
    entries.append(Entry("of_a_library", {"holds": "-1"}, "of less than nothing"))
    return out, kept(
        "the run of every method of the package", lambda: go(options(out, [scene], entries, timeout_s=6.0))
    )


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
        ("hangs", "timeout", "no answer within 6 s; the worker was stopped"),
        ("hangs again", "timeout", "no answer within 6 s; the worker was stopped"),
        ("exits", "failed", "the worker exited with code 3: leaving"),
        ("rejects", "rejected", "needs 1000000000 pairs, allowed are 1048576"),
        ("skips", "skipped", "only for closed scenes"),
        ("grows", "ok", ""),
        ("varies", "ok", ""),
        ("greedy", "ok", ""),
        ("hoards", "ok", ""),
        ("of_a_library", "ok", ""),
        ("of less than nothing", "failed", "ValueError: held_bytes() is -1: less than 0"),
        ("broken", "failed", "cannot be constructed: ImportError: libmissing.so: cannot open"),
    ],
)
def test_trouble_costs_its_own_point_only(troubled, label, status, reason):
    _, records = troubled
    assert (records[label].status, records[label].reason) == (status, reason)


def test_every_planned_point_has_one_record_that_holds_every_sample_and_no_journal(troubled):
    out, records = troubled
    assert len(records) == 19
    assert sorted(p.stem for p in (out / "records").iterdir()) == sorted(r.key for r in records.values())
    assert list((out / "journal").iterdir()) == []
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
    assert {r["place"] for r in records["steady"].rounds} <= set(range(19))
    assert {name: records[name].frames[0].regrown for name in ("grows", "varies", "steady")} == {
        "grows": 2, "varies": 1, "steady": 0,
    }  # fmt: skip
    assert [len(records[name].rounds) for name in ("once", "fickle")] == [0, 1], "rounds before other answers stay"


def started(run: Run) -> set[str]:
    """The names of the workers whose process was started at least once."""
    return {name for name, worker in run.workers._remotes.items() if worker.generation}


def test_a_second_run_measures_nothing_and_changes_no_byte(troubled, scene):
    out, _ = troubled
    before = {p: p.read_bytes() for p in (out / "records").iterdir()}
    entries = [Entry(name, {}, name) for name in ("steady", "hangs")]
    runner = Run(options(out, [scene], entries, timeout_s=6.0), Silent())
    again = runner.go()
    assert [r.status for r in again] == ["ok", "timeout"]
    assert started(runner) == set()
    assert {p: p.read_bytes() for p in (out / "records").iterdir()} == before


def test_memory_that_warp_does_not_allocate_is_counted(troubled):
    """320 MiB of numpy, held from frame to frame or allocated in each, or what a method says it holds, as a structure of a
    library on a GPU: no allocator of Warp's knows of it.
    """
    _, records = troubled
    held = {name: records[name].frames[0].memory_bytes for name in ("steady", "greedy", "hoards", "of_a_library")}
    assert held["steady"] < 1 << 20
    assert min(held["greedy"], held["hoards"]) > 300 << 20
    assert 5 << 20 <= held["of_a_library"] < 6 << 20
    source = records["of_a_library"].frames[0].memory_source
    assert source == "warp allocations and what the method holds besides"


def test_a_method_that_holds_more_than_it_may_is_rejected(package, scene, tmp_path):
    """By any means: with numpy, as a library does on a GPU, of which only the method knows."""
    entries = [Entry(name, {}, name) for name in ("greedy", "hoards", "of_a_library", "warp_bvh")]
    records = go(options(tmp_path, [scene], entries, memory=1 << 20, rounds=1))
    assert [records[e.method].status for e in entries] == ["rejected"] * 3 + ["ok"]
    for name in ("greedy", "hoards"):
        assert re.fullmatch(r"needs [\d,]+ bytes; the limit is 1,048,576", records[name].reason)
    assert records["of_a_library"].reason == "needs 5,242,880 bytes; the limit is 1,048,576"


@pytest.mark.parametrize("name", ["warp_bvh", "embree"])
def test_memory_does_not_depend_on_what_the_process_did_before(scene, tmp_path, name):
    """The first point of a process compiles kernels and loads libraries."""
    pytest.importorskip("embreex", reason="embree is what is measured")
    other = Entry(name, {"threads": "1"} if name == "embree" else {"update": "refit"}, "before")
    records = go(options(tmp_path, [scene], [other, Entry(name, {}, "it")], rounds=1))
    most = max(record.frames[0].memory_bytes for record in records.values())
    assert most < 4 << 20, "four triangles: not the library that was loaded and the kernels that were compiled"


def test_retry_measures_failed_points_only(troubled, scene, tmp_path):
    out, first = tmp_path / "out", troubled[1]
    shutil.copytree(troubled[0], out)
    entries = [Entry(name, {}, name) for name in ("steady", "raises")]
    kept, failed = (out / "records" / f"{first[entry.label].key}.json" for entry in entries)
    before, written, earlier = kept.read_bytes(), kept.stat().st_mtime_ns, failed.stat().st_mtime_ns
    runner = Run(options(out, [scene], entries, timeout_s=6.0, retry=True), Silent())
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
    plain = options(tmp_path, [scene], [entry], timeout_s=6.0).preset
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
    # The command line refuses such a file before anything starts; a file may also break in between.
    records = Run(options(tmp_path / "out", [good, str(broken)], ["steady"]), Silent()).go()
    assert [(r.scene["name"], r.status) for r in records] == [("good", "ok"), ("broken", "failed")]


def test_a_scene_that_is_made_at_last_has_no_column_of_its_failure(package, tmp_path, monkeypatch):
    """The worker that makes it is killed, as a system without memory does; then the same command is given again."""
    scene, out = write_scene(tmp_path / "My Tetra.obj"), tmp_path / "out"
    steady, late = Entry("steady", {}, "steady"), Entry("steady", {"like": "late"}, "late")
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
    """Twice: unseen, before it is asked, and while it loads. After one more there is no score, and the run says so, until it
    is tried again.
    """
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
    chosen = options(tmp_path, [scene], ["warp_bvh"], score=True, frames=1)
    kills += ["idle", "load", "grade"]
    (measured,) = Run(chosen, Silent()).go()
    assert (measured.status, kills) == ("ok", [])
    assert measured.frames[0].unscored.startswith("scoring failed: the worker was killed by signal 9")
    assert Run(chosen, Silent()).go() == [measured]
    assert shown(chosen, [measured], as_json=False) == 1
    assert "1 of 1 points failed; --retry measures them again" in capsys.readouterr().err
    kills += ["idle", "load"]
    (again,) = Run(replace(chosen, retry=True), Silent()).go()
    assert (again.frames[0].score.true_errors, kills) == (0, [])
    assert not list((tmp_path / "journal").iterdir())
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


@pytest.mark.slow
def test_several_graders_give_the_scores_of_one(scene, tmp_path):
    """Each point has its score, its answers and its map, and the scene its picture and its reference."""
    pytest.importorskip("embreex", reason="the reference needs Embree")
    entries = [Entry("accuracy_ladder", {"test": t}, t) for t in ("exact", "woop", "float64")]
    found = {}
    for graders in (1, 2):
        out = tmp_path / str(graders)
        chosen = options(out, [scene], entries, score=True, save_answers=True, frames=1, wrong_maps=True)
        records = Run(chosen, Silent(), graders=graders).go()
        found[graders] = {record.method["label"]: record for record in records}
        assert len(list((out / "logs").glob("grading*"))) == graders
        assert len(list((out / "maps").glob("*-wrong.png"))) == len(entries)
        assert not list((out / "journal").iterdir())
        assert list((out / "truth").glob("*.npz"))
        assert (out / "images" / "tetra-8x8.png").stat().st_size > 100
    for label, one in found[1].items():
        (frame,) = one.frames
        assert frame.score.check == "ok", label
        assert (frame.score.primary.pixels, frame.unscored) == (64, None)
        assert min(frame.shadow_rays, frame.memory_bytes) > 0
        assert (tmp_path / "1" / "answers" / f"{one.key}-0.npz").exists()
        assert frame.score == found[2][label].frames[0].score, label


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
