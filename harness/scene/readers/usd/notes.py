"""What reading a stage has approximated or left out, a clause each."""

from __future__ import annotations

from collections import Counter
from typing import Any

from pxr import UsdGeom

from .drawing import Library
from .gprims import RESOLUTION

_COUNTED = {
    "tessellated": f"tessellated gprims: {{}} ({RESOLUTION})",
    "cages": "subdivision surfaces read as their cages: {}",
    "empty": "prototypes of instancers that draw nothing: {}",
    "draw modes": "draw modes not used: {}",
    "materials": "materials not read: {}",
    "opacities": "opacities of materials and shapes not read: {}",
}
"""What is said of each count that is not 0."""


def approximations(stage: Any, library: Library) -> list[str]:
    """What is read as something else or not at all, and the unit of length."""
    counts = library.counts
    notes = [text.format(counts[name]) for name, text in _COUNTED.items() if counts[name]]
    if library.left_out.total():
        notes.append(f"left out: {listed(library.left_out)}")
    if counts["invisible"] or counts["unseen"]:
        notes.append(f"left out: {counts['invisible']} invisible, {counts['unseen']} of purpose guide or proxy")
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
