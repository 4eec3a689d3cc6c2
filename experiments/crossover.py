"""Where one structure becomes faster than another: over triangles, pixels, lights, pixels hit, and what moves.

Everything is rebuilt every frame but where a label says that a tree is refitted. The scenes are the balls of
:mod:`.scene.standins.balls`: the same surfaces at every triangle count, seen from nearer or farther, with more or fewer
of them moving. The sweeps cross in one setting; two maps take two quantities at once. Lights are also counted in rooms,
where many triangles lie behind one another on the way to a light.
"""

import itertools
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..harness.report import compare, document, numbers, panels, ranking, style
from ..harness.report.dataframe import DataFrame, pd
from ..harness.runner.planning.experiment import Experiment, Preset
from ..harness.scene.overrides import Lighting
from ..harness.scene.standins import balls
from ._paper import large, small
from ._rivals import FEW, STRONGEST, lights
from .scaling import short

AXES = {  # the swept quantities, by column
    "triangles": "triangles", "pixels": "pixels", "lights": "lights", "seen": "pixels that see the ground, %",
    "moving": "triangles that move, %",
}  # fmt: skip
MAPS = (("triangles", "pixels"), ("triangles", "seen"))
NATURAL = -1  # in the columns `seen` and `moving`: the scene's own camera; nothing moves and there is one frame
ROOMS = ("sibenik", "conference")
COLUMNS = [*document.COMMON, "room", *AXES, "memory_bytes", "fastest_exact", "fastest"]
EXACT, EVERY = "exact", "all, exact or not"

Turn = list[tuple[float, list[str]]]
"""Values of an axis that follow one another, and the methods that are the fastest at each: one of them at all."""


def settings(
    base: Preset, sides: Iterable[int], names: Iterable[str], counts: Iterable[int] = (1,)
) -> Iterator[Preset]:
    """``base`` at every size on every scene with every number of lights; 0 lights: the light casts no shadow."""
    for side, name in itertools.product(sides, names):
        lightings = tuple(
            Lighting(f"{n} lights", count=n) if n else Lighting("no shadows", count=1, shadows=False) for n in counts
        )
        yield replace(base, width=side, height=side, scenes=(name,), lightings=lightings, also=())


def sweeps(
    base: Preset, triangles: tuple[str, ...], middle: str, sides: tuple[int, ...], lights: tuple[int, ...],
    seen: tuple[int, ...], few: tuple[str, ...], moving: tuple[int, ...], rooms: tuple[str, ...] = (),
) -> Preset:  # fmt: skip
    """A map of triangles and pixels, one of triangles (``few``) and pixels hit, and the two other sweeps; lights in
    rooms. All but the rooms cross at ``middle`` triangles, at the size of ``base``, with one light.
    """
    parts = [
        *settings(base, sides, (f"balls-{n}" for n in triangles)),
        *settings(base, (base.width,), (f"balls-{middle}",), [n for n in lights if n != 1]),
        *settings(base, (base.width,), (f"balls-{n}-seen{share}" for share in seen for n in few)),
        *settings(base, (base.width,), (f"balls-{middle}-moving{share}" for share in moving)),
        *settings(base, (base.width,), rooms, [n for n in lights if n]),
    ]
    return replace(parts[0], also=tuple(parts[1:]))


def read(folder: Path) -> DataFrame:
    """The points, with what is swept as columns of its own, and the label of the fastest of each setting. ``triangles``
    is the number in the scene's name; of a room, whose title is in ``room``, that of its mesh. ``exact``: the method
    calls itself exact and no answer was wrong.
    """
    table = document.read(folder)
    names = [balls.read_name(name) for name in table["scene"]]
    shares = {column: [getattr(name, column, None) for name in names] for column in ("seen", "moving")}
    table = table.assign(
        room=table["title"].where([name is None for name in names], ""), exact=ranking.exact(table),
        triangles=[name.count if name else count for name, count in zip(names, table["triangles"].tolist(), strict=True)],
        lights=table["lights"].where(table["light_label"] != "no shadows", 0),
        **{column: [NATURAL if x is None else round(100 * x) for x in own] for column, own in shares.items()},
    )  # fmt: skip
    for column, own in (("fastest", table), ("fastest_exact", table[table["exact"]])):
        first = winners(own).set_index([*AXES])["label"]
        table[column] = [first.get(key, "") for key in table[[*AXES]].itertuples(index=False, name=None)]
    return table


def winners(table: DataFrame) -> DataFrame:
    """The fastest point of each setting: with ``next``, the label of the second, ``times``, how many times slower that is,
    and ``told``, whether the gap is more than the spreads of the two.
    """
    axes = [*AXES]
    ranked = document.measured(table).sort_values([*axes, "total_ms"], kind="stable")
    place = ranked.groupby(axes).cumcount()
    first = ranked[place == 0].set_index(axes, drop=False)
    second = ranked[place == 1].set_index(axes).reindex(first.index)[["label", "total_ms", "spread"]]
    # A spread that is not known (one sample) tells nothing: NaN compares false.
    told = second["total_ms"] - first["total_ms"] > np.hypot(first["spread"], second["spread"])
    times, around = compare.over(second["total_ms"], second["spread"], first["total_ms"], first["spread"])
    more = {"next": second["label"].fillna(""), "times": times, "times_spread": around}
    return first.assign(**more, told=told | second["label"].isna()).reset_index(drop=True)


def along(table: DataFrame, *axes: str) -> DataFrame:
    """The points that differ in nothing but ``axes``: of all such groups the one with most settings. Of several such
    groups the one whose other values are the most common: where the sweeps cross.
    """
    others = [axis for axis in AXES if axis not in axes]
    if table.empty:
        return table
    common = sum((table[axis].map(table[axis].value_counts()) for axis in others), start=table["pixels"] * 0)
    groups = table.assign(common=common).groupby(others)
    sizes = groups.agg(common=("common", "first"))
    sizes["settings"] = groups[[*axes]].apply(lambda own: len(own.drop_duplicates()))
    best = sizes.sort_values(["settings", "common"]).index[-1]
    kept = table[(table[others] == list(best)).all(axis=1)]
    return kept[(kept[[*axes]] != NATURAL).all(axis=1)]


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Lines over each quantity, two maps of the winners, a table of every setting, CSV."""
    table = read(folder)
    every = document.measured(table)
    done, inside = every[every["room"] == ""], every[every["room"] != ""].sort_values("lights", kind="stable")
    rooms = {str(room): line for room, line in inside.groupby("room", sort=False)}
    lines = {axis: line for axis in AXES if (line := along(done, axis))[axis].nunique() > 1}
    maps = [pair for pair in MAPS if all(along(done, *pair)[axis].nunique() > 1 for axis in pair)]
    files = [
        line_picture(lines, done, folder / "crossover.svg") if lines else None,
        panels.lines(
            folder / "crossover-rooms.svg", inside, "lights", "total_ms", facet="room", across=2, whisker="spread", log_x=2,
            ticks=str, below="lights", left="ms per frame", wide=2, high=2.0, legend=3,
        ),
        map_picture(maps, done, folder / "crossover-maps.svg") if maps else None,
    ]  # fmt: skip
    tables = {
        f"Fastest over {AXES[axis]} ({crossing(line, axis)})": winner_table(line, axis) for axis, line in lines.items()
    }
    tables |= {f"Fastest over lights in {room}": winner_table(line, "lights") for room, line in rooms.items()}
    told = over_lights("In", ((room, line[line["exact"]]) for room, line in rooms.items()))
    told = [*([of_balls(done)] if len(done) or not told else []), *told]
    notes = [f"Over {name}: not measured." for axis, name in AXES.items() if len(done) and axis not in lines]
    notes += [ABOUT] * bool(len(every))
    return document.write(folder, EXPERIMENT, table, COLUMNS, " ".join(told), tables, files, quiet, notes)


ABOUT = "A tie: the gap is within the spread of the two. A method that answered wrongly is not counted as exact."


def over_lights(preposition: str, groups: Iterable[tuple[Any, DataFrame]]) -> list[str]:
    """Which exact method is the fastest by number of lights, a sentence for each group that has several numbers.

    groups  names, which follow the preposition, and points of exact methods
    """
    told = {name: over(line, "lights", "lights") for name, line in groups}
    return [f"{preposition} {name} {text}." for name, text in told.items() if text]


def over(line: DataFrame, axis: str, name: str) -> str:
    """Which exact method is the fastest along an axis, as "up to 4 lights A, from 8 B"; "" where there is one value. What
    ties with the fastest is the fastest, too: a method stays it until another one is told from it, and its ties are
    counted. ``name``: of the axis in the sentence.
    """
    if line[axis].nunique() < 2:
        return ""
    turns: list[Turn] = []
    for row in winners(line).sort_values(axis).to_dict("records"):
        best = [row["label"]] if row["told"] else [row["label"], row["next"]]
        if not turns or not common([*turns[-1], (row[axis], best)]):
            turns.append([])
        turns[-1].append((row[axis], best))
    low, high = (counted(axis, value) for value in (line[axis].min(), line[axis].max()))
    span = f"from {low} to {high} {name}"
    if len(turns) == 1:
        return f"{span} {common(turns[0])[0]} stays the fastest exact method{ties(turns[0])}"
    told = [f"{common(turn)[0]}{ties(turn)}" for turn in turns]
    later = ", ".join(
        f"from {counted(axis, turn[0][0])} {text}" for turn, text in zip(turns[1:], told[1:], strict=True)
    )
    return f"{span} the fastest exact method is first {told[0]}, {later}"


def common(turn: Turn) -> list[str]:
    """The methods that are the fastest, or tie with it, at every value of a turn."""
    return [label for label in turn[0][1] if all(label in best for _, best in turn)]


def ties(turn: Turn) -> str:
    """In how many of a turn's values its method ties, and with what: " (in 2 of 7 a tie with B)"; "" where in none."""
    first = common(turn)[0]
    others = [label for _, best in turn for label in best if label != first]
    named = numbers.listed(dict.fromkeys(others))
    return f" (in {len(others)} of {len(turn)} a tie with {named})" if others else ""


def of_balls(done: DataFrame) -> str:
    """In how many settings of the balls each structure is the fastest."""
    if done.empty:
        return "Nothing was measured."
    right = done[done["exact"]]
    best, every = winners(right), winners(done)
    if best.empty:
        return f"No method is known to have answered exactly in any of {len(every)} settings."
    methods = dict(zip(done["label"], done["method"], strict=True))
    ends = best[["label", "next", "told"]].itertuples(index=False)
    wins = [{label: methods[label] for label in ([first] if told else [first, then])} for first, then, told in ends]
    times = [dict(zip(own["label"], own["total_ms"], strict=True)) for _, own in right.groupby([*AXES], sort=False)]
    told = ranking.most_wins(wins, times, len(best), "setting")
    first = best.set_index([*AXES])[["total_ms", "spread"]].reindex(pd.MultiIndex.from_frame(every[[*AXES]]))
    ahead = first["total_ms"].to_numpy() - every["total_ms"] > np.hypot(first["spread"].to_numpy(), every["spread"])
    wrong = Counter(every.loc[~every["exact"] & ahead, "label"])
    beaten = [f"{label}, which is not exact, is faster in {n}" for label, n in wrong.most_common()]
    return f"{told} {'; '.join(beaten)}." if beaten else told


def winner_table(line: DataFrame, axis: str) -> DataFrame:
    """One row per value of ``axis``: the fastest of the exact and of all, its time, and the next with its factor."""
    rows: dict[Any, dict[str, str]] = {}
    for kind, own in ((EXACT, line[line["exact"]]), (EVERY, line)):
        for row in winners(own).itertuples():
            value = getattr(row, axis)
            texts = rows.setdefault(value, {AXES[axis]: counted(axis, value)})
            texts[f"fastest, {kind}"] = f"{row.label}, {numbers.carried(row.total_ms, row.spread, numbers.TIME)} ms"
            texts[f"next, {kind}"] = f"{row.next}, {beside(row)}" if row.next else "-"
    return pd.DataFrame([rows[value] for value in sorted(rows)])


def beside(row: Any) -> str:
    """How many times longer the next takes; a tie where the spreads do not tell."""
    return "" if not row.next else numbers.carried(row.times, row.times_spread) + "x" if row.told else "a tie"


def line_picture(lines: dict[str, DataFrame], done: DataFrame, path: Path) -> Path:
    """One panel per quantity: time against it, one line per method."""
    looks = panels.looks(done)
    every = pd.concat(line.assign(axis=axis, x=line[axis]).sort_values("x") for axis, line in lines.items())
    with panels.facets(path, every, "axis", 3, 2.1, 2.0, legend=3, left="ms per frame", sharey=True) as shown:
        for axes, axis, line in shown:
            for label, own in line.groupby("label", sort=False):
                panels.line(axes, own, "x", "total_ms", "spread", label, looks[label])
            values = sorted(line["x"].unique())
            axes.set_xscale("log" if values[0] > 0 else "linear")
            axes.set_xticks(values, [counted(axis, value) for value in values])
            axes.tick_params(axis="x", which="minor", length=0, labelbottom=False)
            axes.set_xlabel(AXES[axis])
            style.plain_log(axes)
    return path


def crossing(line: DataFrame, axis: str) -> str:
    """The values of the quantities that are not swept: "pixels: 128², lights: 1"."""
    others = [other for other in AXES if other != axis and line[other].iloc[0] != NATURAL]
    return ", ".join(f"{AXES[other]}: {counted(other, line[other].iloc[0])}" for other in others)


def counted(axis: str, value: float) -> str:
    """A value of an axis for people: pixels as the square of a side."""
    return f"{round(value**0.5)}²" if axis == "pixels" else short(value)


def map_picture(maps: list[tuple[str, str]], done: DataFrame, path: Path) -> Path:
    """The fastest structure over two quantities: one square per setting in its colour, and how many times slower the
    next is. Left: exact methods only; right: all. A square of two colours is a tie: the gap is within the spreads of
    the two.
    """
    from matplotlib.patches import Polygon, Rectangle

    # Labels of one method have one colour: the later ones are lighter.
    place = done.drop_duplicates("label").set_index("label").groupby("method").cumcount()
    tint = {
        label: style.lightened(look["color"], min(0.8, 0.2 + 0.3 * place[label]))
        for label, look in panels.looks(done).items()
    }
    kinds = {EXACT: done[done["exact"]], EVERY: done}
    size = (2 * style.COLUMN_WIDTH, 2.5 * len(maps) + 0.7)
    with panels.sheet(path, size, len(maps), 2, legend=3, grid="") as (figure, grid):
        for axes, (pair, (kind, table)) in zip(grid.flat, itertools.product(maps, kinds.items()), strict=True):
            field = along(table, *pair)
            found, (columns, rows) = winners(field), (sorted(field[axis].unique()) for axis in pair)
            for cell in found.itertuples():
                x, y = columns.index(getattr(cell, pair[0])), rows.index(getattr(cell, pair[1]))
                axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, fc=tint[cell.label], ec="white"))
                if not cell.told:
                    corners = [(x - 0.48, y - 0.48), (x + 0.48, y - 0.48), (x + 0.48, y + 0.48)]
                    axes.add_patch(Polygon(corners, fc=tint[cell.next], ec="none"))
                text = f"{numbers.carried(cell.total_ms, cell.spread, numbers.TIME)} ms\n{beside(cell)}"
                axes.text(x, y, text, ha="center", va="center", size=5.5)
            for label in dict.fromkeys([*found["label"], *found["next"][~found["told"].astype(bool)]]):
                axes.fill_between([], [], label=label, color=tint[label])
            axes.set_xticks(range(len(columns)), [counted(pair[0], value) for value in columns])
            axes.set_yticks(range(len(rows)), [counted(pair[1], value) for value in rows])
            axes.set(
                xlim=(-0.5, len(columns) - 0.5),
                ylim=(-0.5, len(rows) - 0.5),
                xlabel=AXES[pair[0]],
                ylabel=AXES[pair[1]],
            )
            axes.tick_params(length=0)
            axes.set_title(f"fastest, {kind}", loc="left")
        about = (
            "in a square: its time, and how many times longer the next one takes; two colours: a tie within the spread"
        )
        figure.supxlabel(about, fontsize=7)
    return path


EXPERIMENT = Experiment(
    "crossover", "Crossover: which structure is the fastest where",
    {
        "quick": sweeps(
            small(128, ("balls-10k",), STRONGEST, 1.0, most=5, rounds=2), ("1k", "10k", "100k"), "10k", (64, 128, 256),
            (0, 1, 4), (10, 100), ("1k", "10k", "100k"), (0, 60),
        ),
        "short": sweeps(
            large(("balls-100k",), FEW, 4.5, most=10, deviation=0.02, stage_samples=1, timeout_s=120.0),
            ("1k", "10k", "100k", "1m"), "100k", (256, 1024, 2048), (0, 4, 16), (10, 100), ("1k", "100k", "1m"), (0, 60),
            ROOMS,
        ),
        "paper": sweeps(
            large(
                ("balls-100k",), STRONGEST, 4.5, deviation=0.01, stage_samples=1, timeout_s=300.0, memory=24 << 30
            ),
            ("1k", "10k", "100k", "1m", "10m"), "100k", (256, 512, 1024, 2048, 4096), (0, 1, 2, 4, 8, 16, 32, 64),
            (1, 3, 10, 30, 100), ("1k", "10k", "100k", "1m"), (0, 10, 30, 60, 100), ROOMS,
        ),
        "rooms": large(
            ROOMS, FEW, samples=3, deviation=0.01, stage_samples=0, timeout_s=300.0, lightings=lights(1, 2, 4, 8, 16, 32, 64)
        ),
    },
    draw,
)  # fmt: skip
