"""The log of a run on a cluster: cards with their calibration, shards, and workers that were lost. ``cluster.jsonl`` in
a results folder has one line per event. It also has the cards of earlier runs into the folder, because all results of a
folder share columns, and results of cards that differ too much are not merged into one column.
"""

import time
from collections.abc import Iterable
from pathlib import Path
from statistics import median
from typing import Any

from ...results.journal import Journal
from .calibration import LIMIT, Calibration
from .shard import Outcome, Worker

NAME = "cluster.jsonl"


class Ledger:
    """The events of a results folder; each is on the disk before :meth:`note` returns."""

    def __init__(self, folder: Path, run: str):
        self._journal, self.run = Journal(folder / NAME), run

    def note(self, event: str, **facts: Any) -> None:
        self._journal.append({"event": event, "run": self.run, "noted": time.time(), **facts})

    def events(self, *kinds: str) -> list[dict[str, Any]]:
        """The events of some kinds, in their order, of this and earlier runs."""
        return [event for event in self._journal.events if event["event"] in kinds]

    def reference(self, device_name: str) -> tuple[str, Calibration] | None:
        """The card that all others of this product are compared with, and the median of its calibration points."""
        chosen = next((e["card"] for e in self.events("reference") if e["device_name"] == device_name), None)
        if chosen is None:
            return None
        own = [event for event in self.events("reference", "card", "shard") if event.get("card") == chosen]
        points = [event[when] for event in own for when in ("before", "after", "calibration") if when in event]
        return chosen, Calibration(
            *(median(point[name] for point in points) for name in ("arithmetic_ms", "memory_ms"))
        )

    def gap(self, one: Worker | Outcome, *points: Calibration) -> float:
        """How far calibration points of a card are from its reference, at most; 0 for the reference itself."""
        known = self.reference(one.device_name)
        return 0.0 if known is None or known[0] == one.card else max((p.apart(known[1]) for p in points), default=0.0)


def reference_of(workers: list[Worker]) -> Worker:
    """The worker whose card most others of its product are within :data:`LIMIT` of; of equals, the fastest."""

    def company(one: Worker) -> tuple[int, float]:
        alike = [other for other in workers if other.device_name == one.device_name]
        near = sum(other.card == one.card or one.calibration.apart(other.calibration) <= LIMIT for other in alike)
        return near, -one.calibration.arithmetic_ms - one.calibration.memory_ms

    return max(workers, key=company)


def merging_refused(folders: Iterable[Path]) -> str:
    """Why the results of some folders cannot be merged: their cards are too far apart, in one line; "" if they can."""
    found: dict[str, tuple[Path, tuple[str, Calibration]]] = {}
    for folder in folders:
        ledger = Ledger(folder, "")
        for name in {event["device_name"] for event in ledger.events("reference")}:
            if (own := ledger.reference(name)) is None:
                continue
            other, known = found.setdefault(name, (folder, own))
            if own[0] != known[0] and (gap := own[1].apart(known[1])) > LIMIT:
                limit = f"{gap:.1%} (the limit is {LIMIT:.0%})"
                return f"the cards of {other} and {folder} differ by {limit}, and are not merged"
    return ""
