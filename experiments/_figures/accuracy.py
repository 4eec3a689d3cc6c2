"""The accuracy experiment: tables, Pareto plot, wrong pixels, costs, and the grid of errors, from a folder's records.

Files: accuracy.csv (one row a point), accuracy_equal_error.csv, accuracy_costs.csv, accuracy_heat.csv and
accuracy_hard.csv (made by the run), accuracy.md with every table, and a drawing of each. No time stands without its error.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...harness.report import points, style
from ...harness.report.sheet import title_of
from . import accuracy_cost, accuracy_hard, accuracy_heat, accuracy_pareto, accuracy_where
from .accuracy_cost import Measure, costs
from .accuracy_rows import COLUMNS, FEW, Row, mark_frontier, rows, scenes, usable

EQUAL_COLUMNS = "scene scene_title device family label total_ms wrong_per_frame points best_wrong".split()


def draw(
    folder: Path | str,
    quiet: bool,
    measures: Sequence[Measure],
    other_measures: Sequence[Measure],
    shown: Sequence[str],
    base: str,
) -> list[Path]:
    """Draw everything that a folder holds.

    measures, other_measures  (name, label of the point with it, label of the point without it)
    shown   labels of the points whose wrong pixels are painted
    base    label of the point that has every one of ``measures``
    """
    folder = Path(folder)
    made = rows(folder)
    mark_frontier(made)
    equal = equal_error(made)
    hard = accuracy_hard.read_hard(folder)
    cost = costs(made, [*measures, *other_measures])
    files = [
        points.write_csv(made, folder / "accuracy.csv", COLUMNS),
        points.write_csv(equal, folder / "accuracy_equal_error.csv", EQUAL_COLUMNS),
        points.write_csv(cost, folder / "accuracy_costs.csv", accuracy_cost.COLUMNS),
    ]
    files += accuracy_pareto.draw(made, folder / "accuracy_pareto.svg")
    files += accuracy_cost.draw(made, measures, base, folder / "accuracy_costs.svg")
    where = accuracy_where.draw(folder, made, shown)
    files += where
    files += accuracy_heat.draw(folder)
    sentences = [*found(made, equal, cost), *([accuracy_where.ABOUT] if where else [])]
    files = points.report(folder, "accuracy", "What accuracy costs in time", sentences, files, made, quiet)
    with open(folder / "accuracy.md", "a", encoding="utf-8") as file:
        file.write(
            "\n".join(
                [
                    "",
                    *equal_table(equal),
                    *cost_table(cost, hard),
                    *accuracy_hard.table(hard),
                    *point_tables(made),
                ]
            )
            + "\n"
        )
    return files


def equal_error(made: Sequence[Row]) -> list[dict[str, Any]]:
    """For each scene and family the fastest point with fewer than FEW wrong answers a frame, or that there is none."""
    result = []
    for scene, own in scenes(usable(made)):
        for family in dict.fromkeys(r["family"] for r in own):
            mine = [r for r in own if r["family"] == family]
            good = min(
                (r for r in mine if r["wrong_per_frame"] < FEW), key=lambda r: r["total_ms"], default=None
            )
            result.append(
                {
                    "scene": scene,
                    "scene_title": title_of(mine[0]),
                    "device": mine[0]["device"],
                    "family": family,
                    "label": good["label"] if good else "",
                    "total_ms": good["total_ms"] if good else None,
                    "wrong_per_frame": good["wrong_per_frame"] if good else None,
                    "points": len(mine),
                    "best_wrong": min(r["wrong_per_frame"] for r in mine),
                }
            )
    return result


def found(made: Sequence[Row], equal: Sequence[dict[str, Any]], cost: Sequence[dict[str, Any]]) -> list[str]:
    """What the numbers say, a sentence each."""
    known = usable(made)
    if not known:
        return ["No point has both a time and a score."]
    sentences = [_faultless(known), *_frontier(known), _maps(equal)]
    clear = [c for c in cost if not c["within_noise"]]
    if cost:
        sentence = (
            f"Of {len(cost)} differences with and without a safety measure, {len(clear)} exceed the noise"
        )
        if clear:
            most = max(clear, key=lambda c: c["share"])
            sentence += f"; the dearest is {most['measure']} on {most['scene_title']}: {most['share']:+.0%}"
            faster = [c for c in clear if c["share"] < 0]
            if faster:
                least = min(faster, key=lambda c: c["share"])
                sentence += (
                    f"; {len(faster)} are faster with the measure than without (most of all {least['measure']} on "
                    f"{least['scene_title']}: {least['share']:+.0%})"
                )
        sentences.append(sentence + ".")
    looks = [r for r in known if r["flip"] is not None and r["wrong_per_frame"] > 0]
    if looks:
        hidden = [r for r in looks if r["flip"] < 0.001]
        worst = max(looks, key=lambda r: r["flip"])
        sentences.append(
            f"FLIP is {worst['flip']:.3f} at most ({title_of(worst)}, {worst['label']}: "
            f"{worst['wrong_per_frame']:,.0f} wrong answers); {len(hidden)} of {len(looks)} points with wrong answers "
            "stay below 0.001: the eye does not count."
        )
    left = [
        r
        for r in known
        if any((f.get("score") or {}).get("primary", {}).get("unjudged") for f in r["record"]["frames"])
    ]
    if left:
        sentences.append(
            f"Of {len(left)} points so many answers differ from the reference's that only a sample of them was judged; "
            "every other one counts as wrong, in no class of its own."
        )
    reasons = Counter(r["flip_missing"] for r in known if r["flip_missing"])
    sentences += [
        f"FLIP is missing at {count} points: {reason}." for reason, count in sorted(reasons.items())
    ]
    return [sentence for sentence in sentences if sentence]


def _faultless(known: Sequence[Row]) -> str:
    labels = list(dict.fromkeys(r["label"] for r in known))
    never = [label for label in labels if not any(r["wrong_per_frame"] for r in known if r["label"] == label)]
    return f"Never wrong on any scene here: {'; '.join(never) or 'none'}."


def _frontier(known: Sequence[Row]) -> list[str]:
    sentences = []
    for _, own in scenes(known):
        line = sorted((r for r in own if r["on_frontier"]), key=lambda r: r["total_ms"])
        told = ", ".join(
            f"{r['label']} ({style.number(r['total_ms'])} ms, {r['wrong_per_frame']:,.0f} wrong)"
            for r in line
        )
        sentences.append(f"{title_of(own[0])}: no other point is both faster and less wrong than {told}.")
    return sentences


def _maps(equal: Sequence[dict[str, Any]]) -> str:
    never = sorted({e["family"] for e in equal} - {e["family"] for e in equal if e["label"]})
    if not never:
        return ""
    best = {f: min(e["best_wrong"] for e in equal if e["family"] == f) for f in never}
    told = ", ".join(f"{family} (at best {wrong:,.0f})" for family, wrong in best.items())
    return f"Fewer than {FEW} wrong answers are never reached by: {told}."


def _table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> list[str]:
    rows = ["| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in (head, *lines)]
    return [rows[0], "|" + "---|" * len(head), *rows[1:], ""]


def equal_table(equal: Sequence[dict[str, Any]]) -> list[str]:
    """Families down, scenes across: the time to fewer than FEW wrong answers, and who reached it."""
    names = list(dict.fromkeys((e["scene"], e["scene_title"]) for e in equal))
    lines = []
    for family in dict.fromkeys(e["family"] for e in equal):
        cells = [family]
        for scene, _ in names:
            e = next((e for e in equal if (e["scene"], e["family"]) == (scene, family)), None)
            if e is None:
                cells.append("-")
            elif e["label"]:
                level = e["label"].partition(": ")[2]
                cells.append(f"{style.number(e['total_ms'])} ms, {e['wrong_per_frame']:.0f} wrong ({level})")
            else:
                cells.append(f"not reached: {e['best_wrong']:,.0f} wrong at best")
        lines.append(cells)
    head = ["family", *(title for _, title in names)]
    return [f"## Time to fewer than {FEW} wrong answers a frame", "", *_table(head, lines)]


def cost_table(cost: Sequence[dict[str, Any]], hard: Sequence[dict[str, Any]]) -> list[str]:
    """What each safety measure adds to the frame, and what was wrong without it, here and on the hard cases."""
    on_hard = {row["label"]: f"{row['true_errors']:,}" for row in hard}
    lines = [
        [
            c["scene_title"],
            c["measure"],
            f"{c['cost_ms']:+.3g} ms",
            f"{c['share']:+.1%}",
            "too few repeats" if c["noise_ms"] is None else f"±{style.number(c['noise_ms'])} ms",
            f"{c['wrong_with']:,.0f}",
            f"{c['wrong_without']:,.0f}",
            f"{on_hard.get(c['with'], '-')} / {on_hard.get(c['without'], '-')}",
        ]
        for c in cost
    ]
    head = ["scene", "measure", "cost", "share", "noise", "wrong with it", "wrong without", "hard cases"]
    return ["## What each safety measure costs", "", *_table(head, lines)]


def point_tables(made: Sequence[Row]) -> list[str]:
    """Every point of every scene: time, spread, classes, FLIP. A star: on the frontier."""
    result = []
    for _, own in scenes(made):
        result += [f"## {title_of(own[0])}", ""]
        lines = []
        for r in own:
            if r["wrong_per_frame"] is None or r.get("total_ms") is None:
                lines.append([r["label"], r["status"], *[""] * 6, r["reason"] or r["unscored"] or ""])
                continue
            lines.append(
                [
                    r["label"] + (" *" if r["on_frontier"] else ""),
                    style.number(r["total_ms"]),
                    style.number(r["iqr_ms"]),
                    f"{r['wrong_per_frame']:,.0f}",
                    f"{r['primary_wrong']:,.0f}",
                    f"{r['acne']:,.0f}",
                    f"{r['leak']:,.0f}",
                    f"{r['excused']:,.0f}",
                    "-" if r["flip"] is None else f"{r['flip']:.5f}",
                ]
            )
        head = ["point", "ms", "quartile range", "wrong", "primary", "acne", "leak", "excused", "FLIP"]
        result += _table(head, lines)
    return result
