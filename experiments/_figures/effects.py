"""What each effect costs, alone and together, and what a frame costs by what moved since the last one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...harness.frame.passes import BUILD_PARTS
from ...harness.report import points, style
from ...harness.report.sheet import title_of
from ...harness.scene.overrides import MOVED

COLUMNS = [
    *points.COMMON,
    "moved",
    "ratio",
    "added_ms",
    "added_iqr_ms",
    "passes",
    "builds",
    "memory_bytes",
    "compile_s",
]
NEVER = 1e-3
"""Milliseconds below which a frame did nothing."""


def draw(folder: Path | str, quiet: bool, base: str, order: Sequence[str]) -> list[Path]:
    """CSV, two drawings and text. ``base``: label of the frame that effects are compared with; ``order``: of labels."""
    folder = Path(folder)
    rows = points.rows(folder)
    rank = {label: k for k, label in enumerate(order)}
    rows.sort(key=lambda r: rank.get(r["light_label"], len(rank)))  # stable: methods stay in their order
    add(rows, base)
    files = [points.write_csv(rows, folder / "effects.csv", COLUMNS)]
    done = points.measured(rows)
    effects = [r for r in done if r["moved"] is None and r.get("ratio")]
    moved = [r for r in done if r["moved"] is not None]
    if effects:
        files.append(effects_picture(effects, base, folder / "effects.svg"))
    if moved:
        files.append(moved_picture(moved, folder / "effects-moved.svg"))
    title = "What each effect costs, and what a frame costs by what moved"
    sentences = [*effect_sentences(effects, base, again(moved)), *moved_sentences(moved)]
    return points.report(folder, "effects", title, sentences, files, rows, quiet)


def add(rows: Sequence[dict[str, Any]], base: str) -> None:
    """Add to each row what moved, its passes, and its time against ``base`` of the same method and scene."""
    known = {(r["scene"], r["label"]): r for r in points.measured(rows) if r["light_label"] == base}
    for r in rows:
        record = r["record"]
        r["moved"] = (record["scene"].get("lighting") or {}).get("moved")
        frames = [f for f in record["frames"] if f["total_ms"]]
        if frames:
            r["passes"] = len(frames[-1]["passes"])
            r["builds"] = sum(step["part"] in BUILD_PARTS for step in frames[-1]["passes"])
        first = known.get((r["scene"], r["label"]))
        if first and r.get("total_ms") is not None:
            r["ratio"] = r["total_ms"] / first["total_ms"]
            r["added_ms"] = r["total_ms"] - first["total_ms"]
            # Half of each range, as one reads an error bar; the range between rounds where it is larger.
            spreads = [max(x["iqr_ms"], x["between_ms"]) / 2 for x in (r, first)]
            # One sample says nothing of its own spread.
            r["added_iqr_ms"] = float(np.hypot(*spreads)) if min(r["samples"], first["samples"]) > 1 else None


def again(moved: Sequence[dict[str, Any]]) -> dict[tuple[str, str], float]:
    """Of each scene and method the frame in which all moved, ms: the work of the base frame, measured another time."""
    return {(r["scene"], r["label"]): r["total_ms"] for r in moved if r["moved"] == "all"}


def effect_sentences(
    rows: Sequence[dict[str, Any]], base: str, repeated: dict[tuple[str, str], float]
) -> list[str]:
    """For each scene and method what the effects add to the frame ``base``; ``repeated``: see :func:`again`."""
    if not rows:
        return ["No effect was measured."]
    result = [
        f"Milliseconds that each effect adds to the frame of {base}, everything rebuilt, +- the spread of the two "
        "(times its frame time). Effects are measured one after another, not interleaved: what another program on the "
        "machine did meanwhile is in the differences, and not in the spread. Two hints of how much that is: the same frame "
        "measured once more, as the one in which all moved, and frames that take longer without shadows."
    ]
    for scene, label in dict.fromkeys((r["scene"], r["label"]) for r in rows):
        own = [r for r in rows if (r["scene"], r["label"]) == (scene, label)]
        first = next(r for r in own if r["light_label"] == base)
        parts = [
            f"{r['light_label']} {r['added_ms']:+.3g} {spread_of(r)} (x{r['ratio']:.2f})"
            for r in own
            if r is not first
        ]
        if parts:
            time = repeated.get((scene, label))
            once_more = f" (once more {style.number(time)})" if time else ""
            head = f"{title_of(first)}, {label}, {style.number(first['total_ms'])} ms{once_more}: "
            result.append(head + "; ".join(parts) + ".")
    return result


def spread_of(row: dict[str, Any]) -> str:
    """The spread of what an effect adds, as it is printed."""
    return "(one sample)" if row["added_iqr_ms"] is None else f"+- {row['added_iqr_ms']:.2g}"


def moved_sentences(rows: Sequence[dict[str, Any]]) -> list[str]:
    """For each scene and method the frame by what moved, and how many builds it launched."""
    if not rows:
        return []
    result = [
        "A frame by what alone moved since the last one, in ms (passes that build structures). What moves is told by its "
        "inputs: to methods that do not know parts of a mesh, a part that moves is all of it."
    ]
    for scene, label in dict.fromkeys((r["scene"], r["label"]) for r in rows):
        own = {r["moved"]: r for r in rows if (r["scene"], r["label"]) == (scene, label)}
        parts = []
        for moved in MOVED:
            if moved in own:
                time = own[moved]["total_ms"]
                shown = style.number(time) if own[moved]["passes"] else "no launch"
                shown += " (one sample)" if own[moved]["samples"] == 1 else ""
                parts.append(f"{moved}: {shown} ({own[moved]['builds']})")
        result.append(f"{title_of(next(iter(own.values())))}, {label}: {', '.join(parts)}.")
    return result


def effects_picture(rows: Sequence[dict[str, Any]], base: str, path: Path) -> Path:
    """A line an effect, a mark a method: time over that of ``base``. A panel a scene."""
    import matplotlib
    from matplotlib.figure import Figure

    effects = [x for x in dict.fromkeys(r["light_label"] for r in rows) if x != base]
    scenes = list(dict.fromkeys(r["scene"] for r in rows))
    labels = list(dict.fromkeys(r["label"] for r in rows))
    methods = {r["label"]: r["method"] for r in rows}
    colours = style.colours(methods.values())
    size = (style.COLUMN_WIDTH * max(1.0, 0.45 + 0.55 * len(scenes)), 0.27 * len(effects) + 1.35)
    with matplotlib.rc_context({**points.sheet_style(), "axes.grid.axis": "both"}):
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(1, len(scenes), sharey=True, sharex=True, squeeze=False)[0]
        for axes, scene in zip(panels, scenes, strict=True):
            axes.axvline(1.0, color="#444444", lw=0.8)
            for k, label in enumerate(labels):
                own = [
                    r for r in rows if (r["scene"], r["label"]) == (scene, label) and r["light_label"] != base
                ]
                shift = (k - (len(labels) - 1) / 2) * 0.11
                axes.plot(
                    [r["ratio"] for r in own], [effects.index(r["light_label"]) + shift for r in own], ls="none",
                    marker=points.MARKERS[k % 8], ms=3.6, label=label, color=colours[methods[label]],
                    mfc=None if first_of(label, methods) else "white",
                )  # fmt: skip
            axes.set_xscale("log", base=2)
            axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
            axes.set_title(title_of(next(r for r in rows if r["scene"] == scene)), loc="left")
        panels[0].set_yticks(range(len(effects)), effects)
        panels[0].set_ylim(len(effects) - 0.5, -0.5)
        figure.supxlabel(f"frame time over that of {base}", fontsize=8)
        handles, names = panels[0].get_legend_handles_labels()
        figure.legend(
            handles, names, loc="outside upper center", ncols=2 if len(scenes) < 2 else 3, frameon=False
        )
        return points.save(figure, path)


def moved_picture(rows: Sequence[dict[str, Any]], path: Path) -> Path:
    """Time of a frame against what moved, a line a method; a panel a scene. Nothing moved: nothing is launched."""
    import matplotlib
    from matplotlib.figure import Figure

    scenes = list(dict.fromkeys(r["scene"] for r in rows))
    labels = list(dict.fromkeys(r["label"] for r in rows))
    methods = {r["label"]: r["method"] for r in rows}
    colours = style.colours(methods.values())
    kinds = [x for x in MOVED if any(r["moved"] == x and r["passes"] for r in rows)]
    idle = all(not r["passes"] for r in rows if r["moved"] == "nothing")
    size = (style.COLUMN_WIDTH * max(1.0, 0.25 + 0.6 * len(scenes)), 2.7)
    with matplotlib.rc_context(points.sheet_style()):
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(1, len(scenes), sharey=True, squeeze=False)[0]
        for axes, scene in zip(panels, scenes, strict=True):
            for k, label in enumerate(labels):
                own = {r["moved"]: r for r in rows if (r["scene"], r["label"]) == (scene, label)}
                seen = [x for x in kinds if x in own and own[x]["total_ms"] > NEVER]
                axes.errorbar(
                    [kinds.index(x) for x in seen], [own[x]["total_ms"] for x in seen],
                    yerr=[own[x]["iqr_ms"] / 2 for x in seen], marker=points.MARKERS[k % 8], label=label,
                    elinewidth=0.7, color=colours[methods[label]], ls="-" if first_of(label, methods) else "--",
                    mfc=None if first_of(label, methods) else "white",
                )  # fmt: skip
            style.plain_log(axes)
            axes.set_xticks(range(len(kinds)), kinds)
            axes.set_xlim(-0.3, len(kinds) - 0.7)
            axes.set_title(title_of(next(r for r in rows if r["scene"] == scene)), loc="left")
        panels[0].set_ylabel("ms a frame")
        note = "\n(nothing moved: no kernel is launched)" if idle else ""
        figure.supxlabel(f"what moved since the last frame{note}", fontsize=8)
        handles, names = panels[0].get_legend_handles_labels()
        figure.legend(
            handles, names, loc="outside upper center", ncols=2 if len(scenes) < 2 else 3, frameon=False
        )
        return points.save(figure, path)


def first_of(label: str, methods: dict[str, str]) -> bool:
    """Whether a label is the first of its method: a second configuration keeps the colour and is drawn hollow."""
    return next(x for x in methods if methods[x] == methods[label]) == label
