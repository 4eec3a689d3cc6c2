"""Time against the number of lights, a line a method; and frames a second with two of them, beside the paper's."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...harness.report import points, style
from ...harness.report.sheet import title_of

PAPER_FRAMES = {"the paper's method": 7.6, "its kd-tree peer [HSZ*09]": 5.26}
"""Frames a second on Fairy with two lights (section 5): GTX 280, 1024x1024."""

COLUMNS = [*points.COMMON, "frames_per_s", "ms_per_light", "further_ms", "further_over_first", "shadow_rays"]
LIGHTS_MS = ("light_build_ms", "shadow_ms")


def draw(folder: Path | str, quiet: bool = False) -> list[Path]:
    """CSV, a drawing a scene, and text."""
    folder = Path(folder)
    rows = points.rows(folder)
    for r in points.measured(rows):
        r["frames_per_s"] = 1000.0 / r["total_ms"]
        r["ms_per_light"] = light_ms(r) / r["light_count"]
        r["shadow_rays"] = r["record"]["frames"][-1].get("shadow_rays")
    files: list[Path] = []
    sentences = []
    for scene in dict.fromkeys(r["scene"] for r in points.measured(rows)):
        own = [r for r in points.measured(rows) if r["scene"] == scene]
        for line in lines(own):
            add_further(line)
        files.append(picture(own, folder / f"two_lights-{scene}.svg"))
        sentences += [text for line in lines(own) for text in [sentence(line)] if text]
    sentences.append(
        "The paper: Fairy with two lights at 7.6 frames a second against 5.26 of its kd-tree peer; with one light "
        "82.18 ms, so that the second light added about 49 ms (60 %)."
    )
    files.insert(0, points.write_csv(rows, folder / "two_lights.csv", COLUMNS))
    title = "Several lights: time against their number"
    return points.report(folder, "two_lights", title, sentences, files, rows, quiet)


def lines(rows: Sequence[dict[str, Any]]) -> list[list[dict[str, Any]]]:
    """The rows of each method, fewest lights first."""
    labels = dict.fromkeys(r["label"] for r in rows)
    return [sorted((r for r in rows if r["label"] == x), key=lambda r: r["light_count"]) for x in labels]


def add_further(line: Sequence[dict[str, Any]]) -> None:
    """Add to a method's rows what each light after the first adds, in ms and over what the first costs.

    A light costs its grid and its shadow rays: those passes are compared, with one light and with more. (Whole frames'
    differences would hold the noise of the build and of the primary rays, which can be more than a light.)
    """
    one = next((r for r in line if r["light_count"] == 1), None)
    if one is None:
        return
    first = light_ms(one)
    for r in line:
        if r["light_count"] > 1 and first:
            r["further_ms"] = (light_ms(r) - first) / (r["light_count"] - 1)
            r["further_over_first"] = r["further_ms"] / first


def light_ms(r: dict[str, Any]) -> float:
    """What all lights of a frame cost, ms."""
    return float(sum(r[key] for key in LIGHTS_MS))


def sentence(line: Sequence[dict[str, Any]]) -> str:
    """Two lights in frames a second, and what each further light costs relative to the first."""
    by_count = {r["light_count"]: r for r in line}
    parts = []
    if 2 in by_count:
        two = by_count[2]
        more = (
            f" ({two['total_ms'] / by_count[1]['total_ms'] - 1:+.0%} for the second light)"
            if 1 in by_count
            else ""
        )
        parts.append(
            f"two lights {style.number(two['total_ms'])} ms, {two['frames_per_s']:,.1f} frames a second{more}"
        )
    further = [r for r in line if r.get("further_over_first")]
    if further:
        each = ", ".join(f"{r['further_over_first']:.2f} (of {r['light_count']})" for r in further)
        one = by_count[1]
        parts.append(
            f"the first light costs {style.number(light_ms(one))} of {style.number(one['total_ms'])} ms; each further one, "
            f"over the first: {each}"
        )
    return f"{title_of(line[0])}, {line[0]['label']}: {'; '.join(parts) or 'one number of lights alone'}."


def picture(rows: Sequence[dict[str, Any]], path: Path) -> Path:
    """Time against number of lights, both logarithmic."""
    import matplotlib
    from matplotlib.figure import Figure

    colours = style.colours(r["method"] for r in rows)
    with matplotlib.rc_context(points.sheet_style()):
        figure = Figure(figsize=(style.COLUMN_WIDTH, 2.7), layout="constrained")
        axes = figure.subplots()
        drawn: list[str] = []
        for place, line in enumerate(lines(rows)):
            # A method keeps its colour; its second configuration is dashed.
            dashes = ("-", "--", ":", "-.")[drawn.count(line[0]["method"]) % 4]
            drawn.append(line[0]["method"])
            axes.errorbar(
                [r["light_count"] for r in line], [r["total_ms"] for r in line],
                yerr=[r["iqr_ms"] / 2 for r in line], color=colours[line[0]["method"]],
                marker=points.MARKERS[place % 8], label=line[0]["label"], elinewidth=0.7, ls=dashes,
            )  # fmt: skip
        counts = points.in_order(r["light_count"] for r in rows)
        axes.set_xscale("log", base=2)
        style.plain_log(axes)
        axes.set_xticks(counts, [str(n) for n in counts])
        axes.set_xlabel("number of lights")
        axes.set_ylabel("ms a frame, everything rebuilt")
        axes.set_title(title_of(rows[0]), loc="left")
        figure.legend(loc="outside upper center", ncols=2, frameon=False)
        return points.save(figure, path)
