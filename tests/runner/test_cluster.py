"""Runs on a cluster: the same records as on one machine; a worker, a scheduler and a network that are lost."""

import asyncio
import contextlib
import http.client
import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import urllib.request
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pytest
from helpers.dask_cluster import Cluster, Started, connected_when_ready, namespace
from helpers.experiment_records import record_of
from helpers.tiny_runs import install_misbehaving, options, write_scene
from helpers.waiting import PATIENCE_S, until
from shadowbench.harness.commands.keep import keep
from shadowbench.harness.errors import UserError
from shadowbench.harness.runner.cluster import head, shard
from shadowbench.harness.runner.cluster.calibration import Calibration
from shadowbench.harness.runner.cluster.head import ClusterRun
from shadowbench.harness.runner.cluster.pool import connected
from shadowbench.harness.runner.cluster.shard import Outcome, Worker, code_hash, introduce
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.runner.progress import Silent
from shadowbench.harness.runner.run import Run
from shadowbench.harness.runner.workers import scratch

dask = pytest.importorskip("dask", reason="Dask is not installed: the extra `cluster`")
distributed = pytest.importorskip("distributed", reason="Dask distributed is not installed: the extra `cluster`")
Security = distributed.Security


@pytest.fixture
def place(tmp_path, monkeypatch):
    """The folder of a test, with a scene in it; methods of another package, and temporary files of its own.

    The head looks for workers ten times as often as usual.
    """
    monkeypatch.setattr(head, "LOOK_S", 0.1)
    monkeypatch.setattr(head, "POLL_S", 0.02)
    path = install_misbehaving(tmp_path / "packages")
    monkeypatch.syspath_prepend(tmp_path / "packages")
    monkeypatch.setenv("PYTHONPATH", path)
    (tmp_path / "tmp").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    write_scene(tmp_path / "tetra.obj")
    return tmp_path


def slow(place: Path, rounds: int = 3, scenes: int = 1):
    """Options of a run whose rounds take about a second each."""
    names = [str(shutil.copy(place / "tetra.obj", place / f"tetra{i}.obj")) for i in range(scenes)]
    steady = Entry("steady", {"ms": "20"}, "Steady")
    return options(place / "out", names, [steady], rounds=rounds, frames=1, samples=7, most=7, budget_s=60.0)


def rounds_taken(place: Path) -> int:
    """Rounds in the journals of the shards under way."""
    journals = (place / "tmp").glob("*/shard-*/journal/*.jsonl")
    return sum(text.count('"event":"round"') for text in (path.read_text() for path in journals))


def events(place: Path, kind: str) -> list[dict]:
    lines = (place / "out" / "cluster.jsonl").read_text().splitlines()
    return [event for event in map(json.loads, lines) if event["event"] == kind]


def updated_at_once(client):
    """The client's own update of what it keeps of the scheduler, which has no workers, after every other update."""
    update = client._update_scheduler_info

    async def race(n_workers=0):
        await update(n_workers)
        await update(0)

    return race


@pytest.mark.slow
def test_records_and_answers_are_those_of_a_run_on_one_machine(place, monkeypatch):
    scene, wanted = [str(place / "tetra.obj")], {"save_answers": True, "frames": 1}
    alone = Run(options(place / "alone", scene, ["warp_bvh", "raises"], **wanted), Silent()).go()
    chosen = options(place / "out", scene, ["warp_bvh", "raises"], **wanted)
    with connected("local", "cpu") as pool:
        monkeypatch.setattr(pool.client, "_update_scheduler_info", updated_at_once(pool.client))
        assert len(pool.workers()) == 1, "workers seem lost when the client updates what it keeps"
        found = ClusterRun(pool, chosen, Silent()).go()
        assert not events(place, "lost")
        kept, removed = sorted((place / "out" / "records").iterdir(), key=lambda path: "raises" in path.name)
        written = kept.stat().st_mtime_ns
        removed.unlink()
        again = ClusterRun(pool, chosen, Silent()).go()
    assert [(r.key, r.status, r.reason) for r in found] == [(r.key, r.status, r.reason) for r in alone]
    assert [r.status for r in found] == ["ok", "failed"]
    assert kept.stat().st_mtime_ns == written, "nothing is measured twice"
    assert removed.exists()
    assert [r.key for r in again] == [r.key for r in found]
    assert again[0] == found[0]
    answers = sorted(path.name for path in (place / "alone" / "answers").iterdir())
    assert answers == sorted(path.name for path in (place / "out" / "answers").iterdir()) != []
    for name in answers:
        with np.load(place / "alone" / "answers" / name) as a, np.load(place / "out" / "answers" / name) as b:
            assert a.files == b.files
            assert all(a[one].tobytes() == b[one].tobytes() for one in a.files)
    shards = events(place, "shard")
    assert len(shards) == 2
    assert all({"before", "after", "card"} <= shard.keys() for shard in shards)
    assert [one["card"] for one in found[0].rounds] == [shards[0]["card"]] * 2
    assert found[0].environment == alone[0].environment
    assert not list((place / "tmp").glob("*/shard-*")), "what is delivered is removed"
    assert not list((place / "out").glob("journal/*"))


def listening() -> list[tuple[str, int]]:
    """Addresses and ports at which this process and its workers accept connections."""
    here = psutil.Process()
    found = [one.net_connections(kind="inet") for one in (here, *here.children(recursive=True))]
    return [(one.laddr.ip, one.laddr.port) for own in found for one in own if one.status == "LISTEN"]


def answers(address: str, security: Security) -> bool:
    """Whether what listens there greets as a scheduler or a worker does."""

    async def greeted() -> bool:
        options = security.get_connection_args("client")
        try:
            comm = await asyncio.wait_for(distributed.core.connect(address, timeout=1.5, **options), 2.0)
        except (OSError, TimeoutError):
            return False
        comm.abort()
        return True

    return asyncio.run(greeted())


def test_the_ports_of_local_workers_take_nobody_without_the_key_of_the_run(place, monkeypatch):
    """Whoever may speak to a scheduler or a worker may have it run code. What Dask leaves goes with the run."""
    scratch.folder()
    monkeypatch.setattr(tempfile, "tempdir", str(place / "tmp"))
    with connected("local", "cpu") as pool:
        scheduler, (worker,) = pool.client.scheduler.address, pool.workers()
        ports = listening()
        assert {address.rpartition(":")[2] for address in (scheduler, worker)} < {str(p) for _, p in ports}
        assert {ip for ip, _ in ports} == {"127.0.0.1"}, "no other machine reaches them"
        assert answers(scheduler, pool.client.security), "the run itself does"
        for _, port in ports:
            assert not answers(f"tcp://127.0.0.1:{port}", Security())
            assert not answers(f"tls://127.0.0.1:{port}", Security.temporary())
            with pytest.raises((OSError, http.client.HTTPException)):
                urllib.request.urlopen(f"http://127.0.0.1:{port}/info/main/workers.html", timeout=5.0)
    assert not list((place / "tmp").iterdir())


@pytest.mark.parametrize(
    ("cluster", "said"),
    [
        ("local", "a worker ended as it started"),
        ("nonsense", "give local, or the address"),
        ("tcp://127.0.0.1:9", "no Dask scheduler answers there"),
    ],
)
def test_what_cannot_be_connected_to_is_one_line(place, monkeypatch, cluster, said):
    def failing(**_):
        raise RuntimeError("Nanny failed to start.")

    monkeypatch.setattr(distributed, "SpecCluster", failing)
    monkeypatch.setattr("shadowbench.harness.runner.cluster.pool.CONNECT_S", 0.2)
    with pytest.raises(UserError, match=said), connected(cluster, "cpu"):
        pass


@pytest.fixture
def keyed(place, monkeypatch):
    """The settings of keys of one's own, for this process and those that it starts."""
    program = Path(__file__).parents[2] / "docs" / "cluster" / "keys.py"
    subprocess.run([sys.executable, str(program), str(place / "keys")], check=True, timeout=PATIENCE_S)
    assert (place / "keys").stat().st_mode & 0o077 == 0
    for line in (place / "keys" / "settings").read_text().splitlines():
        name, _, value = line.removeprefix("export ").partition("=")
        monkeypatch.setenv(name, shlex.split(value)[0])
    dask.config.refresh()
    yield
    monkeypatch.undo()
    dask.config.refresh()


@pytest.mark.slow
def test_a_scheduler_that_is_killed_ends_the_run_and_the_same_command_continues(place, keyed):
    chosen = slow(place)
    with contextlib.closing(Cluster(place, os.environ["PYTHONPATH"], scheme="tls")) as cluster:
        worker = cluster.worker()
        with connected_when_ready(cluster) as pool:
            assert not answers(cluster.address.replace("tls://", "tcp://"), Security(require_encryption=False))
            started = Started(pool, chosen)
            until(lambda: rounds_taken(place) >= 1, "a round")
            cluster.scheduler.kill()
            with pytest.raises(UserError, match="connection to the scheduler was lost; 0 of 1 scenes"):
                started.records()
        assert not (place / "out" / "records").exists()
        until(lambda: worker.poll() is not None, "the worker's end")
    with connected("local", "cpu") as pool:
        (record,) = ClusterRun(pool, chosen, Silent()).go()
    assert record.status == "ok"
    assert started.run.run not in {one["run"] for one in record.rounds}, "the scene under way is measured again"
    assert not list((place / "tmp").glob("*/shard-*")), "the next run removes what a lost one left"


@pytest.mark.slow
def test_workers_that_are_lost_are_told_and_others_take_their_points(place):
    """One is killed. The network of another is cut, where a namespace may be made for it; elsewhere it is frozen."""
    with contextlib.ExitStack() as stack:
        inside, host, cut = stack.enter_context(namespace()) or ((), "127.0.0.1", None)
        cluster = stack.enter_context(contextlib.closing(Cluster(place, os.environ["PYTHONPATH"], host)))
        first = cluster.worker(*inside)
        pool = stack.enter_context(connected_when_ready(cluster))
        started = Started(pool, slow(place))
        until(lambda: rounds_taken(place) >= 1, "a round")
        cut() if cut else first.send_signal(signal.SIGSTOP)
        second = cluster.worker()
        until(lambda: lost(place) == 1, "the first loss")
        first.kill()  # the lock of the machine, which both share, is free with its end
        until(lambda: started.run.seats and all(seat.shard for seat in started.run.seats.values()), "the second's turn")
        second.kill()
        cluster.worker()
        (record,) = started.records()
    assert record.status == "ok"
    assert [event["reason"] for event in events(place, "lost")] == ["it ended, or does not answer"] * 2
    assert [event["attempt"] for event in events(place, "shard")] == [3]
    assert sorted(one["round"] for one in record.rounds) == [0, 1, 2]


def lost(place: Path) -> int:
    return (place / "out" / "cluster.jsonl").read_text().count('"event":"lost"')


class Future:
    """A task that has ended."""

    def __init__(self, result, error=None):
        self.status, self._result, self._error = "error" if error else "finished", result, error

    def result(self, timeout=None):
        if self._error:
            raise self._error
        return self._result


class Imagined:
    """A pool of cards with given calibration points: one when the worker joins, then one after the first shard; or, of
    three, the second before it.
    """

    address, kind, local, device = "imagined", "cuda", True, "cuda:0"

    def __init__(self, cards: dict[str, list[float]], code: str = ""):
        self.client = self
        self.given = {card: [Calibration(ms, 1.0) for ms in times] for card, times in cards.items()}
        self.code = code or code_hash()
        self.resources = {"GPU": 1}

    def subscribe_topic(self, topic, handler): ...

    def workers(self):
        return {card: card for card in self.given}

    def submit(self, work, what, workers, **_):
        (card,) = workers
        if work is introduce and card == "broken":
            return Future(None, error=ModuleNotFoundError("No module named 'shadowbench'"))
        if work is introduce:
            about = {"host": "h", "device_name": "Imaginary GPU", "warp": "1", "python": "3"}
            return Future(Worker(card, calibration=self.given[card][0], code=self.code, **about))
        record = record_of("trial", Entry("steady"), scene=Path(what.options.preset.scenes[0]).stem)
        files = {f"records/{record['key']}.json": json.dumps(record).encode()}
        points = self.given[card]
        before = points.pop(1) if len(points) > 2 else points[0]
        if what.refuses(before):
            return Future(Outcome(card, "Imaginary GPU", before))
        after = points.pop(1) if len(points) > 1 else points[0]
        return Future(Outcome(card, "Imaginary GPU", before, after, keys=(record["key"],), files=files))


def test_cards_that_are_apart_are_not_merged(place):
    """One is too slow from the start; one gets slow, and what it measured then goes beside the rest; one has become slow
    before its shard, and measures nothing.
    """
    chosen = slow(place, scenes=4)
    pool = Imagined({"a": [1.0], "b": [1.01, 1.03], "c": [1.05], "d": [0.99], "f": [1.005, 1.04, 1.0], "broken": [1.0]})
    records = ClusterRun(pool, chosen, Silent()).go()
    assert sorted(record.scene["name"] for record in records) == [f"tetra{i}" for i in range(4)]
    assert len(list((place / "out" / "records").glob("*.json"))) == 4
    (beside,) = place.glob("out/card-*/records/*.json")
    assert beside.parts[-3] == "card-b"
    assert (place / "out" / "records" / beside.name).exists(), "another card has measured it"
    apart = {(one["card"], round(one["apart"], 3), one["points"]) for one in events(place, "apart")}
    assert apart == {("b", 0.03, 1), ("f", 0.04, 0)}
    assert sorted(event["card"] for event in events(place, "dropped")) == ["b", "c", "f"]
    assert {event["card"] for event in events(place, "shard")} == {"a", "d"}
    with pytest.raises(UserError, match=r"no worker is fit: card e .* differs by 5.0%"):
        ClusterRun(Imagined({"e": [1.05]}), chosen, Silent()).go()
    elsewhere = replace(chosen, out=place / "elsewhere")
    ClusterRun(Imagined({"e": [1.05]}), elsewhere, Silent()).go()
    with pytest.raises(UserError, match="and are not merged; pack each into its own folder"):
        keep([chosen.out, elsewhere.out], place / "kept")
    assert not (place / "kept").exists()


@pytest.mark.parametrize(("reference", "begins"), [(None, True), (0.99, True), (0.97, False)])
def test_a_card_that_has_drifted_does_not_begin_a_shard(place, monkeypatch, reference, begins):
    """The calibration point before the shard tells; the card that is the reference is compared with none."""
    monkeypatch.setattr(shard, "calibrate", lambda device: Calibration(1.0, 1.0))
    monkeypatch.setattr(shard.Relay, "doing", lambda *said: None)  # there is no worker of Dask's to tell it
    compared = None if reference is None else Calibration(reference, 1.0)
    outcome = shard.measure(shard.Shard(0, slow(place, rounds=1), "run", reference=compared))
    assert (outcome.before, len(outcome.keys)) == (Calibration(1.0, 1.0), begins)
    assert (outcome.after is not None) == any(name.startswith("records/") for name in outcome.files) == begins


def test_a_worker_with_other_source_takes_no_part(place):
    with pytest.raises(UserError, match=r"no worker is fit: .* other source files of shadowbench") as caught:
        ClusterRun(Imagined({"a": [1.0]}, code="other"), slow(place), Silent()).go()
    assert "0 of 1 scenes are finished" in str(caught.value)
