"""The tables that ``shadowbench verify`` and ``score`` print."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.table import Table

COLUMNS = ("disputed", "tie", "near-tie", "edge", "true", "acne", "leak", "worst t", "excused", "check")


def _cells(found: dict[str, Any]) -> list[str]:
    """The columns of a score."""
    primary, shadow = found["primary"], found["shadow"]
    total = {
        name: sum(light[name] for light in shadow) for name in ("disputed", "edge", "acne", "leak", "invalid")
    }
    true = primary["true"] + primary["invalid"] + total["invalid"] + primary.get("unjudged", 0)
    worst = primary.get("t_max_relative_error")
    share = found.get("excused_share")
    return [
        str(primary["disputed"] + total["disputed"]) if "disputed" in primary else "",
        str(primary["tie"]),
        str(primary["near_tie"]),
        str(primary["edge"] + total["edge"]),
        str(true),
        str(total["acne"]),
        str(total["leak"]),
        "" if worst is None else f"{worst:.1e}",
        "" if share is None else f"{100 * share:.3f} %",
        found.get("check", ""),
    ]


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
                if row["known_inexact"] and row["score"]["check"] != "ok":
                    cells[-1] += " *"
                    notes.append(f"* {row['method']} declares itself inexact: {row['known_inexact']}")
                table.add_row(*lead, row["method"], *cells)
            lead = ("", "")
        if report["warning"]:
            notes.append(f"{scene}: {report['warning']}")
        judged = [row["score"] for row in report["methods"] if row["score"]]
        if judged:
            worst = max(judged, key=lambda s: s["primary"]["judged"])
            errors = {**worst["reference_errors"], "shadow": worst["reference_errors"]["shadow"]}
            errors["shadow"] = [{"disputed": 0, **light} for light in errors["shadow"]]
            pixels = errors["primary"]["judged"]
            table.add_row("", "", f"(reference, {pixels} judged)", *_cells(errors))
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
