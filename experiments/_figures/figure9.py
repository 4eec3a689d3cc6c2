"""Figure 9: the scenes with their shadows on one sheet, and their triangles beside the paper's."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...harness.report import gallery, points
from ...harness.report import paper_table1 as paper
from ...harness.report.sheet import title_of

COLUMNS = [*points.COMMON, "paper_triangles", "triangles_to_paper"]


def draw(folder: Path | str, quiet: bool = False) -> list[Path]:
    """Gallery, CSV and text from a folder's records and images."""
    folder = Path(folder)
    rows = points.rows(folder)
    for r in rows:
        r["paper_triangles"] = paper_triangles(r["scene"])
        if r["paper_triangles"] and r["triangles"]:
            r["triangles_to_paper"] = r["triangles"] / r["paper_triangles"]
    scenes = list(dict.fromkeys(r["scene"] for r in rows))
    files = [points.write_csv(rows, folder / "figure9.csv", COLUMNS)]
    files += gallery.draw(folder, scenes, f"The paper's scenes, {points.where(rows)}")
    title = "Figure 9: the scenes"
    return points.report(folder, "figure9", title, sentences(rows), files, rows, quiet)


def paper_triangles(scene: str) -> float | None:
    """Triangles as the paper prints them, "174k" or "1.09M"; None for a scene that it does not have."""
    if scene not in paper.ROWS:
        return None
    digits, unit = re.fullmatch(r"([\d.]+)([kM])", paper.ROWS[scene].triangles).groups()  # type: ignore[union-attr]
    return float(digits) * {"k": 1e3, "M": 1e6}[unit]


def sentences(rows: Sequence[dict[str, Any]]) -> list[str]:
    """How the scenes compare with the paper's, and which are stand-ins."""
    first = {r["scene"]: r for r in rows}
    known = [r for r in first.values() if r.get("triangles_to_paper")]
    result = []
    if known:
        farthest = max(known, key=lambda r: abs(r["triangles_to_paper"] - 1))
        result.append(
            f"{len(known)} of the paper's {len(paper.ROWS)} scenes; triangle counts are within "
            f"{abs(farthest['triangles_to_paper'] - 1):.1%} of the paper's (farthest: {title_of(farthest)})."
        )
    stand_ins = [title_of(r) for r in first.values() if r["stand_in"]]
    if stand_ins:
        result.append("Made by programs in place of originals: " + ", ".join(stand_ins) + ".")
    return result
