"""Figure 9 of the paper: its test scenes, traced with shadows by its own method; of an animation its middle frame."""

from pathlib import Path

import numpy as np

from ..harness.errors import warn
from ..harness.report import document, panels
from ..harness.report import paper_table1 as paper
from ..harness.report.dataframe import DataFrame
from ..harness.report.picture import opened
from ..harness.results.folder import image_name
from ..harness.runner.planning.experiment import Entry, Experiment
from ._paper import METHOD, SCENES, large, small

METHODS = (Entry(METHOD),)

COLUMNS = [*document.COMMON, "paper_triangles", "triangles_to_paper"]


def gallery(folder: Path, points: DataFrame, title: str = "") -> list[Path]:
    """The pictures of the scenes of ``points``, in order, a sheet for each size; damaged ones are left out and named."""
    sheets, sizes = [], list(points.groupby(["width", "height"], sort=False))
    for (width, height), own in sizes:
        shown = []
        for scene in own["scene"].unique():
            file = folder / "images" / image_name(scene, "", width, height)
            if image := opened(file):
                image.thumbnail((704, 4 * 704))
                shown.append(("", np.asarray(image.convert("RGB"))))
            elif file.exists():
                warn(f"{file}: not a whole picture, left out; the same `shadowbench run` draws it again")
        name = "gallery.png" if len(sizes) == 1 else f"gallery-{width}x{height}.png"
        if shown:
            sheets.append(panels.images(folder / name, shown, across=3, below=title, wide=2, colours=256))
    return sheets


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """The gallery; as CSV the triangle counts beside the paper's, which it prints as "174k" or "1.09M"."""
    table, units = document.read(folder), {"k": 1e3, "M": 1e6}
    printed = {x: float(row.triangles[:-1]) * units[row.triangles[-1]] for x, row in paper.ROWS.items()}
    table["paper_triangles"] = table["scene"].map(printed)
    table["triangles_to_paper"] = table["triangles"] / table["paper_triangles"]
    scenes = table.drop_duplicates("scene")
    known = scenes["triangles_to_paper"].dropna()
    most = f"{(known - 1).abs().max():.1%}" if len(known) else "-"
    finding = (
        f"{len(known)} of the paper's {len(paper.ROWS)} scenes, each with its number of triangles within {most}; "
        f"of {len(scenes)} scenes {int((scenes['stand_in'] != '').sum())} are stand-ins."
    )
    method = table["method_title"].iloc[0]
    title = f"Figure 9: the test scenes with shadows, traced by {method}, {document.where(table)}"
    pictures = gallery(folder, scenes, title)
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, {}, pictures, quiet)


EXPERIMENT = Experiment(
    "figure9", "Figure 9: the test scenes",
    {
        "quick": small(384, SCENES, METHODS, 10.0, samples=1),
        "paper": large(SCENES, METHODS, 20.0, most=5, deviation=None, rounds=1),
    },
    draw,
)  # fmt: skip
