"""Raw answers saved for scoring on another machine: made where a method runs, scored where Embree is installed. One
.npz file per frame has the answers, the rays and lights as they were traced, and a few facts. The mesh is beside it in
a file of its own, named by its hash and shared by every method.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import UserError
from ..files import DAMAGED, opened_arrays, write_arrays
from ..frame.frame import BOUNCED
from ..scene.alpha import arrays_of, from_arrays
from ..scene.effects import Effects
from ..scene.facts import input_hashes
from ..scene.moment import Moment
from ..scene.prepared import Prepared, prepare
from ..scene.scene import AlphaMask, Camera, Geometry, Scene
from .context import Judge
from .reference import ANSWERS
from .score import Scored, score_answers

SCHEMA = 1
BOUNCES = tuple(f"bounce_{name}" for name in BOUNCED)
FORMER = {"shadowed": "visibility", "bounce_shadowed": "bounce_visibility"}  # names of version 0.1
TABLES = ("eye", "axes", "tangents", "column", "row", "lights", "spots")


def save_raw(
    path: Path | str, prepared: Prepared, moment: Moment, answers: dict[str, NDArray], scene_argument: str,
    effects: Effects | None = None, extra: dict[str, Any] | None = None,
) -> None:  # fmt: skip
    """Keep a frame's answers (as ``Answers.to_host`` gives them) at ``path``, and the mesh beside it; atomically.

    The alpha mask of a mesh is saved with it.

    ``scene_argument`` is the scene as on the command line, a name or a file: if the mesh's file is missing, it
    is created again from that. ``extra``: anything JSON can hold, for the reader.
    """
    hashes = input_hashes(prepared, moment)
    effects = effects or Effects.of(prepared.scene)
    facts = {
        "schema": SCHEMA, "scene": scene_argument, "frame": moment.index, "shadows": list(effects.shadows),
        "alpha": effects.alpha, "facing": moment.facing, "bounces": effects.bounces, "hashes": hashes,
        "extra": extra or {},
    }  # fmt: skip
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    mesh = _mesh_path(path, hashes)
    if not mesh.exists():
        inputs: dict[str, NDArray] = {"points": moment.points, "faces": prepared.faces, "valid": moment.valid}
        write_arrays(mesh, {**inputs, **arrays_of(prepared.alpha)})
    arrays = {name: answers[name] for name in ANSWERS}
    if facts["bounces"]:
        arrays |= {name: answers[name] for name in BOUNCES} | {"mirror": prepared.mirror}
    arrays |= {f"moment_{name}": getattr(moment, name) for name in TABLES}
    write_arrays(path, {**arrays, "facts": np.array(json.dumps(facts))})


def read_facts(path: Path) -> dict[str, Any]:
    """The facts that :func:`save_raw` wrote: scene, frame, shadows, hashes, extra."""
    try:
        with opened_arrays(path) as stored:
            return json.loads(str(stored["facts"]))
    except DAMAGED as error:
        raise UserError(f"{path}: not a file of raw answers ({error}); run its point again") from error


def read_raw(
    path: Path, scene_dir: Path | str | None = None
) -> tuple[Prepared, Moment, dict[str, NDArray], dict[str, Any]]:
    """Scene, moment, answers and facts of a file of raw answers, its hashes checked."""
    facts = read_facts(path)
    try:
        with opened_arrays(path) as stored:
            mirrored = ("mirror", *BOUNCES) if facts.get("bounces") else ()
            named = {name: name if name in stored else FORMER.get(name, name) for name in (*ANSWERS, *mirrored)}
            answers = {name: stored[at] for name, at in named.items()}
            # Answers that were saved before spotlights existed have no such table: no light was limited.
            tables = {name: stored[f"moment_{name}"] for name in TABLES if f"moment_{name}" in stored}
    except DAMAGED as error:
        raise UserError(f"{path}: not a file of raw answers ({error}); run its point again") from error
    prepared = _mesh(path, facts, scene_dir)
    if facts["frame"] >= prepared.frame_count:
        raise UserError(f"{path}: frame {facts['frame']}, but {facts['scene']} has {prepared.frame_count}")
    points, valid = prepared.points(facts["frame"])
    moment = Moment(index=facts["frame"], points=points, valid=valid, facing=bool(facts.get("facing")), **tables)
    if mirrored:
        prepared = replace(prepared, mirror=answers.pop("mirror"))
    pixels = moment.width * moment.height
    if any(answers[name].shape[-1] != pixels for name in ANSWERS):
        raise UserError(f"{path}: answers of another size than its {moment.width}x{moment.height} rays")
    hashes = input_hashes(prepared, moment)
    names = {**facts["hashes"], **hashes}
    differ = [name for name in names if hashes.get(name) != facts["hashes"].get(name)]
    if differ:
        raise UserError(
            f"{path}: {' and '.join(differ)} of {facts['scene']} differ from what was traced; "
            f"put {_mesh_path(path, facts['hashes']).name} back beside it, or run its point again"
        )
    return prepared, moment, answers, facts


def score_raw(path: Path | str, scene_dir: Path | str | None = None, folder: Path | str | None = None) -> Scored:
    """The score of answers saved by :func:`save_raw`. Raises :class:`UserError` for a file that does not have raw
    answers, or a mesh that is not the one traced. ``scene_dir``: where originals of the catalogue's scenes are.
    ``folder``: stores the reference's answers.
    """
    prepared, moment, answers, facts = read_raw(Path(path), scene_dir)
    effects = Effects(tuple(facts["shadows"]), alpha=bool(facts.get("alpha")), bounces=facts.get("bounces", 0))
    return score_answers(Judge.of(prepared, moment, effects, folder), answers)


def _kept_mesh(
    name: str, frame: int, points: NDArray, faces: NDArray, valid: NDArray, mask: AlphaMask | None = None
) -> Prepared:
    """One frame of a prepared scene, read back: arrays as they were traced, not rounded again."""
    nowhere = Camera((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    geometry = Geometry(faces, lambda k: points, frame + 1)
    alpha = None if mask is None else lambda geometry: mask
    prepared = prepare(Scene(name, name, lambda: geometry, nowhere, (), alpha=alpha))
    return replace(prepared, centre=np.zeros(3), points=lambda k: (points, valid))


def _mesh_path(path: Path, hashes: dict[str, str]) -> Path:
    mask = f"-{hashes['surfaces'][:24]}" if "surfaces" in hashes else ""
    return path.parent / f"mesh-{hashes['mesh'][:24]}{mask}.npz"


def _mesh(path: Path, facts: dict[str, Any], scene_dir: Path | str | None) -> Prepared:
    beside = _mesh_path(path, facts["hashes"])
    if beside.exists():
        try:
            with opened_arrays(beside) as stored:
                arrays = {name: stored[name] for name in ("points", "faces", "valid")}
                mask = from_arrays(stored)
            return _kept_mesh(facts["scene"], facts["frame"], **arrays, mask=mask)
        except DAMAGED as error:
            raise UserError(f"{beside}: damaged ({error}); delete it to make the mesh anew") from error
    from ..scene.catalogue import resolve

    return prepare(resolve(facts["scene"], scene_dir))
