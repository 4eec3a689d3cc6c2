"""Errors of an experiment's points on the hard cases: what a safety measure is for shows there, not on pretty scenes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from ..harness.frame.devices import device_for
from ..harness.frame.registry import make_method, method_class
from ..harness.hardcases import all_cases
from ..harness.hardcases.judge import Judged, judge_method
from ..harness.runner.experiment import Entry


def hard_rows(
    entries: Sequence[Entry], device: str, without: str | tuple[str, ...] = ""
) -> Iterator[dict[str, Any]]:
    """One row an entry: cases run, cases with a true error, true errors in all, and the cases with the most.

    Shadow bits count also where a method declares them to lie outside what it can do. Methods whose library is not
    installed have no row. ``without``: cases whose names begin so are left out. The exact answers are made once and
    shared.
    """
    cases = [case for case in all_cases() if not (without and case.name.startswith(without))]
    judged: dict[str, Judged] = {}
    for entry in entries:
        try:
            place = device_for(method_class(entry.method), device)
        except ImportError:  # a peer's library that is not installed: no row
            continue
        method = lambda e=entry: make_method(e.method, dict(e.settings))  # type: ignore[misc]  # noqa: E731
        found = judge_method(method, place, cases, judged, every_bit=True)
        run = [finding for finding in found if finding.status != "outside"]
        wrong = sorted((f for f in run if f.status == "error"), key=lambda f: -f.true_errors)
        yield {
            "label": entry.label,
            "method": entry.method,
            "device": place,
            "cases": len(run),
            "cases_wrong": len(wrong),
            "true_errors": sum(finding.true_errors for finding in run),
            "worst": "; ".join(f"{finding.case} {finding.true_errors}" for finding in wrong[:4]),
        }
