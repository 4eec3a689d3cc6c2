"""A sort's time against the bits of its keys, a line a number of pairs; and how much fewer bits save."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...harness.report import points, style
from .._sorting import SORT

COLUMNS = [*points.COMMON, "pairs", "bits", "sort_ms", "copy_ms", "ns_a_pair"]


def draw(folder: Path | str, quiet: bool, here: int) -> list[Path]:
    """CSV, a drawing and text. ``here``: the bits of the paper's keys."""
    folder = Path(folder)
    rows = sorted((add(r) for r in points.rows(folder)), key=lambda r: (r["width"], r["bits"]))
    files = [points.write_csv(rows, folder / "key_bits.csv", COLUMNS)]
    done = points.measured(rows)
    if done:
        files.append(picture(done, here, folder / "key_bits.svg"))
    title = "Key bits: what a sort costs by the bits of its keys"
    said = [sentence(line, here) for line in lines(done)]
    said.append(f"The paper: building is fast because a key has fewer than 32 bits, {here} in its case.")
    return points.report(folder, "key_bits", title, said, files, rows, quiet)


def add(r: dict[str, Any]) -> dict[str, Any]:
    """The row with its bits, its pairs, and the time of the sort alone."""
    record = r["record"]
    r["bits"], r["pairs"] = record["point"]["bits"], record["point"]["pairs"]
    r["sort_ms"] = points.pass_ms(record, "build", SORT)
    r["copy_ms"] = points.pass_ms(record, "build", "copy")
    r["ns_a_pair"] = None if r["sort_ms"] is None else 1e6 * r["sort_ms"] / r["pairs"]
    return r


def lines(rows: Sequence[dict[str, Any]]) -> list[list[dict[str, Any]]]:
    """The rows of each number of pairs, fewest bits first."""
    counts = points.in_order(r["pairs"] for r in rows)
    return [sorted((r for r in rows if r["pairs"] == n), key=lambda r: r["bits"]) for n in counts]


def sentence(line: Sequence[dict[str, Any]], here: int) -> str:
    """Every time, and that of the paper's bits over that of the most."""
    times = ", ".join(f"{style.number(r['sort_ms'])} ({r['bits']})" for r in line)
    text = f"{line[0]['pairs']:,} pairs, ms by bits of the key: {times}"
    own = [r for r in line if r["bits"] == here]
    if own and line[-1]["sort_ms"]:
        text += f"; {here} bits take {own[0]['sort_ms'] / line[-1]['sort_ms']:.2f} of the time of {line[-1]['bits']}"
    return text + "."


def picture(rows: Sequence[dict[str, Any]], here: int, path: Path) -> Path:
    """Nanoseconds a pair against bits; the paper's bits are marked."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(points.sheet_style()):
        figure = Figure(figsize=(style.COLUMN_WIDTH, 2.2), layout="constrained")
        axes = figure.subplots()
        for i, line in enumerate(lines(rows)):
            axes.plot([r["bits"] for r in line], [r["ns_a_pair"] for r in line], color=style.COLOURS[i % 8],
                      marker=points.MARKERS[i % 8], label=f"{line[0]['pairs']:,} pairs")  # fmt: skip
        axes.axvline(here, color="0.4", lw=0.8, ls=":", label=f"the paper's {here} bits")
        axes.set_xticks(points.in_order(r["bits"] for r in rows))
        axes.set_ylim(bottom=0)
        axes.set_xlabel("bits of the key")
        axes.set_ylabel("sort, ns a pair")
        figure.legend(loc="outside upper center", ncols=2, frameon=False)
        return points.save(figure, path)
