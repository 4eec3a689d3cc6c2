"""Workers: those of this machine, one per GPU, or those of any Dask scheduler; and which of them are present."""

import contextlib
import logging
import os
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import warp as wp

from ...errors import UserError, install
from ...frame.devices import start_warp
from ..workers import scratch

LOCAL = "local"
CONNECT_S = 10.0  # in which a scheduler must answer, unless `distributed.comm.timeouts.connect` is shorter
RESOURCES = {"cuda": "GPU", "cpu": "CPU"}  # what a worker declares, and a shard takes one of, by kind of device

LOGS = ("distributed", "tornado", "asyncio", "bokeh")


class SchedulerLostError(Exception):
    """The scheduler has ended or can no longer be reached."""


@dataclass
class Pool:
    """A connection to a scheduler. ``kind``: "cuda" or "cpu", which workers measure; ``local``: they end with this run."""

    client: Any
    address: str
    kind: str
    local: bool

    @property
    def device(self) -> str:
        """The device of a point, as its worker names it: a worker sees one card."""
        return "cuda:0" if self.kind == "cuda" else "cpu"

    @property
    def resources(self) -> dict[str, float]:
        return {RESOURCES[self.kind]: 1}

    def workers(self) -> dict[str, str]:
        """The address of every worker that measures, with the id of its process."""
        return {
            address: str(one.get("id", ""))
            for address, one in self.info().items()
            if one["nthreads"] == 1 and (one.get("resources") or {}).get(RESOURCES[self.kind]) == 1
        }

    def info(self) -> dict[str, Any]:
        """The scheduler's information on every worker. Raises :class:`SchedulerLostError` if it does not answer."""
        workers: dict[str, Any] = {}
        if self.client.status == "running":
            try:
                # Not `scheduler_info`: the client's own updates replace what that returns by one without workers.
                workers = self.client.sync(self.client.scheduler.identity, n_workers=-1)["workers"]
            except (OSError, TimeoutError, KeyError, ValueError) as error:
                raise SchedulerLostError from error
        if self.client.status != "running":
            raise SchedulerLostError
        return workers


def kind_of(device: str | None) -> str | None:
    """The kind of device that ``--device`` asks of workers. Raises :class:`UserError` for a single card."""
    if device not in (None, "cpu", "cuda"):
        raise UserError(f"--cluster with --device {device}: every worker has its own card; give cuda, cpu or nothing")
    return device


@contextlib.contextmanager
def connected(cluster: str, kind: str | None) -> Iterator[Pool]:
    """Workers of this machine (``local``), or the scheduler at an address; closed at the end.

    kind  "cuda" or "cpu"; None: GPUs where there are any. Raises :class:`UserError` where there is no Dask, no scheduler
    or no fitting worker.
    """
    try:
        import dask
        import distributed
    except ImportError as error:
        needed = install("shadowbench-rt[cluster]")
        raise UserError(f"--cluster needs Dask ({error.name} is missing): {needed}") from None
    local = cluster == LOCAL
    if not local and ":" not in cluster:  # Dask would look for a host of this name for a while
        raise UserError(f"--cluster {cluster}: give {LOCAL}, or the address of a scheduler, such as tcp://HOST:8786")
    _quiet()
    settings: dict[str, Any] = {"comm.timeouts.connect": CONNECT_S, "scheduler.allowed-failures": 0}
    if local:
        settings |= {"scheduler.http.routes": [], "worker.http.routes": []}
    with contextlib.ExitStack() as open_:
        open_.enter_context(dask.config.set({f"distributed.{name}": value for name, value in settings.items()}))
        address: Any = cluster
        if local:
            open_.enter_context(dask.config.set({"temporary-directory": str(scratch.folder())}))  # for Dask's files
            cards = _cards(kind)
            kind = "cuda" if cards else "cpu"
            address = open_.enter_context(_local(distributed, cards))
        try:
            client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise UserError(
                f"--cluster {cluster}: no Dask scheduler answers there; start one with `dask scheduler`, or give its address"
            ) from error
        open_.callback(_closed, client, timeout=2)
        pool = Pool(client, cluster, kind or "cuda", local)
        try:
            if kind is None and not pool.workers():
                pool.kind = "cpu"
            if not local and not pool.workers():
                wanted, there = RESOURCES[kind or "cuda"], len(pool.info())
                what = "none of its {} workers has one thread and the resource {}=1" if there else "it has no worker"
                start = f"start workers with `dask worker {cluster} --nthreads 1 --resources {wanted}=1`"
                raise UserError(f"--cluster {cluster}: {what.format(there, wanted)}; {start}")
        except SchedulerLostError:
            raise UserError(f"--cluster {cluster}: the scheduler does not answer any more") from None
        yield pool


def _cards(kind: str | None) -> list[str]:
    """The UUIDs of the GPUs of this machine; none for a run on the CPU."""
    start_warp()
    found = [] if kind == "cpu" else [str(device.uuid) for device in wp.get_cuda_devices()]
    if kind == "cuda" and not found:
        raise UserError("--cluster local --device cuda: this machine has no GPU; leave out --device for its CPU")
    return found


@contextlib.contextmanager
def _local(distributed: Any, cards: list[str]) -> Iterator[Any]:
    """A scheduler in this process, and one worker process per GPU, which sees only this GPU; without GPUs, one worker.
    Whoever reaches a port of theirs could have them run code. So the ports take only those who have the key that is
    made here and kept in memory: this process and its workers.
    """
    try:
        security = distributed.Security.temporary()
    except ImportError as error:
        needed = install("shadowbench-rt[cluster]")
        raise UserError(f"--cluster local needs cryptography for its connections ({error}): {needed}") from None
    common = {"host": "127.0.0.1", "security": security, "dashboard": False, "dashboard_address": "127.0.0.1:0"}
    about = {"security": security, "silence_logs": logging.CRITICAL}
    options = {**common, **about, "nthreads": 1, "memory_limit": 0}
    workers: dict[Any, Any] = {}
    for number, card in enumerate(cards or [""]):
        env = {"DASK_LOGGING__DISTRIBUTED": "critical", **({"CUDA_VISIBLE_DEVICES": card} if card else {})}
        own = {"env": env, "resources": {RESOURCES["cuda" if card else "cpu"]: 1}}
        workers[number] = {"cls": distributed.Nanny, "options": {**options, **own}}
    scheduler = {"cls": distributed.Scheduler, "options": {**common, "port": 0}}
    try:
        cluster = distributed.SpecCluster(scheduler=scheduler, workers=workers, shutdown_on_close=False, **about)
    except RuntimeError as error:
        raise UserError(f"--cluster local: a worker ended as it started ({error}); try again") from error
    try:
        yield cluster
    finally:
        _closed(cluster, timeout=10)
        scratch.remove_abandoned()  # of workers that were killed


def _closed(one: Any, timeout: float) -> None:
    with contextlib.suppress(Exception):  # a scheduler that has ended cannot be told
        one.close(timeout=timeout)


def _quiet() -> None:
    """This program reports every event once; Dask's own log is shown only with ``--debug``."""
    if not os.environ.get("SHADOWBENCH_DEBUG"):
        known = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] in LOGS]
        for name in (*LOGS, *known):
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        warnings.filterwarnings("ignore", module=r"distributed\..*")
