"""Points that an experiment measures itself, as a run measures those of methods: journals, rounds in turn, records."""

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from ..harness.results.folder import ResultsFolder
from ..harness.results.record import Record, make_record
from ..harness.runner.machine.environment import clock_state, environment, keep
from ..harness.runner.machine.lock import MACHINE
from ..harness.runner.measuring.memory import peak_resident_bytes
from ..harness.runner.planning.experiment import Preset
from ..harness.runner.planning.planned_point import Options, key_of, orders
from ..harness.runner.progress import Silent


@contextlib.contextmanager
def results(options: Options, report: Silent) -> Iterator[tuple[ResultsFolder, str]]:
    """The locked folder of a run, and the id of its environment; the machine is shared meanwhile."""
    folder = ResultsFolder(options.out)
    MACHINE.say = report.note
    with folder.locked(), MACHINE.shared():
        with folder.writing():
            made_in = keep(options.out, environment())
        yield folder, made_in


@dataclass
class Rounds:
    """Points of a preset that are measured in turn. Those with a record are not measured again.

    facts  of each point for its record: its point, scene and method
    said   of each point for the progress: what it is of, and what it is
    todo   the places of those to be measured
    """

    folder: ResultsFolder
    report: Silent
    preset: Preset
    facts: Sequence[dict[str, Any]]
    said: Sequence[tuple[str, str]]

    def __post_init__(self) -> None:
        pairs = zip(self.facts, self.said, strict=True)
        self.keys = [key_of((one["scene"]["name"], who), self.preset, one) for one, (_, who) in pairs]
        self.found = [self.folder.record(key) for key in self.keys]
        self.todo = [i for i, record in enumerate(self.found) if record is None]
        self.journals = {i: self.folder.journal(self.keys[i]) for i in self.todo}
        self.report.done((len(self.keys) - len(self.todo)) * self.preset.rounds)

    def prepared(self, i: int, seconds: float, frames: list[dict[str, Any]]) -> None:
        """A point is prepared (see :func:`judged`), unless an earlier run has noted that."""
        if not self.journals[i].first("prepared"):
            self._note(i, {"event": "prepared", "compile_s": 0.0, "first_frame_s": seconds, "frames": frames})

    def measure(self, seed: int, device: str, samples: Callable[[int], list[dict[str, Any]]]) -> None:
        """Take the missing rounds, alone on the machine. ``samples``: those of a point in one round, frame by frame."""
        with MACHINE.exclusive():
            for number, order in enumerate(orders(len(self.todo), self.preset.rounds, seed)):
                for place, i in enumerate(self.todo[index] for index in order):
                    what, who = self.said[i]
                    self.report.doing(f"{what}, round {number + 1}", who)
                    if number not in self.journals[i].rounds():
                        started = time.time()
                        taken = {"frames": samples(i), "started": started, "spent_s": time.time() - started}
                        taken |= {"clock": clock_state(device), "peak_rss_bytes": peak_resident_bytes()}
                        self._note(i, {"event": "round", "round": number, "place": place, "of": len(order), **taken})
                    self.report.done()

    def records(self, made_in: str) -> list[Record]:
        """All records; those of the points that were measured are written."""
        for i in self.todo:
            facts, journal = self.facts[i], self.journals[i]
            record = make_record(self.keys[i], facts["point"], facts["scene"], facts["method"], made_in, journal.events)
            self.folder.keep_record(record, journal)
            self.report.point(record)
            self.found[i] = record
        return [record for record in self.found if record is not None]

    def _note(self, i: int, event: dict[str, Any]) -> None:
        with self.folder.writing():
            self.journals[i].append({**event, "noted": time.time()})


def judged(frame: int, pixels: int, wrong: int, counters: dict[str, Any]) -> dict[str, Any]:
    """A frame whose answers the experiment has compared itself: how many of its pixels are wrong."""
    score: dict[str, Any] = {
        "true_errors": wrong, "excused_share": 0.0, "check": "failed" if wrong else "ok", "shadow": [],
        "primary": {"pixels": pixels, "ok": pixels - min(wrong, pixels), "true": wrong},
    }  # fmt: skip
    return {"frame": frame, "counters": counters, "score": score, "unscored": None}
