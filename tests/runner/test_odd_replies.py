"""What a method says of itself goes into records: what no record can hold costs its own point, and nothing else."""

import json
from pathlib import Path

import pytest
from helpers.tiny_runs import go, options
from shadowbench.harness.results.folder import ResultsFolder
from shadowbench.harness.results.record import Record
from shadowbench.harness.results.schema import read_records
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.runner.planning.planned_point import describe_method

UNHELD = "no record can hold what the worker replied: "

REASONS = {
    "counter nan": f"{UNHELD}frames[0].counters[tests] is nan, not a number",
    "counter text": f"{UNHELD}frames[0].counters[tests] is 'many', not a number",
    "counter list": f"{UNHELD}frames[0].counters is [1], not an object",
    "counter huge": UNHELD,
    "counter negative": f"{UNHELD}frames[0].counters[tests] is -1: less than 0",
    "counter complex": "TypeError: Object of type complex is not JSON serializable",
    "built nan": UNHELD,
    "built deep nan": UNHELD,
    "built text": f"{UNHELD}method.built is 'a tree', not an object",
    "built surrogate": f"{UNHELD}'utf-8' codec can't encode character '\\ud800'",
    "built None": f"{UNHELD}method.built is None, not an object",
    "built itself": "RecursionError: ",
    "pass named 5": f"{UNHELD}method.passes[0].name is 5, not text",
    "pass more": "its rounds make no record: ",
    "error unspeakable": "UnspeakableError: UnspeakableError",
    "error read-only": "OSError: [Errno 30] Read-only file system: '/its/own/file'",
}


@pytest.fixture(scope="module")
def odd(package: Path, scene: str, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Record]]:
    """One run: its folder, and its records by label."""
    entries = [Entry("odd", {"what": what}, what) for what in REASONS]
    entries += [Entry("odd", {"what": what, "later": "true"}, f"later {what}") for what in ("built nan", "built text")]
    entries += [Entry("odd_title"), Entry("odd_parameter"), Entry("steady", {}, "steady")]
    out = tmp_path_factory.mktemp("odd")
    return out, go(options(out, [scene], entries, frames=1))


@pytest.mark.parametrize("what", REASONS)
def test_what_no_record_can_hold_fails_its_own_point(odd: tuple[Path, dict[str, Record]], what: str) -> None:
    record = odd[1][what]
    assert record.status == "failed"
    assert record.reason.startswith(REASONS[what])
    assert "\n" not in record.reason


def test_what_is_odd_later_keeps_the_rounds_before(odd: tuple[Path, dict[str, Record]]) -> None:
    for what in ("later built nan", "later built text"):
        assert odd[1][what].status == "failed"
        assert [one["round"] for one in odd[1][what].rounds or ()] == [0], what


def test_all_records_can_be_read_and_all_else_is_measured(odd: tuple[Path, dict[str, Record]]) -> None:
    out, records = odd
    assert records["steady"].status == "ok"
    assert len(records) == len(REASONS) + 5
    assert sorted(one.key for one in read_records(out)) == sorted(one.key for one in records.values())
    assert not list((out / "journal").iterdir())


@pytest.mark.parametrize("name", ["odd_title", "odd_parameter"])
def test_a_method_whose_own_facts_are_odd_is_described(package: Path, name: str) -> None:
    facts = describe_method(Entry(name), "cpu")
    assert facts["title"] == name
    assert facts["broken"].startswith("cannot be constructed: ")
    json.dumps(facts, allow_nan=False, ensure_ascii=False).encode()


ROUND = {
    "event": "round", "round": 0, "started": 1.0, "spent_s": 1.0, "method": {"built": {}}, "frames": [],
    "peak_rss_bytes": 1,
}  # fmt: skip


@pytest.mark.parametrize(
    "line",
    [
        "[]", "{}", '{"event": 5}', '{"event": "round"}', '{"event": "odd", "share": NaN}',
        json.dumps({**ROUND, "round": "1"}), json.dumps({**ROUND, "peak_rss_bytes": -1}), "[" * 100_000,
    ],
)  # fmt: skip
def test_a_journal_ends_before_what_is_no_event(tmp_path: Path, line: str) -> None:
    """As after a crash of the machine, or an edit by hand: what comes before is kept."""
    path = tmp_path / "journal" / "k.jsonl"
    path.parent.mkdir()
    path.write_text(json.dumps(ROUND) + "\n" + line + "\n" + json.dumps({**ROUND, "round": 1}) + "\n")
    journal = ResultsFolder(tmp_path).journal("k")
    assert journal.events == [ROUND]
    assert path.read_text() == json.dumps(ROUND) + "\n"
