"""``--memory-limit``: what exceeds it by far is not taken at all, by whatever means a method asks for it."""

import contextlib
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import warp as wp
from helpers.tiny_runs import Heard, go, options
from shadowbench.harness.commands.answering import answer
from shadowbench.harness.errors import CapacityRejected
from shadowbench.harness.frame.limited_allocator import LimitedAllocator
from shadowbench.harness.runner import run as runner
from shadowbench.harness.runner.measuring import memory
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.runner.run import Run
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.prepared import prepare

LIMIT = 1 << 20
BEYOND = r"an allocation failed beyond the limit of 1,048,576 bytes \(.*\)"
GULPS = [("warp", "prepare"), ("warp", "tenth"), ("numpy", "first"), ("numpy", "tenth"), ("library", "first")]

stopped = pytest.mark.skipif(not memory.stops_allocations(), reason="this system stops no allocation of a process")


def entry(how: str, where: str, **more: str) -> Entry:
    return Entry("gulps", {"how": how, "where": where, **more}, " ".join((how, where, *more.values())))


@stopped
def test_an_allocation_beyond_the_limit_is_not_made(package: Path, scene: str, tmp_path: Path) -> None:
    """Who needs less is measured, in the same process and beside the others."""
    entries = [entry(*place) for place in GULPS]
    less = [entry("warp", "prepare", gib="0.0005"), Entry("steady", {}, "steady")]
    chosen = options(tmp_path, [scene], [*entries, *less], memory=LIMIT, rounds=3, frames=1)
    records = go(chosen)
    for one, place in zip(entries, GULPS, strict=True):
        record = records[one.label]
        assert record.status == "rejected", record.reason
        assert re.fullmatch(BEYOND, record.reason), one.label
        assert [taken["round"] for taken in record.rounds or ()] == ([0] if "tenth" in place else [])
    assert [records[one.label].status for one in less] == ["ok", "ok"]
    assert (tmp_path / "logs" / "gulps.log").read_text().count("taken") == 1


@stopped
@pytest.mark.parametrize("how", ["warp", "numpy"])
def test_so_it_is_where_answers_are_verified(package: Path, scene: str, how: str, capfd) -> None:
    prepared = prepare(resolve(scene))
    given = answer("gulps", {"how": how}, prepared, prepared.moment(0, 8, 8), "cpu", LIMIT)
    assert given.status == "rejected", given.reason
    assert re.fullmatch(BEYOND, given.reason)
    assert "taken" not in capfd.readouterr().out


def test_where_nothing_is_stopped_the_run_says_so(
    package: Path, scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "stops_allocations", lambda: False)
    heard = Heard()
    Run(options(tmp_path, [scene], ["skips"], memory=LIMIT), heard).go()
    assert memory.NOT_STOPPED in heard.notes


@contextlib.contextmanager
def used(limited: LimitedAllocator) -> Iterator[None]:
    """As :meth:`LimitedAllocator.within`; also on a CPU, where Warp has no public way for it."""
    here = wp.get_device(limited.device)
    with limited.within(), pytest.MonkeyPatch.context() as patch:
        if not here.is_cuda:
            patch.setattr(here, "default_allocator", limited)
        yield


def test_an_allocator_counts_what_exists(device: str) -> None:
    def array(size: int) -> wp.array:
        return wp.full(size, 7, dtype=wp.uint8, device=device)

    limited, outside = LimitedAllocator(device, 1000), array(5000)
    with used(limited):
        first = array(600)
        with pytest.raises(CapacityRejected, match="needs 1,001 bytes; the limit is 1,000"):
            array(401)
        second = array(400)
        assert limited.held == 1000
        del first
    assert limited.held == 400
    with used(limited):
        third = array(600)
    assert (third.numpy() == 7).all()
    del second  # outside, too
    assert limited.held == 600
    assert array(5000).shape == outside.shape, "no limit outside"


def test_the_limits_of_the_process_are_as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    before = memory.resource.getrlimit(memory.resource.RLIMIT_DATA)
    with pytest.raises(ZeroDivisionError), memory.bounded(LIMIT, 0):
        1 / 0  # noqa: B018
    with pytest.raises(RuntimeError, match="on device 'cuda:0'"), memory.bounded(LIMIT, 0):
        raise RuntimeError("Failed to allocate 8 bytes on device 'cuda:0'")
    assert memory.resource.getrlimit(memory.resource.RLIMIT_DATA) == before
