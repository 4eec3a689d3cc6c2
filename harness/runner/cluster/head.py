"""The client's side of a run on a cluster: hand out shards, collect results, report what was lost.

Every worker has at most one shard, and a shard is pinned to its worker, so Dask itself never repeats one. If a worker is
lost, that is written into ``cluster.jsonl``, and its shard goes to another worker. Results are stored in the results
folder as a run on one machine stores them.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import time
from dataclasses import dataclass, field
from typing import Any

from ...errors import UserError
from ...results.disputes import charged_records
from ...results.folder import ResultsFolder
from ...results.record import Record
from ..machine.lock import MACHINE
from ..planning.experiment import Experiment
from ..planning.run_options import Options
from ..planning.time_estimate import expected_work, points_of
from ..progress import Silent
from ..workers import scratch
from . import spool
from .delivery import Delivery
from .ledger import LIMIT, Ledger, reference_of
from .pool import Pool, SchedulerLostError
from .shard import TOPIC, Outcome, Shard, Worker, code_hash, introduce, measure

POLL_S = 0.1
LOOK_S = 1.0
"""Seconds between two queries for the present workers."""

ATTEMPTS = 3
"""How many workers may be lost with the same shard before its points count as failed."""

FIRST_S = 120.0
"""Seconds for which the first shards wait for cards that have not been compared, such as one that another run holds."""

PATIENCE_S = 60.0
"""Seconds to wait for a worker when none is left: a nanny starts its worker again."""


@dataclass(eq=False)
class Running:
    """A task on a worker: a shard, or its introduction."""

    future: Any
    shard: Shard | None
    card: str = ""


@dataclass(eq=False)
class ClusterRun:
    """Measures the points of an experiment on a pool of workers; :meth:`go` returns their records in the declared order."""

    pool: Pool
    options: Options
    report: Silent
    run: str = field(default_factory=lambda: os.urandom(6).hex())
    known: dict[str, str] = field(default_factory=dict)
    """The id of the process at each worker's address."""
    cards: dict[str, Worker] = field(default_factory=dict)
    """The workers that measure, by address."""
    tasks: dict[str, Running] = field(default_factory=dict)
    """What each worker does, by address."""
    refused: list[str] = field(default_factory=list)
    todo: list[Shard] = field(default_factory=list)
    keys: dict[int, tuple[str, ...]] = field(default_factory=dict)
    """The keys of the points of each finished shard."""
    joined: bool = False
    """Whether there are workers that have not been compared with the others."""
    began: float = field(default_factory=time.monotonic)
    looked: float = -1e9
    alone: float | None = None
    """Since when there is no worker."""
    cleaning: list[Any] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.folder = ResultsFolder(self.options.out)
        self.delivery = Delivery(self.folder, self.options)

    def go(self) -> list[Record]:
        """Measure every point without a record.

        Raises :class:`UserError`, with what is finished and how to continue, if the scheduler is lost or no worker is left.
        """
        scratch.remove_abandoned()
        with self.folder.locked(), self.folder.writing():
            self.ledger = Ledger(self.options.out, self.run)
            self.todo = self._shards()
            self.count = len(self.todo)
            self.report.steps(self.count)
            self.report.note(
                f"{self.options.experiment.name}, preset {self.options.preset_name}: {self.count} scene"
                f"{'s' * (self.count != 1)}, {sum(points_of(p) for p in self.options.preset.parts())} points on the "
                f"workers of --cluster {self.pool.address}, results go to {self.options.out}"
            )
            self.ledger.note("run", shards=self.count, cluster="local" if self.pool.local else "scheduler")
            self.pool.client.subscribe_topic(TOPIC, self._heard)
            try:
                while len(self.keys) < self.count:
                    self._turn()
                    time.sleep(POLL_S)
                self._clean()
            except SchedulerLostError:
                self.ledger.note("scheduler lost", finished=len(self.keys), shards=self.count)
                raise self._ended("the connection to the scheduler was lost") from None
            self.report.doing("updating scores at pixels where several methods differ")
            records = [self.folder.record(key) for number in range(self.count) for key in self.keys[number]]
            return charged_records(self.folder, [record for record in records if record is not None])

    def _shards(self) -> list[Shard]:
        """One shard per scene and size, the largest first, so that the last ones are short."""
        shards: list[Shard] = []
        named = Experiment(self.options.experiment.name, self.options.experiment.title, {})
        for part in self.options.preset.parts():
            for scene in part.scenes:
                preset = dataclasses.replace(part, scenes=(scene,))
                options = dataclasses.replace(self.options, preset=preset, experiment=named)
                shards.append(Shard(len(shards), options, self.run, wait=MACHINE.wait))
        return sorted(shards, key=lambda one: -expected_work(_scene(one), one.options.preset))

    def _turn(self) -> None:
        """Check the workers, collect finished shards, hand out the next ones."""
        if time.monotonic() - self.looked > LOOK_S:
            self.looked = time.monotonic()
            self._look()
        for address, task in list(self.tasks.items()):
            if task.future.status == "pending":
                continue
            del self.tasks[address]
            if task.future.status in ("cancelled", "lost"):
                raise SchedulerLostError
            self._finished(address, task)
        asked = any(task.shard is None for task in self.tasks.values())
        if asked and not self.keys and time.monotonic() - self.began < FIRST_S:
            return  # the first shards are handed out when all cards have been compared
        if self.joined:
            self._compare()
        for address, worker in list(self.cards.items()):
            if address not in self.tasks and self.todo:
                self._give(address, worker)

    # --- workers ---

    def _look(self) -> None:
        there = self.pool.workers()
        for address, process in list(self.known.items()):
            if there.get(address) != process:
                del self.known[address]
                self.cards.pop(address, None)
                task = self.tasks.pop(address, None)
                if task is not None:
                    with contextlib.suppress(Exception):
                        task.future.cancel()
                    self._lost(task, "it ended, or does not answer")
        for address, process in there.items():
            if address not in self.known:
                self.known[address] = process
                self.tasks[address] = Running(self._submit(introduce, self.pool.device, address), None)
        if self.cards or self.tasks:
            self.alone = None
        elif self.alone is None:
            self.alone = time.monotonic()
        elif self.refused and there:
            raise self._ended(f"no worker is fit: {self.refused[-1]}")
        elif time.monotonic() - self.alone > PATIENCE_S:
            raise self._ended("no worker is left")

    def _admit(self, address: str, worker: Worker) -> None:
        """Add a worker to the run if it runs the same code on a card that can share a column with the others."""
        reason = ""
        if worker.code != code_hash():
            reason = "it has other source files of shadowbench than this machine; install the same version"
        else:
            self.cards[address] = worker
            self.joined = True
        self._note_card(worker, reason)

    def _compare(self) -> None:
        """Choose the reference if the folder has none, and drop the cards that are too far from it."""
        self.joined = False
        names = {one.device_name for one in self.cards.values()}
        if self.cards and not any(self.ledger.reference(name) for name in names):
            chosen = reference_of(list(self.cards.values()))
            facts = {"device_name": chosen.device_name, "calibration": chosen.calibration.facts()}
            self.ledger.note("reference", card=chosen.card, **facts)
        for address, one in list(self.cards.items()):
            reference = self.ledger.reference(one.device_name)
            if reference is None:
                self._drop(address, f"it is another product ({one.device_name}) than the reference")
            elif one.card != reference[0] and (gap := one.calibration.apart(reference[1])) > LIMIT:
                self._drop(address, _too_far(gap))

    def _note_card(self, worker: Worker, reason: str) -> None:
        facts = {"card": worker.card, "host": worker.host, "device_name": worker.device_name}
        versions = {"warp": worker.warp, "python": worker.python}
        self.ledger.note("card", **facts, **versions, calibration=worker.calibration.facts(), refused=reason)
        if reason:
            self._say(f"card {worker.card} takes no part: {reason}")

    def _drop(self, address: str, reason: str) -> None:
        card = self.cards.pop(address).card
        self.ledger.note("dropped", card=card, reason=reason)
        self._say(f"card {card} takes no part: {reason}")

    def _say(self, text: str) -> None:
        self.refused.append(text)
        self.report.note(text)

    # --- shards ---

    def _submit(self, work: Any, what: Any, address: str) -> Any:
        pinned = {"workers": [address], "allow_other_workers": False, "resources": self.pool.resources}
        return self.pool.client.submit(work, what, pure=False, retries=0, **pinned)

    def _give(self, address: str, worker: Worker) -> None:
        """Hand the worker a shard: one that was begun on this card of its machine, else the largest."""
        begun = (one for one in self.todo if spool.name_of(one.options, worker.card) in worker.held)
        shard = next(begun, self.todo[0])
        self.todo.remove(shard)
        beside = sum(one.host == worker.host for one in self.cards.values())
        sent = dataclasses.replace(
            shard,
            known=self.delivery.known(shard.options),
            reference=self.ledger.reference(worker.device_name),
            limit=LIMIT,
            beside=beside,
        )
        self.tasks[address] = Running(self._submit(measure, sent, address), shard, worker.card)
        self.report.doing(f"{_scene(shard)}: on card {worker.card}")

    def _finished(self, address: str, task: Running) -> None:
        if task.future.status == "error":
            error = task.future.exception()
            reason = " ".join(str(error).split())[:300] or type(error).__name__
            if type(error).__name__ == "KilledWorker":
                reason = "it ended, or does not answer"
            elif task.shard is None:
                self._say(f"a worker takes no part: {reason}")
                return
            self._lost(task, reason)
            return
        try:
            result = task.future.result(timeout=PATIENCE_S)
        except Exception as error:  # the worker ended between its answer and our reading it
            self._lost(task, f"its result could not be fetched ({type(error).__name__})")
            return
        if task.shard is None:
            self._admit(address, result)
        else:
            self._take(address, task.shard, result)

    def _take(self, address: str, shard: Shard, outcome: Outcome) -> None:
        """Store the results of a worker. Those of a card that differs too much from the others go into a folder of their
        own."""
        points = {n: p.facts() for n, p in (("before", outcome.before), ("after", outcome.after)) if p}
        about = {"scene": _scene(shard), "size": _size(shard), "card": outcome.card, **points}
        gap = outcome.apart
        reference = self.ledger.reference(outcome.device_name)
        if outcome.after and reference and reference[0] != outcome.card:
            gap = max(gap, outcome.after.apart(reference[1]))
        if gap > LIMIT:
            beside = self.options.out / f"card-{outcome.card}"
            if outcome.keys:
                Delivery(ResultsFolder(beside), self.options).write(outcome)
            self.ledger.note("apart", **about, apart=round(gap, 4), points=len(outcome.keys))
            if address in self.cards:
                self._drop(address, _too_far(gap))
            self.todo.append(shard)
        else:
            for record in self.delivery.write(outcome):
                self.report.point(record)
            self.ledger.note("shard", **about, points=len(outcome.keys), attempt=shard.attempt)
            self.keys[shard.number] = outcome.keys
            self.report.done()
        forgetting = self.pool.client.submit(spool.forget, outcome.folder, workers=[address], pure=False, retries=0)
        self.cleaning.append(forgetting)

    def _lost(self, task: Running, reason: str) -> None:
        """A worker is lost. Its shard goes to another one, at most :data:`ATTEMPTS` times in total."""
        shard = task.shard
        if shard is None:
            return
        about = {"scene": _scene(shard), "size": _size(shard), "card": task.card, "attempt": shard.attempt}
        self.ledger.note("lost", **about, reason=reason)
        gone = f"{_scene(shard)}: the worker on card {task.card} was lost ({reason})"
        if shard.attempt < ATTEMPTS:
            self.report.note(f"{gone}; its points are measured again where there is room")
            self.todo.insert(0, dataclasses.replace(shard, attempt=shard.attempt + 1))
            return
        why = f"its worker was lost {shard.attempt} times: {reason}"
        self.report.note(f"{gone}, the last of {ATTEMPTS} attempts; its points count as failed")
        failed = self.delivery.failed(shard.options, self._device(), why)
        for record in failed:
            self.report.point(record)
        self.keys[shard.number] = tuple(record.key for record in failed)
        self.report.done()

    def _device(self) -> tuple[str, str]:
        """Name and product name of the device of the points."""
        names = [event["device_name"] for event in self.ledger.events("card")]
        return self.options.device, names[-1] if names else ""

    def _heard(self, event: Any) -> None:
        """A message of a worker, in a thread of Dask's."""
        with contextlib.suppress(Exception):
            _, message = event
            if message.get("run") == self.run:
                self.report.doing("measuring", f"card {message['card']}: {message['doing']}")

    def _clean(self) -> None:
        """Wait a moment for the workers to remove what was delivered."""
        end = time.monotonic() + 5.0
        while time.monotonic() < end and any(one.status == "pending" for one in self.cleaning):
            time.sleep(POLL_S)

    def _ended(self, what: str) -> UserError:
        done = f"{len(self.keys)} of {self.count} scenes are finished and in {self.options.out}"
        return UserError(f"--cluster {self.pool.address}: {what}; {done}; run the same command again to continue")


def _scene(shard: Shard) -> str:
    return shard.options.preset.scenes[0]


def _size(shard: Shard) -> str:
    return f"{shard.options.preset.width}x{shard.options.preset.height}"


def _too_far(gap: float) -> str:
    return f"its calibration differs by {gap:.1%} from the other cards' (the limit is {LIMIT:.0%})"
