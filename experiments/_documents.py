"""What the documents of the project say in numbers, drawn from the kept results: ``shadowbench report results --docs .``"""

from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from functools import cache
from typing import Any

from ..harness.report import claims as verdict
from ..harness.report import compare, document, numbers, ranking, style, two_runs
from ..harness.report import paper_table1 as paper
from ..harness.report.dataframe import DataFrame, pd
from ..harness.report.documents import Results
from ..harness.report.page.gather import PARTS as PARTS_OF_A_FRAME
from ..harness.report.page.gather import machine_of, written
from ..harness.results.folder import read_environment
from ..harness.results.schema import newest
from . import _rivals, effects, soft_shadows
from .accuracy.untimed import read_hard
from .claims import CLAIMS

KINDS = ("grids of rays", "trees", "rasterised buffers", "the paper's grids")
"""The kinds that a table of the fastest shows; the others are slower everywhere."""
FLOAT32 = "BVH2 rebuilt, float32"
EXACT = "BVH2 rebuilt"
PAPER, FAITHFUL, WARP = "the paper's grids", "paper-faithful", "LBVH rebuilt in a graph"


def marked(table: DataFrame | Mapping[str, Any] | Sequence[Mapping[str, Any]]) -> list[str]:
    """A table in Markdown, and what the marks of its numbers say."""
    lines = document.markdown(pd.DataFrame(table))
    return [*lines, *(line for meaning in numbers.meanings(lines) for line in ("", meaning))]


PART_NAMES = {"build": "build", "trace": "primary rays", "light_build": "build for the light", "shadow": "shadow rays"}


def finding(results: Results, folder: str) -> list[str]:
    """The sentence of an experiment that ranks methods."""
    return [ranking.finding(results.ranked(folder))]


def headline(results: Results, folder: str) -> list[str]:
    """The same in one sentence."""
    return [f"**{ranking.headline(results.ranked(folder))}**"]


def kinds(results: Results, folder: str) -> list[str]:
    """The fastest exact method of each kind on each scene, ms; one with wrong answers where it is faster than that."""
    table = results.ranked(folder)
    best = ranking.best(results.frames(folder), table)
    table = table[["title", "scene", "exact", "total_ms", "ms", "true_errors"]].assign(
        kind=table["method"].map(style.kind), best=best
    )
    rows = []
    for title, own in table.groupby("title", sort=False):
        cells = {kind: fastest(own[own["kind"] == kind]) for kind in KINDS}
        printed = paper.ROWS[own["scene"].iloc[0]].cells[-1].removesuffix(" ms")
        rows.append({"scene": str(title), **cells, f"*paper, {paper.GPU}*": f"*{printed}*"})
    return marked(rows)


def fastest(own: DataFrame) -> str:
    """A cell of :func:`kinds`."""
    right = own[own["exact"]].sort_values("total_ms").head(1)
    wrong = own[~own["exact"] & (own["total_ms"] < right["total_ms"].min())].head(1)
    texts = [f"**{row['ms']}**" if row["best"] else row["ms"] for row in right.to_dict("records")]
    texts += [f"{row['ms']} with {row['true_errors']:,} wrong" for row in wrong.to_dict("records")]
    return "; ".join(texts) or "-"


def ratio(results: Results, folder: str, label: str, base: str) -> DataFrame:
    """Frame time of one label over that of another, with its spread, by scene."""
    frames, points = results.frames(folder), results.points(folder)
    found = compare.ratios(frames, frames["label"] == base).rename(columns={"spread": "ratio_spread"})
    return points[points["label"] == label].join(found[["ratio", "ratio_spread"]])


def beside(results: Results, folder: str) -> list[str]:
    """How the rivals stand to each other, in sentences; means are geometric, over the scenes."""

    def over(label: str, base: str) -> str:
        return numbers.mean(ratio(results, folder, label, base), "ratio")

    points = results.points(folder)
    wrong = points.loc[points["label"] == FLOAT32, "true_errors"]
    return [
        f"- An exact tree that is rebuilt takes {over(EXACT, FLOAT32)} times the time of its float32 version, which "
        f"answers {numbers.count(wrong.sum())} pixels and shadow bits wrongly in the frames of the {len(wrong)} scenes.",
        f"- The paper's own grids, tuned, take {over(PAPER, EXACT)} times the time of that tree, and {over(PAPER, WARP)} of "
        "that of the `Bvh` of NVIDIA Warp rebuilt within a graph. As the paper describes them they take "
        f"{over(FAITHFUL, PAPER)} times as long as tuned.",
        f"- `hybrid` takes {over(_rivals.HYBRID.label, _rivals.OURS.label)} times the time of `ray_grids`.",
        "- Means are geometric, over the scenes.",
    ]


def exactness(results: Results, folder: str) -> list[str]:
    """Scene by scene what exact answers cost a rebuilt tree, and how many answers are wrong without."""
    points = results.points(folder)
    loose = points[points["label"] == FLOAT32].set_index("title")[["ms", "true_errors"]]
    both = ratio(results, folder, EXACT, FLOAT32).join(loose.add_suffix("_float32"), on="title")
    return marked({
        "scene": both["title"], "float32, ms": both["ms_float32"],
        "wrong answers": both["true_errors_float32"].map(numbers.count), "exact, ms": both["ms"],
        "exact over float32": numbers.texts(both, "ratio"),
    })  # fmt: skip


def frames(results: Results, folder: str, *methods: str) -> list[str]:
    """The whole frame of every setting of these methods on each scene, ms; in brackets how many answers are wrong."""
    table = of_methods(results, folder, methods)
    text = table["ms"] + table["true_errors"].map(lambda n: f" ({n:,} wrong)" if n else "")
    return marked(document.cross_table(table.assign(text=text), {"label": "ms"}, "title", "text"))


def parts(results: Results, folder: str, *methods: str) -> list[str]:
    """The parts of these frames, ms: what each adds to the frame."""
    table = document.with_passes(of_methods(results, folder, methods), results.folder / folder, PARTS_OF_A_FRAME)
    rows = [
        table.assign(part=said, text=table[f"{name}_text"], known=table[f"{name}_ms"])
        for name, said in PART_NAMES.items()
    ]
    rows = [own[own.groupby("label")["known"].transform("max") > 0] for own in rows]  # the others have no such pass
    table = document.arranged(pd.concat(rows), "label", table["label"].unique())
    return marked(document.cross_table(table, {"label": "method", "part": "ms"}, "title", "text"))


def of_methods(results: Results, folder: str, methods: Sequence[str]) -> DataFrame:
    """The measured points of these methods, the first method first, with the titles of stand-ins cut."""
    points = document.measured(results.points(folder))
    table = document.arranged(points[points["method"].isin(methods)], "method", methods)
    return table.assign(title=table["title"].str.removesuffix(" (stand-in)"))


def hard_cases(results: Results, folder: str) -> list[str]:
    """Wrong answers of the points of ``accuracy`` on the hard cases; and the points that have none."""
    table = read_hard(results.folder / folder)
    bad = table[table["true_errors"] > 0]
    rows = {"setting": bad["label"], "hard cases": bad["cases"], "with a wrong answer": bad["cases_wrong"],
            "wrong answers": bad["true_errors"].map(numbers.count)}  # fmt: skip
    none = table.loc[table["true_errors"] == 0, "label"]
    return [*marked(rows), "", f"Without a wrong answer: {'; '.join(none)}."]


def effects_of(results: Results, folder: str, *scenes: str) -> list[str]:
    """What each effect costs grids of rays, a tree and the paper's grids; and a frame by what alone moved."""
    table = document.measured(effects.read(results.folder / folder))
    table = document.arranged(table[table["scene"].isin(scenes)], "scene", scenes)
    table = table[(table["light_label"] != effects.BASE) & table["label"].isin([_rivals.OURS.label, EXACT, PAPER])]
    effect = table["light_label"].where(table["moved"] == "", "only moved: " + table["moved"])
    table = table.assign(text=numbers.texts(table, "ratio"), effect=effect)
    return marked(document.cross_table(table, {"title": "scene", "effect": "effect"}, "label", "text"))


def findings(results: Results, prefix: str, *folders: str) -> list[str]:
    """What experiments found, as their reports say it, each with its machine. ``prefix``: the way to the results."""
    lines = []
    for folder in folders:
        points = results.points(folder)
        name = points["experiment"].iloc[0]
        title, told = written(results.folder / folder, [name])
        lines.append(f"- [{title}]({prefix}/{folder}/{name}.md): {told} ({machine(results, folder)}.)")
    return lines


def machine(results: Results, folder: str) -> str:
    names = results.points(folder)["environment"].unique()
    facts = [read_environment(results.folder / folder, name) or {} for name in names]
    return numbers.listed(list(dict.fromkeys(map(machine_of, facts))))


@cache
def judged(results: Results, machine: str) -> DataFrame:
    """The paper's claims as the records of a machine decide them (:func:`.report.claims.judge_all`)."""
    return verdict.judge_all(CLAIMS, results.data(machine))


def claims(results: Results, *machines: str) -> list[str]:
    """The paper's claims, each with its verdict on every machine."""
    first = judged(results, machines[0])
    rows = {"": first["number"], "claim": first["claim"], "in the paper": first["section"]}
    for name in machines:
        rows[f"on {name}"] = "**" + judged(results, name)["verdict"] + "**"
    return marked({**rows, f"judged from, on {machines[0]}": first["judged_from"]})


def verdicts(results: Results, machine: str) -> list[str]:
    """How many claims hold."""
    return [verdict.tally(judged(results, machine))]


def soft(results: Results, folder: str) -> list[str]:
    """A soft shadow by the number of targets, on each scene: the error of its picture, what the fastest exact grid and tree
    take, and what a filtered map takes, with its error.
    """
    table = document.measured(soft_shadows.read(results.folder / folder))
    rows = []
    for (title, targets), own in table[table["targets"].isin(SHOWN_TARGETS)].groupby(["title", "targets"], sort=False):
        best = own[own["exact"]].sort_values("total_ms")
        error = best["rmse"].dropna().map(percent).head(1)
        row = {"scene": str(title), "targets": int(targets), "error of the light": next(iter(error), "-")}
        for name, labels in (("grid, ms", soft_shadows.GRIDS), ("tree, ms", soft_shadows.TREES)):
            row[name] = next(iter(best["ms"][best["label"].isin(labels)]), "-")
        for label, mapped in own[own["method"] == soft_shadows.FILTERED[0].method].groupby("label", sort=False):
            (one,) = mapped.to_dict("records")
            row[f"{label}, ms (error)"] = f"{one['ms']} ({percent(one['rmse'])})"
        rows.append(row)
    return marked(sorted(rows, key=lambda row: (row["scene"], row["targets"])))


SHOWN_TARGETS = (1, 4, 16, 64)


def percent(share: float) -> str:
    """A share of the light as text; "-" where it is not known."""
    return f"{100 * share:.2g} %" if share == share else "-"


def repeated(results: Results, folder: str, again: str) -> list[str]:
    """How many points of two runs :mod:`.report.two_runs` finds the same, and which methods the others are of."""
    first, second = (two_runs.entries(newest(results.folder / name)[0]) for name in (folder, again))
    rows = two_runs.compared(first, second).rows
    told = [f"{sum(row.verdict == two_runs.SAME for row in rows)} of {len(rows)} points are the same"]
    for other in (one for one in two_runs.VERDICTS if one != two_runs.SAME):
        labels = Counter(row.label for row in rows if row.verdict == other)
        if labels:
            named = ", ".join(f"{label} ({count})" for label, count in labels.most_common())
            told.append(f"{labels.total()} {other}: {named}")
    return [f"A second run against the first, within {two_runs.MARGIN:.0%}: {'; '.join(told)}."]


def folders(results: Results, name: str) -> list[str]:
    """The folders of a machine: what was measured, when, and with which version of the first of its methods."""
    rows = []
    for folder in results.names(name):
        points = results.points(folder)
        title, _ = written(results.folder / folder, [points["experiment"].iloc[0]])
        rows.append({"folder": f"`{folder.removeprefix(f'{name}/')}`", "experiment": title, **measured(points)})
    return marked(rows)


def measured(points: DataFrame) -> dict[str, Any]:
    """Number of points, when they were measured, and the version of ``ray_grids``, or of the first method, by its hash."""
    days = points["started"].dropna()
    day = [datetime.fromtimestamp(s, tz=UTC).strftime("%Y-%m-%d") for s in (days.min(), days.max())]
    methods = points["method"].tolist()
    name = _rivals.OURS.method if _rivals.OURS.method in methods else methods[0]
    own = points[points["method"] == name].sort_values("started")
    hashes = [f"`{sha[:8]}`" for sha in own["method_sha256"].unique() if sha]
    return {"points": str(len(points)), "measured": " to ".join(dict.fromkeys(day)),
            "version": f"{name} {' and '.join(hashes) or 'not known'}"}  # fmt: skip


PARTS = {part.__name__: part for part in (
    headline, finding, kinds, beside, exactness, frames, parts, hard_cases, effects_of, findings, claims, verdicts, folders,
    repeated, soft,
)}  # fmt: skip
