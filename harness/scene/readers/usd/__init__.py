"""USD through the package usd-core: all that the stage draws, in the order of the stage, over its time.

stage     opens it, and finds missing and used files
prims     which prims have a place; transforms and visibility
shapes    triangles of meshes; gprims: of spheres, cubes ...; skins: of what a skeleton bends
drawing   what is drawn where; instancers: many times
frames    at which time codes
views     its cameras and lights
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ....errors import UserError, install
from ..checks import ALL, MAX_TRIANGLES, Mesh, Wanted, broken, checked, guarded, read_bytes
from ..topology import fixed_topology

MOST_POSITIONS = 1 << 28
"""Largest number of vertices of all frames together."""


def missing() -> str:
    """What to do where usd-core is not installed."""
    return f"reading USD needs the package usd-core; {install('usd-core')}"


def available() -> bool:
    """Whether usd-core is installed."""
    try:
        import pxr.Usd  # noqa: F401
    except ImportError:
        return False
    return True


def read_usd(path: Path, wanted: Wanted = ALL) -> Mesh:
    """Everything that the stage draws, in its space: positions float64, float32 where nothing is moved.

    ``up`` is the stage's up axis; lengths are in its unit. Raises :class:`UserError` if usd-core is missing, the stage or
    a file that it refers to cannot be opened, its arrays contradict each other, or it exceeds a limit.
    """
    if not available():
        raise UserError(f"{path}: {missing()}")
    from . import stage as stages

    read_bytes(path, 1024)  # missing and unreadable files get the same message as in every other format
    notes: list[str] = []
    with guarded(path, "USD"), stages.listening(path, notes):
        stage = stages.opened(path, wanted.allow_missing, notes)
        mesh = _drawn(path, stage, wanted, notes)
        files = stages.layer_files(stage, path)
    return replace(mesh, files=files, notes=tuple(notes))


def _drawn(path: Path, stage: Any, wanted: Wanted, notes: list[str]) -> Mesh:
    """The mesh over time, its cameras and lights; what is approximated or left out is added to ``notes``."""
    from pxr import UsdGeom

    from . import views
    from .drawing import Drawing, Library
    from .frames import times
    from .prims import DRAWN

    library = Library(path)
    drawing = Drawing(library, list(stage.GetPseudoRoot().GetFilteredChildren(DRAWN)), DRAWN)
    at = times(path, stage, drawing.times, drawing.moves, wanted, notes)
    frames, positions, triangles = [], 0, 0
    for k, code in enumerate(at.codes):
        frames.append(drawing.pieces(code))
        if not k:
            cameras = views.cameras(drawing.prims, code, notes)
            lights = views.lights(drawing.prims, code, notes)
        positions += sum(len(piece[0]) for piece in frames[-1] if piece is not None)
        triangles = max(triangles, sum(len(piece[1]) for piece in frames[-1] if piece is not None))
        if positions > MOST_POSITIONS or triangles > MAX_TRIANGLES:
            problem = (
                f"its first {k + 1} frames have {positions} vertices, more than {MOST_POSITIONS} together"
            )
            raise broken(path, problem, "choose some with --frames, or export a part of it")
    if not any(piece is not None for frame in frames for piece in frame):
        seen = f" ({_listed(library.left_out)} left out)" if library.left_out.total() else ""
        raise broken(path, f"holds no visible mesh{seen}", "give a stage with meshes")
    fixed = fixed_topology(frames)
    notes += _approximations(stage, library)
    named = [str(drawing.prims.nodes[part.node].prim.GetPath()) for part in drawing.parts]
    if fixed.padded:
        names = _some([named[i] for i in fixed.padded])
        notes.append(f"topology changes, so that padded triangles vanish and appear: {names}")
    if fixed.vanishing:
        notes.append(f"not in all frames: {_some([named[i] for i in fixed.vanishing])}")
    up = (0.0, 0.0, 1.0) if str(UsdGeom.GetStageUpAxis(stage)) == "Z" else (0.0, 1.0, 0.0)
    mesh = checked(path, fixed.frames[0], fixed.faces, up)
    later, rate = fixed.frames[1:], at.rate
    if later and all(np.array_equal(frame, mesh.points, equal_nan=True) for frame in later):
        notes.append(f"{len(later) + 1} frames are alike: read as one")
        later, rate = (), None
    return replace(mesh, later=later, rate=rate, cameras=cameras, lights=lights)


def _approximations(stage: Any, library: Any) -> list[str]:
    """What was left out of a stage, or read as something else."""
    from pxr import UsdGeom

    from .gprims import RESOLUTION

    counts, notes = library.counts, []
    if counts["tessellated"]:
        notes.append(f"tessellated gprims: {counts['tessellated']} ({RESOLUTION})")
    if counts["cages"]:
        notes.append(f"subdivision surfaces read as their cages: {counts['cages']}")
    if library.left_out.total():
        notes.append(f"left out: {_listed(library.left_out)}")
    if counts["invisible"] or counts["guides"]:
        notes.append(
            f"left out: {counts['invisible']} invisible, {counts['guides']} of purpose guide or proxy"
        )
    if counts["materials"]:
        notes.append(f"materials not read: {counts['materials']}")
    if UsdGeom.StageHasAuthoredMetersPerUnit(stage):
        notes.append(f"lengths in units of {UsdGeom.GetStageMetersPerUnit(stage):g} m")
    return notes


def _listed(kinds: Counter[str]) -> str:
    return ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()) if count)


def _some(names: list[str]) -> str:
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return ", ".join(names[:3]) + more
