"""Points with their errors, the frontier, the time to equal error, and what each safety measure costs."""

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
EQUAL_COLUMNS = "scene scene_title device family label total_ms wrong_per_frame points best_wrong".split()
COST_COLUMNS = (
    "scene scene_title device measure with without with_ms without_ms cost_ms noise_ms share within_noise "
    "wrong_with wrong_without"
).split()
FEW = 10
"""Fewer wrong answers a frame than this count as equal error in the equal-error table."""
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
    judged = table["wrong_per_frame"].notna()
    for name, columns in CLASSES.items():
        table[name] = table.reindex(columns=columns).sum(axis=1).where(judged)
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
    import pandas as pd

    found = pd.Series(pd.NA, table.index, dtype="boolean")
    for _, own in usable(table).groupby("title", sort=False):
        here = own["device"] == own["device"].mode()[0]
        time, wrong = (own.loc[here, name].to_numpy(float) for name in ("total_ms", "wrong_per_frame"))
        no_worse = (time[:, None] <= time) & (wrong[:, None] <= wrong)
        beaten = (no_worse & ((time[:, None] < time) | (wrong[:, None] < wrong))).any(axis=0)
        found[own.index] = False
        found[own.index[here]] = ~beaten
    return found


def equal_error(table: pd.DataFrame) -> pd.DataFrame:
    """For each scene and family the fastest point with fewer than :data:`FEW` wrong answers a frame, if any."""
    known = usable(table)
    same = ["title", "family"]
    good = known[known["wrong_per_frame"] < FEW].sort_values("total_ms").drop_duplicates(same).set_index(same)
    groups = known.groupby(same, sort=False).agg(
        scene=("scene", "first"), device=("device", "first"), points=("key", "size"), best_wrong=("wrong_per_frame", "min")
    )  # fmt: skip
    made = groups.join(good[["label", "total_ms", "wrong_per_frame"]]).reset_index()
    return made.assign(scene_title=made["title"]).fillna({"label": ""})


def costs(folder: Path, measures: Sequence[Measure]) -> pd.DataFrame:
    """One row a scene and measure of which both points were measured in one run, over the frames that both have.

    noise_ms  the larger spread of the two points, between quartiles or between rounds; missing with too few repeats
    """
    import pandas as pd

    frames = document.frames(folder)
    titles = document.named(frames).set_index("key")["title"]
    frames = frames[frames["true_errors"].notna()]
    found = []
    for name, with_, without in measures:
        both = frames[frames["label"].isin([with_, without])]
        own, other = compare.pairs(both, both["label"] == without)
        own = own[own["label"] == with_]
        other = other.loc[own.index]
        spreads = [2 * compare.spread(side).where(side["samples"] >= ENOUGH) for side in (own, other)]
        noise = np.maximum(*spreads)
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
    own = usable(table)
    titles = list(own["title"].unique())
    own = own[own["on_frontier"].astype(bool)]
    columns: document.Columns = {"scene": ("title", str), "point": ("name", str), "ms": ("ms", str)}
    counts = {"wrong answers": "wrong_per_frame", "acne": "acne", "leaks": "leak", "excused": "excused"}
    columns |= {heading: (column, "{:,.0f}") for heading, column in counts.items()}
    columns["FLIP"] = ("flip", "{:.4f}")
    return document.texts(document.arranged(own.sort_values("total_ms"), "title", titles), columns)


def cost_table(cost: pd.DataFrame, hard: pd.DataFrame) -> pd.DataFrame:
    """Measures down, scenes across: what each adds to the frame, and what is wrong without it (with it), in all scenes."""
    if cost.empty:
        return cost
    noise = cost["noise_ms"] / cost["without_ms"]
    text = document.carry(cost["share"], noise, "+%").mask(cost["within_noise"], noise.map("±{:.1%}".format))
    text = text.mask(noise.isna(), "?")
    wide = document.cross_table(cost.assign(text=text), ["measure"], "scene_title", "text").set_index(
        "measure"
    )
    groups = cost.groupby("measure", sort=False)
    wrong = groups[["wrong_without", "wrong_with"]].sum().map("{:,.0f}".format)
    wide["wrong without (with)"] = wrong["wrong_without"] + " (" + wrong["wrong_with"] + ")"
    errors = hard.set_index("label")["true_errors"].map("{:,}".format)
    pairs = groups[["without", "with"]].first().apply(lambda labels: labels.map(errors).fillna("-"))
    wide["hard cases"] = pairs["without"] + " (" + pairs["with"] + ")"
    return wide.reset_index()


def finding(table: pd.DataFrame, cost: pd.DataFrame) -> str:
    """One sentence: who is never wrong and fastest, and what the safety measures cost."""
    known = usable(table)
    if known.empty:
        return "No point has both a time and a score."
    never = known.groupby("label")["wrong_per_frame"].max() == 0
    right = known[known["label"].isin(never.index[never])].sort_values("total_ms").drop_duplicates("title")
    scenes = known["title"].nunique()
    counts = [f"{name} ({n} of {scenes} scenes)" for name, n in right["name"].value_counts().items()]
    text = f"{never.sum()} of {len(never)} points are never wrong on these scenes"
    text += f", the fastest of them {' and '.join(counts)}" if counts else ""
    clear = cost[~cost["within_noise"].astype(bool)]
    text += f"; of {len(cost)} differences with and without a safety measure {len(clear)} exceed the noise"
    if len(clear):
        most = clear.loc[clear["share"].idxmax()]
        text += f", the dearest {most['measure']} on {most['scene_title']} ({most['share']:+.0%})"
    return text + "."


def notes(table: pd.DataFrame) -> list[str]:
    """What else must be known to read the tables."""
    known = usable(table)
    told = [
        f"The fastest point of each family with fewer than {FEW} wrong answers: accuracy_equal_error.csv."
    ]
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
