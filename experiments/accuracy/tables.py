"""Points with their errors, the frontier, and what each safety measure costs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...harness.report import compare, document

if TYPE_CHECKING:
    import pandas as pd

Measure = tuple[str, str, str]
"""A safety measure: its name, the label of the point that has it, that of the point without it and otherwise the same."""

CLASSES = {
    "primary_wrong": ("primary.true", "primary.invalid"), "acne": ("shadow.acne",), "leak": ("shadow.leak",),
    "excused": ("primary.near_tie", "primary.edge", "shadow.edge"), "ties": ("primary.tie",),
}  # fmt: skip
COLUMNS = [
    *document.COMMON, "family", "level", "known_inexact", "wrong_per_frame", *CLASSES, "flip", "flip_missing", "on_frontier",
]  # fmt: skip
COST_COLUMNS = (
    "scene scene_title device measure with without with_ms without_ms cost_ms noise_ms share within_noise "
    "wrong_with wrong_without"
).split()
FRONTIER: document.Columns = {
    "scene": ("title", str), "point": ("name", str), "ms": ("ms", str), "wrong answers": ("wrong_per_frame", "{:,.0f}"),
    "acne": ("acne", "{:,.0f}"), "leaks": ("leak", "{:,.0f}"), "excused": ("excused", "{:,.0f}"), "FLIP": ("flip", "{:.4f}"),
}  # fmt: skip
ENOUGH = 4
"""Repeats below which nothing is known of the noise, and no difference of times is taken for a cost."""


def read(folder: Path) -> pd.DataFrame:
    """The points with their mean wrong answers a frame by class. Besides:

    family, level  the two halves of the label; name: the label as a person reads it, with a device that is not the scene's
    on_frontier    see :func:`frontier`
    """
    table = document.read(folder)
    table[["family", "level"]] = table["label"].str.extract(r"^([^:]*)(?:: (.*))?$").to_numpy()
    table["level"] = table["level"].fillna(table["family"])
    for name, columns in CLASSES.items():
        table[name] = table.reindex(columns=columns).sum(axis=1).where(table["wrong_per_frame"].notna())
    table["on_frontier"] = frontier(table)
    elsewhere = table["device"] != table.groupby("title")["device"].transform(lambda own: own.mode()[0])
    names = table["label"].str.replace("as used: ", "").str.replace("in the grids: ", "grids with ")
    table["name"] = names.where(~elsewhere, names + ", on the " + table["device"].str.upper())
    return table


def usable(table: pd.DataFrame) -> pd.DataFrame:
    """Points that have both a time and an error."""
    done = document.measured(table)
    return done[done["wrong_per_frame"].notna()]


def frontier(table: pd.DataFrame) -> pd.Series:
    """Whether no other point of a scene beats one in time and in error at once; missing where either is not known.

    Only points on the device that most of a scene's points ran on: a CPU's times beside a GPU's are no frontier.
    """
    found = (table["wrong_per_frame"] < 0).astype("boolean").where(table.index.isin(usable(table).index))
    for _, own in usable(table).groupby("title", sort=False):
        here = own[own["device"] == own["device"].mode()[0]].sort_values(["total_ms", "wrong_per_frame"])
        wrong = here["wrong_per_frame"]
        found[here.index] = (wrong == wrong.cummin()) & (
            here["total_ms"] == here.groupby(wrong)["total_ms"].transform("min")
        )
    return found


def costs(folder: Path, measures: Sequence[Measure]) -> pd.DataFrame:
    """One row a scene and measure of which both points were measured in one run, over the frames that both have.

    noise_ms  the larger spread of the two points, between quartiles or between rounds; missing with too few repeats
    """
    import pandas as pd

    frames = document.frames(folder)
    titles = document.named(frames)["title"]
    frames, found = frames[frames["true_errors"].notna()], []
    for name, with_, without in measures:
        own, other = compare.pairs(frames[frames["label"].isin([with_, without])], frames["label"] == without)
        own = own[own["label"] == with_]
        other = other.loc[own.index]
        noise = np.maximum(
            *(2 * compare.spread(side).where(side["samples"] >= ENOUGH) for side in (own, other))
        )
        cost = own["total_ms"] - other["total_ms"]
        found.append(own[["scene", "device"]].assign(
            scene_title=titles.loc[own.index], measure=name, **{"with": with_, "without": without},
            with_ms=own["total_ms"], without_ms=other["total_ms"], cost_ms=cost, noise_ms=noise,
            share=cost / other["total_ms"], within_noise=noise.isna() | (cost.abs() <= noise),
            wrong_with=own["wrong_per_frame"], wrong_without=other["wrong_per_frame"],
        ))  # fmt: skip
    return document.arranged(pd.concat(found), "scene_title", titles.unique()).reset_index(drop=True)


def frontier_table(table: pd.DataFrame) -> pd.DataFrame:
    """The points of each scene that no other one beats, fastest first; beside them the fastest that is never wrong."""
    known = usable(table)
    own = known[known["on_frontier"].astype(bool)].sort_values("total_ms")
    return document.texts(document.arranged(own, "title", known["title"].unique()), FRONTIER)


def cost_table(cost: pd.DataFrame, hard: pd.DataFrame) -> pd.DataFrame:
    """Measures down, scenes across: what each adds to the frame, and what is wrong without it (with it), in all scenes."""
    if cost.empty:
        return cost
    noise = cost["noise_ms"] / cost["without_ms"]
    text = document.carry(cost["share"], noise, "+%").mask(cost["within_noise"], noise.map("±{:.1%}".format))
    cost = cost.assign(text=text.mask(noise.isna(), "?"))
    wide, groups = (
        document.cross_table(cost, ["measure"], "scene_title", "text"),
        cost.groupby("measure", sort=False),
    )
    wrong = groups[["wrong_without", "wrong_with"]].sum().map("{:,.0f}".format)
    errors = hard.set_index("label")["true_errors"].map("{:,}".format)
    pairs = groups[["without", "with"]].first().apply(lambda labels: labels.map(errors).fillna("-"))
    wide["wrong without (with)"] = (wrong["wrong_without"] + " (" + wrong["wrong_with"] + ")").array
    return wide.assign(**{"hard cases": (pairs["without"] + " (" + pairs["with"] + ")").array})


def finding(table: pd.DataFrame, cost: pd.DataFrame) -> str:
    """One sentence: who is never wrong and fastest, and what the safety measures cost."""
    known = usable(table)
    if known.empty:
        return "No point has both a time and a score."
    never = known.groupby("label")["wrong_per_frame"].max() == 0
    right = known[known["label"].isin(never.index[never])].sort_values("total_ms").drop_duplicates("title")
    counts = [
        f"{name} ({n} of {known['title'].nunique()} scenes)"
        for name, n in right["name"].value_counts().items()
    ]
    text = f"{never.sum()} of {len(never)} points are never wrong on these scenes"
    text += f", the fastest of them {' and '.join(counts)}" if counts else ""
    clear = cost[~cost["within_noise"].astype(bool)].sort_values("share")
    text += f"; of {len(cost)} differences with and without a safety measure {len(clear)} exceed the noise"
    for most in clear.tail(1).itertuples():
        text += f", the dearest {most.measure} on {most.scene_title} ({most.share:+.0%})"
    return text + "."


def notes(table: pd.DataFrame) -> list[str]:
    """What else must be known to read the tables."""
    known, told = usable(table), []
    if known["device_name"].nunique() > 1:
        told.append("Points on another device than most of their scene's are on no frontier.")
    sampled = known.reindex(columns=["primary.unjudged"])["primary.unjudged"] > 0
    if sampled.any():
        told.append(
            f"Of {int(sampled.sum())} points so many answers differ from the reference's that only a sample of them was "
            "judged; every other one counts as wrong, in no class of its own."
        )
    missing = known.loc[known["flip_missing"].fillna("") != "", "flip_missing"].value_counts()
    return told + [f"FLIP is missing at {count} points: {reason}." for reason, count in missing.items()]
