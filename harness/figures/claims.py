"""Claims, one by one: what was measured, and whether it holds, does not hold, or cannot be told from the records.

A claim is declared by an experiment as a sentence and a function of :class:`Data`; the verdict is computed from the
records of all experiments in a folder, so that it changes with them.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import UserError
from . import points
from .sheet import error_text

HOLDS, FAILS, OPEN = "holds", "does not hold", "can't tell"

Row = dict[str, Any]


@dataclass(frozen=True)
class Finding:
    """A verdict, and the numbers that it rests on."""

    verdict: str
    numbers: str


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper (or of ours), where it stands, and what decides it.

    ``counted``: it is about counted work, the same on every device; all others are about times on a GPU.
    """

    text: str
    section: str
    judge: Callable[[Data], Finding]
    counted: bool = False


@dataclass(frozen=True, eq=False)
class Data:
    """The measured rows of every experiment below a folder."""

    made: tuple[Row, ...]

    def rows(self, experiment: str, **wanted: Any) -> list[Row]:
        """Rows of an experiment whose columns have these values, of its largest image size."""
        own = [r for r in self.made if r["experiment"] == experiment]
        if "width" not in wanted and own:
            own = [r for r in own if r["width"] == max(x["width"] for x in own)]
        return [r for r in own if all(r.get(k) == v for k, v in wanted.items())]

    def by_scene(self, experiment: str, **wanted: Any) -> dict[str, Row]:
        """One row a scene, by its name; by its title where another scene has that name.

        Where there are several rows: the one with the most frames, and of those the one measured last.
        """
        rows = sorted(self.rows(experiment, **wanted), key=lambda r: (r["frames"], measured_at(r["record"])))
        titles = {r["scene"]: {x["scene_title"] for x in rows if x["scene"] == r["scene"]} for r in rows}
        return {r["scene"] if len(titles[r["scene"]]) == 1 else r["scene_title"]: r for r in rows}

    @property
    def gpu(self) -> bool:
        """Whether anything was measured on a GPU; then CPU rows are left out."""
        return any(str(r["device"]).startswith("cuda") for r in self.made)

    def sizes(self, experiment: str) -> list[int]:
        """Image widths that an experiment was run at, smallest first."""
        return points.in_order(r["width"] for r in self.made if r["experiment"] == experiment)

    def versions(self, method: str) -> list[str]:
        """Source hashes of a method among the records, in the order in which each was last measured."""
        own = sorted((r["record"] for r in self.made if r["method"] == method), key=measured_at)
        return list(dict.fromkeys(version_of(record) for record in reversed(own)))[::-1]

    def earlier(self, method: str) -> list[str]:
        """Experiments whose records of a method are not all of its last version."""
        last = self.versions(method)[-1:]
        own = [r for r in self.made if r["method"] == method]
        return points.in_order(r["experiment"] for r in own if [version_of(r["record"])] != last)

    def ratios(
        self,
        experiment: str,
        one: Row | dict[str, Any],
        other: Row | dict[str, Any],
        measure: Callable[[Row], Any],
    ) -> dict[str, float]:
        """Measure of the rows chosen by ``one`` over that of those chosen by ``other``, for each scene that has both."""
        first, second = self.by_scene(experiment, **one), self.by_scene(experiment, **other)
        result = {}
        for scene in first.keys() & second.keys():
            a, b = measure(first[scene]), measure(second[scene])
            if a and b:
                result[scene] = a / b
        return dict(sorted(result.items()))


def version_of(record: Row) -> str:
    """The hash of a method's source."""
    return record["method"].get("source_sha256") or ""


def measured_at(record: Row) -> float:
    """When a record's last round began, seconds."""
    return max((max(f["started"]) for f in record["frames"] if f.get("started")), default=0.0)


def collect(folder: Path) -> Data:
    """Every record in the folder and the folders in it. Raises :class:`UserError` where there is none."""
    places = [path.parent for path in sorted([*folder.glob("records"), *folder.glob("*/records")])]
    made = []
    for place in places:
        if any((place / "records").glob("*.json")):
            made += points.measured(points.rows(place))
    if not made:
        raise UserError(f"{folder}: no records in it or in its folders; name a folder of results")
    on_gpu = [r for r in made if str(r["device"]).startswith("cuda")]
    return Data(tuple(on_gpu or made))


def geometric(values: Sequence[float]) -> float:
    """Geometric mean."""
    return float(np.exp(np.mean(np.log(values))))


def each(values: dict[str, float], form: str = "{:.2f}") -> str:
    """Numbers by scene, as a phrase."""
    return ", ".join(f"{name} {form.format(value)}" for name, value in values.items())


def missing(experiment: str, more: str = "") -> Finding:
    """Not measured: what to run."""
    return Finding(OPEN, f"not measured; run {experiment}{more}")


def by_ratio(values: dict[str, float], experiment: str, what: str, more: bool = True) -> Finding:
    """Holds where the geometric mean of ratios lies above 1 (below, with ``more`` False) by over 3 %."""
    if not values:
        return missing(experiment)
    mean = geometric(list(values.values()))
    away = mean if more else 1 / mean
    verdict = HOLDS if away > 1.03 else FAILS if away < 0.97 else OPEN
    return Finding(verdict, f"{what} {mean:.2f} (geometric mean; {each(values)})")


def judge_all(claims: Sequence[Claim], data: Data) -> list[Row]:
    """One row a claim."""
    made = []
    for number, claim in enumerate(claims, 1):
        found = claim.judge(data)
        if not claim.counted and not data.gpu and found.verdict != OPEN:
            found = Finding(OPEN, f"on a CPU, which does not decide it: {found.numbers}")
        made.append({"number": number, "claim": claim.text, "section": claim.section, "verdict": found.verdict,
                     "numbers": found.numbers})  # fmt: skip
    return made


def draw(folder: Path | str, quiet: bool, claims: Sequence[Claim]) -> list[Path]:
    """``claims.md`` and ``claims.csv`` in the folder; printed unless ``quiet``."""
    folder = Path(folder)
    data = collect(folder)
    made = judge_all(claims, data)
    columns = ("number", "claim", "section", "verdict", "numbers")
    with open(folder / "claims.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(made)
    text = "\n".join(markdown(made, data))
    (folder / "claims.md").write_text(text + "\n", encoding="utf-8")
    if not quiet:
        for r in made:
            print(f"{r['number']:2}  {r['verdict']:13}  {r['claim']} ({r['section']})\n{'':19}{r['numbers']}")
    return [folder / "claims.md", folder / "claims.csv"]


def markdown(made: Sequence[Row], data: Data) -> list[str]:
    """The table, what it was measured on, and what was wrong among the answers behind it."""
    counts = {v: sum(r["verdict"] == v for r in made) for v in (HOLDS, FAILS, OPEN)}
    lines = [
        "# Claims of the paper, measured here",
        "",
        f"{counts[HOLDS]} hold, {counts[FAILS]} do not hold, {counts[OPEN]} cannot be told from these records. "
        f"{points.where(data.made)}. Scenes are stand-ins where their title says so; the paper's own numbers come from a "
        "GTX 280.",
        "",
        "| | claim | section | verdict | measured |",
        "|---|---|---|---|---|",
    ]
    for r in made:
        cells = [str(r["number"]), r["claim"], r["section"], f"**{r['verdict']}**", r["numbers"]]
        lines.append("| " + " | ".join(c.replace("|", "\\|") for c in cells) + " |")
    wrong = sum(1 for r in data.made if error_text(r).startswith("✗"))
    unscored = sum(1 for r in data.made if error_text(r) == "unscored")
    for method in points.in_order(r["method"] for r in data.made):
        old = data.earlier(method)
        if old:
            lines += ["", f"Records of an earlier version of {method}: {', '.join(old)}."]
    lines += [
        "",
        f"Of {len(data.made)} points measured {wrong} have wrong answers and {unscored} are unscored.",
    ]
    return lines
