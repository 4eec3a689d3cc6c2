"""A journal: the events of a point, appended one JSON line at a time."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypedDict

from ..files import canonical, read_regular, require_storable
from ..typed_json import checked


class _Event(TypedDict):
    event: str


class Journal:
    """The events of an unfinished point: one JSON object per line, written to disk before :meth:`append` returns.

    An incomplete last line, left by a crash, is removed when the journal is opened again, and so is all from the first
    event on that does not have the type that ``schema`` gives for its name (others may have any).
    """

    def __init__(self, path: Path, schema: Mapping[str, type] = MappingProxyType({})):
        self.path = path
        self.schema = schema
        self.events: list[dict[str, Any]] = []
        if path.exists():
            self._recover()

    def _recover(self) -> None:
        whole = 0
        for line in read_regular(self.path).splitlines(keepends=True):
            try:
                event = checked(_Event, json.loads(line) if line.endswith(b"\n") else None)
                checked(self.schema.get(event["event"], _Event), event)
                require_storable(event)
            except (ValueError, RecursionError, OverflowError):
                break
            self.events.append(event)
            whole += len(line)
        if whole != self.path.stat().st_size:
            os.truncate(self.path, whole)

    def append(self, event: dict[str, Any]) -> None:
        """Add an event. Raises OSError where it cannot be written; the journal is then as it was."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        line = (canonical(event) + "\n").encode()
        before = self.path.stat().st_size if self.path.exists() else 0
        try:
            with open(self.path, "ab") as file:
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
        except OSError:
            if self.path.exists():
                os.truncate(self.path, before)
            raise
        self.events.append(event)

    def rounds(self) -> dict[int, dict[str, Any]]:
        """The rounds that are complete, by number."""
        return {event["round"]: event for event in self.events if event["event"] == "round"}

    def first(self, kind: str) -> dict[str, Any] | None:
        """The first event of a kind, or None."""
        return next((event for event in self.events if event["event"] == kind), None)

    def remove(self) -> None:
        """Delete the journal after its record is written."""
        self.path.unlink(missing_ok=True)
