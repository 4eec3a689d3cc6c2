"""The tables and the legend that ``shadowbench verify`` and ``score`` print, at most 80 columns wide."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..judge.counts import ReferenceErrors, Score, total
from ..judge.verdict import EXCUSED_LIMIT, Verdict
from ..scene.facts import triangles
from .tables import make_console, make_table, print_legend, print_lines

if TYPE_CHECKING:
    from rich.table import Table

COLUMNS = ("differ", "tie", "near\ntie", "edge", "true", "acne", "leak", "t error", "exc.\n%", "check")

SHOWN = (Verdict.TIE, Verdict.NEAR_TIE, Verdict.EDGE, Verdict.TRUE, Verdict.ACNE, Verdict.LEAK)
LEGEND = (
    "differ: hits and shadow bits that differ from the reference; t error: the largest relative error of t",
    f"check: ok if there is no true error, acne or leak, and at most {EXCUSED_LIMIT:.1%} of the pixels are excused (exc. %)",
)


def print_reports(reports: list[dict[str, Any]]) -> None:
    """Print the result of ``verify``, one table per scene."""
    console = make_console()
    notes: list[str] = []
    for report in reports:
        scene = Path(report["scene"]).name + (" (stand-in)" if report["stand_in"] else "")
        table = _table()
        for row in report["methods"]:
            table.add_row(row["method"], *_cells(row["score"], row["status"], row["known_inexact"]))
            if row["score"] is None:
                notes.append(f"{row['method']} on {scene}: {row['status']}: {row['reason']}")
            elif row["known_inexact"] and not row["score"].passed:
                notes.append(f"* {row['method']} declares itself inexact: {row['known_inexact']}")
        if report["warning"]:
            notes.append(f"{scene}: {report['warning']}")
        most = max(
            (row["score"] for row in report["methods"] if row["score"]),
            key=lambda score: score.primary.judged,
            default=None,
        )
        if most is not None and most.reference_errors:
            table.add_row("reference", "", *_counts(most.reference_errors), "", "", "")
            notes.append(
                f"reference on {scene}: wrong answers of Embree among {most.primary.judged:,} pixels decided exactly"
            )
        facts = [scene, triangles(report["triangles"]), *filter(None, [report["view"]])]
        print_lines(console, ", ".join(facts))
        console.print(table)
    print_lines(console, *dict.fromkeys(notes))
    print_legend(console, SHOWN, *LEGEND)


def print_scores(rows: list[dict[str, Any]]) -> None:
    """Print the result of ``score``: one table per scene, one row per file of answers."""
    console = make_console()
    for scene in dict.fromkeys(row["scene"] for row in rows):
        table = _table()
        for row in (one for one in rows if one["scene"] == scene):
            label = row["method"] if row["frame"] is None else f"{row['method']} frame {row['frame']}"
            table.add_row(label.strip(), *_cells(row["score"], row["status"]))
        print_lines(console, scene)
        console.print(table)
    statuses = Counter(row["status"] for row in rows)
    counted = ", ".join(f"{count} {status}" for status, count in statuses.items())
    print_lines(console, counted, *(row["reason"] for row in rows if row["reason"]))
    print_legend(console, SHOWN, *LEGEND)


def _table() -> Table:
    return make_table("method", numbers=COLUMNS)


def _cells(score: Score | None, status: str, known_inexact: str | None = None) -> list[str]:
    """The columns of a score; without a score, only the status."""
    if score is None:
        return [""] * (len(COLUMNS) - 1) + [status]
    primary = score.primary
    disputed = primary.disputed + sum(light.disputed for light in score.shadow)
    check = score.check + ("*" if known_inexact and not score.passed else "")
    share = f"{100 * score.excused_share:.3f}"
    counts = _counts(score, primary.unjudged)
    return [str(disputed), *counts, f"{primary.t_max_relative_error:.1e}", share, check]


def _counts(found: Score | ReferenceErrors, unjudged: int = 0) -> list[str]:
    """The columns from "tie" to "leak"."""
    excused = [total(found, kind) for kind in (Verdict.TIE, Verdict.NEAR_TIE, Verdict.EDGE)]
    wrong = total(found, Verdict.TRUE) + total(found, Verdict.INVALID) + unjudged
    return [str(count) for count in (*excused, wrong, total(found, Verdict.ACNE), total(found, Verdict.LEAK))]
