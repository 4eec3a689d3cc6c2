"""Figure 10: a frame's stages, stacked, a bar a scene; primary and shadow rays in two families of colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...harness.report import points, style
from ...harness.report.sheet import title_of

PRIMARY, SHADOW = "#0072B2", "#D55E00"


@dataclass(frozen=True)
class Stage:
    """Passes that are counted together: those of ``part`` whose names match ``pattern``.

    ``of`` is "primary" or "shadow"; ``light`` how far the family's colour is mixed with white.
    """

    key: str
    title: str
    part: str
    pattern: str
    of: str
    light: float

    @property
    def colour(self) -> tuple[float, float, float]:
        return style.lightened(PRIMARY if self.of == "primary" else SHADOW, self.light)


def draw(folder: Path | str, quiet: bool, stages: Sequence[Stage], rearrangement: str) -> list[Path]:
    """CSV, drawing and text. ``rearrangement``: key of the stage that the paper says no model changes.

    The largest size is drawn; the text holds the smallest against it.
    """
    folder = Path(folder)
    rows = points.rows(folder)
    done = points.measured(rows)
    for r in done:
        add(r, stages)
    columns = [*points.COMMON, *(f"{s.key}_ms" for s in stages), "other_ms", "shadow_rays"]
    files = [points.write_csv(rows, folder / "figure10.csv", columns)]
    widest = [r for r in done if r["width"] == max(x["width"] for x in done)]
    if widest:
        files.append(picture(widest, stages, folder / "figure10.svg"))
    title = "Figure 10: time of each stage of a frame"
    sentences = spread_sentences(widest, stages, rearrangement) + size_sentences(done, stages, rearrangement)
    return points.report(folder, "figure10", title, sentences, files, rows, quiet)


def add(r: dict[str, Any], stages: Sequence[Stage]) -> dict[str, Any]:
    """The row, with the stages' times in ms, what no stage holds, and the number of shadow rays."""
    for stage in stages:
        r[f"{stage.key}_ms"] = points.pass_ms(r["record"], stage.part, stage.pattern)
    parts = sum(
        points.pass_ms(r["record"], part) or 0.0 for part in ("build", "trace", "light build", "shadow")
    )
    # Sums of the same numbers in another order: what differs by a rounding is nothing, and never minus zero.
    r["other_ms"] = round(parts - sum(r[f"{s.key}_ms"] for s in stages), 9) + 0.0
    r["shadow_rays"] = (
        sum(v for k, v in r["counters"].items() if k.startswith("light ") and k.endswith(" rays")) or None
    )
    return r


def variation(values: Sequence[float]) -> float:
    """Coefficient of variation: standard deviation over mean."""
    return float(np.std(values) / np.mean(values)) if len(values) and np.mean(values) > 0 else 0.0


def spread_sentences(
    rows: Sequence[dict[str, Any]], stages: Sequence[Stage], rearrangement: str
) -> list[str]:
    """How much each stage varies over the scenes; whether rearrangement is "the same for all models"."""
    if len({r["scene"] for r in rows}) < 2:
        return ["One scene alone does not say how the stages depend on the model."]
    vary = {s.key: variation([r[f"{s.key}_ms"] for r in rows]) for s in stages}
    (own,) = [s for s in stages if s.key == rearrangement]
    values = [r[f"{own.key}_ms"] for r in rows]
    others = ", ".join(f"{s.title} {vary[s.key]:.0%}" for s in stages if s is not own)
    verdict = (
        "holds" if vary[own.key] <= 0.15 else "holds roughly" if vary[own.key] <= 0.35 else "does not hold"
    )
    sentences = [
        f"Rearrangement takes {style.number(min(values))} to {style.number(max(values))} ms over "
        f"{len(rows)} scenes; its coefficient of variation is {vary[own.key]:.0%} ({others}). The paper's "
        f'"more or less the same for all models" {verdict} here.'
    ]
    if all(r["shadow_rays"] for r in rows):
        each = variation([r[f"{own.key}_ms"] / r["shadow_rays"] for r in rows])
        rays = [r["shadow_rays"] for r in rows]
        sentences.append(
            f"The scenes have {min(rays):,.0f} to {max(rays):,.0f} shadow rays; per shadow ray rearrangement varies "
            f"by {each:.0%}."
        )
    slower = [r for r in rows if (r["shadow_ms"] or 0) > (r["trace_ms"] or 0)]
    sentences.append(
        f"Shadow rays (rearrangement and traversal) take longer than primary traversal on {len(slower)} of {len(rows)} "
        f"scenes; the paper: almost always."
    )
    return sentences


def growth(
    rows: Sequence[dict[str, Any]], column: str, stages: Sequence[Stage]
) -> tuple[dict[str, float], tuple[dict[str, Any], dict[str, Any]] | None]:
    """A column's value at the largest size over that at the smallest, by scene; and rows of the two sizes.

    Over the frames that a scene has at both.
    """
    rows = sorted(rows, key=lambda r: r["width"])
    if not rows or rows[0]["width"] == rows[-1]["width"]:
        return {}, None
    low, high = ({r["scene"]: r for r in rows if r["width"] == end["width"]} for end in (rows[0], rows[-1]))
    found = {}
    for scene in low:
        common = set(low[scene]["frame_numbers"]) & set(high.get(scene, {}).get("frame_numbers", ()))
        if common:
            small, large = (add(points.of_frames(r[scene], common), stages)[column] for r in (low, high))
            if small:
                found[scene] = large / small
    return found, (rows[0], rows[-1])


def size_sentences(rows: Sequence[dict[str, Any]], stages: Sequence[Stage], rearrangement: str) -> list[str]:
    """How rearrangement and the other stages grow from the smallest size to the largest, over the scenes."""
    grown = {s.key: growth(rows, f"{s.key}_ms", stages) for s in stages}
    own, ends = grown[rearrangement]
    if ends is None or not own:
        return []
    means = {
        s.title: float(np.exp(np.mean(np.log(list(grown[s.key][0].values())))))
        for s in stages
        if grown[s.key][0]
    }
    (title,) = (s.title for s in stages if s.key == rearrangement)
    others = ", ".join(f"{name} {mean:.1f}" for name, mean in means.items() if name != title)
    small, large = ends
    pixels = large["width"] * large["height"] / (small["width"] * small["height"])
    return [
        f"From {small['width']}x{small['height']} to {large['width']}x{large['height']}, {pixels:.0f} times the pixels, "
        f"{title} takes {means[title]:.1f} times as long (geometric mean of {len(own)} scenes, same frames; {others}). "
        f"The paper: it depends on the resolution."
    ]


def picture(rows: Sequence[dict[str, Any]], stages: Sequence[Stage], path: Path) -> Path:
    """One stacked bar a row; the number at its end is the whole frame's median, measured apart."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(style.axes_style()):
        figure = Figure(figsize=(style.COLUMN_WIDTH, 0.26 * len(rows) + 1.25), layout="constrained")
        axes = figure.subplots()
        # Stages are measured apart: on a busy machine they may add up to more than the whole frame.
        widest = 0.0
        for place, r in enumerate(rows):
            left = 0.0
            for stage in stages:
                width = max(0.0, r[f"{stage.key}_ms"])
                axes.barh(place, width, left=left, height=0.7, color=stage.colour, edgecolor="#444444", linewidth=0.3,
                          label=stage.title if place == 0 else None)  # fmt: skip
                left += width
            widest = max(widest, left, r["total_ms"])
            axes.text(
                max(left, r["total_ms"]) * 1.01,
                place,
                " " + style.number(r["total_ms"]),
                va="center",
                fontsize=6,
            )
        labels = dict.fromkeys(r["label"] for r in rows)
        names = [title_of(r) if len(labels) == 1 else f"{title_of(r)}, {r['label']}" for r in rows]
        axes.set_yticks(range(len(rows)), names)
        axes.set_ylim(len(rows) - 0.4, -0.6)
        axes.set_xlim(0, widest * 1.2)
        axes.set_xlabel("ms a frame; number: the whole frame")
        figure.legend(loc="outside upper center", ncols=2, frameon=False, handlelength=1.2, columnspacing=1.0)
        return points.save(figure, path)
