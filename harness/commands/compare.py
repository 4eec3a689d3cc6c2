"""``shadowbench compare``: what is faster and what is slower in run B than in run A, with its uncertainty."""

from __future__ import annotations

import dataclasses
import math
import re
import sys
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import UserError
from ..files import plain
from ..report import numbers, two_runs
from ..report.terminal import make_table, plain_console, print_lines, tell
from ..report.two_runs import OPEN, UNMEASURED, WRONG, Comparison, Row
from ..results.folder import read_environment
from ..results.record import Record
from ..results.schema import folders_with_records, newest
from ..texts import numbered
from .options import command

ALLOWED = ("machine", "driver", "scene", "versions", "missing", "wrong")
"""What may differ where ``--allow`` says so; ``versions``: several versions of one method within a run; ``missing`` and
``wrong``: those of :data:`GUARDS`.
"""

GUARDS = ("missing", "wrong")  # fail with `--fail-on slower` too: a run that lacks or fails a point is not as fast

FAILS = ("slower", "faster", "cannot-tell", *GUARDS)

FIRST = 4  # how many names of a list are printed without `--all`


@command(
    """
    Compare two runs: faster, slower or the same.
    shadowbench compare results/local/old results/local/new --fail-on slower

    A                  A results folder, or a folder of them: the base.
    B                  The results to compare with A.
    --again FOLDER     A second run of A on the same machine: its gap to A counts as the machine's own spread.
    --allow WHAT       Compare although this differs: machine, driver, scene or versions; and let pass what is missing or
                       wrong. Repeatable.
    --fail-on VERDICT  Exit code 1 for this verdict: slower, faster or cannot-tell; for missing, a point of A that B has not
                       measured; or for wrong, errors that A had not. Slower includes missing and wrong. Repeatable.
    --all              Name every round that was left out and every entry, not the first few.
    --margin SHARE     A gap up to this share counts as no difference.
    """
)
def compare(
    a: Path, b: Path, again: Path | None = None, allow: list[str] | None = None, fail_on: list[str] | None = None,
    margin: float = two_runs.MARGIN, everything: bool = False, as_json: bool = False,
) -> int:  # fmt: skip
    """Compare two runs: decide for each scene and method, and for the geometric mean, whether B is faster, slower or the
    same; or wrong, where it has errors that A had not.

    A difference needs nine rounds in both runs, a Mann-Whitney test on the medians of rounds (Holm's correction), and a gap
    above the margin and above the machine's own spread. Rounds whose clocks were throttled are left out, and on a CPU those
    in which the machine was busy (load above 1.25 per core); they are counted by reason.
    """
    for given, known, flag in ((allow, ALLOWED, "--allow"), (fail_on, FAILS, "--fail-on")):
        for word in given or ():
            if word not in known:
                raise UserError(f"{flag} {word}: choose {', '.join(known[:-1])} or {known[-1]}")
    if not 0 < margin < 1:
        raise UserError(f"--margin {margin:g}: must be between 0 and 1")
    folders = {"A": a, "B": b, **({"again": again} if again else {})}
    runs = {name: Run.read(name, folder) for name, folder in folders.items()}
    refuse(runs, allow or ())
    found = two_runs.compared(
        runs["A"].entries, runs["B"].entries, runs["again"].entries if again else None, margin, cores(runs.values())
    )
    if not found.rows:
        raise UserError(f"{a} and {b}: have no entry in common (experiment, scene, method, settings, size)")
    most = None if everything else FIRST
    notes = list(notes_of(runs, found, allow or (), most))
    fails = failures(found, fail_on or (), allow or (), most)
    facts = {**as_data(folders, found, notes, margin), "fails": fails}
    lines = [*notes, *(f"fails: {text}" for text in fails)]
    tell(facts, as_json, lambda _: print_comparison(found, lines, margin, most))
    return 1 if fails else 0


def failures(found: Comparison, fail_on: Collection[str], allow: Collection[str], most: int | None = None) -> list[str]:
    """Why the comparison fails, a line each. ``most``: as in :func:`notes_of`."""
    asked = [*fail_on, *(GUARDS if "slower" in fail_on else ())]
    points = {"missing": found.missing, "wrong": found.wrong}
    texts = []
    for word in dict.fromkeys(word for word in asked if word not in allow):
        if word in GUARDS:
            if points[word]:
                texts.append(f"{word}: {some(points[word], most)}")
        else:
            verdict = OPEN if word == "cannot-tell" else word
            known = {
                "point": two_runs.counts(found.rows)[verdict],
                "geometric mean": two_runs.counts(found.means)[verdict],
            }
            if any(known.values()):
                texts.append(f"{word}: {', '.join(numbered(count, what) for what, count in known.items() if count)}")
    return texts


def notes_of(
    runs: Mapping[str, Run], found: Comparison, allow: Iterable[str], most: int | None = None
) -> Iterable[str]:
    """Notes that belong to the verdicts, one line each. ``most``: of a list only so many names; None: all."""
    yield from left_out_notes(found.left_out, most)
    for name, own in runs.items():
        if own.older:
            yield f"{name}: {numbered(own.older, 'older record')} of the same entries left out"
    for name, points in found.only.items():
        if points:
            yield f"only in {name}: {some(points, most)}"
    packages = [
        {text for facts in run.environments.values() if (text := f"Warp {facts.get('warp', '?')}")}
        for run in runs.values()
    ]
    if len(set.union(*packages)) > 1:
        yield f"versions differ: {', '.join(sorted(set.union(*packages)))}"
    for what in allow:
        yield f"allowed to differ: {what}"


def print_comparison(found: Comparison, notes: Iterable[str], margin: float, most: int | None = None) -> None:
    """The verdicts as a table, geometric means last; then what was left out. ``most``: as in :func:`notes_of`."""
    table = make_table("scene", "method", "verdict", numbers=("A, ms", "B, ms", "gap", "95 %", "own", "wrong"))
    for row in (*found.rows, *found.means):
        table.add_row(
            row.scene, row.label + " *" * row.changed, row.verdict, numbers.carried(row.a_ms), numbers.carried(row.b_ms),
            percent(row.gap), interval(row), percent(row.spread, sign=False), wrong(row),
            style={"slower": "red", "faster": "green", WRONG: "red", OPEN: "dim", UNMEASURED: "dim"}.get(row.verdict, ""),
        )  # fmt: skip
    plain_console().print(table)
    counted = [
        f"{numbered(len(rows), what)}: {', '.join(f'{n} {verdict}' for verdict, n in two_runs.counts(rows).items() if n)}."
        for what, rows in (("point", found.rows), ("geometric mean", found.means))
        if rows
    ]
    lines = [" ".join(counted), f"gap: B over A less one; own: the machine's own spread; margin {margin:.0%}; "
             "wrong: answers of A and B; *: another version of the method"]  # fmt: skip
    why = []
    for verdict in (OPEN, UNMEASURED):
        reasons: dict[str, list[str]] = {}
        for row in (*found.rows, *found.means):
            if row.verdict == verdict:
                reasons.setdefault(row.reason, []).append(f"{row.scene}, {row.label}")
        why += [
            f"{verdict}: {reason} ({some([point for one in alike for point in reasons[one]], most)})"
            for reason, alike in kinds(reasons).items()
        ]
    print_lines(*lines, *why, *notes)
    sys.stdout.flush()


def left_out_notes(left_out: Iterable[tuple[str, str, int, str]], most: int | None) -> Iterable[str]:
    """A line for each run and reason: how many of its rounds were left out, of which points."""
    groups: dict[str, dict[str, dict[str, list[int]]]] = {}
    for run, point, number, why in left_out:
        groups.setdefault(run, {}).setdefault(why, {}).setdefault(point, []).append(number + 1)
    for run, reasons in groups.items():
        for why, alike in kinds(reasons).items():
            points: dict[str, list[int]] = {}
            for reason in alike:
                for point, places in reasons[reason].items():
                    points[point] = sorted([*points.get(point, ()), *places])
            count = sum(map(len, points.values()))
            names = [f"{point} ({', '.join(map(str, places))})" for point, places in points.items()]
            yield f"left out: {numbered(count, 'round')} of {run}, {why}: {some(names, most)}"


def kinds(reasons: Iterable[str]) -> dict[str, list[str]]:
    """Reasons that differ in their numbers only, such as loads, as one: by a phrase with the first of them."""
    groups: dict[str, list[str]] = {}
    for reason in reasons:
        groups.setdefault(re.sub(r"[\d.]+", "", reason), []).append(reason)
    return {"e.g. " * (len(alike) > 1) + alike[0]: alike for alike in groups.values()}


def some(names: Sequence[str], most: int | None = FIRST) -> str:
    """The first of many names, and how many more there are; all of them for None."""
    shown = names[:most]
    return "; ".join(shown) + f" and {len(names) - len(shown)} more" * (len(names) > len(shown))


def percent(share: float, sign: bool = True) -> str:
    """A share as text; a dash where it is not known."""
    return "-" if math.isnan(share) else f"{round(share, 3) + 0.0:{'+' if sign else ''}.1%}"


def interval(row: Row) -> str:
    """The 95 % interval of a row's gap."""
    return "-" if math.isnan(row.low) else f"{percent(row.low)} {percent(row.high)}"


def wrong(row: Row) -> str:
    """Wrong answers of A and B; one number where they are equal, "?" where answers were not judged."""
    if row.scenes > 1:
        return ""
    texts = ["?" if n is None else f"{n:,}" for n in (row.wrong_a, row.wrong_b)]
    return texts[0] if texts[0] == texts[1] else " ".join(texts)


def as_data(folders: Mapping[str, Path], found: Comparison, notes: Iterable[str], margin: float) -> dict[str, Any]:
    """What ``--json`` prints: null where something is not known."""

    def row(one: Row) -> dict[str, Any]:
        facts = dataclasses.asdict(one)
        return {k: None if isinstance(v, float) and math.isnan(v) else plain(v) for k, v in facts.items()}

    return {
        "folders": {name: str(folder) for name, folder in folders.items()},
        "margin": margin,
        "counts": {"points": two_runs.counts(found.rows), "geometric_means": two_runs.counts(found.means)},
        "points": [row(one) for one in found.rows],
        "geometric_means": [row(one) for one in found.means],
        "left_out": [
            {"run": run, "point": point, "round": number, "reason": why} for run, point, number, why in found.left_out
        ],
        "only": {name: list(points) for name, points in found.only.items()},
        "missing": list(found.missing),
        "wrong": list(found.wrong),
        "notes": list(notes),
    }


# --- what is compared: where it was measured, and what makes it too unlike ---


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
    count = cpu.get("usable_cores")
    said = numbered(count, "core") if isinstance(count, int) else "? cores"
    return " and ".join(dict.fromkeys([*gpus, f"{cpu.get('model', '?')} ({said})"]))


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
