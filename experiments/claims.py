"""The paper's claims one by one, judged from the records of the other experiments. It measures nothing itself.

``shadowbench show claims DIR`` reads every results folder in DIR. A claim's words are the paper's, so the paper's
configuration decides it; ours is judged beside it, never instead of it. Each claim stands above the function that decides
it, with its thresholds: times that differ by less than 3 % count as equal. A ratio is taken within one run.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from ..harness.report import claims, compare, numbers
from ..harness.report.claims import Claim, Evidence, Finding, Lacking, Measure, each, judged
from ..harness.report.compare import geometric
from ..harness.report.dataframe import pd
from ..harness.results.table import stage_ms
from ..harness.runner.planning.experiment import Experiment
from . import _rivals, figure10
from ._paper import UNBALANCED
from .ablation import BASE, CULLED, EXACT
from .figure2 import DIRECT, INDIRECT
from .figure11 import RECTANGLES, balanced
from .key_bits import HERE, SORT
from .reflection import KINDS, mirrored_ms

FAITHFUL = {"label": BASE}
OURS = {"method": "perspective_spherical", "settings": "-"}
TREE = {"method": "warp_bvh", "settings": "-"}
GRID = {"method": "uniform_grid", "settings": "-"}
"""The paper's configuration; ours; Warp's tree rebuilt each frame; one uniform grid."""

LARGE, SMALL = ("fairy", "sibenik", "conference"), ("bunny_dragon", "cloth", "buddha")
"""Scenes with large triangles, and scenes of small ones only (but for a ground)."""

BUDDHA = "Buddha with direct and indirect mapping", "buddha"
LEFT = 1.5  # the light's position is compensated if the slowest takes at most this many times the fastest

Judge = Callable[[Evidence], Finding]
CLAIMS: list[Claim] = []  # in the order of this file


def claim(text: str, section: str, *experiments: str, counted: bool = False) -> Callable[[Judge], Judge]:
    """Declare what the function below decides: see :class:`.report.claims.Claim`."""

    def declare(judge: Judge) -> Judge:
        CLAIMS.append(Claim(text, section, experiments, judge, counted))
        return judge

    return declare


def columns(*names: str) -> Measure:
    """The sum of columns, missing where one of them is."""
    return lambda t: t.reindex(columns=names).astype(float).sum(axis=1, skipna=False)


TOTAL, PRIMARY, LIT = columns("total_ms"), columns("build_ms", "trace_ms"), columns("light_build_ms", "shadow_ms")
"""Milliseconds of the frame; of build and trace of primary rays; of light grid and shadow rays."""


@claim("Interactive rates (below 200 ms per frame here) on moderately large models", "1, 5", "figure10")
def interactive(evidence: Evidence) -> Finding:
    times = evidence.by_scene()["total_ms"]
    told = each(dict(times), numbers.carried)
    return judged(times.max() < 200, f"ms per frame, faithful configuration: {told}")


@claim("Indirect mapping makes Buddha 30-50 % faster", "3", "figure2")
def indirect_speed(evidence: Evidence) -> Finding:
    found = evidence.ratios({"label": DIRECT}, {"label": INDIRECT}, columns("trace_ms"), *BUDDHA)
    return judged(found["buddha"] >= 1.3, f"{found['buddha'] - 1:.0%} faster tracing of primary rays")


@claim("... because the most triangles checked for a pixel drop by more than half", "3", "figure2", counted=True)
def indirect_most(evidence: Evidence) -> Finding:
    most = columns("counter.primary tests, most")
    found = evidence.ratios({"label": INDIRECT}, {"label": DIRECT}, most, *BUDDHA)
    return judged(found["buddha"] < 0.5, f"{found['buddha']:.0%} of the most with direct mapping")


@claim("2x2 sorting tiles in a tracing tile are best", "3", "ablation")
def two_by_two(evidence: Evidence) -> Finding:
    labels = {"1x1": "direct mapping, 16x16 tiles", "2x2": BASE, "4x4": "4x4 of 4x4 tiles"}
    over = partial(evidence.ratios, other=FAITHFUL, measure=PRIMARY, lacks="one of 1x1, 2x2 and 4x4")
    means = {size: geometric(over({"label": label}).values()) for size, label in labels.items()}
    best, second, _ = sorted(means, key=means.__getitem__)
    apart = means[second] >= 1.03 * means[best]
    text = f"build and trace of primary rays relative to 2x2: {each(means)}"
    return judged(apart and best == "2x2", text, fails=apart)


@claim("Building the grid is cheap against tracing", "1, 3", "figure10")
def build_cheap(evidence: Evidence) -> Finding:
    points = evidence.by_scene()
    shares = points["build_ms"] / PRIMARY(points)
    told = each(dict(shares), "{:.0%}".format)
    text = f"share of build in build and trace: {told} (an earlier grid: 15-30 %)"
    return judged(shares.max() < 0.5, text, fails=shares.min() > 0.5)


@claim("Culling back faces makes lists shorter and the build faster", "3", "ablation")
def culling(evidence: Evidence) -> Finding:
    """Only with the exact triangle test do points with culling have the same answers as those without."""
    pairs, build = (
        evidence.ratios({"label": CULLED}, {"label": EXACT}, columns(name))
        for name in ("counter.camera pairs", "build_ms")
    )
    if not pairs or not build:
        raise Lacking("a closed scene culled with the exact triangle test")
    counts = evidence.by_scene(label=CULLED)["true_errors"]
    wrong = each(dict(counts[counts > 0]), "{:,}".format)
    less = max(pairs.values()) < 0.97 and max(build.values()) < 0.97
    spoilt = f"; wrong answers: {wrong}" if wrong else ""
    text = f"pairs {each(pairs)}; build time {each(build)} of those without{spoilt}"
    return judged(less and not wrong, text, fails=not wrong)


@claim("Rearranging the shadow rays takes about the same time for all models", "5", "figure10")
def rearrangement(evidence: Evidence) -> Finding:
    points = evidence.by_scene()
    if len(points) < 3:
        raise Lacking("a third scene")
    times = stage_ms(points, *figure10.PASSES["rearrangement"])
    vary = times.std(ddof=0) / times.mean()
    text = f"coefficient of variation {vary:.0%}; ms: {each(dict(times), '{:.3f}'.format)}"
    return judged(vary <= 0.15, text, fails=vary > 0.35)


@claim("... and depends on the resolution", "5", "figure10")
def resolution(evidence: Evidence) -> Finding:
    """Compares the smallest and the largest size, if one run measured both on the same scenes and frames."""
    sizes = evidence.widths
    if len(sizes) < 2:
        raise Lacking("a second size in the same run")
    grown = dict(figure10.growth(evidence.frames)["rearrangement"].dropna())
    if not grown:
        raise Lacking("a scene at both sizes")
    mean, most = geometric(grown.values()), (sizes[-1] / sizes[0]) ** 2
    return judged(mean > 1.2, f"{mean:.1f} times the time for {most:.0f} times the pixels ({each(grown)})")


@claim("Shadow traversal is almost always slower than primary traversal", "5", "figure10")
def shadow_slower(evidence: Evidence) -> Finding:
    points = evidence.by_scene()
    found = stage_ms(points, *figure10.PASSES["shadow_traversal"]) / points["trace_ms"]
    slower, not_faster, most = int((found > 1.03).sum()), int((found >= 0.97).sum()), 0.8 * len(found)
    text = f"slower on {slower} of {len(found)} scenes; shadow over primary: {each(dict(found))}"
    return judged(slower >= most, text, fails=not_faster < most)


@claim("Load balancing compensates for the light's position", "5", "figure11")
def balancing(evidence: Evidence) -> Finding:
    """Holds where balancing helps at the distance that is slowest without it, and leaves at most :data:`LEFT`."""
    compensated, parts = set(), []
    for title, scene in (points := balanced(evidence.of())).groupby("scene_title", sort=False):
        parts += [f"{title}:"] * (points["scene_title"].nunique() > 1)
        for clamp, words in RECTANGLES.items():
            own = scene[scene["set.clamp"] == clamp].set_index("distance")
            gains = each(dict(own["without"] / own["best"]))
            if gains:
                parts.append(f"{words}, without balancing over with it at the best r: {gains}")
        own = scene[scene["set.clamp"] == "none"]
        if len(own) > 1:
            slowest = own.loc[own["without"].idxmax()]
            without, left = (own[name].max() / own[name].min() for name in ("without", "best"))
            compensated.add(bool(slowest["without"] > 1.03 * slowest["best"] and left <= LEFT))
            parts.append(f"unclamped, slowest over fastest distance: {without:.2f} without, {left:.2f} with it")
    text = "; ".join(parts).replace(":;", ":")
    if not compensated:
        raise Lacking(f"traversal without load balancing (r = {UNBALANCED}) at two distances", text)
    return judged(compensated == {True}, text, fails=compensated == {False})


def longer(one: str, other: str, measure: Measure, what: str) -> Judge:
    """A judge that holds where the points labelled ``one`` take longer than those labelled ``other``."""

    def judge(evidence: Evidence) -> Finding:
        found = evidence.ratios({"label": one}, {"label": other}, measure, "either of the two")
        mean = geometric(found.values())
        return judged(mean > 1.03, f"{what} {mean:.2f} (geometric mean; {each(found)})", fails=mean < 0.97)

    return judge


claim("A spherical map is better than a cube map", "4.1", "ablation")(longer(
    "cube map", BASE, LIT, "light grid and shadow rays with a cube map over those with a spherical one:"
))  # fmt: skip
claim("Clamping the light's rectangle to the view helps", "4.1", "ablation")(longer(
    "light not clamped", BASE, LIT, "light grid and shadow rays unclamped over clamped to the view:"
))  # fmt: skip


def with_ours(judge: Callable[[dict[str, Any]], Finding]) -> Finding:
    """The finding for the paper's configuration, with that for ours beside it, given the columns of each."""
    beside = told(judge, OURS, "; our configuration: {0.verdict}, {0.numbers}")
    try:
        found = judge(FAITHFUL)
    except Lacking as lack:
        raise Lacking(*lack.args[:1], beside.removeprefix("; ")) from None
    return replace(found, numbers=found.numbers + beside)


def told(judge: Callable[[dict[str, Any]], Finding], grids: dict[str, Any], form: str) -> str:
    """The finding for a configuration as text; "" where the evidence does not have its numbers."""
    try:
        return form.format(judge(grids))
    except Lacking:
        return ""


@claim("Large triangles hurt grids more than trees (20 % at least)", "5", "ablation", "frame_time", "table1")
def large_triangles(evidence: Evidence) -> Finding:
    """The grids over a tree on scenes with large triangles against the others; one uniform grid beside it."""

    def judge(grids: dict[str, Any]) -> Finding:
        lacks = f"one of the six scenes with both {grids.get('label', 'the grids')} and the tree"
        found = evidence.ratios(grids, TREE, TOTAL, lacks, *LARGE, *SMALL)
        large, small = (geometric([found[scene] for scene in group]) for group in (LARGE, SMALL))
        text = (
            f"frame time over that of a tree rebuilt: {each(found)}; {large / small:.2f} times as much with large ones"
        )
        return judged(large > 1.2 * small, text, fails=large < small)

    found = with_ours(judge)
    return replace(found, numbers=found.numbers + told(judge, GRID, "; one uniform grid: {0.numbers}"))


@claim(
    "Far faster (1.5 times at least) than a grid on Conference and Sibenik, slightly on Fairy",
    "5", "frame_time", "table1",
)  # fmt: skip
def architecture(evidence: Evidence) -> Finding:
    def judge(grids: dict[str, Any]) -> Finding:
        lacks = f"Fairy, Sibenik or Conference with a uniform grid beside {grids.get('label', 'ours')}"
        found = evidence.ratios(GRID, grids, TOTAL, lacks, *LARGE)
        far = min(found["sibenik"], found["conference"])
        text = f"times faster than a uniform grid, whole frame: {each(found)}"
        return judged(far > 1.5 and 1.0 < found["fairy"] < far, text)

    return with_ours(judge)


@claim("Two lights on Fairy: faster than a tree built each frame", "5", "two_lights")
def two_lights(evidence: Evidence) -> Finding:
    two = {"scene": "fairy", "lights": 2}

    def judge(grids: dict[str, Any]) -> Finding:
        lacks = f"Fairy with two lights, {grids.get('label', 'ours')} beside a tree"
        gain = evidence.ratios({**TREE, **two}, {**grids, **two}, TOTAL, lacks, "fairy")["fairy"]
        return judged(gain > 1.03, f"{gain:.2f} times a rebuilt tree", fails=gain < 0.97)

    found, rates = with_ours(judge), 1000 / evidence.of(**two).groupby("label")["total_ms"].mean()
    per_second = each(dict(rates), "{:.1f}".format)
    numbers = f"{found.numbers}; frames per second: {per_second} (paper: 7.6 against 5.26, 1.44)"
    return replace(found, numbers=numbers)


@claim("Sorting costs less the fewer bits the key has; 18 here", "5", "key_bits")
def key_bits(evidence: Evidence) -> Finding:
    """At every number of pairs: holds where no step to more bits is faster, and the paper's bits beat 32."""
    parts, rises, saves = [], [], []
    for width in evidence.widths:
        frames = evidence.of(width=width)
        own, base = compare.pairs(frames, frames["point.bits"] == 32)
        line = stage_ms(own, "build", SORT) / stage_ms(base, "build", SORT)
        line = line.set_axis(own["point.bits"].astype(int)).sort_index()
        if not {HERE, 32} <= set(line.index):
            raise Lacking(f"{HERE} or 32 bits")
        rises.append((line.to_numpy()[1:] > 0.97 * line.to_numpy()[:-1]).all())
        saves.append(line[HERE] < 0.97)
        parts.append(f"{int(own['point.pairs'].iloc[0]):,} pairs, over 32 bits: {each(dict(line))}")
    return judged(all(rises) and all(saves), "; ".join(parts), fails=not any(saves))


@claim("Where the SIMD width is large, a tree does no better than a grid on reflected rays", "6", "reflection")
def reflected(evidence: Evidence) -> Finding:
    """Times of the passes that trace mirrored rays: on each scene the fastest grid over the fastest tree."""
    one = {"light_label": "4 bounces"}
    grids, trees = ([label for label, kind in KINDS.items() if kind == own] for own in ("grid", "tree"))
    tables = {grid: evidence.over_rivals({**one, "label": grid}, trees, mirrored_ms) for grid in grids}
    found = pd.concat(tables).dropna(how="all")
    if found.empty:
        raise Lacking("a grid and a tree with mirrors")
    over_fastest = found.max(axis=1)
    best = over_fastest.groupby(level=1).idxmin()
    mean = geometric(over_fastest[best])
    by_scene = ", ".join(
        f"{scene} {over_fastest[grid, scene]:.2f}, {grid} over {found.loc[(grid, scene)].idxmax()}"
        for grid, scene in best
    )
    what = "mirrored rays of 4 bounces, fastest grid over fastest tree"
    text = f"{what}: {mean:.2f} (geometric mean; {by_scene})"
    return judged(mean < 0.97, text, fails=mean > 1.03)


claim("Smaller cells win where sorting is fast", "6", "ablation")(longer(
    "direct mapping, 16x16 tiles", "direct mapping, 8x8 tiles", PRIMARY,
    "build and trace of primary rays with 16x16 tiles over 8x8 tiles, k = 1:",
))  # fmt: skip


@claim(
    "Ours: ray grids take less time than the fastest exact rival that is rebuilt each frame, on every scene",
    "-", "frame_time",
)  # fmt: skip
def against_rivals(evidence: Evidence) -> Finding:
    """Our two fastest methods against the fastest rivals of every scene. Exact, rebuilt rivals decide, on the first."""
    rebuilt, refitted = ({e.label for e in group} for group in (_rivals.REBUILT, _rivals.REFITTED))
    exact = rebuilt | {e.label for e in (_rivals.RASTERISED, *_rivals.GRIDS)}
    exact -= set(evidence.frames.loc[evidence.frames["known_inexact"] != "", "label"])
    kinds = {"exact and rebuilt": exact, "rebuilt, those in float32 too": exact | rebuilt}
    kinds["refitted"] = refitted
    parts, deciding = [], []
    for ours in (_rivals.OURS.label, _rivals.HYBRID.label):
        table = evidence.over_rivals({"label": ours}, sorted(exact | rebuilt | refitted), TOTAL)
        for kind, labels in kinds.items():
            largest = table[sorted(labels)].max(axis=1).dropna()
            if len(largest):
                parts.append(f"{ours} over the fastest {kind}: {each(dict(largest))}")
            deciding.append(largest.max())
    slowest = deciding[0]
    if slowest != slowest:
        raise Lacking("a scene with our method and a rebuilt rival")
    return judged(slowest < 0.97, "; ".join(parts), fails=slowest > 1.03)


EXPERIMENT = Experiment(
    name="claims", title="The paper's claims, one by one", presets={}, draw=partial(claims.draw, claims=CLAIMS)
)
