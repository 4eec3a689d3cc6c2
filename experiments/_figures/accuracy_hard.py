"""Errors of the experiment's points on the hard cases: kept as CSV by the run, a table when drawn."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .accuracy_heat import write_rows

if TYPE_CHECKING:
    from ...harness.runner.experiment import Entry
    from ...harness.runner.runner import Options

NAME = "accuracy_hard.csv"
COLUMNS = "label method device cases cases_wrong true_errors worst".split()
NUMBERS = ("cases", "cases_wrong", "true_errors")


def keep_hard(options: Options, entries: Sequence[Entry], without: str | tuple[str, ...]) -> Path:
    """Judge the entries on the hard cases and write a row each, unless that was done."""
    from .._hardness import hard_rows

    path = options.out / NAME
    if path.exists():
        return path
    return write_rows(path, hard_rows(entries, options.device, without), COLUMNS)


def read_hard(folder: Path) -> list[dict[str, Any]]:
    """The rows that were kept, numbers as numbers; [] where a folder has none."""
    path = folder / NAME
    if not path.exists():
        return []
    with open(path, newline="", encoding="utf-8") as file:
        return [
            {key: int(value) if key in NUMBERS else value for key, value in row.items()}
            for row in csv.DictReader(file)
        ]


def table(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Markdown: the points with their true errors on the hard cases, the best first."""
    if not rows:
        return []
    lines = ["## True errors on the hard cases", ""]
    lines += [
        "| point | cases | cases with an error | true errors | most errors in |",
        "|---|---|---|---|---|",
    ]
    for row in sorted(rows, key=lambda r: (r["true_errors"], r["cases_wrong"])):
        cells = [row["label"], *(f"{row[name]:,}" for name in NUMBERS), row["worst"] or "-"]
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return [*lines, ""]
