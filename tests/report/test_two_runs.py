"""The verdict between two runs, on made records: equal, 3 % slower, throttled, too few rounds, too noisy."""

import copy
import json
import math
from functools import partial

import numpy as np
import pytest
from helpers.experiment_records import record_of, score, write_records
from shadowbench.harness.report import two_runs
from shadowbench.harness.results.throttled import throttled
from shadowbench.harness.runner.planning.experiment import Entry

TREE, GRIDS, EMBREE = (
    Entry("warp_bvh", {}, "tree"),
    Entry("ray_grids", {}, "grids"),
    Entry("embree", {}, "on the CPU"),
)
FACTS = {
    "cpu": {"model": "A CPU", "usable_cores": 2},
    "warp": "1.0",
    "gpus": [{"name": "A GPU", "smi": {"driver_version": "1"}}],
}
CLEAR, THERMAL = "0x0000000000000000", "0x0000000000000020"


def made(entry, ms, seed, scene="cloth", rounds=9, noise=0.004, throttled=(), slow=1.5):
    """A record of ``rounds`` rounds about ``ms``; those of ``throttled`` take ``slow`` times as long and say why."""
    record = record_of("frame_time", entry, scene, ms=ms)
    draws = np.random.default_rng(seed).normal(1.0, noise, (rounds, 3)) * ms
    for number in throttled:
        draws[number] *= slow
    (frame,) = record["frames"]
    frame["total_ms"] = frame["wall_ms"] = [float(x) for x in draws.ravel()]
    frame["round"] = [i for i in range(rounds) for _ in range(3)]
    record["method"]["source_sha256"] = f"version of {entry.method}"
    record["scene"]["arrays_sha256"] = f"arrays of {scene}"
    record["rounds"] = [
        {"round": i, "run": "one", "clock": {"gpu": {"clocks.sm": "1980",
         "clocks_throttle_reasons.active": THERMAL if i in throttled else CLEAR}}}
        for i in range(rounds)
    ]  # fmt: skip
    return record


def write(folder, records, facts=FACTS):
    write_records(folder, records)
    (folder / "environments").mkdir()
    (folder / "environments" / "e.json").write_text(json.dumps(facts))
    return folder


@pytest.fixture
def call(call):
    return partial(call, "compare")


@pytest.fixture
def pair(tmp_path):
    """Two runs: the tree is equal in both, the grids take 3 % longer in B, Embree's B has two throttled rounds."""
    a = [made(e, ms, i, s) for i, (e, ms, s) in enumerate((e, ms, s) for s in ("cloth", "buddha")
         for e, ms in ((TREE, 1.0), (GRIDS, 0.5), (EMBREE, 20.0)))]  # fmt: skip
    b = [made(e, ms, 50 + i, s, **more) for i, (e, ms, s, more) in enumerate((e, ms, s, more) for s in ("cloth", "buddha")
         for e, ms, more in ((TREE, 1.0, {}), (GRIDS, 0.515, {}),
                             (EMBREE, 20.0, {"rounds": 11, "throttled": (3, 7)})))]  # fmt: skip
    return write(tmp_path / "a", a), write(tmp_path / "b", b)


def test_equal_slower_and_throttled_runs(call, pair):
    code, out, _ = call(*pair, "--json")
    found = json.loads(out)
    verdicts = {(row["scene"], row["label"]): row for row in found["points"]}
    assert {key: row["verdict"] for key, row in verdicts.items()} == {
        (f"{scene} (stand-in)", label): verdict
        for scene in ("Cloth", "Buddha")
        for label, verdict in (("tree", "same"), ("grids", "slower"), ("on the CPU", "same"))
    }
    assert {row["label"]: row["verdict"] for row in found["geometric_means"]} == {
        "tree": "same", "grids": "slower", "on the CPU": "same",
    }  # fmt: skip
    assert verdicts["Cloth (stand-in)", "grids"]["gap"] == pytest.approx(0.03, abs=0.006)
    assert {(left["run"], left["round"], left["reason"]) for left in found["left_out"]} == {
        ("B", 3, "clocks throttled (temperature (software))"), ("B", 7, "clocks throttled (temperature (software))"),
    }  # fmt: skip
    assert code == 0
    counts = {what: {word: n for word, n in own.items() if n} for what, own in found["counts"].items()}
    assert counts == {"points": {"slower": 2, "same": 4}, "geometric_means": {"slower": 1, "same": 2}}


def test_exit_codes_follow_the_verdicts(call, pair):
    a, b = pair
    code, out, _ = call(a, b, "--fail-on", "slower")
    assert code == 1
    assert "6 points: 2 slower, 4 same. 3 geometric means: 1 slower, 2 same." in out
    assert "fails: slower: 2 points, 1 geometric mean" in out
    assert (call(a, b, "--fail-on", "faster")[0], call(b, a, "--fail-on", "faster")[0]) == (0, 1)
    code, out, _ = call(a, b)
    assert code == 0
    assert (
        "left out: 4 rounds of B, clocks throttled (temperature (software)): Buddha (stand-in), on the CPU (4, 8); "
        "Cloth (stand-in), on the CPU (4, 8)" in " ".join(out.split())
    )


def judged(record, wrong=0, excused=0.0):
    """The record with a score of so many wrong answers, or a share of excused ones."""
    changed = copy.deepcopy(record)
    for frame in changed["frames"]:
        frame["score"] = score(4, wrong)
        frame["score"]["excused_share"] = excused
        frame["score"]["check"] = "failed" if wrong or excused > 0.001 else "ok"
    return changed


def unjudged(record):
    """The record without a score."""
    changed = copy.deepcopy(record)
    for frame in changed["frames"]:
        frame.update(score=None, unscored="not requested")
    return changed


def test_a_point_that_is_gone_fails_with_slower(call, pair, tmp_path):
    a, b = pair
    for place in (b / "records").glob("*on_the_CPU*"):
        place.unlink()
    lost = "missing: Buddha (stand-in), on the CPU; Cloth (stand-in), on the CPU"
    code, out, _ = call(b, b, "--fail-on", "slower", "--json")
    assert (code, json.loads(out)["fails"], json.loads(out)["missing"]) == (0, [], [])
    code, out, _ = call(a, b, "--fail-on", "missing", "--json")
    assert (code, json.loads(out)["fails"]) == (1, [lost])
    code, out, _ = call(a, b, "--fail-on", "slower")
    assert code == 1
    assert f"fails: {lost}" in " ".join(out.split())
    assert call(a, b, "--fail-on", "cannot-tell", "--fail-on", "faster")[0] == 0
    assert call(a, b, "--fail-on", "missing", "--allow", "missing")[0] == 0
    assert call(b, a, "--fail-on", "missing")[0] == 0, "what only B has is not missing"


@pytest.mark.parametrize("status", ["failed", "timeout", "rejected", "skipped"])
def test_a_point_that_b_could_not_measure_is_missing(call, tmp_path, status):
    a, b = made(TREE, 1.0, 1), made(TREE, 1.0, 2)
    b.update(status=status, reason="it fell over", frames=[])
    one, other = write(tmp_path / "a", [a]), write(tmp_path / "b", [b])
    code, out, _ = call(one, other, "--fail-on", "slower", "--json")
    assert (code, json.loads(out)["fails"]) == (1, ["missing: Cloth (stand-in), tree"])
    assert call(other, one, "--fail-on", "slower")[0] == 0


def test_what_neither_run_could_measure_is_not_measured(call, tmp_path):
    """Apart from what cannot be told: here the tree's, which has too few rounds."""
    for name in "ab":
        refused = {**made(GRIDS, 1.0, 1), "status": "rejected", "reason": "no such mesh", "frames": []}
        write(tmp_path / name, [made(TREE, 1.0, 1, rounds=8), refused])
    code, out, _ = call(tmp_path / "a", tmp_path / "b", "--fail-on", "cannot-tell")
    out = " ".join(out.split())
    assert code == 1
    assert "1 can't tell, 1 not measured." in out
    assert "not measured: rejected in A: no such mesh (Cloth (stand-in), grids)" in out
    assert "fails: cannot-tell: 1 point" in out


@pytest.mark.parametrize(("in_a", "in_b", "ms", "verdict"), [
    ({}, {"wrong": 1}, 0.5, "wrong"), ({}, {"wrong": 1}, 1.0, "wrong"), ({}, {"wrong": 1}, 1.5, "slower"),
    ({"wrong": 3}, {"wrong": 4}, 0.5, "wrong"), ({"wrong": 3}, {"wrong": 3}, 0.5, "faster"),
    ({"wrong": 3}, {}, 0.5, "faster"), ({}, {"excused": 0.01}, 0.5, "wrong"), (None, {"wrong": 1}, 0.5, "wrong"),
    ({}, None, 0.5, "can't tell"), ({}, None, 1.5, "slower"), (None, None, 0.5, "faster"),
])  # fmt: skip
def test_what_is_faster_because_it_is_wrong_is_never_faster(call, tmp_path, in_a, in_b, ms, verdict):
    """``in_a``, ``in_b``: the answers of each, None: not judged."""
    for name, asked, time in (("a", in_a, 1.0), ("b", in_b, ms)):
        records = [made(TREE, time, 7 + i, scene) for i, scene in enumerate(("cloth", "buddha"))]
        write(tmp_path / name, [unjudged(one) if asked is None else judged(one, **asked) for one in records])
    code, out, _ = call(tmp_path / "a", tmp_path / "b", "--fail-on", "wrong", "--json")
    found = json.loads(out)
    assert {row["verdict"] for row in found["points"]} == {verdict}
    errs = in_b is not None and in_b != {} and in_b != in_a
    assert ((code == 1), bool(found["wrong"])) == (errs, errs)
    (mean,) = found["geometric_means"]
    assert mean["verdict"] == verdict
    assert (call(tmp_path / "a", tmp_path / "b", "--fail-on", "slower")[0] == 1) == (errs or verdict == "slower")
    assert call(tmp_path / "a", tmp_path / "b", "--fail-on", "faster")[0] == (verdict == "faster")


def verdict(tmp_path, a, b, again=None):
    from shadowbench.harness.results.schema import read_records

    runs = []
    for number, record in enumerate(filter(None, (a, b, again))):
        runs.append(two_runs.entries(read_records(write_records(tmp_path / str(number), [record]))))
    (row,) = two_runs.compared(*runs).rows
    return row


def test_few_rounds_say_what_to_run(tmp_path):
    row = verdict(tmp_path, made(TREE, 1.0, 1, rounds=8), made(TREE, 2.0, 2))
    assert (row.verdict, row.reason) == (two_runs.OPEN, "8 in A of 9 rounds; run with --rounds 9")


def test_noise_and_drift_of_the_machine_hide_a_gap(tmp_path):
    noisy = verdict(tmp_path / "noisy", made(TREE, 1.0, 1, noise=0.2), made(TREE, 1.03, 2, noise=0.2))
    assert noisy.verdict == two_runs.OPEN
    drifting = [made(TREE, ms, i, rounds=12, noise=0.001) for i, ms in enumerate((1.0, 1.04))]
    for number, one in enumerate(drifting[0]["frames"][0]["round"]):
        drifting[0]["frames"][0]["total_ms"][number] *= 1.0 + 0.1 * (one > 5)
    row = verdict(tmp_path / "drift", *drifting)
    assert row.spread > 0.09
    assert row.verdict == two_runs.OPEN


def test_a_second_run_of_a_tells_the_spread_between_runs(tmp_path):
    a, b, again = (made(TREE, ms, i) for i, ms in enumerate((1.0, 1.04, 1.06)))
    assert verdict(tmp_path / "alone", a, b).verdict == two_runs.SLOWER
    row = verdict(tmp_path / "again", a, b, again)
    assert (row.verdict, row.spread) == (two_runs.OPEN, pytest.approx(0.06, abs=0.01))


def test_a_lower_clock_counts_as_throttled_where_no_reason_is_reported(tmp_path):
    b = made(TREE, 1.0, 2, rounds=10, throttled=(4,))
    for one in b["rounds"]:
        one["clock"]["gpu"] = {"clocks.sm": "1200" if one["round"] == 4 else "1980"}
    row = verdict(tmp_path, made(TREE, 1.0, 1), b)
    assert (row.verdict, row.rounds_b) == (two_runs.SAME, 9)


def test_rounds_of_a_cpu_that_had_too_much_to_do_are_left_out(call, tmp_path):
    busy = made(EMBREE, 20.0, 2, rounds=10)
    busy["method"]["device"] = "cpu"
    for one in busy["rounds"]:
        one["clock"] = {"load": 2.6 if one["round"] == 5 else 1.0, "gpu": None}
    quiet = {**made(EMBREE, 20.0, 1), "method": busy["method"]}
    a, b = write(tmp_path / "a", [quiet]), write(tmp_path / "b", [busy])
    _, out, _ = call(a, b)
    assert "left out: 1 round of B, load 2.6 on 2 cores: Cloth (stand-in), on the CPU (6)" in out
    assert "1 point: 1 same." in out


def test_many_rounds_left_out_are_one_line_for_each_reason_and_all_of_them_on_request(call, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "4000")  # workers of pytest-xdist have 80
    scenes = ("cloth", "fairy", "sibenik", "buddha", "conference", "bunny_dragon")
    quiet = [made(EMBREE, 20.0, 1, scene) for scene in scenes]
    busy = [made(EMBREE, 20.0, 2, scene, rounds=12) for scene in scenes]
    for one in quiet + busy:
        one["method"]["device"] = "cpu"
    for one in (single for record in busy for single in record["rounds"]):
        one["clock"] = {"load": 2.6 + one["round"] / 10 if one["round"] < 3 else 1.0, "gpu": None}
    a, b = write(tmp_path / "a", quiet), write(tmp_path / "b", busy)
    short, whole = ([x for x in call(a, b, *more)[1].splitlines() if "left out" in x] for more in ((), ("--all",)))
    assert len(short) == len(whole) == 1
    assert short[0].startswith("left out: 18 rounds of B, e.g. load 2.6 on 2 cores: ")
    assert short[0].count("on the CPU (1, 2, 3)") == 4
    assert short[0].endswith(" and 2 more")
    assert whole[0].count("on the CPU (1, 2, 3)") == 6
    assert len(json.loads(call(a, b, "--json")[1])["left_out"]) == 18


@pytest.mark.parametrize(("change", "said", "allow"), [
    (lambda r, f: f["gpus"][0].update(name="Another"), "machine: A GPU and A CPU (2 cores) in A, Another", "machine"),
    (lambda r, f: f["gpus"][0]["smi"].update(driver_version="2"), "driver: 1 in A, 2 in B", "driver"),
    (lambda r, f: r["scene"].update(arrays_sha256="x"), "scene Cloth (stand-in): is not the same version", "scene"),
])  # fmt: skip
def test_what_is_not_alike_is_refused_unless_asked(call, refused_call, tmp_path, change, said, allow):
    record, facts = made(TREE, 1.0, 2), copy.deepcopy(FACTS)
    change(record, facts)
    a, b = write(tmp_path / "a", [made(TREE, 1.0, 1)]), write(tmp_path / "b", [record], facts)
    err = refused_call(a, b)
    assert said in err
    assert f"--allow {allow}" in err
    assert call(a, b, "--allow", allow)[0] == 0


def test_bad_input_is_one_line(refused_call, tmp_path):
    whole = write(tmp_path / "a", [made(TREE, 1.0, 1)])
    (tmp_path / "empty").mkdir()
    half = write(tmp_path / "half", [made(TREE, 1.0, 1)])
    path = next((half / "records").glob("*.json"))
    path.write_text(path.read_text()[:300])
    two = [made(TREE, 1.0, 1), made(TREE, 1.0, 1, scene="buddha")]
    two[1]["method"]["source_sha256"] = "another"
    mixed = write(tmp_path / "mixed", two)
    for other, said in (
        (tmp_path / "none", "no such folder"),
        (tmp_path / "empty", "no records in it"),
        (half, "not a record"),
        (mixed, "has several versions of warp_bvh"),
        (write(tmp_path / "others", [made(GRIDS, 1.0, 1)]), "have no entry in common"),
    ):
        assert said in refused_call(whole, other)


def test_holm_and_the_spread_of_a_run_against_itself():
    assert two_runs.holm([0.01, 0.04, math.nan, 0.03]) == pytest.approx([0.03, 0.06, math.nan, 0.06], nan_ok=True)
    quiet = np.full(9, 2.0)
    assert two_runs.own_spread(quiet) == 0.0
    gap, low, high = two_runs.gap_between(quiet, quiet * 1.1)
    assert (gap, low, high) == pytest.approx((0.1, 0.1, 0.1))


@pytest.mark.parametrize("bits", ["nan", "inf", "-inf", "0x" + "f" * 400, "[N/A]", None])
def test_reasons_that_are_no_number_are_not_known(bits):
    """A round then counts as throttled by its clock alone."""
    gpu = {"clocks_throttle_reasons.active": bits, "clocks.sm": "1500"}
    assert throttled({"clock": {"gpu": gpu}}, 1980.0) == "1500 MHz where 1980 are usual"
    assert throttled({"clock": {"gpu": {**gpu, "clocks.sm": bits}}}, 1980.0) == ""
