"""The tables that ``shadowbench verify`` and ``score`` print."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..judge.counts import ReferenceErrors, Score, total
from ..judge.verdict import Verdict

if TYPE_CHECKING:
    from rich.table import Table

COLUMNS = ("disputed", "tie", "near-tie", "edge", "true", "acne", "leak", "worst t", "excused", "check")


def _cells(found: Score | ReferenceErrors) -> list[str]:
    """The columns of a score, or of the reference's own errors."""
    wrong = total(found, Verdict.TRUE) + total(found, Verdict.INVALID)
    classes = [total(found, kind) for kind in (Verdict.TIE, Verdict.NEAR_TIE, Verdict.EDGE)]
    bits = [total(found, kind) for kind in (Verdict.ACNE, Verdict.LEAK)]
    if isinstance(found, ReferenceErrors):
        return ["", *map(str, (*classes, wrong, *bits)), "", "", ""]
    primary = found.primary
    disputed = primary.disputed + sum(light.disputed for light in found.shadow)
    cells = map(str, (disputed, *classes, wrong + primary.unjudged, *bits))
    share = f"{100 * found.excused_share:.3f} %"
    return [*cells, f"{primary.t_max_relative_error:.1e}", share, found.check]


def _table(*first: str) -> Table:
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in first:
        table.add_column(name, overflow="fold")
    for name in COLUMNS:
        table.add_column(name, justify="right")
    return table


def print_reports(reports: list[dict[str, Any]]) -> None:
    """What ``verify`` found, a scene after the other."""
    from rich.console import Console

    table = _table("scene", "triangles", "method")
    notes: list[str] = []
    for report in reports:
        scene = Path(report["scene"]).name + (" (stand-in)" if report["stand_in"] else "")
        lead = (scene, f"{report['triangles']:,}")
        for row in report["methods"]:
            if row["score"] is None:
                table.add_row(*lead, row["method"], *[""] * (len(COLUMNS) - 1), row["status"])
                notes.append(f"{row['method']} on {scene}: {row['status']}: {row['reason']}")
            else:
                cells = _cells(row["score"])
                if row["known_inexact"] and not row["score"].passed:
                    cells[-1] += " *"
                    notes.append(f"* {row['method']} declares itself inexact: {row['known_inexact']}")
                table.add_row(*lead, row["method"], *cells)
            lead = ("", "")
        if report["warning"]:
            notes.append(f"{scene}: {report['warning']}")
        judged = [row["score"] for row in report["methods"] if row["score"]]
        if judged:
            most = max(judged, key=lambda score: score.primary.judged)
            errors = most.reference_errors
            table.add_row("", "", f"(reference, {most.primary.judged} judged)", *_cells(errors))
    console = Console(width=None if sys.stdout.isatty() else 160, markup=False)
    console.print(table)
    for note in dict.fromkeys(notes):
        console.print(note, soft_wrap=True, highlight=False, markup=False)


def print_scores(rows: list[dict[str, Any]]) -> None:
    """What ``score`` filled in, a line a file of answers."""
    from rich.console import Console

    table = _table("scene", "method", "frame", "")
    for row in rows:
        lead = (row["scene"], row["method"], str(row["frame"]), row["status"])
        table.add_row(*lead, *(_cells(row["score"]) if row["score"] else []))
    console = Console(width=None if sys.stdout.isatty() else 160, markup=False)
    console.print(table)
    for row in rows:
        if row["reason"]:
            console.print(row["reason"], soft_wrap=True, highlight=False, markup=False)
