"""The client's side of a run on a cluster: hand out shards, collect results, report what was lost.

Every worker has at most one shard, and a shard is pinned to its worker, so Dask itself never repeats one. If a worker is
lost, that is written into ``cluster.jsonl``, and its shard goes to another worker. Results are stored in the results
folder as a run on one machine stores them.
"""

import contextlib
import os
import time
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from ...errors import UserError, one_line
from ...results.disputes import charged_records
from ...results.folder import ResultsFolder
from ...results.record import Record
from ...texts import numbered
from ..machine.lock import MACHINE
from ..planning.experiment import Experiment
from ..planning.planned_point import Options
from ..planning.time_estimate import expected_work, points_of
from ..progress import Silent
from ..workers import scratch
from . import delivery
from .calibration import LIMIT
from .ledger import Ledger, reference_of
from .pool import Pool, SchedulerLostError
from .shard import TOPIC, Outcome, Shard, Worker, code_hash, introduce, measure

POLL_S = 0.1
LOOK_S = 1.0  # seconds between two queries for the present workers
ATTEMPTS = 3  # how many workers may be lost with the same shard before its points count as failed
FIRST_S = 120.0  # how long the first shards wait for cards not yet compared, such as one that another run holds
PATIENCE_S = 60.0  # seconds to wait for a worker when none is left: a nanny starts its worker again

GONE = "it ended, or does not answer"
OTHER_CODE = "it has other source files of shadowbench than this machine; install the same version"


@dataclass(eq=False)
class Seat:
    """What is known of the worker at an address, and what it does.

    process  the id of the worker's process: another one may have the address later
    worker   how it describes itself; None: it has not done so, or takes no part
    task     its introduction, or the shard
    """

    process: str
    task: Any = None
    worker: Worker | None = None
    shard: Shard | None = None


@dataclass(eq=False)
class ClusterRun:
    """Measures the points of an experiment on a pool of workers; :meth:`go` returns their records in the declared order.

    seats    the workers by address; ``joined``: whether some have not been compared with the others
    keys     the keys of the points of each finished shard
    alone    since when there is no worker
    """

    pool: Pool
    options: Options
    report: Silent
    run: str = field(default_factory=lambda: os.urandom(6).hex())
    seats: dict[str, Seat] = field(default_factory=dict)
    joined: bool = False
    refused: list[str] = field(default_factory=list)
    keys: dict[int, tuple[str, ...]] = field(default_factory=dict)
    began: float = field(default_factory=time.monotonic)
    looked: float = -1e9
    alone: float | None = None

    def __post_init__(self) -> None:
        self.folder = ResultsFolder(self.options.out)

    def go(self) -> list[Record]:
        """Measure every point without a record. Raises :class:`UserError`, with what is finished and how to continue,
        if the scheduler is lost or no worker is left.
        """
        options = self.options
        scratch.remove_abandoned()
        with self.folder.locked(), self.folder.writing():
            self.ledger, self.todo = Ledger(options.out, self.run), self._shards()
            self.count = len(self.todo)
            self.report.steps(self.count)
            points = sum(points_of(part) for part in options.preset.parts())
            self.report.note(
                f"{options.experiment.name}, preset {options.preset_name}: {numbered(self.count, 'scene')}, {points} points "
                f"on the workers of --cluster {self.pool.address}, results go to {options.out}"
            )
            self.ledger.note("run", shards=self.count, cluster="local" if self.pool.local else "scheduler")
            self.pool.client.subscribe_topic(TOPIC, self._heard)
            try:
                while len(self.keys) < self.count:
                    self._turn()
                    time.sleep(POLL_S)
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
                options = replace(self.options, preset=replace(part, scenes=(scene,)), experiment=named)
                shards.append(Shard(len(shards), options, self.run, wait=MACHINE.wait))
        return sorted(shards, key=lambda one: -expected_work(one.about["scene"], one.options.preset))

    def _turn(self) -> None:
        """Check the workers, collect finished shards, hand out the next ones."""
        if time.monotonic() - self.looked > LOOK_S:
            self.looked = time.monotonic()
            self._look()
        for seat in list(self.seats.values()):
            if seat.task is not None and seat.task.status != "pending":
                if seat.task.status in ("cancelled", "lost"):
                    raise SchedulerLostError
                self._finished(seat)
        asked = any(seat.task is not None and seat.shard is None for seat in self.seats.values())
        if asked and not self.keys and time.monotonic() - self.began < FIRST_S:
            return  # the first shards are handed out when all cards have been compared
        if self.joined:
            self._compare()
        for address, seat in self.seats.items():
            if seat.worker is not None and seat.task is None and self.todo:
                self._give(address, seat, seat.worker)

    # --- workers ---

    def _look(self) -> None:
        """Take note of workers that have come or gone."""
        there = self.pool.workers()
        for address, seat in list(self.seats.items()):
            if there.get(address) != seat.process:
                del self.seats[address]
                if seat.task is not None:
                    with contextlib.suppress(Exception):
                        seat.task.cancel()
                    self._lost(seat.shard, seat.worker, GONE)
        for address in there.keys() - self.seats.keys():
            self.seats[address] = Seat(there[address], self._submit(introduce, self.pool.device, address))
        if any(seat.worker or seat.task for seat in self.seats.values()):
            self.alone = None
        elif self.alone is None:
            self.alone = time.monotonic()
        elif self.refused and there:
            raise self._ended(f"no worker is fit: {self.refused[-1]}")
        elif time.monotonic() - self.alone > PATIENCE_S:
            raise self._ended("no worker is left")

    def _admit(self, seat: Seat, worker: Worker) -> None:
        """Add a worker to the run if it runs the same code."""
        reason = "" if worker.code == code_hash() else OTHER_CODE
        facts = {name: value for name, value in asdict(worker).items() if name != "code"}
        self.ledger.note("card", **facts, refused=reason)
        if reason:
            self._refuse(f"card {worker.card}", reason)
        else:
            seat.worker, self.joined = worker, True

    def _compare(self) -> None:
        """Choose the reference if the folder has none, and drop the cards that are too far from it."""
        self.joined = False
        workers = [seat.worker for seat in self.seats.values() if seat.worker is not None]
        if workers and not any(self.ledger.reference(one.device_name) for one in workers):
            one = reference_of(workers)
            self.ledger.note(
                "reference", card=one.card, device_name=one.device_name, calibration=asdict(one.calibration)
            )
        for seat in self.seats.values():
            if (worker := seat.worker) is None:
                continue
            if self.ledger.reference(worker.device_name) is None:
                self._drop(seat, f"it is another product ({worker.device_name}) than the reference")
            elif (gap := self.ledger.gap(worker, worker.calibration)) > LIMIT:
                self._drop(seat, _too_far(gap))

    def _drop(self, seat: Seat, reason: str) -> None:
        """Give the worker no more shards."""
        if seat.worker is not None:
            self.ledger.note("dropped", card=seat.worker.card, reason=reason)
            self._refuse(f"card {seat.worker.card}", reason)
            seat.worker = None

    def _refuse(self, who: str, reason: str) -> None:
        self.refused.append(f"{who} takes no part: {reason}")
        self.report.note(self.refused[-1])

    # --- shards ---

    def _submit(self, work: Any, what: Any, address: str) -> Any:
        pinned = {"workers": [address], "allow_other_workers": False, "resources": self.pool.resources}
        return self.pool.client.submit(work, what, pure=False, retries=0, **pinned)

    def _give(self, address: str, seat: Seat, worker: Worker) -> None:
        """Hand the worker the largest shard."""
        seat.shard = shard = self.todo.pop(0)
        chosen = self.ledger.reference(worker.device_name)
        sent = replace(
            shard,
            reference=None if chosen is None or chosen[0] == worker.card else chosen[1],
            known=delivery.known_files(self.folder, shard.options),
            beside=sum(one.worker is not None and one.worker.host == worker.host for one in self.seats.values()),
        )
        seat.task = self._submit(measure, sent, address)
        self.report.doing(f"{shard.about['scene']}: on card {worker.card}")

    def _finished(self, seat: Seat) -> None:
        """Take what a worker's task has given."""
        task, shard = seat.task, seat.shard
        seat.task = seat.shard = None
        try:
            result = task.result(timeout=PATIENCE_S)
        except Exception as error:
            reason = one_line(error)
            if task.status != "error":  # the worker ended between its answer and our reading it
                reason = f"its result could not be fetched ({type(error).__name__})"
            elif type(error).__name__ == "KilledWorker":
                reason = GONE
            elif shard is None:
                self._refuse("a worker", reason)
            self._lost(shard, seat.worker, reason)
            return
        if shard is None:
            self._admit(seat, result)
        else:
            self._take(seat, shard, result)

    def _take(self, seat: Seat, shard: Shard, outcome: Outcome) -> None:
        """Store a worker's results; those of a card that differs too much go into a folder of their own. A card that did so
        before it began has none.
        """
        points = {n: asdict(p) for n, p in (("before", outcome.before), ("after", outcome.after)) if p}
        about = {**shard.about, "card": outcome.card, **points, "points": len(outcome.keys)}
        gap = self.ledger.gap(outcome, *filter(None, (outcome.before, outcome.after)))
        if gap > LIMIT or not outcome.keys:
            if outcome.files:
                delivery.write(ResultsFolder(self.options.out / f"card-{outcome.card}"), outcome.files)
            self.ledger.note("apart", **about, apart=round(gap, 4))
            self._drop(seat, _too_far(gap))
            self.todo.append(shard)
        else:
            records = delivery.write(self.folder, outcome.files)
            self.ledger.note("shard", **about, attempt=shard.attempt)
            self._done(shard, outcome.keys, records)

    def _done(self, shard: Shard, keys: tuple[str, ...], new: list[Record]) -> None:
        for record in new:
            self.report.point(record)
        self.keys[shard.number] = keys
        self.report.done()

    def _lost(self, shard: Shard | None, worker: Worker | None, reason: str) -> None:
        """A worker is lost. Its shard, if any, goes to another one, at most :data:`ATTEMPTS` times in total."""
        if shard is None or worker is None:
            return
        self.ledger.note("lost", **shard.about, card=worker.card, attempt=shard.attempt, reason=reason)
        gone = f"{shard.about['scene']}: the worker on card {worker.card} was lost ({reason})"
        if shard.attempt < ATTEMPTS:
            self.report.note(f"{gone}; its points are measured again where there is room")
            self.todo.insert(0, replace(shard, attempt=shard.attempt + 1))
            return
        self.report.note(f"{gone}, the last of {ATTEMPTS} attempts; its points count as failed")
        device = self.options.device, self.ledger.events("card")[-1]["device_name"]
        why = f"its worker was lost {shard.attempt} times: {reason}"
        records = delivery.failed(self.folder, shard.options, device, why)
        self._done(shard, tuple(record.key for record in records), records)

    def _heard(self, event: Any) -> None:
        """A message of a worker, in a thread of Dask's."""
        with contextlib.suppress(Exception):
            _, message = event
            if message.get("run") == self.run:
                self.report.doing("measuring", f"card {message['card']}: {message['doing']}")

    def _ended(self, what: str) -> UserError:
        done = f"{len(self.keys)} of {self.count} scenes are finished and in {self.options.out}"
        return UserError(f"--cluster {self.pool.address}: {what}; {done}; run the same command again to continue")


def _too_far(gap: float) -> str:
    return f"its calibration differs by {gap:.1%} from the other cards' (the limit is {LIMIT:.0%})"
