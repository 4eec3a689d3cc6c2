"""What accuracy shows: points with errors, the Pareto frontier, costs of safety measures, the places of wrong pixels."""

import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageColor

from ...harness.judge.verdict import Verdict
from ...harness.report import compare, document, numbers, panels, pareto, style
from ...harness.report.dataframe import DataFrame, Series, pd
from ...harness.report.picture import opened, reference_path
from ...harness.results.pixel_maps import read_wrong, wrong_path
from .untimed import HEAT as NAME

Measure = tuple[str, str, str]  # a safety measure: name, label of the point with it, and of the equal point without it

CLASSES = {
    "primary_wrong": ("primary.true", "primary.invalid"), "acne": ("shadow.acne",), "leak": ("shadow.leak",),
    "excused": ("primary.near_tie", "primary.edge", "shadow.edge"), "ties": ("primary.tie",),
}  # fmt: skip
COLUMNS = [
    *document.COMMON, "family", "level", "known_inexact", "wrong_per_frame", *CLASSES, "flip", "flip_missing", "on_frontier",
]  # fmt: skip
COST = "Frame time with a safety measure over that without (=: within the noise, ?: not known)"
ENOUGH = 4  # number of repeats below which the noise is not known, so that no difference of times counts as a cost
UNJUDGED = -1  # number of disputed pixels from which only a sample is judged

PAINT: dict[str, tuple[tuple[int, ...], str]] = {
    "acne: says shadowed, is lit": ((Verdict.ACNE,), "#D55E00"),
    "leak: says lit, is shadowed": ((Verdict.LEAK,), "#0072B2"),
    "wrong triangle or no answer": ((Verdict.TRUE, Verdict.INVALID), "#000000"),
    "not judged: differs from the reference": ((UNJUDGED,), "#CC79A7"),
    "excused: edge or near tie": ((Verdict.EDGE, Verdict.NEAR_TIE), "#009E73"),
}
RIGHT = (Verdict.OK, Verdict.TIE)
ABOUT = "Of large frames the part where most is wrong in any panel; numbers count the whole frame."
HEAT = (
    "distance of the light from the middle, in scene radii\nIn a cell: wrong answers, and its colour their share, on {}, "
    "{}x{}, scene not recentred; in brackets those that are excused, within rounding of an edge"
)
SAMPLED = (
    "Of {} points a sample of the many answers that differ was judged; every other one counts as wrong, in no class."
)
LARGEST = 320  # pixels along a side of a panel: larger frames are cropped to where most is wrong


def read(folder: Path) -> DataFrame:
    """The points with mean wrong answers per frame by class. Columns: the label, its two halves as family and level."""
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


def usable(table: DataFrame) -> DataFrame:
    """Points that have both a time and an error."""
    return document.measured(table).dropna(subset="wrong_per_frame")


def frontier(table: DataFrame) -> Series:
    """Whether no other point of the scene, on its usual device, is better in time and error; missing if one is unknown."""
    found = (table["wrong_per_frame"] < 0).astype("boolean").where(table.index.isin(usable(table).index))
    for _, own in usable(table).groupby("title", sort=False):
        here = own[own["device"] == own["device"].mode()[0]]
        found[here.index] = pareto.front(here)
    return found


def costs(folder: Path, measures: Sequence[Measure]) -> DataFrame:
    """A row per scene and measure whose two points were measured in one run; ``noise_ms`` is missing with few repeats."""
    frames = document.frames(folder)
    titles = document.named(frames)["title"]
    frames, found = frames[frames["true_errors"].notna()], []
    for name, with_, without in measures:
        both = frames[frames["label"].isin([with_, without])]
        own, other = compare.pairs(both, both["label"] == without)
        own = own[own["label"] == with_]
        other = other.loc[own.index]
        noise = 2 * np.maximum(*(compare.spread(x).where(x["samples"] >= ENOUGH) for x in (own, other)))
        cost = own["total_ms"] - other["total_ms"]
        found.append(own[["scene", "device"]].assign(
            scene_title=titles.loc[own.index], measure=name, **{"with": with_, "without": without},
            with_ms=own["total_ms"], without_ms=other["total_ms"], cost_ms=cost, noise_ms=noise,
            share=cost / other["total_ms"], within_noise=noise.isna() | (cost.abs() <= noise),
            wrong_with=own["wrong_per_frame"], wrong_without=other["wrong_per_frame"],
        ))  # fmt: skip
    return document.arranged(pd.concat(found), "scene_title", titles.unique()).reset_index(drop=True)


def cost_table(cost: DataFrame, hard: DataFrame) -> DataFrame:
    """Measures down, scenes across: the frame with over that without, and what is wrong without (with) it, in all scenes."""
    if cost.empty:
        return cost
    noise = cost["noise_ms"] / cost["without_ms"]
    text = numbers.carry(1.0 + cost["share"], noise).mask(cost["within_noise"], "=").mask(noise.isna(), "?")
    cost = cost.assign(text=text)
    wide = document.cross_table(cost, ["measure"], "scene_title", "text").set_index("measure")
    groups, errors = cost.groupby("measure"), hard.set_index("label")["true_errors"].map("{:,}".format)
    wrong = groups[["wrong_without", "wrong_with"]].sum().map(numbers.count)
    pairs = groups[["without", "with"]].first().apply(lambda labels: labels.map(errors).fillna("-"))
    wide["wrong without (with)"] = wrong["wrong_without"] + " (" + wrong["wrong_with"] + ")"
    wide["hard cases"] = pairs["without"] + " (" + pairs["with"] + ")"
    return wide.reset_index()


def finding(table: DataFrame, cost: DataFrame) -> str:
    """One sentence: the fastest points without errors, and the costs of the safety measures."""
    known = usable(table)
    if known.empty:
        return "No point has both a time and a score."
    never = known.groupby("label")["wrong_per_frame"].max() == 0
    right = known[known["label"].isin(never.index[never])].sort_values("total_ms").drop_duplicates("title")
    wins = right["name"].value_counts().items()
    first = numbers.listed([f"{name} on {n} of {right['title'].nunique()}" for name, n in wins])
    clear = cost[~cost["within_noise"].astype(bool)]
    told = f"{never.sum()} of {len(never)} points are never wrong on these scenes, the fastest of them {first or '-'}."
    costly = list(clear.assign(ratio=1.0 + clear["share"]).groupby("measure", sort=False))
    if not costly:
        return f"{told} No safety measure costs more than the noise."
    name, most = max(costly, key=lambda pair: compare.geometric(pair[1]["ratio"]))
    times = numbers.mean(most, "ratio")
    return f"{told} Of the safety measures {name} takes the most: {times} times the frame without."


def draw_frontier(table: DataFrame, path: Path) -> Path | None:
    """Wrong answers of every point against its time, a panel a scene, with the front; points of the usual device."""
    known = usable(table)
    known = known[known["on_frontier"].notna() & ~known["name"].str.contains(", on the ")]
    return pareto.draw(path, known.astype({"on_frontier": bool})) if len(known) else None


def draw_costs(cost: DataFrame, base: str, path: Path) -> Path | None:
    """One bar per scene: the frame of the point ``base``, and what of it each measure adds beyond the noise."""
    own = cost[cost["with"] == base]
    if own.empty:
        return None
    added = own["cost_ms"].clip(lower=0.0).where(~own["within_noise"], 0.0)
    table = own.assign(added=added).pivot(index="scene_title", columns="measure", values="added").fillna(0.0)
    table = table.loc[own["scene_title"].unique(), [n for n in own["measure"].unique() if table[n].any()]]
    parts = {"all else": ("rest", "#cccccc"), **{n: (n, style.COLOURS[i]) for i, n in enumerate(table)}}
    total = own.groupby("scene_title", sort=False)["with_ms"].first()
    rest, text = total - table.sum(axis=1), total.map(numbers.carried) + " ms"
    table = table.assign(total_ms=total, iqr_ms=0.0, scene=total.index, method="", text=text, rest=rest)
    below = f"ms: the frame of {base}, and what of it each measure adds that adds more than the noise"
    return panels.bars(path, table, name="scene", parts=parts, room=1.25, legend=2, below=below)


def draw_where(folder: Path, table: DataFrame, shown: Sequence[str]) -> list[Path]:
    """One picture per scene: points ``shown`` (labels) with saved maps, of one part of the image. Without maps it stays."""
    inks = {title: colour for title, (_, colour) in PAINT.items()}
    rows = table[table["label"].isin(shown)].drop_duplicates(["file", "label"])
    rows = document.arranged(rows, "label", shown)
    rows["frame"] = [max(numbers, default=0) for numbers in rows["frame_numbers"]]  # of which maps are saved
    rows["map"] = [wrong_path(folder, row.key, row.frame) for row in rows.itertuples()]
    for name, own in rows[rows["map"].map(Path.exists).astype(bool)].groupby("file", sort=False):
        kept = [read_wrong(path) for path in own["map"]]
        part = window(max((~np.isin(classes, RIGHT) for classes in kept), key=np.sum))
        image = opened(reference_path(folder, own["scene"].iloc[0], own["frame"].iloc[0]))
        images = [
            ("\n".join([label, *textwrap.wrap(counted(classes), 44)]), painted(image, classes)[part])
            for label, classes in zip(own["label"], kept, strict=True)
        ]
        below = f"Where the wrong pixels are: {own['title'].iloc[0]}\n{ABOUT}"
        panels.images(folder / f"accuracy_where-{name}.png", images, across=3, below=below, key=inks, wide=2,
                      inks=list(inks.values()))  # fmt: skip
    return sorted(folder.glob("accuracy_where*.png"))


def draw_heat(folder: Path) -> Path | None:
    """One panel per method: the share of answers that are wrong, from white (none) to dark (all); excused ones as text."""
    import matplotlib
    from matplotlib.colors import LogNorm

    path = folder / "accuracy_heat.png"
    rows = pd.read_csv(folder / NAME).query("status == 'ok'") if (folder / NAME).exists() else pd.DataFrame()
    if rows.empty:
        return None
    rows["share"] = rows["wrong"] / rows["pixels"]
    excused = rows["excused"].map("\n(+{:,.0f})".format).where(rows["excused"] > 0, "")
    rows["text"] = rows["wrong"].map(numbers.count) + excused
    look = {"norm": LogNorm(1e-4, 1.0), "cmap": matplotlib.colormaps["magma_r"].with_extremes(bad="white")}
    scene, size = rows.iloc[0][["scene", "size"]]
    sheet = panels.facets(path, rows, "label", min(3, rows["label"].nunique()), 1.6, 2.06, legend=0, grid="", dpi=200,
                          colours=160, sharex=True, sharey=True, below=HEAT.format(scene, size, size),
                          left="offset of the scene from the origin, in radii")  # fmt: skip
    with sheet as shown:
        for axes, label, own in shown:
            share, text = (own.pivot(index="offset", columns="distance", values=v) for v in ("share", "text"))
            image = axes.imshow(share.where(share > 0), origin="lower", aspect="auto", **look)
            for (y, x), words in np.ndenumerate(text.to_numpy()):
                ink = "white" if share.iat[y, x] > 0.02 else "black"
                axes.text(x, y, words, ha="center", va="center", fontsize=4.8, color=ink)
            axes.set_title(label, fontsize=7)
            axes.set_xticks(range(share.shape[1]), map(style.radii, share.columns))
            axes.set_yticks(range(share.shape[0]), map(style.radii, share.index))
        bar = axes.figure.colorbar(image, ax=[axes for axes, *_ in shown], shrink=0.9, pad=0.01)
        bar.ax.yaxis.set_major_formatter(lambda at, _: f"{at:g}")
        bar.set_label("wrong answers / pixels (white: none)", fontsize=6.5)
    return path


def painted(image: Image.Image | None, classes: NDArray[np.int64]) -> NDArray[np.uint8]:
    """The reference in light grey with every wrong or excused pixel in its class's colour. uint8 [h, w, 3]."""
    grey = np.full(classes.shape, 255.0) if image is None else np.asarray(image.convert("L"), dtype=float)
    picture = np.repeat((110 + grey * 0.55)[..., None], 3, axis=2).clip(0, 255).astype(np.uint8)
    for kinds, colour in PAINT.values():
        picture[np.isin(classes, kinds)] = ImageColor.getrgb(colour)
    return picture


def window(wrong: NDArray[np.bool_]) -> tuple[slice, slice]:
    """The square of a large frame with the most wrong pixels, else the whole frame."""
    h, w = (min(LARGEST, side) for side in wrong.shape)
    total = np.pad(wrong.cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    inside = total[h:, w:] - total[:-h, w:] - total[h:, :-w] + total[:-h, :-w]
    y, x = map(int, np.unravel_index(int(inside.argmax()), inside.shape))
    return slice(y, y + h), slice(x, x + w)


def counted(classes: NDArray[np.int64]) -> str:
    """How many pixels of a map are in each class that is painted."""
    counts = {title: np.isin(classes, kinds).sum() for title, (kinds, _) in PAINT.items()}
    told = (f"{n:,} {title.split(':')[0].split(' or')[0]}" for title, n in counts.items() if n)
    return ", ".join(told) or "nothing wrong"
