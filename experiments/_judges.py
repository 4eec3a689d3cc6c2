"""What decides each claim of the paper: a function of the evidence of one experiment, with its thresholds.

Times that differ by less than 3 % can't be told apart.
"""

from __future__ import annotations

import itertools

from ..harness.report import points, style
from ..harness.report.claims import FAILS, HOLDS, OPEN, Finding, by_ratio, each, geometric, lacking
from ..harness.report.evidence import Evidence, Row, ratio
from ._figures import figure10 as stages
from ._figures import figure11 as distance
from ._figures import key_bits as bits_drawing
from ._paper import UNBALANCED
from .ablation import BASE, CULLED, EXACT
from .figure2 import DIRECT, INDIRECT
from .figure10 import STAGES
from .figure11 import TRAVERSAL
from .key_bits import HERE

OURS = {"method": "perspective_spherical", "settings": "-"}
TREE = {"method": "bvh", "settings": "-"}
GRID = {"method": "uniform_grid", "settings": "-"}
"""Each as it is by itself: our best configuration, Warp's tree built anew each frame, one uniform grid."""

LARGE, SMALL = ("fairy", "sibenik", "conference"), ("bunny_dragon", "cloth", "buddha")
"""Scenes with large triangles, and scenes of small ones only (but for a ground)."""


def total(r: Row) -> float:
    """The whole frame, ms."""
    return r["total_ms"]


def primary(r: Row) -> float:
    """Build and trace of primary rays, ms."""
    return r["build_ms"] + r["trace_ms"]


def lit(r: Row) -> float:
    """Light grid and shadow rays, ms."""
    return r["light_build_ms"] + r["shadow_ms"]


def indirect_speed(evidence: Evidence) -> Finding:
    found = evidence.ratios({"label": DIRECT}, {"label": INDIRECT}, lambda r: r["trace_ms"])
    if "buddha" not in found:
        return lacking("Buddha with direct and indirect mapping")
    gain = found["buddha"] - 1
    return Finding(HOLDS if gain >= 0.3 else FAILS, f"{gain:.0%} faster tracing of primary rays")


def indirect_most(evidence: Evidence) -> Finding:
    found = evidence.ratios(
        {"label": INDIRECT}, {"label": DIRECT}, lambda r: r["counters"].get("primary tests, most")
    )
    if "buddha" not in found:
        return lacking("Buddha with direct and indirect mapping")
    verdict = HOLDS if found["buddha"] < 0.5 else FAILS
    return Finding(verdict, f"{found['buddha']:.0%} of the most with direct mapping")


def two_by_two(evidence: Evidence) -> Finding:
    labels = {"1x1": "direct mapping, 16x16 tiles", "2x2": BASE, "4x4": "4x4 of 4x4 tiles"}
    found = {k: evidence.ratios({"label": v}, {"label": BASE}, primary) for k, v in labels.items()}
    if not all(found.values()):
        return lacking("one of 1x1, 2x2 and 4x4")
    means = {k: geometric(list(v.values())) for k, v in found.items()}
    close = sorted(means.values())[1] / sorted(means.values())[0] < 1.03
    verdict = OPEN if close else HOLDS if min(means, key=lambda k: means[k]) == "2x2" else FAILS
    return Finding(verdict, f"build and trace of primary rays relative to 2x2: {each(means)}")


def build_cheap(evidence: Evidence) -> Finding:
    shares = {scene: r["build_ms"] / primary(r) for scene, r in evidence.by_scene().items()}
    verdict = HOLDS if max(shares.values()) < 0.5 else FAILS if min(shares.values()) > 0.5 else OPEN
    return Finding(
        verdict, f"share of build in build and trace: {each(shares, '{:.0%}')} (an earlier grid: 15-30 %)"
    )


def culling(evidence: Evidence) -> Finding:
    """With the exact triangle test: only there do culled rows have the answers of those that are not."""
    one, other = {"label": CULLED}, {"label": EXACT}
    pairs = evidence.ratios(one, other, lambda r: r["counters"].get("camera pairs"))
    build = evidence.ratios(one, other, lambda r: r["build_ms"])
    if not pairs or not build:
        old = [r for r in evidence.rows() if r["set"].get("cull") == "primary" and r["label"] != CULLED]
        wrong = {r["scene"]: r["true_errors"] for r in old if r["true_errors"]}
        test = old[0]["set"]["triangle_test"] if old else ""
        told = f"culled with {test}, answers are wrong: {each(wrong, '{:,}')}" if wrong else ""
        return lacking("a closed scene culled with the exact triangle test", told)
    wrong = {s: r["true_errors"] for s, r in evidence.by_scene(**one).items() if r["true_errors"]}
    verdict = OPEN if wrong else HOLDS if max(pairs.values()) < 0.97 and max(build.values()) < 0.97 else FAILS
    spoilt = f"; wrong answers: {each(wrong, '{:,}')}" if wrong else ""
    return Finding(verdict, f"pairs {each(pairs)}; build time {each(build)} of those without{spoilt}")


def rearrangement(evidence: Evidence) -> Finding:
    rows = evidence.by_scene()
    if len(rows) < 3:
        return lacking("a third scene")
    times = {scene: stages.add(r, STAGES)["rearrangement_ms"] for scene, r in rows.items()}
    vary = stages.variation(list(times.values()))
    verdict = HOLDS if vary <= 0.15 else FAILS if vary > 0.35 else OPEN
    return Finding(verdict, f"coefficient of variation {vary:.0%}; ms: {each(times, '{:.3f}')}")


def resolution(evidence: Evidence) -> Finding:
    """Of the smallest and the largest size, where one run measured both on the same scenes and frames."""
    sizes = evidence.sizes()
    low, high = (evidence.by_scene(width=width) for width in (sizes[0], sizes[-1]))
    if len(sizes) < 2:
        return lacking("a second size in the same run")
    found = {
        scene: ratio(high[scene], low[scene], lambda r: stages.add(r, STAGES)["rearrangement_ms"], sizes=True)
        for scene in high
        if scene in low
    }
    grown = {scene: value for scene, value in found.items() if value is not None}
    if not grown:
        return lacking("a scene at both sizes")
    mean, most = geometric(list(grown.values())), (sizes[-1] / sizes[0]) ** 2
    text = f"{mean:.1f} times the time for {most:.0f} times the pixels ({each(grown)})"
    return Finding(HOLDS if mean > 1.2 else FAILS, text)


def shadow_slower(evidence: Evidence) -> Finding:
    rows = {scene: stages.add(r, STAGES) for scene, r in evidence.by_scene().items()}
    found = {scene: r["shadow_traversal_ms"] / r["trace_ms"] for scene, r in rows.items()}
    slower, close = sum(v > 1.03 for v in found.values()), sum(0.97 <= v <= 1.03 for v in found.values())
    most = 0.8 * len(found)
    verdict = HOLDS if slower >= most else FAILS if slower + close < most else OPEN
    return Finding(verdict, f"slower on {slower} of {len(found)} scenes; shadow over primary: {each(found)}")


def placed(r: Row) -> Row:
    """A row of figure11 with its distance, its r, and the time of its traversal."""
    distance.add(r, TRAVERSAL)
    return r


def gains(evidence: Evidence, clamp: str) -> dict[float, tuple[float, float]]:
    """By the light's distance in radii: traversal, ms, without load balancing and with it at the best r."""
    rows = [placed(r) for r in evidence.rows()]
    found = {}
    for place in points.in_order(r["light_distance"] for r in rows):
        own = [r for r in distance.panel(rows, clamp, distance.AXES[True]) if r["light_distance"] == place]
        plain = [r for r in own if r["r"] == int(UNBALANCED)]
        balanced = [r for r in own if r["r"] < int(UNBALANCED)]
        if plain and balanced:
            best = min(balanced, key=lambda r: r["traversal_ms"])
            gain = ratio(plain[0], best, lambda r: placed(r)["traversal_ms"])
            if gain is not None:
                found[place] = (best["traversal_ms"] * gain, best["traversal_ms"])
    return found


def balancing(evidence: Evidence) -> Finding:
    """Holds where balancing helps at the distance that is slowest without it, and takes a fifth off the growth."""
    known = {clamp: gains(evidence, clamp) for clamp in distance.CLAMPS}
    parts = []
    for clamp, found in known.items():
        if found:
            times = {f"{distance.short(d)} radii": a / b for d, (a, b) in found.items()}
            parts.append(
                f"{distance.CLAMPS[clamp]}, without balancing over with it at the best r: {each(times)}"
            )
    own = list(known["none"].values())
    if len(own) < 2:
        return lacking(
            f"traversal without load balancing (r = {UNBALANCED}) at two distances", "; ".join(parts)
        )
    slowest, fastest = max(own), min(own)
    without, best = slowest[0] / fastest[0], max(b for _, b in own) / min(b for _, b in own)
    helps = slowest[0] / slowest[1]
    verdict = OPEN
    if helps <= 1.03 or best > 0.97 * without:
        verdict = FAILS
    elif best < 0.8 * without:
        verdict = HOLDS
    parts.append(f"unclamped, slowest over fastest distance: {without:.2f} without, {best:.2f} with it")
    return Finding(verdict, "; ".join(parts))


def unbalanced(evidence: Evidence) -> str:
    """What load balancing is worth with the light where the scene has it."""
    found = evidence.ratios({"label": "no load balancing"}, {"label": BASE}, lambda r: r["shadow_ms"])
    what = "at the scene's own light, shadow rays without balancing over with it"
    return f"{what}: {each(found)}" if found else ""


def spherical(evidence: Evidence) -> Finding:
    found = evidence.ratios({"label": "cube map"}, {"label": BASE}, lit)
    return by_ratio(found, "light grid and shadow rays with a cube map over those with a spherical one:")


def clamping(evidence: Evidence) -> Finding:
    found = evidence.ratios({"label": "light not clamped"}, {"label": BASE}, lit)
    return by_ratio(found, "light grid and shadow rays unclamped over clamped to the view:")


def large_triangles(evidence: Evidence) -> Finding:
    """Of the paper's configuration where the run has it, else of ours; one uniform grid beside it."""
    grids = {BASE: {"label": BASE}, "ours": OURS, "one uniform grid": GRID}
    found = {name: evidence.ratios(one, TREE, total) for name, one in grids.items()}
    hurt = {
        name: geometric([over[s] for s in LARGE]) / geometric([over[s] for s in SMALL])
        for name, over in found.items()
        if over.keys() >= {*LARGE, *SMALL}
    }
    name = next(iter(hurt), "")
    if name not in (BASE, "ours"):
        return lacking("one of the six scenes with both the grids and the tree")
    verdict = HOLDS if hurt[name] > 1.2 else FAILS if hurt[name] < 1 else OPEN
    six = {scene: found[name][scene] for scene in (*LARGE, *SMALL)}
    others = ", ".join(f"{other} {value:.2f}" for other, value in hurt.items() if other != name)
    text = f"frame time of {name} over that of a tree rebuilt: {each(six)}; {hurt[name]:.2f} times as much with large ones"
    return Finding(verdict, text + (f" ({others})" if others else ""))


def architecture(evidence: Evidence) -> Finding:
    found = evidence.ratios(GRID, OURS, total)
    if not set(LARGE) <= found.keys():
        return lacking("Fairy, Sibenik or Conference with both grids")
    far = min(found["sibenik"], found["conference"])
    verdict = HOLDS if far > 1.5 and 1.0 < found["fairy"] < far else FAILS
    six = {scene: found[scene] for scene in (*LARGE, *SMALL) if scene in found}
    return Finding(verdict, f"times faster than a uniform grid, whole frame: {each(six)}")


def two_lights(evidence: Evidence) -> Finding:
    with_two = {"scene": "fairy", "light_count": 2}
    found = evidence.ratios({**TREE, **with_two}, {**OURS, **with_two}, total)
    if not found:
        return lacking("Fairy with two lights")
    frames = {r["label"]: 1000 / r["total_ms"] for r in evidence.rows(**with_two)}
    gain = found["fairy"]
    verdict = HOLDS if gain > 1.03 else FAILS if gain < 0.97 else OPEN
    told = f"ours {gain:.2f} times a rebuilt tree (paper: 7.6 against 5.26, 1.44)"
    return Finding(verdict, f"frames a second: {each(frames, '{:.1f}')}; {told}")


def key_bits(evidence: Evidence) -> Finding:
    """At every number of pairs: holds where no step to more bits is faster, and the paper's bits beat 32."""
    told, rises, saves = [], [], []
    for width in evidence.sizes():
        rows = {r["bits"]: r for r in map(bits_drawing.add, evidence.rows(width=width))}
        if not {HERE, 32} <= rows.keys():
            return lacking(f"{HERE} or 32 bits")
        over = {
            n: ratio(rows[n], rows[32], lambda r: bits_drawing.add(r)["sort_ms"]) or 0.0 for n in sorted(rows)
        }
        line = list(over.values())
        rises.append(all(b > 0.97 * a for a, b in itertools.pairwise(line)))
        saves.append(over[HERE] < 0.97)
        shares = each({str(n): value for n, value in over.items()})
        told.append(f"{rows[32]['pairs']:,} pairs, over {rows[32]['sort_ms']:.3f} ms with 32 bits: {shares}")
    verdict = HOLDS if all(rises) and all(saves) else OPEN if any(saves) else FAILS
    return Finding(verdict, "; ".join(told))


def small_cells(evidence: Evidence) -> Finding:
    ones, others = {"label": "direct mapping, 16x16 tiles"}, {"label": "direct mapping, 8x8 tiles"}
    found = evidence.ratios(ones, others, primary)
    return by_ratio(found, "build and trace of primary rays with 16x16 tiles over 8x8 tiles, k = 1:")


def beats_tree(evidence: Evidence) -> Finding:
    found = evidence.ratios(OURS, TREE, total)
    if not found:
        return lacking("a scene with both")
    faster = sum(v <= 1 for v in found.values())
    text = f"no slower on {faster} of {len(found)} scenes; our time over the tree's: {each(found)}"
    return Finding(HOLDS if faster == len(found) else FAILS, text)


def interactive(evidence: Evidence) -> Finding:
    frames = {scene: r["total_ms"] for scene, r in evidence.by_scene().items()}
    told = ", ".join(f"{k} {style.number(v)}" for k, v in frames.items())
    return Finding(
        HOLDS if max(frames.values()) < 200 else FAILS, f"ms a frame, faithful configuration: {told}"
    )
