"""Every ratio of a report: two points compared over the frames that both have, within one run. Points of different
runs, scenes, lights, devices, image sizes or versions of one method are never compared: they form no pair here, and
tables and drawings show no ratio for them (:func:`apart`).
"""

import math
import re
from collections.abc import Iterable, Sequence

import numpy as np

from ..results.means import points
from .dataframe import DataFrame, Series, pd

LIT_SCENE = ("scene", "scene_title", "scene_sha256", "light_label", "lights")
"""The columns in which points agree that stand beside one another in a table: of one scene, lit alike."""
SCENE = ("folder", "run", "scene", "scene_title", "scene_sha256", "device")
LIGHTS = ("light_label", "lights")
SIZE = ("width", "height")
SAME = (*SCENE, *LIGHTS, *SIZE)  # points must agree in these to be compared, unless the caller allows others to differ


BULKY = ("pass.", "counter.", "set.", "light.", "point.", "round.", "primary.", "shadow.")
"""Prefixes of the columns of a tidy table that no ratio of frame times needs, but those of rounds."""


def slim(frames: DataFrame, but: tuple[str, ...] = ("round.",)) -> DataFrame:
    """A tidy table without :data:`BULKY` columns, ``but`` those that some row has: they take most of the time."""
    return frames[[x for x in frames if not x.startswith(BULKY) or (x.startswith(but) and frames[x].notna().any())]]


def pairs(frames: DataFrame, base: Series, same: Sequence[str] = SAME) -> tuple[DataFrame, DataFrame]:
    """Points and what they are compared with, each over the frames that both have.

    frames  a tidy table (:func:`.results.table.tidy`)
    base    which of its rows are compared with, a boolean Series
    same    columns that a point and its base agree in. Where several bases do, the one measured last counts.

    Returns two tables as :func:`.results.means.points` makes them, both with the points' keys as index: row by row the
    point, and the values of its base. A point without a base or without a common frame is in neither.
    """
    known = frames[frames["total_ms"].notna()]
    names = ["key", "frame", "method", "method_sha256", "started", *same]
    found = known[names].merge(known.loc[base, names], on=[*same, "frame"], suffixes=("", "_base"))
    alike = found["method_sha256"] == found["method_sha256_base"]  # the same version, or another method
    found = found[alike | (found["method"] != found["method_base"])].sort_values("started_base")
    found = found[found["key_base"] == found.groupby("key")["key_base"].transform("last")]
    own = known.merge(found[["key", "frame"]], on=["key", "frame"])
    of = found[["key_base", "frame", "key"]].set_axis(["key", "frame", "of"], axis=1)
    bases = known.merge(of, on=["key", "frame"]).drop(columns="key").rename(columns={"of": "key"})
    one, two = points(own), points(bases)
    return one.set_index("key"), two.set_index("key").reindex(one["key"])


def ratios(frames: DataFrame, base: Series, same: Sequence[str] = SAME) -> DataFrame:
    """Frame time over that of the base, for each point that has one (see :func:`pairs`), by key.

    ratio   of the means over the frames that both have; frames: how many these are
    spread  uncertainty of the ratio, from the spreads of the two (:func:`spread`); NaN: not known
    low, high  the smallest and the largest ratio if each time lies anywhere in its range between rounds
    """
    one, other = pairs(slim(frames), base, same)
    ratio, around = over(one["total_ms"], spread(one), other["total_ms"], spread(other))
    half, other_half = one["between_ms"] / 2, other["between_ms"] / 2
    low = (one["total_ms"] - half) / (other["total_ms"] + other_half)
    high = (one["total_ms"] + half) / (other["total_ms"] - other_half).clip(lower=1e-9)
    return pd.DataFrame({"ratio": ratio, "spread": around, "low": low, "high": high, "frames": one["frames"]})


def over(one: Series, around: Series, other: Series, other_around: Series) -> tuple[Series, Series]:
    """A quantity over another, and its uncertainty from those of the two."""
    ratio = one / other
    return ratio, ratio * np.hypot(around / one, other_around / other)


def spread(table: DataFrame) -> Series:
    """Uncertainty of a point's time, ms: half its interquartile range or range between rounds; NaN for a single sample."""
    return (table[["iqr_ms", "between_ms"]].max(axis=1) / 2).where(table["samples"] > 1)


def pass_spread(samples: DataFrame, part: str, pattern: str = "") -> Series:
    """Uncertainty of the time of passes, ms, by key: as :func:`spread`, of the sums of the passes.

    samples  every sample of a folder (:func:`.results.table.samples`)
    part, pattern  which passes: those of the part whose names hold the pattern, a regular expression
    """
    names = [name for name in samples["pass"].cat.categories if re.search(pattern, name)]
    own = samples[(samples["part"] == part) & samples["pass"].isin(names)].astype({"key": "object"})
    sums = own.groupby(["key", "frame", "round", "sample"], sort=False)["ms"].sum().astype("float64")
    repeats = sums.groupby(["key", "frame"])
    iqr = (repeats.quantile(0.75) - repeats.quantile(0.25)).where(repeats.size() > 1).groupby("key").mean()
    rounds = sums.groupby(["key", "frame", "round"]).median().groupby(["key", "round"]).mean().groupby("key")
    return np.fmax(iqr, (rounds.max() - rounds.min()).where(iqr.notna())) / 2


def geometric(values: Iterable[float]) -> float:
    """Geometric mean of the known values; NaN if there are none."""
    known = [math.log(value) for value in values if value == value]
    return math.exp(sum(known) / len(known)) if known else math.nan


def apart(table: DataFrame) -> list[str]:
    """Which columns were measured together, where the points of a scene are of several runs: a line for scenes alike."""
    lines: dict[str, list[str]] = {}
    for title, own in table[table["total_ms"].notna()].groupby("scene_title", sort=False):
        split = own.groupby("label")["run"].nunique() > 1  # such a method is named with its lightings
        lights = own["light_label"].where(own["label"].map(split), "").groupby([own["run"], own["label"]], sort=False)
        lit = lights.agg(lambda found: ", ".join(dict.fromkeys(found)))
        names = lit.index.get_level_values("label") + lit.where(lit == "", ": " + lit)
        between = "; " if (lit != "").any() else ", "
        labels = names.groupby("run", sort=False).agg(between.join)
        if len(labels) > 1:
            runs = f"{len(labels)} runs, which are not compared"
            runs += f": {' | '.join(labels)}" * (labels.nunique() > 1)
            lines.setdefault(runs, []).append(str(title))
    were = {runs: "were" if len(titles) > 1 else "was" for runs, titles in lines.items()}
    return [f"{', '.join(titles)} {were[runs]} measured in {runs}." for runs, titles in lines.items()]


def in_sequence(frames: DataFrame) -> list[str]:
    """A line if the lightings of a scene were measured one after another, as earlier versions did; none if in turn."""
    known = frames[frames["total_ms"].notna() & (frames["started"] > 0) & ~frames["run"].str.contains("[+]")]
    points = known.sort_values("started").drop_duplicates("key", keep="last")
    lights = points.groupby([*SCENE, *SIZE], sort=False)["light_label"]
    # The order of single points, one for each lighting, does not tell.
    apart = lights.agg(lambda own: 1 < own.nunique() == (own != own.shift()).sum() < len(own))
    return [ONE_BY_ONE] * bool(apart.any())


ONE_BY_ONE = (
    "Lightings were measured one after another, not interleaved: a difference between two also holds what changed on the "
    "machine between them."
)
