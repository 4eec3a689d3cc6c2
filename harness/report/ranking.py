"""The methods of each scene sorted by time, and in sentences which one is the fastest. A scene stands for one scene
with one set of lights on one device. A method counts as exact where it calls itself exact and no answer was wrong.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from ..files import plain
from ..texts import numbered
from . import compare, document, numbers, style
from .dataframe import DataFrame, Series, pd

SETTING = ["title", "light_label", "device"]  # what the points of a scene have in common
ABOUT = "ratio: time over that of the fastest exact method of the scene."
MOST_TOLD = 2  # number of scenes up to which a finding speaks of each
LEAST_MS = 1e-9  # a time that a clock gave as nothing counts as this in a geometric mean


def exact(table: DataFrame) -> Series:
    """Which points are of a method that calls itself exact, and have no wrong answer; unscored ones do not count."""
    return (table["known_inexact"] == "") & (table["true_errors"].fillna(1) == 0)


def best(frames: DataFrame, points: DataFrame) -> Series:
    """Which points are the fastest of their scene with every answer right, and those that tie with it; by key. Compared
    over the frames that two points have in common, on whatever device. A tie: apart by no more than the spreads. Where
    two points of a scene may not be compared, or only one is right, none is the best.
    """
    right = document.measured(points).query("error == @numbers.OK")
    scene = right.groupby(["title", "light_label"], sort=False)
    right = right[scene["key"].transform("size") > 1]
    if right.empty:
        return points["key"].isin(())
    frames, same = (frames[frames["key"].isin(right["key"])], [name for name in compare.SAME if name != "device"])
    group = right.groupby(["title", "light_label"], sort=False).ngroup()
    first = right["total_ms"].groupby(group).idxmin()
    for _ in range(2):  # the one with the least mean may have been measured over other frames
        found = compare.ratios(frames, frames["key"].isin(first), same).reindex(right.index)
        least = found["ratio"].fillna(math.inf).groupby(group)
        first = first.mask(least.min() < 1.0, least.idxmin())
    known = found["ratio"].ge(1.0).groupby(group).transform("all")
    alike = (found["ratio"] - 1.0 <= found["spread"]) | right["key"].isin(first)
    return points["key"].isin(right["key"][known & alike])


def ranked(frames: DataFrame) -> DataFrame:
    """The measured points of a tidy table (:func:`.document.named`), each scene sorted by time. Besides:

    exact    :func:`exact`
    setting  the scene with its lights, as a heading
    times    frame time over that of the fastest exact method of the scene (of the fastest, where none is exact), over the
             frames that both have; NaN where they are not of one run
    times_spread, low, high  of ``times``, see :func:`.compare.ratios`
    """
    points = document.named(frames)
    points = points.assign(exact=exact(points), setting=document.with_light(points, "title"))
    done = document.measured(points)
    order = done.groupby(SETTING, sort=False).ngroup()
    done = done.assign(order=order).sort_values(["order", "total_ms"], kind="stable").drop(columns="order")
    best = done.sort_values("exact", ascending=False, kind="stable").groupby(SETTING, sort=False).head(1)
    found = compare.ratios(frames, frames["key"].isin(best.index)).drop(columns="frames")
    return done.join(found.rename(columns={"ratio": "times", "spread": "times_spread"}))


def settings(table: DataFrame) -> Iterator[tuple[str, DataFrame]]:
    """The heading and the points of each scene of a ranked table."""
    for _, own in table.groupby(SETTING, sort=False):
        yield own["setting"].iloc[0], own


def tables(table: DataFrame, frames: DataFrame | None = None) -> dict[str, DataFrame]:
    """For each scene of a ranked table a table of texts, fastest first. Its column ``in_each_frame``: what is built there.
    ``frames``: the tidy table that was ranked, for rows of those without a time, which say why.
    """
    made = {f"{setting}, fastest first": sorted_table(own) for setting, own in settings(table)}
    if frames is None:
        return made
    lost = document.lost(document.named(frames))
    rows = lost[["label", "why"]].set_axis(["method", "answers"], axis=1)
    whose = document.with_light(lost, "title") + ", fastest first"
    return {heading: pd.concat([own, rows[whose == heading]]) for heading, own in made.items()}


def sorted_table(own: DataFrame) -> DataFrame:
    """One row per method: time, ratio to the fastest exact method, wrong answers, memory, and what a frame rebuilds."""
    # Where only some inputs have moved, a frame may build nothing.
    idle = (own["moved"] != "") & (own["build_count"].fillna(1) == 0)
    return pd.DataFrame({
        "method": own["label"], "ms": own["ms"], "ratio": numbers.texts(own, "times"), "answers": own["error"],
        "memory, MB": (own["memory_bytes"].astype("float64") / 1e6).map("{:.1f}".format, na_action="ignore"),
        "in each frame": own["in_each_frame"].astype("object").fillna("-").mask(idle, "builds nothing"),
    })  # fmt: skip


def as_json(table: DataFrame) -> list[dict[str, Any]]:
    """What :func:`tables` and :func:`sentences` say, for programs: one entry per scene; None where a value is not known."""
    names = {"label": "method", "method": "name", "total_ms": "total_ms", "times": "ratio", "exact": "exact",
             "true_errors": "true_errors", "unscored": "unscored", "memory_bytes": "memory_bytes",
             "in_each_frame": "in_each_frame"}  # fmt: skip
    found = []
    for setting, own in settings(table):
        rows = own[[*names]].rename(columns=names).astype("object")
        methods = [plain(row) for row in rows.where(rows.notna(), None).to_dict("records")]
        found.append({"scene": setting, "sentences": sentences(own), "methods": methods})
    return found


def alike(one: Mapping[str, Any], two: Mapping[str, Any]) -> bool:
    """Whether the times of two points are known to differ by no more than their spreads; NaN, not known, compares false."""
    return bool(abs(two["total_ms"] - one["total_ms"]) <= (one["spread"] ** 2 + two["spread"] ** 2) ** 0.5)


def sentences(own: DataFrame) -> list[str]:
    """Two sentences on a scene: the fastest exact method and by how much, and the fastest of all with its wrong answers."""
    rows = own.to_dict("records")
    best = [row for row in rows if row["exact"]]
    return [fastest_exact(own["setting"].iloc[0], best), fastest(rows[0], best)]


def fastest_exact(setting: str, best: list[dict[str, Any]]) -> str:
    """The sentence on the exact methods of a scene, fastest first."""
    if not best:
        return f"{setting}: no method is known to have answered exactly."
    first = f"{setting}: the fastest exact method is {best[0]['label']} with {best[0]['ms']} ms a frame"
    if len(best) == 1:
        return f"{first}; no other exact method was measured."
    after = best[1]
    if alike(best[0], after):
        return f"{first}; {after['label']} with {after['ms']} ms is as fast within the spread of the repeats."
    times = numbers.carried(after["times"], after["times_spread"])
    if times == "-":  # of another run
        return f"{first}; the next, {after['label']}, took {after['ms']} ms in another run."
    return f"{first}; the next, {after['label']}, takes {times} times as long."


def fastest(first: dict[str, Any], best: list[dict[str, Any]]) -> str:
    """The sentence on the fastest method of all."""
    if first["exact"]:
        return "No inexact method is faster."
    near = " (the difference is within the spread of the repeats)" * bool(best and alike(first, best[0]))
    return f"The fastest of all is {first['label']} with {first['ms']} ms{near}: {wrong(first)}."


def finding(table: DataFrame) -> str:
    """What a report says first: :func:`sentences` on each scene; of many scenes who wins, and what comes closest."""
    if table.empty:
        return "Nothing was measured."
    parts = [own.to_dict("records") for _, own in settings(table)]
    if len(parts) <= MOST_TOLD:
        return " ".join(sentence for _, own in settings(table) for sentence in sentences(own))
    wrong = told(
        table[~table["exact"]], "Of those that are not exact, {} on {} takes the least: {} times as long, and {}."
    )
    return " ".join(filter(None, (winners(parts), nearest(table, parts), wrong)))


def headline(table: DataFrame) -> str:
    """In one sentence which kind of structure is the fastest, and how near others come; :func:`finding` of few scenes."""
    scenes = [own.to_dict("records") for _, own in settings(table)]
    if len(scenes) <= MOST_TOLD:
        return finding(table)
    first, known = winners(scenes, named=False), nearest_others(table, scenes)
    if known.empty:
        return first
    ends = known.iloc[[0, -1]].to_dict("records")
    times = " to ".join(dict.fromkeys(numbers.carried(row["times"], row["times_spread"]) for row in ends))
    return f"{first.removesuffix('.')}; the nearest exact structure of another kind takes {times} times as long."


def winners(scenes: Sequence[Sequence[Mapping[str, Any]]], named: bool = True) -> str:
    """Which methods answer everything right the fastest, as a sentence. ``scenes``: the points of each, fastest first."""
    right = [[row for row in rows if row["exact"]] for rows in scenes]
    wins = [{r["label"]: r["method"] for r in rows if r is rows[0] or alike(rows[0], r)} for rows in right if rows]
    if not wins:
        return f"No method is known to have answered exactly on any of {len(scenes)} scenes."
    times = [{r["label"]: r["total_ms"] for r in rows} for rows in right]
    return most_wins(wins, times, len(scenes), named=named)


def most_wins(
    wins: Sequence[Mapping[str, str]], times: Iterable[Mapping[str, float]], count: int, what: str = "scene",
    named: bool = True,
) -> str:  # fmt: skip
    """Which kinds of structure are the fastest on how many of ``count`` scenes, and which methods, as a sentence.

    wins   of each scene the labels that win or tie, with their methods
    times  of each scene the ms of every label that is right: of those that win equally often the faster comes first
    named  whether the methods of a kind are
    """
    # A method without a kind stands for itself.
    alone = {label for one in wins for label, method in one.items() if style.kind(method) == method}
    kind = {x: x if x in alone else style.kind(method) for one in wins for x, method in one.items()}
    slow = slowness(times)
    kinds = most_first(
        [{kind[x] for x in one} for one in wins], lambda name: min(slow[x] for x in kind if kind[x] == name)
    )
    labels = most_first(wins, slow.__getitem__)
    (first, most), *others = kinds.items()
    on = f"the {what}" if count == 1 else f"{'all' if most == count else f'{most} of'} {numbered(count, what)}"
    beside = [f", {kind} too" if count == 1 else f", {kind} on {n}" for kind, n in others]
    which = ", ".join(label + f" on {'all' if n == count else n}" * (count > 1) for label, n in labels.items())
    ties = " (ties count for each)" if any(len(one) > 1 for one in wins) else ""
    text = f"{first} {'is' if first in alone else 'are'} the fastest on {on}{''.join(beside)}, with every answer right"
    text = text if first in alone else text[0].upper() + text[1:]
    return f"{text}{(f': {which}{ties}' if set(labels) != set(kinds) else ties) * named}."


def slowness(times: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """Of each label the logarithm of the geometric mean, over its scenes, of its time over the least of the scene."""
    logs: dict[str, list[float]] = {}
    for one in times:
        known = {label: math.log(max(ms, LEAST_MS)) for label, ms in one.items()}
        for label, log in known.items():
            logs.setdefault(label, []).append(log - min(known.values()))
    return {label: math.fsum(own) / len(own) for label, own in logs.items()}


def most_first(wins: Iterable[Iterable[str]], slow: Callable[[str], float]) -> dict[str, int]:
    """In how many of the lists a name is, the most first; of equal ones the least ``slow``, then by name."""
    counts = Counter(name for one in wins for name in one)
    return dict(sorted(counts.items(), key=lambda entry: (-entry[1], slow(entry[0]), entry[0])))


def nearest(table: DataFrame, scenes: Sequence[Sequence[Mapping[str, Any]]]) -> str:
    """The exact method of another kind nearest to the fastest of a scene, in words; and the scene without one."""
    known = nearest_others(table, scenes)
    text = told(known.head(1), "The nearest exact one of another kind, {} on {}, takes {} times as long")
    return text and text + told(known.tail(1), "; on {1} the nearest, {0}, {2}") * (len(known) > 1) + "."


def nearest_others(table: DataFrame, scenes: Sequence[Sequence[Mapping[str, Any]]]) -> DataFrame:
    """Of each scene the fastest exact point that is of another kind than the fastest of all exact ones, nearest first."""
    kinds = {rows[0]["setting"]: style.kind(row["method"]) for rows in scenes for row in rows[::-1] if row["exact"]}
    others = table[table["exact"] & (table["method"].map(style.kind) != table["setting"].map(kinds))]
    return others[others["times"].notna()].sort_values("times", kind="stable").drop_duplicates("setting")


def told(table: DataFrame, form: str) -> str:
    """The form with label, scene, ratio and wrong answers of the point that takes the least over the fastest exact."""
    if not len(known := table[table["times"].notna()]):
        return ""
    row = known.loc[known["times"].idxmin()]
    return form.format(row["label"], row["setting"], numbers.carried(row["times"], row["times_spread"]), wrong(row))


def wrong(row: Mapping[str, Any]) -> str:
    """How many answers of a point are wrong, in words."""
    if row["error"] == numbers.UNSCORED:
        return "its answers were not scored"
    count = int(row["true_errors"])
    if not count:
        return "none of its answers is wrong here, which it does not promise elsewhere"
    return f"{count:,} of its answers {'is' if count == 1 else 'are'} wrong"
