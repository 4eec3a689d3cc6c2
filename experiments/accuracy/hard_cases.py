"""Wrong answers of the experiment's points on the hard cases: counted without timing, and kept as CSV."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from ...harness.files import write_text
from ...harness.frame.devices import device_for
from ...harness.frame.registry import make_method, method_class
from ...harness.hardcases import all_cases
from ...harness.hardcases.judge import Judged, judge_method
from ...harness.report import document
from ...harness.runner.planning.experiment import Entry
from ...harness.runner.planning.run_options import Options
from ...harness.runner.progress import Silent, counted

NAME = "accuracy_hard.csv"
NONE = "none"
COLUMNS = "label method device cases cases_wrong true_errors worst left_out".split()


def hard_rows(
    entries: Sequence[Entry], device: str, without: tuple[str, ...] = (), but: Sequence[str] = ()
) -> Iterator[dict[str, Any]]:
    """One row per entry: cases run, cases with a true error, true errors in all, the cases with the most, and those left
    out.

    Shadow bits count also where a method declares them to lie outside what it can do. Methods whose library is not
    installed have no row. ``without``: cases whose names begin so are left out, ``but`` for those named. The exact answers
    are made once and shared.
    """
    known = all_cases()
    cases = [case for case in known if case.name in but or not case.name.startswith(without or ("\0",))]
    left_out = "; ".join(case.name for case in known if case not in cases) or NONE
    judged: dict[str, Judged] = {}
    for entry in entries:
        try:
            place = device_for(method_class(entry.method), device)
        except ImportError:  # a peer's library that is not installed: no row
            continue
        method = partial(make_method, entry.method, dict(entry.settings))
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
            "left_out": left_out,
        }


def keep_hard(
    options: Options, report: Silent, entries: Sequence[Entry], without: tuple[str, ...], but: Sequence[str] = ()
) -> None:
    """Judge the entries on the hard cases and write one row for each, unless that was done."""
    import pandas as pd

    if not (options.out / NAME).exists():
        rows = hard_rows(entries, options.device, without, but)
        table = pd.DataFrame(counted(report, "hard cases, untimed", rows, len(entries)), columns=COLUMNS)
        write_text(options.out / NAME, table.to_csv(index=False, lineterminator="\n"))


def read_hard(folder: Path) -> document.DataFrame:
    """The stored rows; none if a folder has none. Older folders have no ``left_out``: it is not known."""
    import pandas as pd

    path = folder / NAME
    return pd.read_csv(path).reindex(columns=COLUMNS) if path.exists() else pd.DataFrame(columns=COLUMNS)


def described(hard: document.DataFrame) -> list[str]:
    """What the counts on the hard cases cover, as sentences for the report."""
    import pandas as pd

    if hard.empty:
        return []
    most = int(hard["cases"].max())
    text = f"Wrong answers on the hard cases: up to {most} of them per point, each in {NAME}"
    missing = hard["left_out"].iloc[0]
    if pd.isna(hard["left_out"]).all():
        return [f"{text}; which of the others were left out was not recorded."]
    names = str(missing).split("; ")
    if missing == NONE:
        return [f"{text}; none was left out."]
    return [f"{text}. {len(names)} were not tried, in which a point may still be wrong: {', '.join(names)}."]
