"""What reading a stage has approximated or left out, a clause each."""

from __future__ import annotations

from collections import Counter
from typing import Any

from pxr import UsdGeom

from .drawing import Library
from .gprims import RESOLUTION


def approximations(stage: Any, library: Library) -> list[str]:
    """What is read as something else or not at all, and the unit of length."""
    counts, notes = library.counts, []
    if counts["tessellated"]:
        notes.append(f"tessellated gprims: {counts['tessellated']} ({RESOLUTION})")
    if counts["cages"]:
        notes.append(f"subdivision surfaces read as their cages: {counts['cages']}")
    if library.left_out.total():
        notes.append(f"left out: {listed(library.left_out)}")
    if counts["invisible"] or counts["unseen"]:
        notes.append(
            f"left out: {counts['invisible']} invisible, {counts['unseen']} of purpose guide or proxy"
        )
    if counts["empty"]:
        notes.append(f"prototypes of instancers that draw nothing: {counts['empty']}")
    if counts["draw modes"]:
        notes.append(f"draw modes not used: {counts['draw modes']}")
    if counts["materials"]:
        notes.append(f"materials not read: {counts['materials']}")
    if counts["opacities"]:
        notes.append(f"opacities of materials and shapes not read: {counts['opacities']}")
    if UsdGeom.StageHasAuthoredMetersPerUnit(stage):
        notes.append(f"lengths in units of {UsdGeom.GetStageMetersPerUnit(stage):g} m")
    return notes


def changes(padded: list[str], vanishing: list[str], absent: list[str]) -> list[str]:
    """Parts that are not the same triangles in all frames, by name."""
    notes = []
    if padded:
        notes.append(f"topology changes, so that padded triangles vanish and appear: {_some(padded)}")
    if vanishing:
        notes.append(f"not in all frames: {_some(vanishing)}")
    if absent:
        notes.append(f"in no frame, empty or invisible: {_some(absent)}")
    return notes


def listed(kinds: Counter[str]) -> str:
    return ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()) if count)


def _some(names: list[str]) -> str:
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return ", ".join(names[:3]) + more
