"""``shadowbench check``: test a method for correctness before it is timed."""

import dataclasses
from collections import Counter
from typing import Any

from ..errors import UserError
from ..frame.devices import device_for, find_device
from ..frame.registry import make_method, method_class
from ..hardcases import all_cases, find_case
from ..hardcases.conformance import Check, conformance
from ..hardcases.judge import ERROR_NAMES, SHADOWS, Finding, judge_method, outside_of
from ..judge.verdict import Verdict
from ..report.terminal import make_table, plain_console, print_legend, print_lines, tell
from ..runner.machine.lock import MACHINE
from ..scene.facts import few_hits
from ..texts import numbered
from .options import command


@command(
    """
    Test one method on small scenes that are hard to trace.
    shadowbench check perspective_spherical --device cpu

    method             Name of a method; see shadowbench list methods.
    --set PARAM=VALUE  Parameter of the method; see shadowbench list methods NAME. Repeatable.
    --case NAME        Name of a hard case. Repeatable. Default: all.
    """
)
def check(
    method: str, device: str | None = None, setting: list[str] | None = None, case: list[str] | None = None,
    as_json: bool = False,
) -> int:  # fmt: skip
    """Run one method on small scenes that are hard to trace, and test that it keeps the rules of the interface.

    Every answer is compared with exact arithmetic. A wrong answer that float32 rounding explains (near-tie, edge) is
    excused, up to a limit per case; any other wrong answer is a true error. Exit code 1 if a case has a true error or
    too many excused answers, if a rule is broken, or if no case could be run; this also holds for a method that declares
    itself inexact. A method declares what it does not support in its attribute ``outside``: a case in {case: reason} is
    listed and not run; with {"shadows": reason}, wrong shadow bits are counted but do not fail the check.
    """
    settings = _settings(method, setting or [])
    place = device_for(method_class(method), find_device(device))
    cases = [find_case(name) for name in case] if case else list(all_cases(large=True))
    made = make_method(method, settings)
    outside = dict(outside_of(made))
    unknown = sorted(set(outside) - {one.name for one in all_cases(large=True)} - {SHADOWS})
    if unknown:
        raise UserError(f"{method}: its attribute 'outside' names {unknown[0]!r}, which is not a hard case")
    MACHINE.share_beside(place)
    findings = judge_method(lambda: make_method(method, settings), place, cases, {})
    checks = [] if case else conformance(lambda: make_method(method, settings), place)
    notice = few_hits(sum(one.hits for one in findings), sum(one.pixels for one in findings))
    statuses = [*(finding.status for finding in findings), *(one.status for one in checks)]
    unchecked = _unchecked(findings)
    passed = not unchecked and not any(status in ("error", "excused") for status in statuses)
    facts = {
        "method": method, "settings": settings, "device": place,
        "known_inexact": getattr(made, "known_inexact", None), "outside": outside, "passed": passed,
        "unchecked": unchecked, "true_errors": sum(finding.true_errors for finding in findings),
        "excused": sum(finding.excused for finding in findings), "rays": sum(finding.rays for finding in findings),
        "warning": str(dataclasses.replace(notice, advice="")) if notice else "",  # the camera is the case's
    }  # fmt: skip
    report = {**facts, "cases": [one.as_json() for one in findings], "conformance": [one.as_json() for one in checks]}
    tell(report, as_json, lambda facts: _print(facts, findings, checks))
    return 0 if passed else 1


def _unchecked(findings: list[Finding]) -> str:
    """Why nothing was checked, where the method could run no case: the reason of most of them. Else ""."""
    reasons = Counter(finding.reason for finding in findings if finding.status == "outside")
    ran = any(finding.rays or finding.status == "error" for finding in findings)
    return "" if ran or not reasons else reasons.most_common(1)[0][0]


def _settings(method: str, texts: list[str]) -> dict[str, str]:
    settings = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise UserError(f"--set {text!r}: write param=value")
        settings[name.removeprefix(f"{method}.")] = value
    return settings


CLASS_NAMES = {
    **{kind.key: kind.label for kind in Verdict},
    "hole": "rays through a closed surface",
    "differs": "pairs that must be the same and differ",
    "failed": "crash",
}


def _print(facts: dict[str, Any], findings: list[Finding], checks: list[Check]) -> None:
    if facts["unchecked"]:
        print_lines(f"{facts['method']} on {facts['device']}: nothing was checked: {facts['unchecked']}")
        return
    table = make_table("case", "what", "expected", "got", "excused", "result")
    notes = []
    for finding in findings:
        excused = f"{finding.excused} of {finding.rays}" if finding.excused else ""
        got = "the same" if finding.got == finding.expected else finding.got
        table.add_row(finding.case, finding.title, finding.expected, got, excused, _result(finding))
        if finding.reason and finding.status != "ok":
            notes.append(f"{finding.case}: {finding.reason}")
        if finding.status == "error":
            notes += [f"{finding.case}: {_example(example)}" for example in finding.examples[:2]]
    for one in checks:
        table.add_row("", one.name, "", "", "", {"error": "ERROR"}.get(one.status, one.status))
        if one.status == "error":
            notes.append(f"{one.name}: {one.reason}")
    plain_console().print(table)
    print_lines(*notes)
    method, count = facts["method"], Counter(finding.status for finding in findings)
    if facts["known_inexact"] and (count["error"] or count["excused"]):
        print_lines(f"{method} declares itself inexact: {facts['known_inexact']}")
    bits = sum(finding.bits_outside for finding in findings)
    if bits:
        reason = facts["outside"]["shadows"]
        print_lines(f"{bits} wrong shadow bits are outside what {method} can do: {reason}")
    summary = f"{method} on {facts['device']}: {numbered(len(findings), 'case')}, {count['error']} with true errors"
    summary += f", {count['excused']} with too many excused" if count["excused"] else ""
    summary += f", {count['outside']} outside" if count["outside"] else ""
    print_lines(f"{summary}; {facts['excused']} of {facts['rays']:,} answers excused")
    print_lines(*filter(None, [facts["warning"]]))
    named = {name for finding in findings for name in finding.classes}
    outside = ["outside: the method declares that it cannot do this"] if bits or count["outside"] else []
    print_legend((kind for kind in Verdict if kind.key in named), *outside)


def _result(finding: Finding) -> str:
    """The result of a case in words: errors follow ERROR, ties and excused answers are listed separately."""
    errors = _listed(finding, wrong=True)
    others = _listed(finding, wrong=False)
    if finding.bits_outside:
        others.append(f"{finding.bits_outside} shadow bits outside")
    if finding.status == "outside":
        return "outside"
    if finding.status == "ok":
        return ", ".join(["ok", *others])
    if finding.status == "excused":
        return f"TOO MANY EXCUSED: {', '.join(others)}"
    return f"ERROR: {', '.join(errors)}" + (f"; not errors: {', '.join(others)}" if others else "")


def _listed(finding: Finding, wrong: bool) -> list[str]:
    named = ((name, count) for name, count in finding.classes.items() if (name in ERROR_NAMES) == wrong)
    return [f"{count} {CLASS_NAMES[name]}" for name, count in named]


def _example(example: dict[str, Any]) -> str:
    """One wrong answer as one line of text."""
    parts = [str(example["kind"])]
    if "pixel" in example:
        parts.append(f"at pixel {example['pixel'][0]},{example['pixel'][1]}")
    if "light" in example:
        parts.append(f"of light {example['light']}")
    if "got" in example:
        parts.append(f"got {example['got']}, exact {example.get('exact', 'not judged')}")
    return " ".join(parts)
