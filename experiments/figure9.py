"""Figure 9 of the paper: its test scenes, traced with shadows by its own method; of an animation its middle frame."""

from __future__ import annotations

from pathlib import Path

from ..harness.report import document, gallery
from ..harness.report import paper_table1 as paper
from ..harness.runner.experiment import Entry, Experiment, Preset
from ._paper import METHOD, SCENES

METHODS = (Entry(METHOD),)

COLUMNS = [*document.COMMON, "paper_triangles", "triangles_to_paper"]
HEADINGS: document.Columns = {
    "scene": ("title", str), "triangles": ("triangles", "{:,.0f}"), "the paper's": ("paper_triangles", "{:,.0f}"),
    "share": ("triangles_to_paper", "{:.1%}"), "made as": ("stand_in", str),
}  # fmt: skip


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """The gallery, CSV, and triangle counts beside the paper's."""
    table = document.read(folder)
    table["paper_triangles"] = table["scene"].map({scene: paper_triangles(scene) for scene in paper.ROWS})
    table["triangles_to_paper"] = table["triangles"] / table["paper_triangles"]
    scenes = table.drop_duplicates("scene")
    known = scenes["triangles_to_paper"].dropna()
    method = table["method_title"].iloc[0]
    pictures = gallery.draw(
        folder, scenes, f"Figure 9: the test scenes with shadows, traced by {method}, {document.where(table)}"
    )
    finding = f"{len(known)} of the paper's {len(paper.ROWS)} scenes"
    finding += f", each with its number of triangles within {(known - 1).abs().max():.1%}" * bool(len(known))
    finding += f"; of {len(scenes)} scenes {int((scenes['stand_in'] != '').sum())} are stand-ins."
    tables = {"Scenes": document.texts(scenes, HEADINGS)}
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, tables, pictures, quiet)


def paper_triangles(scene: str) -> float:
    """Triangles as the paper prints them, "174k" or "1.09M", as a number."""
    digits, unit = paper.ROWS[scene].triangles[:-1], paper.ROWS[scene].triangles[-1]
    return float(digits) * {"k": 1e3, "M": 1e6}[unit]


EXPERIMENT = Experiment(
    name="figure9",
    title="Figure 9: the test scenes",
    presets={
        "quick": Preset(
            384, 384, SCENES, METHODS, frames=1, samples=1, most=1, stage_samples=1, rounds=1, budget_s=10.0
        ),
        "paper": Preset(
            1024, 1024, SCENES, METHODS, frames=1, samples=5, most=5, stage_samples=2, rounds=1, budget_s=20.0,
            timeout_s=600.0,
        ),
    },
    draw=draw,
)  # fmt: skip
