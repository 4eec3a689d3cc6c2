"""Folders that are kept: one compressed file of records, read as the records themselves are."""

import dataclasses
from pathlib import Path

import pytest
from helpers import experiment_records
from helpers.experiment_records import record_of
from shadowbench.harness.commands.keep import keep
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.registry import method_class
from shadowbench.harness.results.folder import ResultsFolder
from shadowbench.harness.results.schema import ARCHIVE, read_records, write_archive
from shadowbench.harness.runner.planning.experiment import Entry

pytestmark = pytest.mark.usefixtures("unpainted")

ENTRIES = [Entry("perspective_spherical", {}, "ours"), Entry("warp_bvh", {}, "tree"), Entry("ray_grids", {}, "grids")]


def run_folder(place: Path, scenes=("cloth",), name="frame_time", **changed) -> Path:
    """A folder as a run leaves it."""
    experiment_records.write_records(
        place, [record_of(name, entry, scene, **changed) for scene in scenes for entry in ENTRIES]
    )
    for part, text in (
        ("environments/e.json", "{}"), ("environments/other.json", "{}"), ("images/cloth.png", "picture"),
        ("maps/a.png", "map"), ("journal/a.jsonl", "{}"), ("answers/a.npz", "bits"), ("scenes.json", "{}"),
    ):  # fmt: skip
        (place / part).parent.mkdir(exist_ok=True)
        (place / part).write_text(text)
    return place


def files(place: Path) -> set[str]:
    return {str(path.relative_to(place)) for path in place.rglob("*") if path.is_file()}


def test_a_kept_folder_reads_and_draws_as_the_run_did(tmp_path: Path) -> None:
    run, out = run_folder(tmp_path / "run"), tmp_path / "kept"
    assert (keep([run], out), read_records(out), len(read_records(out))) == (0, read_records(run), 3)
    keep([out], tmp_path / "again")
    assert read_records(tmp_path / "again") == read_records(out)
    found = files(out)
    assert {f"records/{ARCHIVE}", "environments/e.json", "frame_time.md", "frame_time.csv"} <= found
    assert not {name for name in found if name.split("/")[0] in ("images", "maps", "journal", "answers")}
    assert "scenes.json" not in found
    assert "environments/other.json" not in found, "no record names it"


def test_the_same_records_give_the_same_bytes_and_fewer_of_them(tmp_path: Path) -> None:
    run = run_folder(tmp_path / "run", scenes=("cloth", "fairy", "sibenik", "buddha"))
    keep([run], tmp_path / "a")
    keep([run], tmp_path / "b")
    one, two = ((tmp_path / name / "records" / ARCHIVE).read_bytes() for name in "ab")
    assert one == two
    assert len(one) < sum(path.stat().st_size for path in (run / "records").iterdir()) / 7


def test_an_archive_has_the_digits_that_each_clock_carries(tmp_path: Path) -> None:
    (record,) = read_records(run_folder(tmp_path / "run"))[:1]
    frame = dataclasses.replace(
        record.frames[0], total_ms=[1.2345678] * 2, wall_ms=[1.2345678] * 2, started=[1795799537.5678]
    )
    write_archive(
        tmp_path / "kept" / "records" / ARCHIVE, [dataclasses.replace(record, frames=[frame], load_s=0.0123456)]
    )
    (kept,) = read_records(tmp_path / "kept")
    (frame,) = kept.frames
    assert (kept.load_s, frame.total_ms, frame.wall_ms) == (0.01235, [1.2345678] * 2, [1.235] * 2)
    assert frame.started == [1795799537.6]


def test_several_runs_become_one_and_the_last_named_wins(tmp_path: Path) -> None:
    first = run_folder(tmp_path / "first", ms=10.0)
    second = run_folder(tmp_path / "second", scenes=("fairy",), ms=20.0)
    third = run_folder(tmp_path / "third", ms=30.0)
    keep([first, second, third], tmp_path / "out")
    times = {(r.scene["name"], r.frames[0].total_ms[0]) for r in read_records(tmp_path / "out")}
    assert times == {("cloth", 30.0), ("fairy", 20.0)}


def test_pictures_and_maps_come_along_where_asked_for_and_what_is_laid_beside_always(tmp_path: Path, capsys) -> None:
    run = run_folder(tmp_path / "run")
    (run / "ncu.md").write_text("what the profiler said")
    (run / "images" / "more").mkdir()
    keep([run], tmp_path / "out", ["images", "maps"])
    assert {"images/cloth.png", "maps/a.png", "ncu.md"} <= files(tmp_path / "out")
    assert "1 answer without a score" in capsys.readouterr().err
    keep([run], tmp_path / "out", ["maps"], replace=True)
    assert "images/cloth.png" not in files(tmp_path / "out"), "what was kept before is replaced"


def test_what_is_there_already_is_never_lost_unasked(tmp_path: Path) -> None:
    run, other = run_folder(tmp_path / "run"), run_folder(tmp_path / "other", name="table1")
    before = {path: path.read_bytes() for path in other.rglob("*") if path.is_file()}
    with pytest.raises(UserError, match=r"is not empty; choose another, or give --replace"):
        keep([run], other)
    # Nor where what is made comes to nothing.
    (run / "records" / "bad.json").write_text("{")
    with pytest.raises(UserError, match=r"bad\.json"):
        keep([run], other, replace=True)
    assert {path: path.read_bytes() for path in other.rglob("*") if path.is_file()} == before
    (run / "records" / "bad.json").unlink()
    keep([run], other, replace=True)
    assert read_records(other) == read_records(run)
    assert not [name for name in files(other) if name.startswith(("answers", "records/table1", "images"))]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["other", "run"], "nothing half made is left"


def test_only_a_folder_of_results_is_replaced(tmp_path: Path) -> None:
    run, letters, file = run_folder(tmp_path / "run"), tmp_path / "letters", tmp_path / "file"
    letters.mkdir()
    (letters / "a.txt").write_text("dear")
    file.write_text("dear")
    with pytest.raises(UserError, match="letters: is no folder of results, so it is not replaced"):
        keep([run], letters, replace=True)
    with pytest.raises(UserError, match="file: is a file; choose another"):
        keep([run], file, replace=True)
    assert [path.read_text() for path in (letters / "a.txt", file)] == ["dear", "dear"]


def test_a_folder_that_a_run_writes_to_is_left_alone(tmp_path: Path) -> None:
    run, busy = run_folder(tmp_path / "run"), run_folder(tmp_path / "busy")
    with ResultsFolder(busy).locked():
        for sources, out in (([run], busy), ([busy], tmp_path / "out")):
            with pytest.raises(UserError, match="a run is writing there; wait for its end"):
                keep(sources, out, replace=True)
    keep([busy], tmp_path / "out")


def test_a_failure_takes_nothing_from_what_was_measured(tmp_path: Path) -> None:
    good, failed = run_folder(tmp_path / "good"), run_folder(tmp_path / "failed", status="failed")
    keep([good, failed], tmp_path / "a")
    keep([failed, good], tmp_path / "b")
    assert {r.status for r in read_records(tmp_path / "a") + read_records(tmp_path / "b")} == {"ok"}


def test_a_run_into_a_kept_folder_goes_on_from_its_records(tmp_path: Path) -> None:
    run = run_folder(tmp_path / "run")
    keep([run], tmp_path / "kept")
    (one, *_) = read_records(run)
    assert ResultsFolder(tmp_path / "kept").record(one.key) == one
    assert ResultsFolder(tmp_path / "kept").record("another") is None
    # What is measured there since has a file of its own, and that one counts.
    newer = dataclasses.replace(one, reason="measured again")
    experiment_records.write_records(tmp_path / "kept", [newer.to_json()])
    assert ResultsFolder(tmp_path / "kept").record(one.key) == newer
    assert newer in read_records(tmp_path / "kept")
    assert len(read_records(tmp_path / "kept")) == 3


def test_archives_beside_one_another_are_one_folder(tmp_path: Path) -> None:
    keep([run_folder(tmp_path / "run")], tmp_path / "out")
    keep([run_folder(tmp_path / "later", scenes=("fairy",))], tmp_path / "more")
    (tmp_path / "more" / "records" / ARCHIVE).rename(tmp_path / "out" / "records" / "later.jsonl.xz")
    both = read_records(tmp_path / "out")
    assert ({record.scene["name"] for record in both}, len(both)) == ({"cloth", "fairy"}, 6)
    assert ResultsFolder(tmp_path / "out").record(both[-1].key) == both[-1]


def test_wrong_calls_are_one_line_each(tmp_path: Path) -> None:
    run = run_folder(tmp_path / "run")
    other = run_folder(tmp_path / "other", name="table1")
    for sources, out, take, said in (
        ([run, other], tmp_path / "out", [], "records of frame_time and table1"),
        ([run], run, [], "is one of the folders to read"),
        ([run], tmp_path / "out", ["answers"], "--with answers: choose images or maps"),
        ([tmp_path], tmp_path / "out", [], "no records here"),
        ([run], run / "scenes.json", [], "is a file"),
        ([run], run / "scenes.json" / "in", [], "cannot be read or written"),
        ([run], Path("/proc/kept"), [], "^/proc/kept: cannot be read or written"),
    ):
        with pytest.raises(UserError, match=said):
            keep(sources, out, take)
    assert not (tmp_path / "out").exists()


def test_records_of_a_renamed_method_are_read_as_its_own(tmp_path: Path) -> None:
    place = run_folder(tmp_path / "old")
    for path in (place / "records").glob("*.json"):
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace('"name": "warp_bvh"', '"name": "bvh"'), encoding="utf-8")
    assert '"bvh"' in "".join(path.read_text(encoding="utf-8") for path in (place / "records").iterdir())
    assert {record.method["name"] for record in read_records(place)} == {entry.method for entry in ENTRIES}
    with pytest.raises(UserError, match="method 'bvh' is now called warp_bvh"):
        method_class("bvh")
