"""Table 1 of the paper, exactly as printed, with its hardware, sources and footnotes. Nothing is scored against it.
Guntury and Narayanan 2010, "Ray Tracing Dynamic Scenes with Shadows on the GPU": milliseconds. An entry "a / b" is
build / traversal and tracing of primary rays; the last column is all steps up to the shadow bits.
"""

from collections.abc import Iterable
from typing import NamedTuple

from .dataframe import DataFrame, pd

GPU = "GTX 280"
SIZE = (1024, 1024)
LABEL = f"paper, {GPU}, {SIZE[0]}x{SIZE[1]}"


COLUMNS = {  # where the numbers of each printed column come from
    "HBVH": "[LGS*09] Lauterbach et al. 2009, Fast BVH construction on GPUs",
    "kd-tree": "[HSZ*09] Hou et al. 2009, Memory-scalable GPU spatial hierarchy construction",
    "Grid": "[KS09] Kalojanov and Slusallek 2009, A parallel algorithm for uniform grids",
    "Our Method": "the paper, primary rays",
    "With Shadows": "the paper, all steps till shadow computation",
}


class Row(NamedTuple):
    """A printed row. ``triangles`` and ``cells`` are the printed text, in the order of :data:`COLUMNS`."""

    title: str
    triangles: str
    cells: tuple[str, str, str, str, str]


ROWS = {
    "fairy": Row("Fairy", "174k", ("124 / 33.11", "65 / 125 [#]", "24 / 285.7", "8.73 / 32.43", "82.18 ms")),
    "sibenik": Row("Sibenik", "82k", ("30 / 45.32", "n/a", "n/a", "8.86 / 13.11", "58.81 ms")),
    "bunny_dragon": Row("Bunny/Dragon", "252k", ("66 / 128.94", "93 / 25", "13 / 129.87", "3.71 / 10.92", "31.63 ms")),
    "conference": Row("Conference", "284k", ("105 / 37.11", "n/a", "27 / 142.85", "7.51 / 17.64", "61.15 ms")),
    "cloth": Row("Cloth", "92k", ("39 / n/a*", "n/a", "n/a", "5.23 / 11.23", "44.47 ms")),
    "buddha": Row("Buddha", "1.09M", ("n/a", "n/a", "n/a", "13.76 / 38.91", "114.57 ms")),
}  # fmt: skip
"""By the catalogue's scene name, in the printed order. Only the last column is printed with its unit; all are ms."""

FOOTNOTES = (
    "[#] Fairy in kd-tree was rendered with two lights and shadows.",
    "* Cloth model in BVH was rendered at 14 fps with shadows.",
    "Our times don't include time to shade or the time taken for the costly transfers of data from host to GPU.",
)


def entries(scenes: Iterable[str]) -> DataFrame:
    """A row per printed entry of these scenes, in the columns of Table 1's CSV: ``printed``, and the times in that text."""
    found = [
        (scene, ROWS[scene].title, *column, printed)
        for scene in scenes
        if scene in ROWS
        for column, printed in zip(COLUMNS.items(), ROWS[scene].cells, strict=True)
    ]
    table = pd.DataFrame(found, columns=["scene", "scene_title", "method", "label", "printed"])
    pattern = r"^(?P<build_ms>[\d.]+) / (?P<trace_ms>[\d.]+)?|^(?P<total_ms>[\d.]+) ms"
    times = table["printed"].str.extract(pattern).astype(float)
    return table.join(times).assign(
        origin=LABEL, device_name=f"NVIDIA {GPU}", width=SIZE[0], height=SIZE[1], unscored="the paper states no errors",
        status=times.notna().any(axis=1).map({True: "printed", False: "n/a"}),
        reason="printed as '" + table["printed"] + "'",
    )  # fmt: skip
