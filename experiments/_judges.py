"""The judges of the paper's claims: functions of the evidence of one experiment, with their thresholds.

A claim's words are the paper's, so the paper's configuration decides it; ours is judged beside it, never instead of it.
Times that differ by less than 3 % count as equal.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..harness.report import compare, style
from ..harness.report.claims import FAILS, HOLDS, OPEN, Finding, by_ratio, each, lacking
from ..harness.report.compare import geometric
from ..harness.report.evidence import Evidence
from ..harness.results.table import stage_ms
from . import _rivals, figure10
from ._paper import UNBALANCED
from ._sorting import SORT
from .ablation import BASE, CULLED, EXACT
from .figure2 import DIRECT, INDIRECT
from .figure11 import TRAVERSAL
from .key_bits import HERE
from .reflection import KINDS, MIRRORED

if TYPE_CHECKING:
    from pandas import DataFrame, Series

FAITHFUL = {"label": BASE}
OURS = {"method": "perspective_spherical", "settings": "-"}
TREE = {"method": "warp_bvh", "settings": "-"}
GRID = {"method": "uniform_grid", "settings": "-"}
"""The paper's configuration; ours; Warp's tree rebuilt each frame; one uniform grid."""

LARGE, SMALL = ("fairy", "sibenik", "conference"), ("bunny_dragon", "cloth", "buddha")
"""Scenes with large triangles, and scenes of small ones only (but for a ground)."""

CLAMPS = {"none": "unclamped", "view": "clamped to the view", "hits": "clamped to the hits"}
LEFT = 1.5
"""Load balancing compensates for the light's position if the slowest position takes at most this many times the
fastest."""


def total(t: DataFrame) -> Series:
    """The whole frame, ms."""
    return t["total_ms"]


def primary(t: DataFrame) -> Series:
    """Build and trace of primary rays, ms."""
    return t["build_ms"] + t["trace_ms"]


def lit(t: DataFrame) -> Series:
    """Light grid and shadow rays, ms."""
    return t["light_build_ms"] + t["shadow_ms"]


def column(name: str) -> Callable[[DataFrame], Series]:
    """A column, missing where there is none."""
    return lambda t: t.get(name, t["total_ms"] * float("nan"))


def with_ours(judge: Callable[[dict[str, Any]], Finding]) -> Finding:
    """The finding for the paper's configuration, with that for ours beside it, given the columns of each."""
    paper, ours = judge(FAITHFUL), judge(OURS)
    beside = "" if ours.lacking else f"; our configuration: {ours.verdict}, {ours.numbers}"
    return replace(paper, numbers=paper.numbers + beside)


def indirect_speed(evidence: Evidence) -> Finding:
    found = evidence.ratios({"label": DIRECT}, {"label": INDIRECT}, column("trace_ms"))
    if "buddha" not in found:
        return lacking("Buddha with direct and indirect mapping")
    gain = found["buddha"] - 1
    return Finding(HOLDS if gain >= 0.3 else FAILS, f"{gain:.0%} faster tracing of primary rays")


def indirect_most(evidence: Evidence) -> Finding:
    found = evidence.ratios({"label": INDIRECT}, {"label": DIRECT}, column("counter.primary tests, most"))
    if "buddha" not in found:
        return lacking("Buddha with direct and indirect mapping")
    verdict = HOLDS if found["buddha"] < 0.5 else FAILS
    return Finding(verdict, f"{found['buddha']:.0%} of the most with direct mapping")


def two_by_two(evidence: Evidence) -> Finding:
    labels = {"1x1": "direct mapping, 16x16 tiles", "2x2": BASE, "4x4": "4x4 of 4x4 tiles"}
    found = {k: evidence.ratios({"label": v}, {"label": BASE}, primary) for k, v in labels.items()}
    if not all(found.values()):
        return lacking("one of 1x1, 2x2 and 4x4")
    means = {k: geometric(v.values()) for k, v in found.items()}
    close = sorted(means.values())[1] / sorted(means.values())[0] < 1.03
    verdict = OPEN if close else HOLDS if min(means, key=lambda k: means[k]) == "2x2" else FAILS
    return Finding(verdict, f"build and trace of primary rays relative to 2x2: {each(means)}")


def build_cheap(evidence: Evidence) -> Finding:
    points = evidence.by_scene()
    shares = points["build_ms"] / primary(points)
    verdict = HOLDS if shares.max() < 0.5 else FAILS if shares.min() > 0.5 else OPEN
    text = f"share of build in build and trace: {each(dict(shares), '{:.0%}')} (an earlier grid: 15-30 %)"
    return Finding(verdict, text)


def wrong_in(points: DataFrame) -> str:
    """The scenes with wrong answers, and how many; "" where there is none."""
    counts = points["true_errors"]
    return each(dict(counts[counts > 0]), "{:,}")


def culling(evidence: Evidence) -> Finding:
    """Only with the exact triangle test do points with culling have the same answers as those without."""
    one, other = {"label": CULLED}, {"label": EXACT}
    pairs = evidence.ratios(one, other, column("counter.camera pairs"))
    build = evidence.ratios(one, other, column("build_ms"))
    if not pairs or not build:
        known = "set.cull" in evidence.frames
        old = evidence.by_scene(**{"set.cull": "primary"} if known else {"label": CULLED})
        old = old[old["label"] != CULLED]
        wrong = wrong_in(old)
        test = f"culled with {old['set.triangle_test'].iloc[0]}, answers are wrong: {wrong}" if wrong else ""
        return lacking("a closed scene culled with the exact triangle test", test)
    wrong = wrong_in(evidence.by_scene(**one))
    verdict = OPEN if wrong else HOLDS if max(pairs.values()) < 0.97 and max(build.values()) < 0.97 else FAILS
    spoilt = f"; wrong answers: {wrong}" if wrong else ""
    return Finding(verdict, f"pairs {each(pairs)}; build time {each(build)} of those without{spoilt}")


def rearrangement(evidence: Evidence) -> Finding:
    points = evidence.by_scene()
    if len(points) < 3:
        return lacking("a third scene")
    times = stage_ms(points, *figure10.PASSES["rearrangement"])
    vary = times.std(ddof=0) / times.mean()
    verdict = HOLDS if vary <= 0.15 else FAILS if vary > 0.35 else OPEN
    return Finding(verdict, f"coefficient of variation {vary:.0%}; ms: {each(dict(times), '{:.3f}')}")


def resolution(evidence: Evidence) -> Finding:
    """Compares the smallest and the largest size, if one run measured both on the same scenes and frames."""
    sizes = evidence.widths
    if len(sizes) < 2:
        return lacking("a second size in the same run")
    grown = dict(figure10.growth(evidence.frames)["rearrangement"].dropna())
    if not grown:
        return lacking("a scene at both sizes")
    mean, most = geometric(grown.values()), (sizes[-1] / sizes[0]) ** 2
    text = f"{mean:.1f} times the time for {most:.0f} times the pixels ({each(grown)})"
    return Finding(HOLDS if mean > 1.2 else FAILS, text)


def shadow_slower(evidence: Evidence) -> Finding:
    points = evidence.by_scene()
    found = stage_ms(points, *figure10.PASSES["shadow_traversal"]) / points["trace_ms"]
    slower, close = int((found > 1.03).sum()), int(found.between(0.97, 1.03).sum())
    most = 0.8 * len(found)
    verdict = HOLDS if slower >= most else FAILS if slower + close < most else OPEN
    return Finding(
        verdict, f"slower on {slower} of {len(found)} scenes; shadow over primary: {each(dict(found))}"
    )


def balanced(evidence: Evidence) -> DataFrame:
    """One row per scene, clamp and distance of the light: traversal, ms, without load balancing and with it at the best
    r."""
    frames = evidence.of()
    own = frames[
        (frames["set.precision"] == "float64")
        & frames["set.aimed"].astype(str).str.lower().isin(["true", "1"])
    ]
    one, plain = compare.pairs(own, own["set.r"].astype(int) == int(UNBALANCED), (*compare.SAME, "set.clamp"))
    one = one.assign(best=stage_ms(one, *TRAVERSAL), without=stage_ms(plain, *TRAVERSAL))
    one = one[one["set.r"].astype(int) < int(UNBALANCED)]
    return one.loc[one.groupby(["scene", "scene_title", "set.clamp", "light_distance"])["best"].idxmin()]


def radii(distance: float) -> str:
    """A distance of the light in short form: 0.1, 10, 1e7."""
    return f"{distance:g} {'radius' if distance == 1 else 'radii'}".replace("e+0", "e")


def balancing(evidence: Evidence) -> Finding:
    """Holds where balancing helps at the distance that is slowest without it, and leaves at most :data:`LEFT`."""
    verdicts, parts = set(), []
    for title, scene in (points := balanced(evidence)).groupby("scene_title", sort=False):
        parts += [f"{title}:"] * (points["scene_title"].nunique() > 1)
        for clamp, own in sorted(scene.groupby("set.clamp"), key=lambda item: list(CLAMPS).index(item[0])):
            gains = (own["without"] / own["best"]).set_axis(own["light_distance"].map(radii))
            parts.append(
                f"{CLAMPS[clamp]}, without balancing over with it at the best r: {each(dict(gains))}"
            )
        own = scene[scene["set.clamp"] == "none"]
        if len(own) < 2:
            continue
        slowest = own.loc[own["without"].idxmax()]
        without, left = (own[name].max() / own[name].min() for name in ("without", "best"))
        helps = slowest["without"] / slowest["best"] > 1.03
        verdicts.add(HOLDS if helps and left <= LEFT else FAILS)
        parts.append(f"unclamped, slowest over fastest distance: {without:.2f} without, {left:.2f} with it")
    if not verdicts:
        return lacking(
            f"traversal without load balancing (r = {UNBALANCED}) at two distances", "; ".join(parts)
        )
    return Finding(verdicts.pop() if len(verdicts) == 1 else OPEN, "; ".join(parts).replace(":;", ":"))


def ratio(
    one: str, other: str, measure: Callable[[DataFrame], Series], what: str
) -> Callable[[Evidence], Finding]:
    """A judge that holds where the points labelled ``one`` take longer than those labelled ``other``."""
    return lambda evidence: by_ratio(evidence.ratios({"label": one}, {"label": other}, measure), what)


spherical = ratio(
    "cube map", BASE, lit, "light grid and shadow rays with a cube map over those with a spherical one:"
)
clamping = ratio(
    "light not clamped", BASE, lit, "light grid and shadow rays unclamped over clamped to the view:"
)
small_cells = ratio(
    "direct mapping, 16x16 tiles", "direct mapping, 8x8 tiles", primary,
    "build and trace of primary rays with 16x16 tiles over 8x8 tiles, k = 1:",
)  # fmt: skip


def six_of(found: dict[str, float]) -> dict[str, float]:
    """The scenes of the six that were measured: those with large triangles first."""
    return {scene: found[scene] for scene in (*LARGE, *SMALL) if scene in found}


def large_triangles(evidence: Evidence) -> Finding:
    """The grids over a tree on scenes with large triangles against the others; one uniform grid beside it."""

    def judge(grids: dict[str, Any]) -> Finding:
        found = six_of(evidence.ratios(grids, TREE, total))
        if len(found) < 6:
            return lacking(f"one of the six scenes with both {grids.get('label', 'the grids')} and the tree")
        hurt = geometric([found[s] for s in LARGE]) / geometric([found[s] for s in SMALL])
        text = (
            f"frame time over that of a tree rebuilt: {each(found)}; {hurt:.2f} times as much with large ones"
        )
        return Finding(HOLDS if hurt > 1.2 else FAILS if hurt < 1 else OPEN, text)

    found, grid = with_ours(judge), judge(GRID)
    beside = "" if grid.lacking else f"; one uniform grid: {grid.numbers}"
    return replace(found, numbers=found.numbers + beside)


def architecture(evidence: Evidence) -> Finding:
    def judge(grids: dict[str, Any]) -> Finding:
        found = six_of(evidence.ratios(GRID, grids, total))
        if not set(LARGE) <= found.keys():
            return lacking(
                f"Fairy, Sibenik or Conference with a uniform grid beside {grids.get('label', 'ours')}"
            )
        far = min(found["sibenik"], found["conference"])
        verdict = HOLDS if far > 1.5 and 1.0 < found["fairy"] < far else FAILS
        return Finding(verdict, f"times faster than a uniform grid, whole frame: {each(found)}")

    return with_ours(judge)


def two_lights(evidence: Evidence) -> Finding:
    two = {"scene": "fairy", "lights": 2}

    def judge(grids: dict[str, Any]) -> Finding:
        gain = evidence.ratios({**TREE, **two}, {**grids, **two}, total).get("fairy")
        if gain is None:
            return lacking(f"Fairy with two lights, {grids.get('label', 'ours')} beside a tree")
        verdict = HOLDS if gain > 1.03 else FAILS if gain < 0.97 else OPEN
        return Finding(verdict, f"{gain:.2f} times a rebuilt tree")

    found, rates = with_ours(judge), 1000 / evidence.of(**two).groupby("label")["total_ms"].mean()
    told = f"; frames per second: {each(dict(rates), '{:.1f}')}" if len(rates) else ""
    return replace(found, numbers=f"{found.numbers}{told} (paper: 7.6 against 5.26, 1.44)")


def key_bits(evidence: Evidence) -> Finding:
    """At every number of pairs: holds where no step to more bits is faster, and the paper's bits beat 32."""
    told, rises, saves = [], [], []
    for width in evidence.widths:
        frames = evidence.of(width=width)
        own, base = compare.pairs(frames, frames["point.bits"] == 32)
        line = stage_ms(own, "build", SORT) / stage_ms(base, "build", SORT)
        line = line.set_axis(own["point.bits"].astype(int)).sort_index()
        if not {HERE, 32} <= set(line.index):
            return lacking(f"{HERE} or 32 bits")
        rises.append((line.to_numpy()[1:] > 0.97 * line.to_numpy()[:-1]).all())
        saves.append(line[HERE] < 0.97)
        told.append(f"{int(own['point.pairs'].iloc[0]):,} pairs, over 32 bits: {each(dict(line))}")
    verdict = HOLDS if all(rises) and all(saves) else OPEN if any(saves) else FAILS
    return Finding(verdict, "; ".join(told))


def reflected(evidence: Evidence) -> Finding:
    """Times of the passes that trace mirrored rays: on each scene the fastest grid over the fastest tree."""
    import pandas as pd

    traced = functools.partial(stage_ms, part="trace", pattern=MIRRORED)
    grids, trees = ([label for label, kind in KINDS.items() if kind == own] for own in ("grid", "tree"))
    bounced = {"light_label": "4 bounces"}
    tables = {grid: evidence.over_rivals({**bounced, "label": grid}, trees, traced) for grid in grids}
    largest = pd.DataFrame({grid: table.max(axis=1) for grid, table in tables.items()}).dropna(how="all")
    if largest.empty:
        return lacking("a grid and a tree with mirrors")
    told = ", ".join(
        f"{scene} {largest.loc[scene, grid]:.2f}, {grid} over {tables[grid].loc[scene].idxmax()}"
        for scene, grid in largest.idxmin(axis=1).items()
    )
    mean = geometric(largest.min(axis=1))
    verdict = HOLDS if mean < 0.97 else FAILS if mean > 1.03 else OPEN
    text = f"mirrored rays of 4 bounces, fastest grid over fastest tree: {mean:.2f} (geometric mean; {told})"
    return Finding(verdict, text)


def against_rivals(evidence: Evidence) -> Finding:
    """Our two fastest methods against the fastest rivals of every scene. Exact, rebuilt rivals decide, on the first."""
    exact = {e.label for e in (*_rivals.REBUILT, _rivals.RASTERISED, *_rivals.GRIDS)}
    exact -= set(evidence.frames.loc[evidence.frames["known_inexact"] != "", "label"])
    kinds = {
        "exact and rebuilt": exact,
        "rebuilt, those in float32 too": exact | {e.label for e in _rivals.REBUILT},
        "refitted": {e.label for e in _rivals.REFITTED},
    }
    told: list[str] = []
    decides: dict[str, dict[str, float]] = {}  # of the first method: over the fastest rival of a scene
    for ours in (_rivals.OURS.label, _rivals.HYBRID.label):
        rivals = sorted(set().union(*kinds.values()))
        table = evidence.over_rivals({"label": ours}, rivals, total)
        for kind, labels in kinds.items():
            largest = dict(table[sorted(labels)].max(axis=1).dropna())
            told += [f"{ours} over the fastest {kind}: {each(largest)}"] * bool(largest)
            decides.setdefault(kind, largest)
    if not decides["exact and rebuilt"]:
        return lacking("a scene with our method and a rebuilt rival")
    slowest = max(decides["exact and rebuilt"].values())
    return Finding(HOLDS if slowest < 0.97 else FAILS if slowest > 1.03 else OPEN, "; ".join(told))


def interactive(evidence: Evidence) -> Finding:
    frames = evidence.by_scene()["total_ms"]
    told = ", ".join(f"{k} {style.number(v)}" for k, v in frames.items())
    return Finding(HOLDS if frames.max() < 200 else FAILS, f"ms per frame, faithful configuration: {told}")
