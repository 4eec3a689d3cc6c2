"""Soft shadows: time and error of the picture against the number of shadow rays that a pixel has.

The scene's first light is a sphere. The picture of 256 targets is the reference; the error is that of the share of the
light that each pixel sees, where the surface faces the light. Exact methods make the same picture, so for them it depends
on the number of targets alone. A shadow map with percentage-closer filtering is a rival whose picture is smooth and wrong:
its filter is as wide everywhere.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..harness.report import compare, document, numbers, panels, pareto, ranking, sentences, style
from ..harness.report.picture import save_png
from ..harness.runner.planning.experiment import Entry, Experiment, Preset
from ..harness.runner.planning.run_options import Options
from ..harness.runner.progress import Silent
from ._rivals import HYBRID, OURS, RASTERISED, REBUILT
from ._soft_pictures import EXACT, REFERENCE, SIZE, errors, side_by_side, targets

WITH_TREE = Entry("hybrid", {"shadows": "tree"}, "hybrid with its tree")
"""The camera's stream, and a tree for shadow rays whatever their number; "hybrid" itself takes a grid or a tree."""

TREES, GRIDS = (REBUILT[0].label, WITH_TREE.label), (OURS.label,)
FILTERED = tuple(
    Entry("shadow_map", {"size": "2048", "filter": "soft", "spread": spread}, f"{name} filtered map")
    for name, spread in (("narrow", "0.25"), ("wide", "1"))
)
METHODS = (OURS, *REBUILT[:2], HYBRID, WITH_TREE, RASTERISED, *FILTERED)
SCENES = ("sibenik", "conference", "fairy", "buddha", "cloth")
"""Two rooms, two open scenes, and one that moves."""

ERROR = ["rmse", "largest", "flip_error"]
COLUMNS = [*document.COMMON, "targets", *ERROR, "front_exact", "front"]


def after(options: Options, report: Silent) -> None:
    """Untimed: for each scene the errors of its pictures as CSV, and pictures side by side. Not made again while there."""
    import pandas as pd

    for name in options.preset.scenes:
        path = beside(options.out, options.described(name).name, "csv")
        if path.exists():
            continue
        report.doing(f"{name}: errors of its pictures")
        found: list[tuple[str, NDArray[np.uint8]]] = []
        made = pd.DataFrame(errors(options, name, found))
        save_png(side_by_side(found), path.with_suffix(".png"))
        made.to_csv(path, index=False, float_format="%.6g", lineterminator="\n")


def beside(folder: Path, scene: str, kind: str) -> Path:
    """The file of a scene's errors or pictures. One each, so that results of several folders can be put together."""
    return folder / f"soft_shadows-{scene}.{kind}"


def after_s(options: Options) -> float:
    """Seconds of :func:`after`, roughly: as many frames as points, and the reference."""
    return 8.0 * sum(not beside(options.out, name, "csv").exists() for name in options.preset.scenes)


def read(folder: Path) -> document.DataFrame:
    """The points with the error of their picture, and whether they lie on the front of error over time.

    front_exact, front  of the exact methods, and of all, of each scene
    """
    import pandas as pd

    table = document.named(document.frames(folder))
    table = table.assign(exact=ranking.exact(table))
    found = [pd.read_csv(path) for path in sorted(folder.glob(beside(folder, "*", "csv").name))]
    known = pd.concat(found) if found else pd.DataFrame(columns=["scene", "picture", "targets", *ERROR])
    table["picture"] = table["label"].where(table["known_inexact"] != "", EXACT)
    made = table.merge(known.astype({"targets": "Int64"}), on=["scene", "picture", "targets"], how="left").set_index(
        table.index
    )
    done = document.measured(made)
    for column, own in (("front_exact", done[done["exact"]]), ("front", done)):
        best = [pareto.front(one, y="rmse") for _, one in own[own["rmse"].notna()].groupby("title")]
        made[column] = pd.concat(best).reindex(made.index, fill_value=False).astype(bool) if best else False
    return document.arranged(made, "targets", sorted(made["targets"].unique()))


def overtaking(done: document.DataFrame) -> tuple[float, float, str]:
    """From how many targets on the fastest exact tree is faster than the fastest exact grid, its spread, and in words.

    ``done``: points of one scene. Between two numbers of targets times are taken to lie on a line.
    """
    own = done[done["exact"]]
    best = []
    for labels in (TREES, GRIDS):
        rows = own[own["label"].isin(labels)].sort_values("total_ms").drop_duplicates("targets").set_index("targets")
        best.append(rows.sort_index())
    counts = best[0].index.intersection(best[1].index)
    tree, grid = (one.loc[counts] for one in best)
    if not len(counts):
        return np.nan, np.nan, "not measured"
    gap, around = tree["total_ms"] - grid["total_ms"], np.hypot(tree["spread"], grid["spread"])
    if gap.iloc[0] <= 0.0:
        return float(counts[0]), 0.0, f"at {counts[0]} already"
    after = np.nonzero((gap <= 0.0).to_numpy())[0]
    if not len(after):
        return np.inf, np.nan, f"not up to {counts[-1]}"
    k = int(after[0])
    (low, high), (one, other) = counts[k - 1 : k + 1], gap.iloc[k - 1 : k + 1]
    share = one / (one - other)
    at = low + share * (high - low)
    spread = float(np.hypot((1 - share) * around.iloc[k - 1], share * around.iloc[k]) * (high - low) / (one - other))
    return at, spread, f"at {numbers.carried(at, spread)}"


def finding(done: document.DataFrame) -> str:
    """Where trees overtake grids, and what error so many targets leave."""
    if done.empty:
        return "Nothing was measured."
    words: dict[str, list[str]] = {}
    for title, own in done.groupby("title", sort=False):
        words.setdefault(overtaking(own)[2], []).append(str(title))
    told = "; ".join(f"{how} on {sentences.listed(titles)}" for how, titles in words.items())
    text = f"Number of targets at which an exact tree overtakes the exact grids: {told}."
    known = done[done["rmse"].notna()]
    exact = known[known["picture"] == EXACT]
    if exact.empty:
        return text
    most = exact["targets"].max()
    means = exact[exact["targets"] == most].drop_duplicates("title")["rmse"].mean()
    text += f" With {most} targets the share of light is off by {100 * means:.2g} % (root mean square)"
    mapped = known[known["label"].isin([entry.label for entry in FILTERED]) & (known["targets"] == most)]
    if len(mapped):
        least = mapped.groupby("label")["rmse"].mean()
        text += f", that of the {least.idxmin()} by {100 * least.min():.2g} %"
    return text + "."


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time against the number of targets, error over time with its front, where trees overtake grids; CSV."""
    table = read(folder)
    done = document.measured(table)
    if done.empty:
        return document.write(folder, EXPERIMENT, table, COLUMNS, finding(done), {}, [], quiet)
    across = min(3, done["title"].nunique())
    files = [panels.lines(
        folder / "soft_shadows.svg", table, "targets", "total_ms", facet="title", across=across, whisker="spread", log_x=2,
        ticks=str, below="targets of the light", left="ms per frame", legend=3, wide=2, high=2.0,
    )]  # fmt: skip
    known = done[done["rmse"].gt(0.0)]
    tables = {
        "Milliseconds, by number of targets": document.cross_table(
            done, {"title": "scene", "label": "method"}, "targets", "ms"
        ),
        "Number of targets at which an exact tree overtakes the exact grids": overtakings(done),
    }
    notes = [*compare.in_sequence(document.frames(folder)), ABOUT]
    if len(known):
        files.append(error_picture(folder / "soft_shadows-error.svg", known, across))
        shown = known.assign(
            text=(100 * known["rmse"]).map("{:.2g}".format) + " (" + known["largest"].map("{:.2f}".format) + ")"
        )
        names = {"title": "scene", "picture": "picture of"}
        tables["Error of the share of light, % (root mean square; the largest)"] = document.cross_table(
            shown, names, "targets", "text"
        )
        for column, title in (("front_exact", "exact methods"), ("front", "all methods, exact or not")):
            tables[f"Front of error over time, {title}"] = front_table(known[known[column]])
    pictures = [place for name in dict.fromkeys(done["scene"]) if (place := beside(folder, name, "png")).exists()]
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding(done), tables, [*files, *pictures], quiet, notes)


ABOUT = (
    f"The light is a sphere with a diameter of {SIZE:g} radii of the scene. Errors are against {REFERENCE} targets, of "
    "which fewer are the first ones; the spread of a number of targets follows from those of the times beside it."
)


def error_picture(path: Path, known: document.DataFrame, across: int) -> Path:
    """Error over time, both logarithmic: along the line of a method its number of targets grows; the fronts as stairs."""
    drawn = panels.looks(known)
    below = (
        "ms per frame; along a line the number of targets grows\nstairs: the front, dashed of exact ones, dotted of all"
    )
    left = "error of the share of light (root mean square)"
    with panels.facets(path, known, "title", across, 2.2, 2, legend=4, below=below, left=left) as shown:
        for axes, title, own in shown:
            for label, line in own.sort_values("targets").groupby("label", sort=False):
                panels.line(axes, line, "total_ms", "rmse", "", str(label), drawn[label])
            axes.set_yscale("log")
            style.plain_log(axes, "x")
            style.plain_log(axes)
            axes.set_title(title, loc="left")
            for column, ls in (("front", ":"), ("front_exact", "--")):
                best = own[own[column]].sort_values("total_ms")
                axes.step(best["total_ms"], best["rmse"], where="post", c="0.3", lw=0.8, ls=ls, zorder=1)
    return path


def overtakings(done: document.DataFrame) -> document.DataFrame:
    """Texts of :func:`overtaking` by scene."""
    import pandas as pd

    return pd.DataFrame(
        [
            {"scene": title, "targets": words, "spread": "-" if not spread < np.inf else f"{spread:.2g}"}
            for title, own in done.groupby("title", sort=False)
            for _, spread, words in [overtaking(own)]
        ]
    )


def front_table(best: document.DataFrame) -> document.DataFrame:
    """The points of a front, fastest first: method, number of targets, time and error."""
    import pandas as pd

    best = best.sort_values(["title", "total_ms"], kind="stable")
    return pd.DataFrame(
        {
            "scene": best["title"], "method": best["label"], "targets": best["targets"], "ms": best["ms"],
            "error, %": (100 * best["rmse"]).map("{:.2g}".format), "largest": best["largest"].map("{:.2f}".format),
            "FLIP": best["flip_error"].map("{:.4f}".format, na_action="ignore"),
        }
    )  # fmt: skip


EXPERIMENT = Experiment(
    name="soft_shadows",
    title="Soft shadows: what the number of shadow rays costs, and what error it leaves",
    presets={
        "quick": Preset(
            96, 96, ("sibenik", "cloth"), (OURS, *REBUILT[:2], FILTERED[0]), frames=1, samples=2, most=2, stage_samples=1,
            rounds=1, budget_s=2.0, lightings=targets(1, 4, 16),
        ),
        "short": Preset(
            1024, 1024, SCENES, METHODS[:-1], frames=1, samples=3, most=5, stage_samples=0, rounds=2, budget_s=0.2,
            timeout_s=300.0, lightings=targets(1, 4, 16, 64),
        ),
        "paper": Preset(
            1024, 1024, SCENES, METHODS, frames=1, samples=10, most=20, deviation=0.01, stage_samples=0, rounds=9,
            budget_s=20.0, timeout_s=600.0, lightings=targets(1, 2, 4, 8, 16, 32, 64),
        ),
    },
    draw=draw,
    after=after,
    after_s=after_s,
)  # fmt: skip
