"""A moving light: time of each frame along its path, a panel a scene, a line a method; and what a slow place costs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...harness.frame.passes import PARTS
from ...harness.report import points, style
from ...harness.report.sheet import title_of
from ...harness.results.statistics import part_ms

SPIKE = 1.5
"""A place is slow where its frame takes so many times the median of the path: the text says what was done there."""

WORK = {
    "tests a shadow ray": ("shadow tests a hundred rays", 0.01),
    "tiles with rays": ("light 0 tiles with rays", 1.0),
    "most rays in a tile": ("light 0 most rays in a tile", 1.0),
    "longest list": ("light 0 list, longest", 1.0),
    "pairs of the light": ("light 0 pairs", 1.0),
}
"""What explains a slow place: what it is called, the work counter, and what that is multiplied by."""

COLUMNS = [
    *points.COMMON, "frame", "turn", "frame_ms", "frame_iqr_ms", "frame_true_errors",
    *(f"frame_{part.replace(' ', '_')}_ms" for part in PARTS),
    *(name.replace(" ", "_") for name in WORK),
]  # fmt: skip


def draw(folder: Path | str, quiet: bool = False, order: Sequence[str] = ()) -> list[Path]:
    """CSV (one row a frame), a drawing, and text. ``order``: scenes, those that are not among them last."""
    folder = Path(folder)
    rows = points.rows(folder)
    rank = {scene: i for i, scene in enumerate(order)}
    rows.sort(key=lambda r: rank.get(r["scene"], len(rank)))  # stable: methods stay in their order
    table = [step for r in points.measured(rows) for step in steps(r)]
    files = [points.write_csv(table, folder / "moving.csv", COLUMNS)]
    if table:
        files.append(picture(points.measured(rows), folder / "moving.svg"))
    sentences = [sentence(r) for r in points.measured(rows)]
    sentences.append(
        "The paper moves its lights too, and says that everything is rebuilt each frame; it shows no path."
    )
    return points.report(
        folder, "moving", "A moving light: time along its path", sentences, files, rows, quiet
    )


def steps(r: dict[str, Any]) -> list[dict[str, Any]]:
    """A row a frame: where the light is on its path, in turns, and the frame's median time."""
    last = max(1, (r["record"]["scene"].get("frame_count") or 1) - 1)
    made = []
    for frame in r["record"]["frames"]:
        if frame["total_ms"]:
            low, middle, high = np.percentile(frame["total_ms"], [25, 50, 75])
            turn = frame["frame"] / last * (r["light_turns"] or 0.0)
            made.append({**r, "frame": frame["frame"], "turn": turn, "frame_ms": float(middle)})
            made[-1]["frame_iqr_ms"] = float(high - low)
            made[-1]["frame_true_errors"] = (frame.get("score") or {}).get("true_errors")
            made[-1].update({f"frame_{part.replace(' ', '_')}_ms": part_ms(frame, part) for part in PARTS})
            counted = frame.get("counters") or {}
            for name, (counter, scale) in WORK.items():
                known = counted.get(counter)
                made[-1][name.replace(" ", "_")] = None if known is None else known * scale
    return made


def sentence(r: dict[str, Any]) -> str:
    """Range of the times along the path, and why the slowest is slow where it is."""
    line = steps(r)
    times = [step["frame_ms"] for step in line]
    share = max(times) / min(times) - 1
    planned = len(r["record"]["scene"].get("frames") or ())
    left_out = f", of {planned}: the others were beyond the budget" if planned > len(times) else ""
    return (
        f"{title_of(r)}, {r['label']}: {style.number(min(times))} to {style.number(max(times))} ms over "
        f"{len(times)} places of the light (slowest {share:+.0%} over fastest{left_out}).{spike(line)}"
    )


def spike(line: Sequence[dict[str, Any]]) -> str:
    """What was done more at the slowest place of a path, beside the median over its places; "" where none is slow."""
    slow = max(line, key=lambda step: step["frame_ms"])

    def usual(key: str) -> float:
        return float(np.median([step[key] for step in line]))

    if slow["frame_ms"] < SPIKE * usual("frame_ms"):
        return ""
    parts = {part: f"frame_{part.replace(' ', '_')}_ms" for part in PARTS}
    more = {part: slow[key] - usual(key) for part, key in parts.items()}
    part = max(more, key=lambda name: more[name])
    text = (
        f" Slowest at {slow['turn']:.2f} turns, {slow['frame_ms'] / usual('frame_ms'):.1f} times the median of the path: "
        f"{part} took {style.number(slow[parts[part]])} ms there and {style.number(usual(parts[part]))} at the median"
    )
    keys = {name: name.replace(" ", "_") for name in WORK}
    counted = {name: key for name, key in keys.items() if all(step[key] is not None for step in line)}
    if not counted:
        return f"{text}; its work was not counted."
    told = [f"{name} {slow[key]:,.0f} (median {usual(key):,.0f})" for name, key in counted.items()]
    text += f"; {', '.join(told)}."
    tiles, tests = keys["tiles with rays"], keys["tests a shadow ray"]
    known = {tiles, tests} <= set(counted.values())
    if known and slow[tiles] < usual(tiles) and slow[tests] > SPIKE * usual(tests):
        text += (
            " The rays crowd into fewer tiles with longer lists, as where the light stands amid what is seen and the one "
            "rectangle around all rays has coarse tiles."
        )
    return text


def picture(rows: Sequence[dict[str, Any]], path: Path) -> Path:
    """One panel a scene; whiskers are the interquartile range of repeats."""
    import matplotlib
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    scenes = list(dict.fromkeys(r["scene"] for r in rows))
    labels = list(dict.fromkeys(r["label"] for r in rows))
    colours = style.colours(r["method"] for r in rows)
    down = -(-len(scenes) // 2)
    across = min(2, len(scenes))
    erring = 0
    with matplotlib.rc_context(points.sheet_style()):
        figure = Figure(figsize=(style.COLUMN_WIDTH, 1.25 * down + 0.9), layout="constrained")
        grid = figure.subplots(down, across, squeeze=False, sharex=True).ravel()
        for axes, scene in zip(grid, scenes, strict=False):
            for r in (r for r in rows if r["scene"] == scene):
                line, place = steps(r), labels.index(r["label"])
                axes.errorbar(
                    [s["turn"] for s in line], [s["frame_ms"] for s in line],
                    yerr=[s["frame_iqr_ms"] / 2 for s in line], color=colours[r["method"]],
                    marker=points.MARKERS[place % 8], ms=2.5, elinewidth=0.6,
                )  # fmt: skip
                wrong = [step for step in line if step["frame_true_errors"]]
                erring += len(wrong)
                axes.plot(
                    [s["turn"] for s in wrong], [s["frame_ms"] for s in wrong], color="black", marker="x", ls="", ms=5,
                    mew=0.9,
                )  # fmt: skip
                axes.set_title(title_of(r), fontsize=6.5)
            axes.set_ylim(bottom=0)
        for i, axes in enumerate(grid):
            axes.set_visible(i < len(scenes))
            # The lowest panel that is seen of a column has the numbers.
            axes.tick_params(labelbottom=i + across >= len(scenes))
        figure.supxlabel("turns of the light about the scene", fontsize=7)
        figure.supylabel("ms a frame, everything rebuilt", fontsize=7)
        handles, names = _handles(rows, labels, colours), list(labels)
        if erring:
            handles.append(Line2D([], [], color="black", marker="x", ls="", ms=5, mew=0.9))
            names.append("a frame with wrong answers")
        figure.legend(handles, names, loc="outside upper center", ncols=2, frameon=False)
        return points.save(figure, path)


def _handles(rows: Sequence[dict[str, Any]], labels: Sequence[str], colours: dict[str, str]) -> list[Any]:
    from matplotlib.lines import Line2D

    method = {r["label"]: r["method"] for r in rows}
    return [
        Line2D([], [], color=colours[method[x]], marker=points.MARKERS[i % 8], ms=3, lw=1.1)
        for i, x in enumerate(labels)
    ]
