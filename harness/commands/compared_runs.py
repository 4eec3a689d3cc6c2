"""The two runs of a comparison: their newest records, where they were measured, and what makes them too unlike."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from ..errors import UserError
from ..report import two_runs
from ..results.folder import read_environment
from ..results.newest import newest
from ..results.record import Record
from ..results.schema import folders_with_records


@dataclasses.dataclass(frozen=True)
class Run:
    """One side of a comparison: the newest record of each entry, and the environments that these refer to."""

    name: str
    folder: Path
    entries: dict[tuple, Record]
    older: int
    environments: dict[str, dict[str, Any]]

    @classmethod
    def read(cls, name: str, folder: Path) -> Run:
        records, older, known = [], 0, {}
        for place in folders_with_records(folder):
            found, others = newest(place)
            older += others
            records += found
            for one in {known_as for record in found for known_as in environments_of(record)}:
                facts = read_environment(place, one)
                if facts is not None:
                    known[one] = facts
        return cls(name, folder, two_runs.entries(records), older, known)

    def of(self, record: Record) -> list[dict[str, Any]]:
        """The known environments in which a record was measured."""
        return [self.environments[one] for one in environments_of(record) if one in self.environments]


def environments_of(record: Record) -> list[str]:
    """The names of the environments of a record: one, or several if a run was continued in another environment."""
    names = [record.environment, *(str(one["environment"]) for one in record.rounds or () if "environment" in one)]
    return list(dict.fromkeys(names))


def machine(facts: Mapping[str, Any]) -> str:
    """The device of a measurement, as a phrase."""
    gpus = [gpu.get("name", "?") for gpu in facts.get("gpus") or ()]
    cpu = facts.get("cpu") or {}
    return " and ".join(dict.fromkeys([*gpus, f"{cpu.get('model', '?')} ({cpu.get('usable_cores', '?')} cores)"]))


def driver(facts: Mapping[str, Any]) -> str:
    """The driver's version; "" where there is no GPU."""
    versions = [(gpu.get("smi") or {}).get("driver_version", "?") for gpu in facts.get("gpus") or ()]
    cuda = (facts.get("cuda") or {}).get("driver")
    return ", ".join(dict.fromkeys([*versions, *([f"CUDA {cuda}"] if cuda else [])]))


def cores(runs: Iterable[Run]) -> int | None:
    """The cores that all runs may use: the least that an environment has; None where none is known."""
    known = [(facts.get("cpu") or {}).get("usable_cores") for run in runs for facts in run.environments.values()]
    return min((count for count in known if count), default=None)


def refuse(runs: Mapping[str, Run], allow: Iterable[str]) -> None:
    """Raise :class:`UserError` if the runs differ in more than their methods."""
    base = runs["A"]
    shared = [entry for entry in base.entries if all(entry in run.entries for run in runs.values())]
    facts_of: Mapping[str, Callable[[Mapping[str, Any]], str]] = {"machine": machine, "driver": driver}
    for what, text in facts_of.items():
        if what in allow:
            continue
        seen: dict[str, str] = {}
        for name, run in runs.items():
            for entry in shared:
                facts = run.of(run.entries[entry])
                if not facts:
                    missing = run.entries[entry].environment
                    raise UserError(
                        f"{run.folder}: environments/{missing}.json is not there, so that the {what} is not known; "
                        f"--allow {what} compares all the same"
                    )
                for one in facts:
                    seen.setdefault(text(one), name)
        if len(seen) > 1:
            (first, in_one), (second, in_other) = list(seen.items())[:2]
            raise UserError(
                f"{what}: {first} in {in_one}, {second} in {in_other}; --allow {what} compares all the same"
            )
    if "scene" not in allow:
        for entry in shared:
            hashes = {run.entries[entry].scene.get("arrays_sha256") for run in runs.values()}
            if len(hashes) > 1:
                scene = base.entries[entry].scene
                raise UserError(
                    f"scene {scene.get('title') or scene['name']}: is not the same version in both (its arrays have other "
                    "hashes); --allow scene compares all the same"
                )
    if "versions" not in allow:
        for run in runs.values():
            for method in dict.fromkeys(record.method["name"] for record in run.entries.values()):
                own = {r.method.get("source_sha256") or "" for r in run.entries.values() if r.method["name"] == method}
                if len(own) > 1:
                    named = " and ".join(sorted(version[:8] or "unknown" for version in own))
                    raise UserError(
                        f"{run.folder}: has several versions of {method} ({named}); compare folders of one version each, or "
                        "--allow versions"
                    )
