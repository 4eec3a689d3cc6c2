"""``shadowbench check``: is a method right before it is ever timed?"""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import UserError
from .options import Device, Json

if TYPE_CHECKING:
    from ..hardcases.conformance import Check
    from ..hardcases.judge import Finding


def check(
    method: Annotated[str, typer.Argument(help="A method's name; see shadowbench list methods.")],
    device: Device = None,
    setting: Annotated[list[str] | None, typer.Option("--set", help="param=value; again for more.")] = None,
    case: Annotated[
        list[str] | None, typer.Option("--case", help="A hard case's name; again for more. Default: all.")
    ] = None,
    as_json: Json = False,
) -> int:
    """Run the hard cases and the rules of conduct on one method, and judge every answer exactly.

    A near-tie or an edge is excused (the rounding of a float32 test explains it), but only so many a case; anything
    else that is wrong is a true error. Exit code 1 where a case has a true error or too much to excuse, or a rule is
    broken, also for a method that says of itself that it is inexact. A method may declare what lies outside what it
    can do, with the reason, in its attribute ``outside``: {case: reason} is shown and not run, {"shadows": reason} is
    shown and no shadow bit is held against it.
    """
    from ..frame.devices import device_for, find_device
    from ..frame.registry import make_method, method_class
    from ..hardcases import all_cases, find_case
    from ..hardcases.conformance import conformance
    from ..hardcases.judge import SHADOWS, judge_method, outside_of
    from ..runner.machine_lock import MACHINE

    settings = _settings(method, setting or [])
    place = device_for(method_class(method), find_device(device))
    cases = [find_case(name) for name in case] if case else list(all_cases())
    made = make_method(method, settings)
    outside = dict(outside_of(made))
    unknown = sorted(set(outside) - {one.name for one in all_cases()} - {SHADOWS})
    if unknown:
        raise UserError(f"{method} declares {unknown[0]!r} to lie outside, which is no hard case")
    MACHINE.share()
    findings = judge_method(lambda: make_method(method, settings), place, cases, {})
    checks = [] if case else conformance(lambda: make_method(method, settings), place)
    statuses = [*(finding.status for finding in findings), *(one.status for one in checks)]
    passed = not any(status in ("error", "excused") for status in statuses)
    facts = {
        "method": method,
        "settings": settings,
        "device": place,
        "known_inexact": getattr(made, "known_inexact", None),
        "outside": outside,
        "passed": passed,
        "true_errors": sum(finding.true_errors for finding in findings),
        "excused": sum(finding.excused for finding in findings),
        "rays": sum(finding.rays for finding in findings),
    }
    if as_json:
        report = {
            **facts,
            "cases": [finding.as_json() for finding in findings],
            "conformance": [one.as_json() for one in checks],
        }
        print(json.dumps(report, indent=1))
    else:
        _print(facts, findings, checks)
    return 0 if passed else 1


def _settings(method: str, texts: list[str]) -> dict[str, str]:
    settings = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise UserError(f"--set {text!r}: write param=value")
        settings[name.removeprefix(f"{method}.")] = value
    return settings


def _print(facts: dict[str, Any], findings: list[Finding], checks: list[Check]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in ("case", "what", "expected", "got", "excused", "class"):
        table.add_column(name, overflow="fold")
    notes = []
    for finding in findings:
        classes = ", ".join(f"{count} {name.replace('_', '-')}" for name, count in finding.classes.items())
        if finding.bits_outside:
            classes += f"{', ' if classes else ''}{finding.bits_outside} shadow bits outside"
        verdict = {
            "ok": classes or "ok",
            "outside": "outside",
            "error": f"ERROR: {classes}",
            "excused": f"TOO MUCH EXCUSED: {classes}",
        }[finding.status]
        excused = f"{finding.excused} of {finding.rays}" if finding.excused else ""
        table.add_row(finding.case, finding.title, finding.expected, finding.got, excused, verdict)
        if finding.reason and finding.status != "ok":
            notes.append(f"{finding.case}: {finding.reason}")
        if finding.status == "error":
            notes += [f"{finding.case}: {_example(example)}" for example in finding.examples[:2]]
    for one in checks:
        table.add_row("", one.name, "", "", "", {"error": "ERROR"}.get(one.status, one.status))
        if one.status == "error":
            notes.append(f"{one.name}: {one.reason}")
    console = Console(width=None if sys.stdout.isatty() else 160, markup=False)
    console.print(table)
    for note in notes:
        console.print(note, soft_wrap=True, highlight=False, markup=False)
    count = {
        name: sum(finding.status == name for finding in findings) for name in ("error", "excused", "outside")
    }
    bits = sum(finding.bits_outside for finding in findings)
    says = []
    if facts["known_inexact"] and (count["error"] or count["excused"]):
        says.append(f"{facts['method']} says that it is inexact: {facts['known_inexact']}")
    if bits:
        says.append(
            f"{bits} wrong shadow bits lie outside what {facts['method']} can do: {facts['outside']['shadows']}"
        )
    summary = (
        f"{facts['method']} on {facts['device']}: {len(findings)} cases, {count['error']} with true errors"
    )
    summary += f", {count['excused']} with too much excused" if count["excused"] else ""
    summary += f", {count['outside']} outside" if count["outside"] else ""
    says.append(f"{summary}; {facts['excused']} of {facts['rays']:,} answers excused")
    for text in says:
        console.print(text, soft_wrap=True, highlight=False, markup=False)


def _example(example: dict[str, Any]) -> str:
    """One wrong answer as a line."""
    parts = [str(example["kind"])]
    if "pixel" in example:
        parts.append(f"at pixel {example['pixel'][0]},{example['pixel'][1]}")
    if "light" in example:
        parts.append(f"of light {example['light']}")
    if "got" in example:
        parts.append(f"got {example['got']}, exact {example.get('exact', 'not judged')}")
    return " ".join(parts)
