"""The worker's side: what a worker is, and one shard measured by it.

A shard is one scene at one size with all its methods (and all its lights), because the product of an experiment is the
ratio between methods, and that needs one card. The Dask worker has one thread, which runs the shard as
:class:`~..run.Run` does on a single machine, with worker processes of our own.
"""

import dataclasses
import functools
import platform
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import warp as wp

from ...files import digest
from ...frame.devices import device_title, start_warp
from ...results.record import Record
from ..machine.lock import MACHINE, MachineLock
from ..planning.planned_point import Options
from ..planning.survey import survey
from ..progress import Silent
from ..run import Run
from ..source.closure import project
from ..workers import scratch
from ..workers.handle import judges_processors
from . import delivery
from .calibration import LIMIT, Calibration, calibrate

BOOT = Path("/proc/sys/kernel/random/boot_id")

TOPIC = "shadowbench"  # the topic of the messages that workers send while they measure


@dataclass(frozen=True)
class Worker:
    """A worker's description of itself. ``card`` and ``host`` are hashes: they identify without a name or serial number.

    code   hash of the source of this project; warp, python: versions
    """

    card: str
    host: str
    device_name: str
    code: str
    warp: str
    python: str
    calibration: Calibration


@dataclass(frozen=True)
class Shard:
    """The points to be measured. ``options``: of one scene; ``known``: files of the results folder that concern it.

    run        the name of the run, common to all its shards; attempt: which one this is, from 1
    beside     workers on its machine, which share the cores for scoring
    reference  of the card that the worker's is compared with; None: there is none, or the worker's is it
    """

    number: int
    options: Options
    run: str
    attempt: int = 1
    known: delivery.Files = field(default_factory=dict)
    beside: int = 1
    wait: bool = True
    reference: Calibration | None = None

    @property
    def about(self) -> dict[str, str]:
        preset = self.options.preset
        return {"scene": preset.scenes[0], "size": f"{preset.width}x{preset.height}"}

    def refuses(self, point: Calibration) -> bool:
        """Whether a card with this calibration point differs too much from the reference to begin."""
        return self.reference is not None and point.apart(self.reference) > LIMIT


@dataclass(frozen=True)
class Outcome:
    """The outcome of a shard.

    before, after  calibration points; none where nothing was to be measured
    keys           the keys of all its points in the declared order; none if the card is refused, before a sample is taken
    """

    card: str
    device_name: str
    before: Calibration | None = None
    after: Calibration | None = None
    keys: tuple[str, ...] = ()
    files: delivery.Files = field(default_factory=dict)


@functools.cache
def code_hash() -> str:
    """The hash of the source files of all modules of this project, so that all workers run the same code. Of their
    bytes: every worker waits for it, and to tell code from comments takes seconds.
    """
    files = {
        f"{package}/{path.relative_to(root).as_posix()}": path.read_text(encoding="utf-8")
        for package, root in project().items()
        for path in root.rglob("*.py")
        if "template" not in path.parts
    }
    return digest(files)[:16]


def host_id() -> str:
    """A hash that identifies this machine while it runs: on Linux its kernel's, which containers share."""
    try:
        return digest(BOOT.read_text(encoding="ascii").strip())[:8]
    except OSError:
        return digest(platform.node())[:8]


def card_id(device: str) -> str:
    """A hash that identifies the card behind a device: of a GPU's UUID; for the CPU, the machine's own."""
    return digest(str(wp.get_device(device).uuid))[:8] if device.startswith("cuda") else host_id()


def introduce(device: str) -> Worker:
    """The worker's description of itself, with a calibration point. Runs in a worker, as a task."""
    start_warp()
    judges_processors()  # not when it has a shard already
    card = card_id(device)
    with MachineLock(of=card).exclusive():
        calibration = _calibrated(device)
    versions = wp.__version__, platform.python_version()
    return Worker(card, host_id(), device_title(device), code_hash(), *versions, calibration)


def _calibrated(device: str) -> Calibration:
    """A calibration point in the turn that a measurement on the device has."""
    with MACHINE.shared() if device.startswith("cuda") else MACHINE.exclusive():
        return calibrate(device)


class Relay(Silent):
    """Sends the messages of a run to the client, and prints nothing."""

    def __init__(self, shard: Shard, card: str):
        self.about = {"run": shard.run, "card": card}

    def note(self, text: str) -> None:
        if text.startswith("waiting"):  # short ones are many, where the host times methods on several cards in turn
            self.doing(text)

    def doing(self, what: str, who: str = "") -> None:
        from distributed import get_worker

        get_worker().log_event(TOPIC, {**self.about, "doing": f"{what} ({who})" if who else what})


def measure(shard: Shard) -> Outcome:
    """Measure one shard. Runs in a worker, as a task; the client reports its exceptions. The lock of the card (of a
    CPU: of its worker's turn) is held from the first calibration point to the last, so nothing else measures on it
    between.
    """
    start_warp()
    device, MACHINE.wait = shard.options.device, shard.wait
    card = card_id(device)
    relay, lock = Relay(shard, card), MachineLock(of=card)
    lock.say = relay.note
    before = after = None
    records: list[Record] = []
    with lock.exclusive(), tempfile.TemporaryDirectory(prefix="shard-", dir=scratch.folder()) as folder:
        options = dataclasses.replace(shard.options, out=Path(folder))
        delivery.fill(options.out, shard.known)
        if any(point.to_do for point in survey(options)):
            before = _calibrated(device)
        if before is None or not shard.refuses(before):
            records = Run(options, relay, name=shard.run, card=card, beside=shard.beside).go()
            after = before and _calibrated(device)
        files = delivery.fresh(options.out, shard.known)
    return Outcome(card, device_title(device), before, after, tuple(record.key for record in records), files)
