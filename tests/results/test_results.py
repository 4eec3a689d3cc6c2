"""What the documents quote of the results is what the results say. test_committed_results judges the claims anew."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import pytest
from shadowbench.experiments.claims import CLAIMS

RESULTS = Path(__file__).resolve().parents[2] / "results"
MACHINE = RESULTS / "nvidia-h200"

QUOTED = re.compile(r"(?<![\w.])\d+(?:,\d{3})*(?:\.\d+)?%?")
NOT_MEASURED = re.compile(r"`[^`]*`|\d+x\d+|on \d+ scenes")
"""Numbers that are no measurements: in code, sizes, how many scenes."""


def kept():
    """The rows of ``claims.csv``, by number."""
    with open(MACHINE / "claims.csv", encoding="utf-8", newline="") as file:
        return {row["number"]: row for row in csv.DictReader(file)}


def table():
    """Number, claim, judged from, what is said: the rows of the table of claims in ``results/README.md``."""
    lines = (RESULTS / "README.md").read_text(encoding="utf-8").splitlines()
    found = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in lines
        if re.match(r"\| \d+ \|", line)
    ]
    return {cells[0]: cells for cells in found}


@pytest.mark.parametrize("number", sorted(kept(), key=int))
def test_the_table_says_what_the_claims_say(number):
    row, (_, _, source, said) = kept()[number], table()[number]
    assert re.match(r"\*\*(.+?)\*\*", said)[1] == row["verdict"]
    numbers = set(QUOTED.findall(NOT_MEASURED.sub(" ", said)))
    known = set(QUOTED.findall(row["numbers"]))
    assert numbers <= known, "quoted, but not among the numbers of the claim"
    named = set(re.findall(r"`(\w+)`", source))
    assert named, "the row names no experiment"
    assert named <= set(CLAIMS[int(number) - 1].experiments), "the claim is not judged from these"


def test_every_claim_stands_in_the_table():
    assert set(table()) == set(kept())
    assert len(table()) == len(CLAIMS)
