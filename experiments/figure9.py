"""Figure 9 of the paper: its test scenes, traced with shadows by its own method; of an animation its middle frame."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..harness.report import document, gallery
from ..harness.report import paper_table1 as paper
from ..harness.runner.experiment import Entry, Experiment, Preset
from ._paper import METHOD, SCENES

if TYPE_CHECKING:
    pass

METHODS = (Entry(METHOD),)


COLUMNS = [*document.COMMON, "paper_triangles", "triangles_to_paper"]


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """The gallery, CSV, and triangle counts beside the paper's."""
    import pandas as pd

    table = document.read(folder)
    table["paper_triangles"] = table["scene"].map({scene: paper_triangles(scene) for scene in paper.ROWS})
    table["triangles_to_paper"] = table["triangles"] / table["paper_triangles"]
    files = [document.write_csv(table, folder / "figure9.csv", COLUMNS)]
    scenes = table.drop_duplicates("scene")
    stand_ins = scenes["stand_in"].notna() & (scenes["stand_in"] != "")
    known = scenes[scenes["paper_triangles"].notna()]
    about = f"Figure 9: {len(scenes)} test scenes, {int(stand_ins.sum())} of them stand-ins"
    files += gallery.draw(folder, scenes, f"{about}; {document.where(table)}")
    share = (known["triangles_to_paper"] - 1).abs().max()
    shown = pd.DataFrame({
        "scene": scenes["title"], "triangles": scenes["triangles"].map("{:,.0f}".format, na_action="ignore"),
        "the paper's": scenes["paper_triangles"].map("{:,.0f}".format, na_action="ignore"),
        "share": scenes["triangles_to_paper"].map("{:.1%}".format, na_action="ignore"), "made as": scenes["stand_in"],
    })  # fmt: skip
    finding = f"{about}; {len(known)} of the paper's {len(paper.ROWS)}"
    finding += f", with its number of triangles within {share:.1%}." * bool(len(known)) or "."
    return document.write(
        folder, "figure9", EXPERIMENT.title, finding, {"Scenes": shown}, files, table, quiet
    )


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
