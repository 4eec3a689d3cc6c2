"""Claims, one by one: what was measured, and whether it holds, does not hold, cannot be told, or is not measured. An
experiment declares a claim as a sentence and a function of :class:`Evidence`. A ratio is taken within one run, between
points of the same scene, size, lights and frames (:func:`.report.compare.pairs`).
"""

import operator
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from pathlib import Path
from typing import Any

from . import compare, document, numbers
from .dataframe import DataFrame, Series, pd
from .terminal import print_table

HOLDS, FAILS, OPEN, UNMEASURED = "holds", "does not hold", "can't tell", "not measured"
VERDICTS = (HOLDS, FAILS, OPEN, UNMEASURED)
ABOUT = (
    "Scenes are stand-ins where their title says so; the paper's own numbers come from a GTX 280. A ratio is taken within "
    "one run, over the same frames; where there are several runs, that of the last versions of the methods counts."
)
RUN = ["experiment", "folder", "run"]
SCENE = ["scene", "scene_title", "scene_sha256"]
Measure = Callable[[DataFrame], Series]


class Lacking(Exception):
    """The evidence does not have the deciding numbers: what is not measured, and the numbers that exist."""

    def __str__(self) -> str:
        return f"{self.args[0]} is not measured" + "".join(f"; {known}" for known in self.args[1:] if known)


def matching(table: DataFrame, **wanted: Any) -> Series:
    """Which rows have these values in these columns, or one of a list of values."""
    return reduce(operator.and_, (table[x].isin(v if isinstance(v, list) else [v]) for x, v in wanted.items()))


def by_scene(points: DataFrame) -> DataFrame:
    """The point of each scene that was measured last, by the scene's name; by its title beside a stand-in of that name."""
    last = points.sort_values("started").drop_duplicates(SCENE[:2], keep="last")
    last = points[points.index.isin(last.index)]
    alone = last.groupby("scene")["scene_title"].transform("nunique") == 1
    return last.set_index(last["scene"].where(alone | (last["stand_in"] != ""), last["scene_title"]))


def over(points: DataFrame, bases: DataFrame, measure: Measure) -> Series:
    """Measure of points over that of their bases, by scene."""
    known = by_scene(points.reset_index())
    values = measure(known) / measure(bases.loc[known["key"]]).to_numpy()
    return values[(values != 0.0) & (values < float("inf"))]


@dataclass(frozen=True, eq=False)
class Evidence:
    """The measured frames of one experiment: one version of each method, and for each scene those of one run."""

    experiment: str
    frames: DataFrame

    @cached_property
    def versions(self) -> dict[str, str]:
        return dict(self.frames.groupby("method")["method_sha256"].last())

    @cached_property
    def widths(self) -> list[int]:
        """Image widths, smallest first."""
        return sorted(self.frames["width"].unique())

    @cached_property
    def largest(self) -> DataFrame:
        """The frames of the largest image size."""
        return self.of()

    def of(self, **wanted: Any) -> DataFrame:
        """Frames whose columns have these values, of the largest image size unless a width is named."""
        return self.frames[matching(self.frames, **{"width": self.widths[-1], **wanted})]

    def by_scene(self, **wanted: Any) -> DataFrame:
        """One point per scene (:func:`by_scene`) of the frames that :meth:`of` gives."""
        return by_scene(document.named(self.of(**wanted)))

    def ratios(
        self, one: dict[str, Any], other: dict[str, Any], measure: Measure, lacks: str = "", *scenes: str
    ) -> dict[str, float]:
        """Measure of ``one``'s points over ``other``'s, by scene (all, or ``scenes``). Raises :class:`Lacking` if none."""
        found = dict[str, float]()
        for points, bases in self.against(one, other):
            found = dict(sorted(over(points, bases, measure).items()))
        if lacks and not (set(scenes) <= set(found) and found):
            raise Lacking(lacks)
        return {scene: found[scene] for scene in scenes or found}

    def against(self, one: dict[str, Any], other: dict[str, Any]) -> list[tuple[DataFrame, DataFrame]]:
        """``one``'s points and those of ``other`` beside them (:func:`.report.compare.pairs`); none if a side has none."""
        base, own = matching(self.largest, **other), matching(self.largest, **one)
        if not (base.any() and own.any()):
            return []
        both = compare.slim(self.largest[base | own], ("pass.", "counter."))
        points, bases = compare.pairs(both, base[base | own])
        mine = matching(points, **one)
        return [(points[mine], bases[mine])]

    def over_rivals(self, one: dict[str, Any], rivals: Sequence[str], measure: Measure) -> DataFrame:
        """:meth:`ratios` over each other label in place of that of ``one``: a row per scene, a column per label."""
        found = {rival: pd.Series(dtype=float) for rival in rivals}
        for points, ours in self.against({**one, "label": list(rivals)}, one):
            found |= {
                str(rival): 1.0 / over(own, ours.loc[own.index], measure) for rival, own in points.groupby("label")
            }
        return pd.DataFrame(found, dtype=float).sort_index()

    def described(self) -> str:
        """Its folders, sizes and versions of methods."""
        sizes = ", ".join(dict.fromkeys(f"{w}x{h}" for w, h in self.frames[["width", "height"]].to_numpy()))
        versions = ", ".join(f"{m} {v[:8]}".strip() for m, v in sorted(self.versions.items()))
        return f"{' and '.join(sorted(self.frames['folder'].unique()))} ({sizes}; {versions})"


@dataclass(frozen=True, eq=False)
class Data:
    """The measured frames of every experiment below a folder. What may be compared comes from :meth:`evidence` alone."""

    frames: DataFrame

    @property
    def gpu(self) -> bool:
        """Whether anything was measured on a GPU; then CPU points are left out."""
        return bool(self.frames["device"].str.startswith("cuda").any())

    @cached_property
    def newest(self) -> dict[str, str]:
        """The version of each method that was measured last."""
        return dict(self.frames.sort_values("started").groupby("method")["method_sha256"].last())

    def evidence(self, *experiments: str) -> list[Evidence]:
        """What there is of these experiments, the last versions of the methods first, then as they are named."""
        last = self.frames.groupby(["method", "method_sha256"])["started"].max()
        found = [e for name in experiments for e in self.runs.get(name, [])]
        # Two that share a version are equally recent, whichever of them was measured later.
        return sorted(found, key=lambda e: -max(last[item] for item in e.versions.items()))

    @cached_property
    def runs(self) -> dict[str, list[Evidence]]:
        """Evidence by experiment, of the last version in each run; runs of other scenes and the same versions are joined."""
        # What other experiments count and set are columns of this one too, all empty.
        known = self.frames.notna().groupby(self.frames["experiment"]).any()
        own = self.frames.sort_values("started", kind="stable")
        own = own[own["method_sha256"] == own.groupby([*RUN, "method"])["method_sha256"].transform("last")]
        runs = sorted((run for _, run in own.groupby(RUN)), key=lambda run: -run["started"].max())
        found: dict[str, list[Evidence]] = {}
        for frames in runs:
            experiment = frames["experiment"].iloc[0]
            run = Evidence(experiment, frames.loc[:, known.loc[experiment]])
            before = found.setdefault(run.experiment, [])
            for i, other in enumerate(before):
                shared = other.versions.items() & run.versions.items()
                agree = shared and len(shared) == len(other.versions.keys() & run.versions.keys())
                if agree and not run.frames.merge(other.frames[SCENE]).size:
                    before[i] = Evidence(run.experiment, pd.concat([other.frames, run.frames]).sort_index())
                    break
            else:
                before.append(run)
        return found


def collect(folder: Path) -> Data:
    """Every record in the folder and the folders in it. Raises :class:`.errors.UserError` where there is none."""
    return together([source.frames for source in document.sources(folder)])


def together(tables: Sequence[DataFrame]) -> Data:
    """The measured frames of several folders (:func:`.report.document.frames`)."""
    frames = pd.concat(tables, ignore_index=True)
    frames["key"] = frames["folder"] + "/" + frames["key"]  # the same point may be in several folders
    frames = frames[(frames["status"] == "ok") & frames["total_ms"].notna()]
    on_gpu = frames["device"].str.startswith("cuda")
    return Data(frames[on_gpu] if on_gpu.any() else frames)


@dataclass(frozen=True)
class Finding:
    """A verdict, and the numbers behind it."""

    verdict: str
    numbers: str


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper (or of this project), its section, and what decides it.

    experiments  whose records may decide it; the last versions of the methods come first, then this order
    judge        given one piece of evidence at a time, until one does not raise :class:`Lacking`
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
    """The finding of the first evidence with all needed numbers, and its folders; else what is lacking and what to run."""
    lacks, evidence = [], data.evidence(*claim.experiments)
    for one in evidence:
        try:
            return claim.judge(one), origin(one, data)
        except Lacking as lack:
            lacks.append(str(lack))
    told = lacks[0] if lacks else "no records"
    if len(evidence) > 1:
        alike = Counter(one.described() for one in evidence)
        known = "; ".join(f"{count} runs of {name}" if count > 1 else name for name, count in alike.items())
        told += f"; of different runs or versions, and not to be mixed: {known}"
    return Finding(UNMEASURED, f"{told}; run {claim.experiments[0]}"), ""


def origin(evidence: Evidence, data: Data) -> str:
    """The folders of evidence, and the methods in it of which there are records of a later version."""
    old = sorted(m for m, version in evidence.versions.items() if data.newest[m] != version)
    earlier = f", an earlier version of {' and '.join(old)}" if old else ""
    return " and ".join(sorted(evidence.frames["folder"].unique())) + earlier


def judge_all(claims: Sequence[Claim], data: Data) -> DataFrame:
    """One row per claim: number, claim, section, verdict, numbers, judged_from."""
    made = []
    for number, claim in enumerate(claims, 1):
        found, source = decide(claim, data)
        if not claim.counted and not data.gpu and found.verdict in (HOLDS, FAILS):
            found = Finding(OPEN, f"on a CPU, which does not decide it: {found.numbers}")
        made.append((number, claim.text, claim.section, found.verdict, found.numbers, source))
    return pd.DataFrame(made, columns=["number", "claim", "section", "verdict", "numbers", "judged_from"])


def tally(made: DataFrame) -> str:
    """How many claims :func:`judge_all` gave each verdict, as a sentence."""
    told = made["verdict"].value_counts()
    counts = ", ".join(f"{verdict} {told.get(verdict, 0)}" for verdict in VERDICTS)
    return f"Verdicts on {len(made)} claims: {counts}."


def draw(folder: Path, quiet: bool, claims: Sequence[Claim]) -> list[Path]:
    """:func:`write` the claims as the records in the folder decide them; printed unless ``quiet``."""
    data = collect(folder)
    made = judge_all(claims, data)
    if not quiet:
        text = made["claim"] + " (" + made["section"] + "): " + made["numbers"]
        print_table(made[["number", "verdict"]].assign(**{"claim (section): what was measured": text}))
    return write(folder, made, data)


def write(folder: Path, made: DataFrame, data: Data) -> list[Path]:
    """``claims.md`` and ``claims.csv`` in the folder: what :func:`judge_all` made of the data."""
    points, path = document.named(data.frames), folder / "claims.md"
    errors = points["error"].str.split().str[0].value_counts()
    shown = made.assign(verdict="**" + made["verdict"] + "**")
    lines = [
        f"# Claims of the paper, measured here\n\n{tally(made)}\n\n{document.where(points)}. {ABOUT}\n",
        *document.markdown(shown.rename(columns={"number": "", "numbers": "measured", "judged_from": "judged from"})),
        f"\nOf {len(points)} points measured {errors.get(numbers.WRONG, 0)} have wrong answers and "
        f"{errors.get(numbers.UNSCORED, 0)} are unscored.\n",
    ]
    path.write_text("\n".join(lines), encoding="utf-8")
    return [path, document.write_csv(made, folder / "claims.csv", list(made))]
