"""Soft shadows: time and error of the picture against the number of shadow rays that a pixel has.

The scene's first light is a sphere. The picture of 256 targets is the reference; the error is that of the share of the
light that each pixel sees, where the surface faces the light. Exact methods make the same picture, so for them it depends
on the number of targets alone. A shadow map with percentage-closer filtering is a rival whose picture is smooth and wrong:
its filter is as wide everywhere.
"""

import itertools
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..harness.errors import CapacityRejected, UserError
from ..harness.frame.devices import placed_method
from ..harness.frame.registry import make_method
from ..harness.frame.session import Session
from ..harness.judge.receivers import facing
from ..harness.report import compare, document, numbers, panels, pareto, ranking, style
from ..harness.report.dataframe import DataFrame, pd
from ..harness.report.picture import captioned, flip, save_png, shade
from ..harness.runner.machine.lock import MACHINE
from ..harness.runner.measuring.measured_point import spread_frames
from ..harness.runner.planning.experiment import Entry, Experiment
from ..harness.runner.planning.planned_point import Options
from ..harness.runner.progress import Silent
from ..harness.scene.overrides import Lighting
from ..harness.scene.prepared import Prepared, prepare
from ..harness.texts import numbered
from ._paper import large, small
from ._rivals import HYBRID, OURS, RASTERISED, REBUILT

SIZE = 0.08  # diameter of the light in radii of the scene: half a metre in a room six metres across

REFERENCE = 256
EXACT = "every exact method"
JUDGES = (Entry("bvh2"), Entry("two_level_grid"))
"""What the pictures of the exact methods and of the reference are made with, the first that has room for all targets;
records say whether a method answers as they do.
"""

Made = tuple[dict[str, NDArray], NDArray[np.uint8]]  # answers, and their picture

WITH_TREE = Entry("hybrid", {"shadows": "tree"}, "hybrid with its tree")
"""The camera's stream, and a tree for shadow rays whatever their number; "hybrid" itself takes a grid or a tree."""

TREES, GRIDS = (REBUILT[0].label, WITH_TREE.label), (OURS.label,)
FILTERED = tuple(
    Entry("shadow_map", {"size": "2048", "filter": "soft", "spread": spread}, f"{name} filtered map")
    for name, spread in (("narrow", "0.25"), ("wide", "1"))
)
METHODS = (OURS, *REBUILT[:2], HYBRID, WITH_TREE, RASTERISED, *FILTERED)
SCENES = ("sibenik", "conference", "fairy", "buddha", "cloth")  # two rooms, three open scenes

ERROR = ["rmse", "largest", "flip_error"]
COLUMNS = [*document.COMMON, "targets", *ERROR, "front_exact", "front"]


def targets(*counts: int) -> tuple[Lighting, ...]:
    """The first light as a sphere with the given numbers of targets."""
    return tuple(Lighting(numbered(n, "target"), count=1, size=SIZE, samples=n) for n in counts)


class Pictures:
    """Answers and pictures of one scene with a number of targets."""

    def __init__(self, prepared: Prepared, options: Options):
        self.prepared, self.device = prepared, options.device
        self.size = options.preset.width, options.preset.height
        self.frame = spread_frames(prepared.frame_count, 1)[0]

    def made(self, entry: Entry, lighting: Lighting) -> Made | None:
        """The answers and the picture; None where the method cannot trace the scene or has no room for the targets."""
        MACHINE.give_way()
        lit = lighting.applied(self.prepared)
        method, place, cannot = placed_method(entry.method, dict(entry.settings), lit.scene, self.device)
        if cannot:
            return None
        moment = lit.moment(self.frame, *self.size)
        try:
            answers = Session(method, lit, *self.size, place).answers(moment)
        except CapacityRejected:
            return None
        return answers, shade(lit, moment, answers, lit.lights(self.frame))

    def exact(self, lighting: Lighting) -> Made:
        """The exact answers and their picture."""
        for entry in JUDGES:
            if found := self.made(entry, lighting):
                return found
        raise UserError(
            f"{self.prepared.scene.name}: no exact method has room for {lighting.label}; choose a smaller --size"
        )

    def facing(self, triangle: NDArray[np.int32]) -> NDArray[np.bool_]:
        """Which pixels hit a surface that faces the middle of the light: the others get no light, whatever their bits."""
        moment = targets(1)[0].applied(self.prepared).moment(self.frame, *self.size)
        corners = moment.points[self.prepared.faces[np.maximum(triangle, 0)]]
        return (triangle >= 0) & facing(moment, corners, 0)


def share_of_light(answers: dict[str, NDArray]) -> NDArray[np.float64]:
    """The share of a light's targets that each pixel sees, float64 [pixels]."""
    lit: NDArray[np.float64] = 1.0 - answers["shadowed"].mean(axis=0)
    return lit


def errors(options: Options, name: str, found: list[tuple[str, NDArray[np.uint8]]]) -> Iterator[dict[str, Any]]:
    """A row for each number of targets and each picture: of the exact methods, and of each other method of its own.

    found  receives pictures to show side by side, with captions
    """
    pictures, lightings = Pictures(prepare(options.described(name)), options), options.preset.lightings
    reference = pictures.exact(targets(REFERENCE)[0])
    right, counted = share_of_light(reference[0]), pictures.facing(reference[0]["triangle"])
    shown = {lightings[0], lightings[len(lightings) // 2], lightings[-1]}
    ways: dict[str, Callable[[Lighting], Made | None]] = {EXACT: pictures.exact}
    for entry in options.preset.methods:
        if getattr(make_method(entry.method, dict(entry.settings)), "known_inexact", None):
            ways[entry.label] = partial(pictures.made, entry)
    for (label, make), lighting in itertools.product(ways.items(), lightings):
        if (made := make(lighting)) is None:
            continue
        off = np.abs(share_of_light(made[0]) - right)[counted]
        yield {
            "scene": pictures.prepared.scene.name, "picture": label, "targets": lighting.samples,
            "rmse": float(np.sqrt(np.mean(off**2))) if len(off) else 0.0, "largest": float(off.max(initial=0.0)),
            "flip_error": flip(reference[1], made[1])["flip"],
        }  # fmt: skip
        if lighting in shown and (label == EXACT or lighting == lightings[-1]):
            found.append((f"{label}, {lighting.label}", made[1]))
    found.append((f"reference, {REFERENCE} targets", reference[1]))


TILE = 320  # largest height of a picture in a sheet, pixels: sheets are kept with the results


def side_by_side(found: list[tuple[str, NDArray[np.uint8]]]) -> NDArray[np.uint8]:
    """Pictures with captions in one sheet, three across; large ones are shown smaller, small ones enlarged."""
    from PIL import Image

    high, wide = found[0][1].shape[:2]
    times = max(1, 256 // high)
    size = (wide * TILE // high, TILE) if high > TILE else (wide * times, high * times)
    tiles = [
        captioned(np.asarray(Image.fromarray(picture).resize(size, Image.Resampling.BOX)), "", text)
        for text, picture in found
    ]
    high = max(len(tile) for tile in tiles)
    tiles = [np.pad(tile, ((0, high - len(tile)), (0, 4), (0, 0)), constant_values=250) for tile in tiles]
    tiles += [np.full_like(tiles[0], 250)] * (-len(tiles) % 3)
    return np.vstack([np.hstack(tiles[i : i + 3]) for i in range(0, len(tiles), 3)])


def after(options: Options, report: Silent) -> None:
    """Untimed: for each scene the errors of its pictures as CSV, and pictures side by side. Not made again while there."""
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


def read(folder: Path) -> DataFrame:
    """The points with the error of their picture, and whether they lie on the front of error over time.

    front_exact, front  of the exact methods, and of all, of each scene
    """
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


def overtaking(done: DataFrame) -> tuple[str, str]:
    """From how many targets on the fastest exact tree is faster than the fastest exact grid, and by how much at most, in
    words; and the spread of that number. ``done``: points of one scene. Between two numbers of targets times are taken to
    lie on a line.
    """
    own = done[done["exact"]].sort_values("total_ms")
    tree, grid = (
        own[own["label"].isin(labels)].drop_duplicates("targets").set_index("targets").sort_index()
        for labels in (TREES, GRIDS)
    )
    counts = tree.index.intersection(grid.index)
    if not len(counts):
        return "not measured", "-"
    tree, grid = tree.loc[counts], grid.loc[counts]
    gap, around = tree["total_ms"] - grid["total_ms"], np.hypot(tree["spread"], grid["spread"])
    if gap.iloc[0] <= 0.0:
        return f"at {counts[0]} already", "0"
    after = np.nonzero((gap <= 0.0).to_numpy())[0]
    if not len(after):
        return f"not up to {counts[-1]}", "-"
    k = int(after[0])
    (low, high), (one, other) = counts[k - 1 : k + 1], gap.iloc[k - 1 : k + 1]
    share = one / (one - other)
    spread = float(np.hypot((1 - share) * around.iloc[k - 1], share * around.iloc[k]) * (high - low) / (one - other))
    met = numbers.carried(low + share * (high - low), spread)
    most = float((-gap / grid["total_ms"]).max())
    return f"at {met} (by {100 * most:.2g} % of the frame at most)", f"{spread:.2g}" if spread < np.inf else "-"


def finding(done: DataFrame, met: dict[str, tuple[str, str]]) -> str:
    """Where trees overtake grids (``met``: :func:`overtaking` by scene), and what error so many targets leave."""
    if done.empty:
        return "Nothing was measured."
    words: dict[str, list[str]] = {}
    for title, (how, _) in met.items():
        words.setdefault(how, []).append(title)
    told = "; ".join(f"{how} on {numbers.listed(titles)}" for how, titles in words.items())
    text = f"Number of targets at which an exact tree overtakes the exact grids: {told}"
    known = done[done["rmse"].notna()]
    exact = known[known["picture"] == EXACT]
    most = exact["targets"].max()
    if len(exact):
        own = exact[exact["targets"] == most].drop_duplicates("title")["rmse"]
        over = f", mean over {len(own)} scenes" if len(own) > 1 else ""
        text += f". With {most} targets the share of light is off by {100 * own.mean():.2g} % (root mean square{over})"
    mapped = known[known["label"].isin([entry.label for entry in FILTERED]) & (known["targets"] == most)]
    if len(mapped) and len(exact):
        least = mapped.groupby("label")["rmse"].mean()
        text += f", that of the {least.idxmin()} by {100 * least.min():.2g} %"
    return text + "."


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time against the number of targets, error over time with its front, where trees overtake grids; CSV."""
    table = read(folder)
    done = document.measured(table)
    across = min(3, done["title"].nunique())
    met = {str(title): overtaking(own) for title, own in done.groupby("title", sort=False)}
    known = done[done["rmse"].gt(0.0)]
    known = known.assign(
        error=(100 * known["rmse"]).map("{:.2g}".format), most=known["largest"].map("{:.2f}".format),
        FLIP=known["flip_error"].map("{:.4f}".format, na_action="ignore"),
    )  # fmt: skip
    known["text"] = known["error"] + " (" + known["most"] + ")"
    rows = {"title": "scene", "label": "method"}
    tables = {
        "Milliseconds, by number of targets": document.cross_table(done, rows, "targets", "ms"),
        "Number of targets at which an exact tree overtakes the exact grids":
            pd.DataFrame([(title, *words) for title, words in met.items()], columns=["scene", "targets", "spread"]),
        "Error of the share of light, % (root mean square; the largest)":
            document.cross_table(known, {"title": "scene", "picture": "picture of"}, "targets", "text"),
    }  # fmt: skip
    shown = {**rows, "targets": "targets", "ms": "ms", "error": "error, %", "most": "largest", "FLIP": "FLIP"}
    fastest = known.sort_values(["title", "total_ms"], kind="stable")
    for column, title in (("front_exact", "exact methods"), ("front", "all methods, exact or not")):
        best = fastest[fastest[column]] if len(fastest) else fastest
        tables[f"Front of error over time, {title}"] = best[[*shown]].rename(columns=shown)
    files = [
        panels.lines(
            folder / "soft_shadows.svg", table, "targets", "total_ms", facet="title", across=across, whisker="spread",
            log_x=2, ticks=str, below="targets of the light", left="ms per frame", legend=3, wide=2, high=2.0,
        ),
        error_picture(folder / "soft_shadows-error.svg", known, across) if len(known) else None,
        *(place for name in dict.fromkeys(done["scene"]) if (place := beside(folder, name, "png")).exists()),
    ]  # fmt: skip
    notes = [*compare.in_sequence(document.frames(folder)), ABOUT] if len(done) else []
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding(done, met), tables, files, quiet, notes)


ABOUT = (
    f"The light is a sphere with a diameter of {SIZE:g} radii of the scene. Errors are against {REFERENCE} targets, of "
    "which fewer are the first ones; the spread of a number of targets follows from those of the times beside it."
)


def error_picture(path: Path, known: DataFrame, across: int) -> Path:
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


EXPERIMENT = Experiment(
    "soft_shadows", "Soft shadows: what the number of shadow rays costs, and what error it leaves",
    {
        "quick": small(
            96, ("sibenik", "cloth"), (OURS, *REBUILT[:2], FILTERED[0]), 2.0, samples=2, lightings=targets(1, 4, 16)
        ),
        "short": large(
            SCENES, METHODS[:-1], 0.2, samples=3, most=5, deviation=None, stage_samples=0, rounds=2, timeout_s=300.0,
            lightings=targets(1, 4, 16, 64),
        ),
        "paper": large(
            SCENES, METHODS, 20.0, samples=10, deviation=0.01, stage_samples=0, lightings=targets(1, 2, 4, 8, 16, 32, 64)
        ),
    },
    draw, after, after_s,
)  # fmt: skip
