"""Records that anyone may have written: read within stated limits, refused in one line, or shown harmlessly."""

import contextlib
import json
import lzma
import os
from pathlib import Path

import numpy as np
import pytest
from helpers.experiment_records import record_of, write_records
from helpers.mesh_files import traced_memory
from helpers.tiny_runs import options
from shadowbench.harness import files
from shadowbench.harness.commands.compare import compare
from shadowbench.harness.commands.keep import keep
from shadowbench.harness.commands.listing import rows_of
from shadowbench.harness.commands.report import report
from shadowbench.harness.commands.run import run
from shadowbench.harness.commands.show import show
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame import registry
from shadowbench.harness.results import pixel_maps, schema
from shadowbench.harness.results.disputes import read_disputes
from shadowbench.harness.results.folder import ResultsFolder, read_environment, read_json
from shadowbench.harness.results.table import samples, tidy
from shadowbench.harness.results.throttled import disturbances
from shadowbench.harness.runner.machine import environment
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.runner.workers.pool import GRADER, Workers
from shadowbench.harness.scene.chosen_view import ChosenView

ODD = "a\x1b[31m<b>x</b> $\\foo$ & $ \udc80 \u202e | [l](javascript:1) `c`"
METHODS = ("ray_grids", "bvh2", "warp_bvh")


def one() -> dict:
    return record_of("frame_time", Entry("bvh2", {}, "tree"))


def refused(folder) -> str:
    with pytest.raises(UserError) as found:
        schema.read_records(folder)
    line = str(found.value)
    assert "\n" not in line
    assert len(line) < 600
    return line


def packed(folder, content: bytes):
    (folder / "records").mkdir()
    (folder / "records" / schema.ARCHIVE).write_bytes(content)
    return folder


@pytest.mark.parametrize(
    ("content", "limit"),
    [(b"x" * 3_000_000, "MOST_RECORD"), (json.dumps(one()).encode() + b"\n" * 3_000_000, "MOST_UNPACKED")],
)
def test_an_archive_that_unpacks_to_too_much_is_refused(tmp_path, monkeypatch, content, limit):
    monkeypatch.setattr(schema, limit, 2_000_000)
    monkeypatch.setattr(schema, "BLOCK", 1 << 16)
    whole = packed(tmp_path, lzma.compress(content * 20))
    with traced_memory() as most:
        assert "line" in refused(whole)
        assert most() < 20_000_000


@pytest.mark.parametrize(("damage", "said"), [
    (lambda text: lzma.compress(text)[:-40], "damaged (it ends too early)"),
    (lambda text: b"not at all" * 9, "damaged (Input format not supported"),
    (lambda text: lzma.compress(b"{}\n"), "line 1: schema None"),
    (lambda text: lzma.compress(text + b"[\n"), "line 2: not a record"),
    (lambda text: lzma.compress(text) + b"x", "bytes follow its end"),
    (lambda text: lzma.compress(text, preset=9), "damaged (Memory usage limit"),
])  # fmt: skip
def test_a_damaged_archive_is_reported_by_its_name(tmp_path, monkeypatch, damage, said):
    monkeypatch.setattr(schema, "MOST_DICTIONARY", 32 << 20)
    line = refused(packed(tmp_path, damage(json.dumps(one()).encode() + b"\n")))
    assert said in line
    assert schema.ARCHIVE in line


def test_a_record_that_is_too_long_or_no_file_is_refused(tmp_path, monkeypatch):
    place = write_records(tmp_path, [one()]) / "records"
    monkeypatch.setattr(schema, "MOST_RECORD", 100)
    assert "longer than 100 bytes" in refused(tmp_path)
    monkeypatch.undo()
    os.mkfifo(place / "pipe.json")
    assert "pipe.json: cannot be read (not a regular file)" in refused(tmp_path)
    (place / "pipe.json").unlink()
    (place / "zero.json").symlink_to("/dev/zero")
    assert "zero.json: cannot be read (not a regular file)" in refused(tmp_path)


def test_records_are_read_one_after_another(tmp_path):
    """The memory for many is that of one and of what is made of them."""
    long = [10.0 + i / 7 for i in range(2000)]
    made = []
    for number in range(30):
        record = record_of("frame_time", Entry("bvh2", {}, f"tree {number}"))
        frame = record["frames"][0]
        frame.update(total_ms=long, wall_ms=long, round=[0] * 2000, stage_round=[0] * 2000)
        frame["passes"] = [{**step, "ms": long} for step in frame["passes"]]
        made.append(record)
    write_records(tmp_path, made)
    size = sum(path.stat().st_size for path in (tmp_path / "records").iterdir())
    tidy(tmp_path)
    with traced_memory() as most:
        tidy(tmp_path)
        disturbances(tmp_path)
        assert most() < size / 2, "all of them would take more than their text"
    found = samples(tmp_path)
    assert len(found) == 30 * 2000 * 6
    assert found.memory_usage(deep=True).sum() < 60 * len(found)


def odd_folder(place):
    """Records with odd texts wherever there may be a text, and lists and objects in free fields."""
    made = []
    for method in METHODS:
        for scene in ("cloth", "fairy"):
            for status in ("ok", "failed"):
                record = record_of("frame_time", Entry(method, {}, method + status), scene, status=status)
                record["key"] = f"{method}-{scene}-{status}"
                record["reason"] = ODD * (status != "ok")
                record["scene"] |= {"title": scene + ODD, "view": ODD, "notes": ODD, "stand_in": ODD,
                                    "lighting": {"label": "", "target": [1, 2], "more": {ODD: [1]}}}  # fmt: skip
                record["method"] |= {"title": ODD, "known_inexact": ODD, "device_name": ODD, ODD: [ODD],
                                     "settings": {"k": [1, {ODD: 2}]}, "built": {ODD: {"a": [ODD]}}}  # fmt: skip
                made.append(record)
    write_records(place, made)
    (place / "environments").mkdir()
    (place / "environments" / "e.json").write_text(json.dumps({"cpu": {"model": ODD}, "gpus": [], ODD: ODD}))
    return place


def test_odd_texts_are_shown_harmlessly(tmp_path, capfd):
    place = odd_folder(tmp_path / "run")
    for path in show("frame_time", place):
        assert path.is_file()
    assert (keep([place], tmp_path / "kept"), report(place, tmp_path / "report.html")) == (0, 0)
    assert compare(place, tmp_path / "kept", allow=["driver"]) == 0
    said = "".join(capfd.readouterr())
    assert r"\x1b[31m<b>" in said
    written = said + "".join(
        path.read_bytes().decode("utf-8")  # without halves of characters
        for path in tmp_path.rglob("*")
        if path.suffix in (".md", ".csv", ".svg", ".html")
    )
    assert "\x1b" not in written.replace("\x1b[3m", "").replace("\x1b[0m", "")
    assert "\u202e" not in written
    text = (place / "frame_time.md").read_text()
    assert "<b>" not in text
    assert "](javascript" not in text
    assert "<b>x</b> $" not in (tmp_path / "report.html").read_text().split("<script")[0]


@pytest.mark.parametrize(
    "facts",
    ['{"cpu": "x"}', '{"gpus": 3}', '{"gpus": [1]}', '{"cuda": []}', "[]", "nonsense", '{"a": NaN}', "[" * 10_000],
)
def test_odd_facts_of_an_environment_are_left_out(tmp_path, capsys, facts):
    place = write_records(tmp_path, [one()])
    (place / "environments").mkdir()
    path = place / "environments" / "e.json"
    path.write_text(facts)
    assert read_environment(place, "e") is None
    assert f"{path}: not the facts of an environment" in capsys.readouterr().err
    show("frame_time", place, quiet=True)
    assert read_environment(place, "none") is None


@pytest.mark.parametrize("error", [RuntimeError("broken\x1b"), SystemExit(3), ImportError("no\nmodule")])
def test_a_package_that_fails_on_import_hides_no_record_and_no_method(tmp_path, monkeypatch, error):
    class Point:
        value = "broken:Method"

        def load(self):
            raise error

    monkeypatch.setattr(registry, "_entry_points", lambda: {"broken": Point()})
    registry.current_name.cache_clear()
    record = one()
    record["method"]["name"] = "of_another"
    assert schema.read_records(write_records(tmp_path, [record]))[0].method["name"] == "of_another"
    (row,) = [row for row in rows_of("methods", [], ChosenView, None, brief=False) if row["name"] == "broken"]
    assert "cannot be imported" in row["title"]
    with pytest.raises(UserError, match="correct that package"):
        registry.method_class("broken")
    registry.current_name.cache_clear()


@pytest.mark.parametrize(
    "name", [".lock", "journal/k.jsonl", "scenes.json", "a.svg", "maps/k-0-wrong.png", "truth/disputes-k-0.npz"]
)
def test_a_pipe_in_the_place_of_a_file_holds_nobody_up(tmp_path, name):
    """Opening one waits until somebody writes into it."""
    place = write_records(tmp_path, [one()])
    (place / name).parent.mkdir(exist_ok=True)
    os.mkfifo(place / name)
    folder = ResultsFolder(place)
    attempts = [
        folder.journal, pixel_maps.read_map, read_json, read_disputes,
        lambda _: folder.locked().__enter__(), lambda _: folder.idle().__enter__(),
    ]  # fmt: skip
    for attempt in attempts:
        with contextlib.suppress(UserError, OSError):
            attempt("k" if attempt == folder.journal else place / name)
    with pytest.raises(UserError, match=f"{name}: a link, or no file at all"):
        report(place, tmp_path / "report.html")


def test_arrays_that_unpack_to_too_much_are_refused(tmp_path):
    files.write_arrays(tmp_path / "a.npz", {"a": np.zeros(100_000)})
    with files.opened_arrays(tmp_path / "a.npz") as stored:
        assert stored["a"].shape == (100_000,)
    with (
        pytest.raises(files.DAMAGED, match="unpacks to more than 1,000 bytes"),
        files.opened_arrays(tmp_path / "a.npz", 1000),
    ):
        raise AssertionError
    (tmp_path / "b.npz").write_bytes(b"\x80\x04\x95")
    with pytest.raises(files.DAMAGED, match=r"it is no \.npz file"), files.opened_arrays(tmp_path / "b.npz"):
        raise AssertionError


# --- folders in which something else stands in the place of a file ---

PLACES = (
    "table1.svg", "cluster.jsonl", ".lock", "scenes.json", "answers/a-0.npz", "logs/uniform_grid.log", "journal/a.jsonl",
)  # fmt: skip


@pytest.mark.parametrize("place", PLACES)
def test_links_and_pipes_in_place_of_files_are_refused(tmp_path: Path, place: str) -> None:
    victim, out, kept = (tmp_path / name for name in ("victim", "out", "kept"))
    victim.write_text("precious")
    files.write_atomic(out / "records" / "a.json", {})
    (tmp_path / "larger disk").mkdir()
    (out / "images").symlink_to(tmp_path / "larger disk")  # a folder may be a link
    path = out / place
    path.parent.mkdir(exist_ok=True)
    chosen = options(out, ["tetra.obj"], ["uniform_grid"])
    for plant in (
        lambda: path.symlink_to(victim),
        lambda: path.symlink_to(tmp_path / "nowhere"),
        lambda: os.mkfifo(path),
    ):
        plant()
        for act in (lambda: run(chosen), lambda: show("table1", out), lambda: report(out), lambda: keep([out], kept)):
            with pytest.raises(UserError) as refused:
                act()
            assert str(refused.value) == f"{path}: a link, or no file at all; put a file in its place, or remove it"
        path.unlink()
    assert victim.read_text() == "precious"
    assert {one.name for one in tmp_path.iterdir()} == {"victim", "out", "larger disk"}
    with ResultsFolder(out).locked():
        pass


def test_of_a_folder_without_results_it_is_said_that_there_are_none(tmp_path: Path) -> None:
    (tmp_path / "localtime").symlink_to(tmp_path / "nowhere")
    with pytest.raises(UserError, match="no records in it or in its folders; name a folder of results"):
        report(tmp_path)
    for act in (lambda: show("table1", tmp_path), lambda: run(options(tmp_path, ["tetra.obj"], ["uniform_grid"]))):
        with pytest.raises(UserError, match=r"localtime: .*; .* has no records of its own, name another folder"):
            act()


def test_an_environment_that_cannot_be_read_is_written_again(tmp_path: Path) -> None:
    facts = {"id": "abc", "cpu": {"model": "any"}}
    path = tmp_path / "environments" / "abc.json"
    path.parent.mkdir()
    for damage in ("", "{", "[]", '{"id": "abc"}'):
        path.write_text(damage)
        environment.keep(tmp_path, facts)
        assert environment.read_json(path) == facts


def test_a_log_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    workers = Workers(ResultsFolder(tmp_path), options(tmp_path, ["tetra.obj"], ["uniform_grid"]))
    (tmp_path / "logs" / f"{GRADER}.log").mkdir(parents=True)
    with pytest.raises(UserError, match=rf"cannot write \(.*{GRADER}.log: Is a directory\)"):
        workers.send(workers.get(GRADER), do="free")
