"""Records and journals: atomic, torn lines cut off, every sample kept, statistics on reading."""

import errno
import functools
import json
import operator
import os
import re

import numpy as np
import pytest
from helpers.experiment_records import record_of
from hypothesis import given, settings
from hypothesis import strategies as st
from shadowbench.harness import files
from shadowbench.harness.errors import UserError
from shadowbench.harness.results.journal import Journal
from shadowbench.harness.results.means import points
from shadowbench.harness.results.record import PassTimes, as_read, make_record
from shadowbench.harness.results.schema import read_records
from shadowbench.harness.results.table import table_of
from shadowbench.harness.runner.planning.experiment import Entry


def round_event(number, times, frames=(0,), stages=2):
    parts = (("sort", "build"), ("walk", "trace"), ("bin", "light build"), ("any hit", "shadow"))
    passes = [{"name": n, "part": p, "ms": [1.0 + k] * stages} for k, (n, p) in enumerate(parts)]
    one = {
        "started": 1.0 * number, "passes": passes, "stopped_by": "samples", "regrown": number, "memory_bytes": 64,
        "memory_source": "warp allocations",
    }  # fmt: skip
    samples = [
        {"frame": k, "total_ms": [t + k for t in times], "wall_ms": [t + k + 0.5 for t in times]} for k in frames
    ]
    return {
        "event": "round", "round": number, "place": 0, "peak_rss_bytes": 100 + number, "spent_s": 1.0,
        "method": {"built": {"kind": "lbvh"}}, "frames": [{**one, **sampled} for sampled in samples],
    }  # fmt: skip


SCENE = {"name": "s", "title": "S", "triangles": 3, "lights": [{}], "load_s": 0.25}
METHOD = {"name": "m", "title": "M", "label": "L", "device": "cpu", "device_name": "C"}
POINT = {"experiment": "e", "width": 4, "height": 4}


def made(events, **changes):
    return make_record("k", POINT, SCENE, METHOD, "env", events, **changes)


def finished_event(frames=(0,), score=None):
    return {
        "event": "finished",
        "frames": [{"frame": f, "counters": {"tests": 5}, "score": score, "unscored": None} for f in frames],
    }


def test_rounds_are_joined_in_their_order_and_nothing_is_dropped():
    whole = made([round_event(1, [5.0, 6.0]), round_event(0, [1.0, 2.0]), finished_event()])
    (frame,) = whole.frames
    assert (frame.total_ms, frame.wall_ms) == ([1.0, 2.0, 5.0, 6.0], [1.5, 2.5, 5.5, 6.5])
    assert (frame.round, frame.stage_round) == ([0, 0, 1, 1], [0, 0, 1, 1])
    assert (frame.passes[3], frame.regrown) == (PassTimes("any hit", "shadow", [4.0] * 4), 1)
    assert (frame.counters, whole.status, whole.peak_rss_bytes, whole.load_s) == ({"tests": 5}, "ok", 101, 0.25)
    assert (whole.method["built"], whole.stopped_by) == ({"kind": "lbvh"}, "samples")


def test_what_the_host_does_is_joined_by_round_and_has_columns():
    first, second = round_event(0, [1.0]), round_event(1, [2.0])
    graphs = made([first, second, finished_event()])
    for event, submitted in ((first, 0.5), (second, 1.5)):
        event["frames"][0]["submitted_ms"] = submitted
    launched = made([first, second, finished_event()])
    assert launched.frames[0].submitted_ms == [0.5, 1.5]
    (row,) = points(table_of([as_read(launched)])).to_dict("records")
    assert row["submitted_ms"] == 1.0
    launched.frames[0].row_ms = [0.75, 1.75]  # as earlier records had it
    assert as_read(launched).frames[0].total_ms == [0.75, 1.75]
    (row,) = points(table_of([as_read(graphs)])).to_dict("records")
    assert np.isnan(row["submitted_ms"])
    assert "submitted_ms" not in graphs.to_json()["frames"][0]


def test_a_point_that_never_ran_has_a_record_too():
    whole = made([], status="rejected", reason="needs 7 pairs")
    assert (whole.frames, whole.status, whole.reason) == ([], "rejected", "needs 7 pairs")
    (row,) = points(table_of([whole])).to_dict("records")
    assert (row["status"], row["reason"], row["unscored"]) == ("rejected", "needs 7 pairs", "not measured")
    assert (row["frames"], row["samples"]) == (0, 0)
    assert np.isnan([row["total_ms"], row["between_ms"], row["build_ms"]]).all()
    with pytest.raises(ValueError, match="not one of"):
        made([], status="lost")


def test_statistics_of_a_point():
    events = [round_event(0, [10.0, 11.0, 12.0], (0, 2)), round_event(1, [14.0, 15.0, 16.0], (0, 2))]
    (row,) = points(table_of([made([*events, finished_event((0, 2))])])).to_dict("records")
    # Medians of 10 11 12 14 15 16 and of the same plus 2; their mean.
    assert row["total_ms"] == 14.0
    assert row["iqr_ms"] == np.subtract(*np.percentile([10, 11, 12, 14, 15, 16], [75, 25]))
    assert (row["between_ms"], row["frames"], row["samples"]) == (4.0, 2, 6)
    parts = [row[f"{part}_ms"] for part in ("build", "trace", "light_build", "shadow")]
    assert (parts, row["stage_gap"]) == ([1.0, 2.0, 3.0, 4.0], (10.0 - 14.0) / 14.0)


def test_a_journal_is_on_the_disk_line_by_line(tmp_path):
    path = tmp_path / "journal" / "k.jsonl"
    journal = Journal(path)
    journal.append({"event": "prepared", "compile_s": 1.5})
    journal.append(round_event(0, [1.0]))
    again = Journal(path)
    assert (again.events, list(again.rounds())) == (journal.events, [0])
    assert again.first("prepared")["compile_s"] == 1.5
    assert again.first("finished") is None
    again.remove()
    assert Journal(path).events == []


@settings(max_examples=60, deadline=None)
@given(cut=st.integers(1, 400), junk=st.binary(max_size=8))
def test_a_torn_journal_keeps_its_whole_lines_and_can_be_written_on(tmp_path_factory, cut, junk):
    path = tmp_path_factory.mktemp("torn") / "k.jsonl"
    journal = Journal(path)
    for number in range(3):
        journal.append({"event": "round", "round": number, "text": "x" * 50})
    lines = path.read_bytes().splitlines(keepends=True)
    whole = b"".join(lines)
    kept = whole[: max(0, len(whole) - cut)]
    path.write_bytes(kept + junk.replace(b"\n", b""))
    torn = Journal(path)
    complete = kept.count(b"\n")
    # The junk may happen to end nothing: only whole lines count.
    assert [e["round"] for e in torn.events] == list(range(complete))
    assert path.read_bytes() == b"".join(lines[:complete])
    torn.append({"event": "round", "round": 9})
    assert [e["round"] for e in Journal(path).events] == [*range(complete), 9]


def test_a_journal_that_cannot_be_written_stays_as_it_was(tmp_path, monkeypatch):
    journal = Journal(tmp_path / "k.jsonl")
    journal.append({"event": "prepared"})
    before = journal.path.read_bytes()

    def full(handle):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        journal.append(round_event(0, [1.0]))
    assert (journal.path.read_bytes(), [e["event"] for e in journal.events]) == (before, ["prepared"])


def test_a_write_is_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "r.json"
    files.write_atomic(path, {"a": 1})
    monkeypatch.setattr(os, "replace", lambda *_: (_ for _ in ()).throw(OSError(errno.EIO, "broken")))
    with pytest.raises(OSError, match="broken"):
        files.write_atomic(path, {"a": 2})
    assert (json.loads(path.read_text()), list(tmp_path.iterdir())) == ({"a": 1}, [path])


def test_not_a_number_is_never_written(tmp_path):
    with pytest.raises(ValueError, match="JSON"):
        files.write_atomic(tmp_path / "r.json", {"a": float("nan")})
    assert list(tmp_path.iterdir()) == []


def test_reading_says_what_is_wrong(tmp_path):
    with pytest.raises(UserError, match="no records here"):
        read_records(tmp_path)
    folder = tmp_path / "records"
    folder.mkdir()
    whole = made([round_event(0, [1.0]), finished_event()])
    files.write_atomic(folder / "k.json", whole.to_json())
    assert read_records(tmp_path) == [whole]
    files.write_atomic(folder / "old.json", {**whole.to_json(), "schema": 0})
    with pytest.raises(UserError, match=r"old.json: schema 0, this version reads 1"):
        read_records(tmp_path)
    for text, said in (
        ("{", "not a record"),
        ("[]", "all of it is [], not an object"),
        ('{"schema": "\\u001b"}', r"schema \x1b"),
    ):
        (folder / "old.json").write_text(text)
        with pytest.raises(UserError, match=re.escape(said)) as refused:
            read_records(tmp_path)
        assert "old.json: " in str(refused.value)


def test_fields_that_old_records_lack_may_be_absent(tmp_path):
    whole = made([round_event(0, [1.0]), finished_event()])
    old = {k: v for k, v in whole.to_json().items() if k not in ("baseline_rss_bytes", "load_s", "rounds")}
    (frame,) = old["frames"]
    for name in ("started", "stopped_by", "memory_source", "counters", "score"):
        del frame[name]
    files.write_atomic(tmp_path / "records" / "k.json", old)
    (read,) = read_records(tmp_path)
    assert (read.rounds, read.frames[0].started, read.frames[0].score) == ([], [], None)
    assert read.frames[0].total_ms == whole.frames[0].total_ms


WRONG = r"""
point.width = "abc" -> point.width is 'abc', not a whole number
point.width = 1000000 -> point.width is 1000000: more than 99999
scene = null -> scene is None, not an object
scene.name = "a/b" -> scene.name is 'a/b', not the name of a file
scene.lights = [{"x": NaN}] -> scene.lights[0].x is nan, not a number
scene.triangles = 1000000000000000000000000000000 -> scene.triangles is 1000000000000000000000000000000: more than
scene.lighting.label = [] -> scene.lighting.label is [], not text
scene.source.kind = 3 -> scene.source.kind is 3, not text
method = gone -> it has no method
method.more = [1e999] -> method.more[0] is inf, not a number
method.settings = {"k": NaN} -> method.settings[k] is nan, not a number
key = "../../escape" -> key is '../../escape', not the name of a file
environment = "/etc/passwd" -> environment is '/etc/passwd', not the name of a file
status = "fine" -> status 'fine' is not one of ok, skipped, failed, timeout, rejected
compile_s = -1.0 -> compile_s is -1.0: less than 0
peak_rss_bytes = 10.5 -> peak_rss_bytes is 10.5, not a whole number
rounds = [{"run": {"a": 1}}] -> rounds[0].run is {'a': 1}, not text
rounds = [{"noted": "now"}] -> rounds[0].noted is 'now', not a number
rounds = [{"clock": {"gpu": [1]}}] -> rounds[0].clock.gpu is [1], not an object
frames.0.total_ms = [1.0, null] -> frames[0].total_ms[1] is None
frames.0.total_ms = [-1.0] -> frames[0].total_ms[0] is -1.0: less than 0
frames.0.total_ms = [NaN] -> frames[0].total_ms[0] is nan, not a number
frames.0.total_ms = [Infinity] -> frames[0].total_ms[0] is inf, not a number
frames.0.total_ms = [-Infinity] -> frames[0].total_ms[0] is -inf, not a number
frames.0.wall_ms = [true] -> frames[0].wall_ms[0] is True, not a number
frames.0.wall_ms = [1.0] -> frames[0]: wall_ms has 1 entries, total_ms 2
frames.0.memory_bytes = -5 -> frames[0].memory_bytes is -5: less than 0
frames.0.regrown = -1 -> frames[0].regrown is -1: less than 0
frames.0.speed = 1 -> frames[0].speed is no field that this version knows
frames.0.stage_round = [0] -> frames[0]: build has 2 samples, stage_round 1
frames.0.passes.1.ms = [-9.0, -9.0] -> frame 0: passes add up to -2 ms, less than 0
method.device = "cpu"; frames.0.passes.1.ms = [-0.2, 0.3] -> frame 0: a pass takes -0.2 ms, less than 0
frames.0.score.true_errors = -1 -> frames[0].score.true_errors is -1: less than 0
frames.0.score.true_errors = gone -> it has no frames[0].score.true_errors
frames.0.score.excused_share = "0" -> frames[0].score.excused_share is '0', not a number
frames.0.score.primary.pixels = "x" -> frames[0].score.primary.pixels is 'x', not a whole number
frames.0.score.primary.pixels = null -> frames[0].score.primary.pixels is None, not a whole number
frames.0.score.primary.ties = 1 -> frames[0].score.primary.ties is no field that this version knows
frames.0.score.shadow = [3] -> frames[0].score.shadow[0] is 3, not an object
frames.0.score.shadow = {} -> frames[0].score.shadow is {}, not a list
"""
"""What is set in a record, as JSON that Python reads, and what is said of it."""


@pytest.mark.parametrize("line", WRONG.strip().splitlines())
def test_a_wrong_field_is_reported_by_its_file_and_its_name(tmp_path, line):
    changes, said = line.split(" -> ")
    whole = record_of("frame_time", Entry("bvh2", {}, "tree"))
    for change in changes.split("; "):
        path, value = change.split(" = ")
        *steps, last = (int(step) if step.isdigit() else step for step in path.split("."))
        inner = functools.reduce(operator.getitem, steps, whole)
        inner[last] = json.loads(value) if value != "gone" else None
        if value == "gone":
            del inner[last]
    (tmp_path / "records").mkdir()
    (tmp_path / "records" / "k.json").write_text(json.dumps(whole))
    with pytest.raises(UserError) as refused:
        read_records(tmp_path)
    assert f"records/k.json: not a record ({said}" in str(refused.value)
    assert len(str(refused.value)) < 600


def test_what_cannot_be_read_is_not_called_unwritten(tmp_path, monkeypatch):
    (tmp_path / "records" / "dir.json").mkdir(parents=True)
    with pytest.raises(UserError, match=r"dir\.json: cannot be read \(Is a directory\)"):
        read_records(tmp_path)

    def locked(self):
        raise PermissionError(errno.EACCES, "Permission denied", str(self))

    monkeypatch.setattr(type(tmp_path), "iterdir", locked)
    with pytest.raises(UserError, match=r"records: cannot be read \(Permission denied\)"):
        read_records(tmp_path)


def test_equal_configurations_have_equal_hashes():
    assert files.digest({"a": 1, "b": [1.5]}) == files.digest({"b": [1.5], "a": 1})
    assert files.digest([-1]) != files.digest([1])
    assert files.digest({"a": "1"}) != files.digest({"a": 1})
