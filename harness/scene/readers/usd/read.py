"""What a stage draws, over the time codes that are wanted, as one mesh, and what reading it has approximated or left out."""

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pxr import UsdGeom

from ..checks import MAX_TRIANGLES, Loaded, Wanted, broken, checked
from ..topology import Piece, fixed_topology
from . import views
from .drawing import Drawing, Library
from .gprims import RESOLUTION
from .prims import DRAWN
from .times import times

MOST_POSITIONS = 1 << 27
"""Largest number of vertices of all frames together: 3 GiB."""


def over_time(path: Path, stage: Any, wanted: Wanted, notes: list[str]) -> Loaded:
    """The mesh, its cameras and lights; what is approximated or left out is added to ``notes``."""
    library = Library(path)
    drawing = Drawing(library, stage.GetPseudoRoot().GetFilteredChildren(DRAWN), DRAWN)
    at = times(path, stage, drawing.times, drawing.moves, wanted, notes)
    drawing.prims.at(at.codes[0])
    cameras = views.cameras(drawing.prims, at.codes[0], notes)
    lights = views.lights(drawing.prims, at.codes[0], notes)
    frames = _frames(path, drawing, at.codes)
    there = [any(frame[i] is not None for frame in frames) for i in range(len(drawing.parts))]
    if not any(there):
        seen = f" ({listed(library.left_out)} left out)" if library.left_out.total() else ""
        raise broken(path, f"holds no visible mesh{seen}", "give a stage with meshes")
    fixed = fixed_topology(frames)
    names = [str(drawing.prims.nodes[part.node].prim.GetPath()) for part in drawing.parts]
    notes += approximations(stage, library)
    notes += changes(
        [names[i] for i in fixed.padded],
        [names[i] for i in fixed.vanishing],
        [name for name, shown in zip(names, there, strict=True) if not shown],
    )
    up = (0.0, 0.0, 1.0) if UsdGeom.GetStageUpAxis(stage) == "Z" else (0.0, 1.0, 0.0)
    mesh = checked(path, fixed.frames[0], fixed.faces, up)
    (first,), later, rate = mesh.frames, fixed.frames[1:], at.rate
    if later and all(np.array_equal(frame, first, equal_nan=True) for frame in later):
        notes.append(f"{len(fixed.frames)} frames are alike: read as one")
        later, rate = (), None
    return replace(mesh, frames=(first, *later), rate=rate, cameras=cameras, lights=lights)


def _frames(path: Path, drawing: Drawing, codes: tuple[float, ...]) -> list[list[Piece | None]]:
    """The parts at each time code. Raises :class:`UserError` as soon as they have too many vertices or triangles."""
    frames: list[list[Piece | None]] = []
    positions = 0
    for code in codes:
        frames.append([])
        triangles = 0
        for piece in drawing.pieces(code):
            frames[-1].append(piece)
            positions += len(piece[0]) if piece else 0
            triangles += len(piece[1]) if piece else 0
            if positions > MOST_POSITIONS or triangles > MAX_TRIANGLES:
                size = f"{positions} vertices in {len(frames)} frames, {triangles} triangles"
                most = f"more than {MOST_POSITIONS} or {MAX_TRIANGLES}"
                raise broken(path, f"has {size}, {most}", "choose --frames, or export a part of it")
    return frames


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
