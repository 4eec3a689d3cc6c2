"""What a stage draws, over the time codes that are wanted, as one mesh, and what reading it has approximated or left
out. Nothing of what it is composed of is missing in silence, and nothing is printed by USD's library.
"""

import math
import re
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Ar, Tf, Usd, UsdGeom, UsdUtils

from ..checks import MAX_TRIANGLES, Loaded, Wanted, broken, checked, guarded, some
from ..polygons import Piece, fixed_topology
from . import views
from .drawing import Drawing, Library
from .prims import DRAWN
from .shapes import RESOLUTION

MOST_POSITIONS = 1 << 27  # largest number of vertices of all frames together: 3 GiB
MOST_FRAMES = 1 << 20  # largest number of frames of an animation, before some are chosen
_SLACK = 1e-6  # difference of time codes, in frames, that rounding explains

_COUNTED = {  # what is said of each count that is not 0
    "tessellated": f"tessellated gprims: {{}} ({RESOLUTION})",
    "cages": "subdivision surfaces read as their cages: {}",
    "empty": "prototypes of instancers that draw nothing: {}",
    "draw modes": "draw modes not used: {}",
    "materials": "materials not read: {}",
    "opacities": "opacities of materials and shapes not read: {}",
}

_LOADED = Usd.PrimIsActive & Usd.PrimIsLoaded & ~Usd.PrimIsAbstract
_LEAVE_OUT = "add what is missing, or give --allow-missing to leave it out"


def read(path: Path, wanted: Wanted) -> Loaded:
    """What :func:`.read_usd` says."""
    notes: list[str] = []
    with guarded(path, "USD"), _listening(path, notes):
        stage = _opened(path, wanted.allow_missing, notes)
        mesh = _over_time(path, stage, wanted, notes)
        files = _layer_files(stage, path)
    return replace(mesh, files=files, notes=tuple(notes))


def _over_time(path: Path, stage: Any, wanted: Wanted, notes: list[str]) -> Loaded:
    """The mesh, its cameras and lights; what is approximated or left out is added to ``notes``."""
    library = Library(path)
    drawing = Drawing(library, stage.GetPseudoRoot().GetFilteredChildren(DRAWN), DRAWN)
    codes, rate = _times(path, stage, drawing, wanted, notes)
    drawing.at(codes[0])
    cameras = views.cameras(drawing.nodes, codes[0], notes)
    lights = views.lights(drawing.nodes, codes[0], notes)
    frames = _frames(path, drawing, codes)
    there = [any(piece is not None for piece in part) for part in zip(*frames, strict=True)]
    if not any(there):
        seen = f" ({_listed(library.left_out)} left out)" if library.left_out.total() else ""
        raise broken(path, f"holds no visible mesh{seen}", "give a stage with meshes")
    fixed = fixed_topology(frames)
    names = [str(part.node.prim.GetPath()) for part in drawing.parts]
    absent = [i for i, shown in enumerate(there) if not shown]
    notes += _approximations(stage, library)
    for what, parts in (
        ("topology changes, so that padded triangles vanish and appear", fixed.padded),
        ("not in all frames", fixed.vanishing),
        ("in no frame, empty or invisible", absent),
    ):
        notes += [f"{what}: {some([names[i] for i in parts])}"] if parts else []
    up = (0.0, 0.0, 1.0) if UsdGeom.GetStageUpAxis(stage) == "Z" else (0.0, 1.0, 0.0)
    mesh = checked(path, fixed.frames[0], fixed.faces, up)
    (first,), later = mesh.frames, fixed.frames[1:]
    if later and all(np.array_equal(frame, first, equal_nan=True) for frame in later):
        notes.append(f"{len(fixed.frames)} frames are alike: read as one")
        later, rate = (), None
    return replace(mesh, frames=(first, *later), rate=rate, cameras=cameras, lights=lights)


def _frames(path: Path, drawing: Drawing, codes: list[float]) -> list[list[Piece | None]]:
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


def _times(
    path: Path, stage: Any, drawing: Drawing, wanted: Wanted, notes: list[str]
) -> tuple[list[float], float | None]:
    """The time codes of the frames of a stage, and the frames a second, None where there is one frame. It starts where
    the file says, else at the earliest sample of what is drawn, and ends likewise. There is a frame for each time code,
    or as many a second as the file or ``wanted`` says. One frame, the start, if nothing moves.
    """
    start = _authored(stage, "startTimeCode", min(drawing.times, default=0.0))
    end = max(start, _authored(stage, "endTimeCode", max(drawing.times, default=start)))
    if not drawing.moves:
        wanted.chosen(path, 1)
        return [start], None
    second = stage.GetTimeCodesPerSecond()
    second = second if 0.0 < second < math.inf else 24.0
    said = _authored(stage, "framesPerSecond", second)
    rate = wanted.rate or (said if said > 0.0 else second)
    step = second / rate
    count = (end - start) / step if step > 0.0 else math.inf
    if not count < MOST_FRAMES:
        problem = f"its animation from {start:g} to {end:g} at {rate:g} frames a second has too many frames"
        raise broken(path, problem, f"at most {MOST_FRAMES}: give a lower --rate")
    frames = math.floor(count + _SLACK) + 1
    chosen = wanted.chosen(path, frames)
    codes = [start + k * step for k in chosen]
    if len(codes) < frames:
        notes.append(f"{len(codes)} of {frames} frames read")
    outside = {code for code in drawing.times if not start - _SLACK * step <= code <= end + _SLACK * step}
    if outside:
        notes.append(f"samples at {len(outside)} time codes outside {start:g} to {end:g} not read")
    place = (np.array(sorted(drawing.times - outside)) - start) / step
    between = int((np.abs(place - place.round()) > _SLACK).sum())
    if between:
        notes.append(f"samples at {between} time codes between frames not read")
    return codes, second / step / chosen.step if len(codes) > 1 else None


def _authored(stage: Any, name: str, otherwise: float) -> float:
    """A number of the stage's metadata where the file gives it and it is finite."""
    value = float(stage.GetMetadata(name)) if stage.HasAuthoredMetadata(name) else otherwise
    return value if math.isfinite(value) else otherwise


def _approximations(stage: Any, library: Library) -> list[str]:
    """What is read as something else or not at all, and the unit of length."""
    counts = library.counts
    notes = [text.format(counts[name]) for name, text in _COUNTED.items() if counts[name]]
    if library.left_out.total():
        notes.append(f"left out: {_listed(library.left_out)}")
    if counts["invisible"] or counts["unseen"]:
        notes.append(f"left out: {counts['invisible']} invisible, {counts['unseen']} of purpose guide or proxy")
    if UsdGeom.StageHasAuthoredMetersPerUnit(stage):
        notes.append(f"lengths in units of {UsdGeom.GetStageMetersPerUnit(stage):g} m")
    return notes


def _listed(kinds: Counter[str]) -> str:
    return ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()) if count)


@contextmanager
def _listening(path: Path, notes: list[str]) -> Iterator[None]:
    """Keep what USD's library warns of from stderr, and note it; its errors are one line that names the file."""
    # While a delegate exists, the library tells it and prints nothing.
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    except (Tf.ErrorException, Tf.CppException) as error:
        first = getattr(error.args[0], "commentary", "damaged") if error.args else "damaged"
        raise broken(path, f"USD cannot read it: {_plain(first, path)[:200]}") from None
    except UnicodeDecodeError:
        raise broken(path, "USD cannot read it: it holds text that is not UTF-8") from None
    finally:
        heard = {_plain(found.commentary, path) for found in delegate.TakeUncoalescedDiagnostics()}
    # What could not be composed is noted apart. Several threads warn in any order.
    said = sorted(text for text in heard if "instantiating stage" not in text)
    if said:
        more = f" ({len(said) - 1} more)" if len(said) > 1 else ""
        notes.append(f"USD warns: {said[0][:160]}{more}")


def _opened(path: Path, allow_missing: bool, notes: list[str]) -> Any:
    """The stage of a file, all its payloads loaded. Raises :class:`UserError` for a reference, payload, sublayer or
    clip that cannot be opened or found; with ``allow_missing`` it is noted and left out.
    """
    stage = Usd.Stage.Open(str(path))
    lost = sorted({_plain(str(error), path) for error in stage.GetCompositionErrors()})
    lost += _missing_clips(stage, path)
    if lost and not allow_missing:
        more = f" (and {len(lost) - 1} more)" if len(lost) > 1 else ""
        raise broken(path, lost[0][:250] + more, _LEAVE_OUT)
    notes += [f"left out: {text}" for text in lost[:3]]
    if len(lost) > 3:
        notes.append(f"{len(lost) - 3} more left out")
    return stage


def _layer_files(stage: Any, path: Path) -> tuple[Path, ...]:
    """The files that were read beside ``path``: of references, payloads, sublayers and value clips. Sorted. A layer
    within a package counts as the package. Clips are those of the times that were read.
    """
    names = {Ar.SplitPackageRelativePathOuter(layer.realPath)[0] for layer in stage.GetUsedLayers()}
    root = path.resolve()
    return tuple(Path(name) for name in sorted(names) if name and Path(name).resolve() != root)


def _missing_clips(stage: Any, path: Path) -> list[str]:
    """Value clips that are named and not there: USD has no value at their times."""
    lost = []
    for prim in stage.Traverse(_LOADED):
        if not prim.HasAuthoredMetadata("clips"):
            continue
        clips = Usd.ClipsAPI(prim)
        for name in clips.GetClips():
            for asset in clips.GetClipAssetPaths(name) or ():
                if not asset.resolvedPath:
                    lost.append(_plain(f"Could not open clip {asset.path} of <{prim.GetPath()}>", path))
    return sorted(set(lost))


def _plain(text: str, path: Path) -> str:
    """A message of USD's on one line, without the folder of the file, addresses in memory and marks of layers."""
    text = " ".join(text.split())
    text = re.sub(r" \(instantiating stage on stage .*\)$", " (instantiating stage)", text)
    text = re.sub(r",?@?anon:0x[^@]*@|<0x[0-9a-f]+>|( matching)? pxrInternal\S*", "", text)
    for folder in (path.absolute().parent, path.resolve().parent):
        text = text.replace(f"{folder}/", "")
    return text.replace("@", "").rstrip(".; ")
