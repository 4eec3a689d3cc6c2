"""Claims, one by one: what was measured, and whether it holds, does not hold, or cannot be decided from the records.

An experiment declares a claim as a sentence and a function of :class:`.report.evidence.Evidence`, rows that may be compared.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from . import document, style
from .evidence import Data, Evidence, Lacking, collect
from .terminal import print_table

if TYPE_CHECKING:
    from pandas import DataFrame

HOLDS, FAILS, OPEN = "holds", "does not hold", "can't tell"
ABOUT = (
    "Scenes are stand-ins where their title says so; the paper's own numbers come from a GTX 280. A ratio is taken within "
    "one run, over the same frames; where there are several runs, that of the last versions of the methods counts."
)


@dataclass(frozen=True)
class Finding:
    """A verdict, and the numbers behind it."""

    verdict: str
    numbers: str


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper (or of this project), its section, and what decides it.

    experiments  whose records may decide it; the last versions of the methods come first, then this order
    judge        given one piece of evidence at a time, until one does not raise :class:`.evidence.Lacking`
    counted      it is about counted work, the same on every device; all others are about times on a GPU
    """

    text: str
    section: str
    experiments: tuple[str, ...]
    judge: Callable[[Evidence], Finding]
    counted: bool = False


def each(values: Mapping[str, float], form: Callable[[float], str] = "{:.2f}".format) -> str:
    """Numbers by scene, as a phrase."""
    return ", ".join(f"{name} {form(value)}" for name, value in values.items())


def judged(holds: bool, numbers: str, fails: bool = True) -> Finding:
    """It holds; or, where it does not, it fails or cannot be told."""
    return Finding(HOLDS if holds else FAILS if fails else OPEN, numbers)


def decide(claim: Claim, data: Data) -> tuple[Finding, str]:
    """The finding of the first evidence that has all needed numbers, and its folders.

    If none has them: what the first one lacks, which points cannot be compared, and what to run.
    """
    lacks, evidence = [], data.evidence(*claim.experiments)
    for one in evidence:
        try:
            return claim.judge(one), origin(one, data)
        except Lacking as lack:
            lacks.append(str(lack))
    told = lacks[0] if lacks else "not measured"
    if len(evidence) > 1:
        alike = Counter(one.described() for one in evidence)
        known = "; ".join(f"{count} runs of {name}" if count > 1 else name for name, count in alike.items())
        told += f"; of different runs or versions, and not to be mixed: {known}"
    return Finding(OPEN, f"{told}; run {claim.experiments[0]}"), ""


def origin(evidence: Evidence, data: Data) -> str:
    """The folders of evidence, and the methods in it of which there are records of a later version."""
    old = sorted(m for m, version in evidence.versions.items() if data.newest[m] != version)
    earlier = f", an earlier version of {' and '.join(old)}" if old else ""
    return " and ".join(sorted(evidence.frames["folder"].unique())) + earlier


def judge_all(claims: Sequence[Claim], data: Data) -> DataFrame:
    """One row per claim: number, claim, section, verdict, numbers, judged_from."""
    import pandas as pd

    made = []
    for number, claim in enumerate(claims, 1):
        found, source = decide(claim, data)
        if not claim.counted and not data.gpu and found.verdict != OPEN:
            found = Finding(OPEN, f"on a CPU, which does not decide it: {found.numbers}")
        made.append((number, claim.text, claim.section, found.verdict, found.numbers, source))
    return pd.DataFrame(made, columns=["number", "claim", "section", "verdict", "numbers", "judged_from"])


def draw(folder: Path, quiet: bool, claims: Sequence[Claim]) -> list[Path]:
    """``claims.md`` and ``claims.csv`` in the folder; printed unless ``quiet``."""
    data = collect(folder)
    made, points, path = judge_all(claims, data), document.named(data.frames), folder / "claims.md"
    told, errors = made["verdict"].value_counts(), points["error"].str.split().str[0].value_counts()
    shown = made.assign(verdict="**" + made["verdict"] + "**")
    lines = [
        f"# Claims of the paper, measured here\n\n{told.get(HOLDS, 0)} hold, {told.get(FAILS, 0)} do not hold, "
        f"{told.get(OPEN, 0)} cannot be told from these records.\n\n{document.where(points)}. {ABOUT}\n",
        *document.markdown(
            shown.rename(columns={"number": "", "numbers": "measured", "judged_from": "judged from"})
        ),
        f"\nOf {len(points)} points measured {errors.get(style.WRONG, 0)} have wrong answers and "
        f"{errors.get(style.UNSCORED, 0)} are unscored.\n",
    ]
    path.write_text("\n".join(lines), encoding="utf-8")
    if not quiet:
        text = made["claim"] + " (" + made["section"] + "): " + made["numbers"]
        print_table(made[["number", "verdict"]].assign(**{"claim (section): what was measured": text}))
    return [path, document.write_csv(made, folder / "claims.csv", list(made))]
