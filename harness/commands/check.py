"""``shadowbench check``: is a method right before it is ever timed?"""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .options import Device, Json

if TYPE_CHECKING:
    from ..conformance import Check
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

    A tie, a near-tie or an edge is excused (rounding of float32 inputs' own tests explains it); anything else is
    a true error and the exit code is 1. A method may declare cases that lie outside what it can do, with the
    reason, in its class attribute ``outside = {case: reason}``: they are shown and not run. A method that
    declares itself inexact (``known_inexact``) has its errors listed with that reason, and exit code 0; its
    crashes and its broken rules still count.
    """
    from ..conformance import conformance
    from ..hardcases import all_cases, find_case
    from ..hardcases.judge import judge_method
    from ..plan import device_for, find_device
    from ..registry import make_method, method_class

    settings = _settings(method, setting or [])
    place = device_for(method_class(method), find_device(device))
    cases = [find_case(name) for name in case] if case else list(all_cases())
    known_inexact = getattr(make_method(method, settings), "known_inexact", None)
    findings = judge_method(lambda: make_method(method, settings), place, cases, {})
    checks = [] if case else conformance(lambda: make_method(method, settings), place)
    passed = not any(_counts_against(finding, known_inexact) for finding in findings)
    passed = passed and all(one.status != "error" for one in checks)
    facts = {
        "method": method,
        "settings": settings,
        "device": place,
        "known_inexact": known_inexact,
        "passed": passed,
        "true_errors": sum(finding.true_errors for finding in findings),
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
    from ..errors import UserError

    settings = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise UserError(f"--set {text!r}: write param=value")
        settings[name.removeprefix(f"{method}.")] = value
    return settings


def _counts_against(finding: Finding, known_inexact: str | None) -> bool:
    """Whether a finding fails the check: what a method knows to be inexact does not, a crash always does."""
    if finding.status != "error":
        return False
    crashed = any(finding.classes.get(name) for name in ("failed", "differs"))
    return crashed or not known_inexact


def _print(facts: dict[str, Any], findings: list[Finding], checks: list[Check]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in ("case", "what", "expected", "got", "class"):
        table.add_column(name, overflow="fold")
    notes = []
    for finding in findings:
        classes = ", ".join(f"{count} {name.replace('_', '-')}" for name, count in finding.classes.items())
        verdict = {"ok": classes or "ok", "outside": "outside", "error": f"ERROR: {classes}"}[finding.status]
        table.add_row(finding.case, finding.title, finding.expected, finding.got, verdict)
        if finding.reason and finding.status != "ok":
            notes.append(f"{finding.case}: {finding.reason}")
        if finding.status == "error":
            notes += [f"{finding.case}: {_example(example)}" for example in finding.examples[:2]]
    for one in checks:
        table.add_row("", one.name, "", "", {"error": "ERROR"}.get(one.status, one.status))
        if one.status == "error":
            notes.append(f"{one.name}: {one.reason}")
    console = Console(width=None if sys.stdout.isatty() else 160, markup=False)
    console.print(table)
    for note in notes:
        console.print(note, soft_wrap=True, highlight=False, markup=False)
    wrong = sum(finding.status == "error" for finding in findings)
    if facts["known_inexact"] and wrong:
        text = f"known inexact: {facts['known_inexact']}"
        console.print(text, soft_wrap=True, highlight=False, markup=False)
    outside = sum(finding.status == "outside" for finding in findings)
    summary = f"{facts['method']} on {facts['device']}: {len(findings)} cases, {wrong} with true errors"
    console.print(summary + (f", {outside} outside" if outside else ""), highlight=False)


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
