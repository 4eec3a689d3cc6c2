"""The reference that every answer is compared with: Embree in robust mode, with its provenance.

Embree also makes errors: where a method and Embree differ, the exact referee decides, and Embree's errors are counted
separately. Rules for its Python binding: build the whole scene before the first query; pass a copy of the ray lengths,
which are overwritten; do not read the details of an OCCLUDED query, which are uninitialised; check indices, because it
does not. It has no minimum ray length; so the origin of a shadow ray is moved off the surface by a bound of its rounding.
"""

import hashlib
import importlib.metadata
import importlib.util
import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..arrays import F32, I32, U8
from ..files import DAMAGED, opened_arrays, write_arrays
from ..frame.devices import cpu_model
from ..scene.effects import Effects
from ..scene.facts import input_hashes
from ..scene.moment import Moment
from ..scene.prepared import Prepared
from .consistency import in_blocks
from .decisions import Exact
from .distances import plane_numbers
from .referee import Referee

ROBUST = True
OFFSET_UNITS = 8 * 2.0**-24
"""Distance of the origin of a shadow ray from its surface, relative to the coordinates and the triangle that it
leaves.
"""


EXACT = "exact referee"  # the provenance of a reference that consists of the referee's own answers

DECIDED = 1 << 14
"""Largest image, in pixels, for which a reference has the referee's answers in full, with the ties of every ray: about
0.5 KB per pixel.
"""

NO_FILTER = "triangles have holes, and Embree's Python binding has no filter functions to skip a hit in one"


ANSWERS = ("triangle", "t", "u", "v", "shadowed")
"""The answers to a set of rays, by their names in :class:`.frame.frame.Answers`."""


@dataclass(eq=False)
class Reference:
    """Embree's answers to one moment, in the form of a method's answers.

    triangle int32 [pixels], t, u, v float32 [pixels] (inf, 0, 0 at a miss), shadowed uint8 [lights, pixels];
    ``provenance`` names Embree, the processor and the hashes of what was traced. ``decided``: the referee's answers that
    these were made from, for images of at most :data:`DECIDED` pixels.
    """

    triangle: I32
    t: F32
    u: F32
    v: F32
    shadowed: U8
    provenance: dict[str, Any]
    decided: Exact | None = None

    @property
    def exact(self) -> bool:
        """Whether these are the referee's answers, which are exact."""
        return self.provenance.get("reference") == EXACT

    def answers(self) -> dict[str, NDArray]:
        """The answers in the form of a method's answers."""
        return {name: getattr(self, name) for name in ANSWERS}


Answered = tuple[dict[str, Any], Exact | None]  # answers by name, and the referee's that they were made from


_SCENES: WeakKeyDictionary[Referee, Any] = WeakKeyDictionary()
"""Embree's scenes of meshes that do not move, by their referees: all moments of such a mesh share one."""


def embree_reference(
    prepared: Prepared, moment: Moment, effects: Effects | None = None, folder: Path | str | None = None,
    referee: Referee | None = None,
) -> Reference:  # fmt: skip
    """Trace a moment with Embree. ``folder``: store the answers there as .npz, named by the hash of all inputs.
    ``referee``: the mesh's, under which Embree's scene is kept for other moments if the mesh does not move. Lights
    without shadows (by ``effects``, default the scene's) get rows of zeros.
    """
    shadows = shadow_flags(moment, effects or Effects.of(prepared.scene))
    facts = {
        "reference": "Embree", "embreex": importlib.metadata.version("embreex"), "robust": ROBUST,
        "offset_units": OFFSET_UNITS, "shadows": shadows, "processor": processor(), **input_hashes(prepared, moment),
    }  # fmt: skip
    return _stored(folder, facts, lambda: _trace(prepared, moment, shadows, referee))


def exact_reference(
    prepared: Prepared, moment: Moment, referee: Referee, effects: Effects | None = None,
    folder: Path | str | None = None,
) -> Reference:  # fmt: skip
    """The referee's own answers in place of Embree's: 10 to 30 us per pixel. ``folder`` as in :func:`embree_reference`.
    For a machine without Embree, and for triangles with holes, which Embree's Python binding cannot skip.
    """
    shadows = shadow_flags(moment, effects or Effects.of(prepared.scene))
    facts = {"reference": EXACT, "shadows": shadows, **input_hashes(prepared, moment)}
    if referee.holes.mask is not None:
        facts["why"] = NO_FILTER
    return _stored(folder, facts, lambda: _decide(prepared, moment, referee, shadows))


def _decide(prepared: Prepared, moment: Moment, referee: Referee, shadows: Sequence[bool]) -> Answered:
    pixels = np.arange(moment.width * moment.height)
    origins, directions = moment.origins(pixels), moment.directions(pixels)
    decided = referee.answers(origins, directions, moment.lights, shadows)
    hits = decided.hits
    answers = _misses(moment)
    answers |= {"triangle": hits.triangle, "t": hits.t.astype(np.float32)}
    answers["shadowed"] = (decided.occluders >= 0).astype(np.uint8)
    rows = np.nonzero(hits.triangle >= 0)[0]
    corners = moment.points[prepared.faces[hits.triangle[rows]]].astype(np.float64)
    o, d = origins[rows].astype(np.float64), directions[rows].astype(np.float64)
    _, answers["u"][rows], answers["v"][rows], _ = plane_numbers(corners, o, d)
    return answers, decided if len(pixels) <= DECIDED else None


def reference_for(
    prepared: Prepared, moment: Moment, referee: Referee, effects: Effects, folder: Path | str | None = None
) -> Reference:
    """Embree's answers; the referee's own where Embree is not installed, or where triangles have holes."""
    if effects.alpha or not embree_installed():
        return exact_reference(prepared, moment, referee, effects, folder)
    return embree_reference(prepared, moment, effects, folder, referee)


def embree_installed() -> bool:
    return importlib.util.find_spec("embreex") is not None


def make_scene(points: F32, faces: I32, valid: NDArray) -> Any | None:
    """An Embree scene of the valid triangles with unchanged ids; None if there is no valid triangle. Invalid triangles
    get a NaN vertex: Embree drops such triangles, and the others keep their ids. Raises ValueError for an index out of
    range, with which Embree would read outside the array.
    """
    # Imported here, so that answers can be saved for scoring elsewhere on a machine without Embree.
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    valid = np.asarray(valid).astype(bool)
    if not valid.any():
        return None
    if faces.min() < 0 or faces.max() >= len(points):
        raise ValueError("a face names a vertex that does not exist")
    vertices = np.concatenate([points, np.full((1, 3), np.nan, dtype=np.float32)]).astype(np.float32)
    indices = np.where(valid[:, None], faces, len(points)).astype(np.int32)
    scene = EmbreeScene(robust=ROBUST)
    TriangleMesh(scene, vertices, indices)
    return scene


def shadow_origins(corners: F32, eye: F32, directions: F32, lights: F32) -> Iterator[F32]:
    """Origins of shadow rays [n, 3] to each light [lights, 3]: float64 hit points on triangles ``corners`` [n, 3, 3], moved
    off the surface.

    ``eye`` is where the rays started, [3] or [n, 3].

    They are moved towards the light's side by :data:`OFFSET_UNITS` of the point's largest coordinate plus the distance to
    the farthest corner. That is exact enough to find the pixels that the referee must decide.
    """
    a, b, c = (corners[:, i].astype(np.float64) for i in range(3))
    o, d = eye.astype(np.float64), directions.astype(np.float64)
    normal = np.cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.einsum("ij,ij->i", normal, a - o) / np.einsum("ij,ij->i", normal, d)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    p = o + np.where(np.isfinite(t), t, 0.0)[:, None] * d
    reach = np.linalg.norm(corners - p[:, None], axis=2).max(axis=1)
    step = OFFSET_UNITS * (np.abs(p).max(axis=1) + reach)
    for light in lights.astype(np.float64):
        side = np.where(np.einsum("ij,ij->i", normal, light - p) < 0, -1.0, 1.0)
        yield (p + (side * step)[:, None] * normal).astype(np.float32)


def shadow_flags(moment: Moment, effects: Effects) -> list[bool]:
    """Which lights of a moment have shadow rays."""
    count = len(moment.lights)
    return [*effects.shadows, *[False] * count][:count]


def _misses(moment: Moment) -> dict[str, Any]:
    """Answers that say that nothing is hit."""
    pixels = moment.width * moment.height
    return {
        "triangle": np.full(pixels, -1, dtype=np.int32),
        "t": np.full(pixels, np.inf, dtype=np.float32),
        "u": np.zeros(pixels, dtype=np.float32),
        "v": np.zeros(pixels, dtype=np.float32),
        "shadowed": np.zeros((len(moment.lights), pixels), dtype=np.uint8),
    }


def _scene(prepared: Prepared, moment: Moment, referee: Referee | None) -> Any | None:
    """A new Embree scene of a moment's mesh, or the one that is kept."""
    if referee is None or prepared.moves:
        return make_scene(moment.points, prepared.faces, moment.valid)
    if referee not in _SCENES:
        _SCENES[referee] = make_scene(moment.points, prepared.faces, moment.valid)
    return _SCENES[referee]


def _trace(prepared: Prepared, moment: Moment, shadows: Sequence[bool], referee: Referee | None) -> Answered:
    answers = _misses(moment)
    triangle, t, u, v, shadowed = answers.values()
    pixels = len(triangle)
    scene = _scene(prepared, moment, referee)
    if scene is not None:
        # The first query commits the scene: alone, before the threads.
        scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32), query="OCCLUDED")
        directions, origins = moment.directions(np.arange(pixels)), moment.origins(np.arange(pixels))

        def primary(block: slice) -> None:
            result = scene.run(np.ascontiguousarray(origins[block]), directions[block], output=1)
            hit = result["primID"] >= 0
            triangle[block] = np.where(hit, result["primID"], -1)
            t[block] = np.where(hit, result["tfar"], np.inf)
            u[block], v[block] = np.where(hit, result["u"], 0), np.where(hit, result["v"], 0)

        in_blocks(pixels, primary)
        hits = np.nonzero(triangle >= 0)[0]
        lit = np.nonzero(np.array(shadows, dtype=bool))[0]

        def secondary(block: slice) -> None:
            some = hits[block]
            corners = moment.points[prepared.faces[triangle[some]]]
            lights = moment.lights[lit]
            for i, light, starts in zip(
                lit, lights, shadow_origins(corners, origins[some], directions[some], lights), strict=True
            ):
                lengths = np.ones(len(starts), dtype=np.float32)
                shadowed[i, some] = scene.run(starts, light - starts, dists=lengths, query="OCCLUDED") == 0

        in_blocks(len(hits), secondary)
    return answers, None


# --- provenance and the folder ------------------------------------------------------------------------------


def processor() -> dict[str, str]:
    """Model and vector extensions of this machine: Embree's answers depend on them."""
    try:
        flags = re.search(r"^flags\s*:(.*)", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    except OSError:
        flags = None
    known = [flag for flag in flags[1].split() if flag.startswith(("sse4", "avx", "fma"))] if flags else []
    return {"model": cpu_model() or "unknown", "isa": " ".join(known) or "unknown"}


def _stored(folder: Path | str | None, facts: dict[str, Any], make: Callable[[], Answered]) -> Reference:
    """The reference stored in ``folder`` for these inputs, else a new one, which is then stored. None: not stored."""
    facts["key"] = hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()
    path = None if folder is None else Path(folder) / f"truth-{facts['key'][:24]}.npz"
    answers = _read(path, facts) if path is not None and path.exists() else None
    if answers is not None:
        return Reference(**answers, provenance=facts)
    answers, decided = make()
    if path is not None:
        write_arrays(path, {**answers, "provenance": np.array(json.dumps(facts, sort_keys=True))})
    return Reference(**answers, provenance=facts, decided=decided)


def _read(path: Path, facts: dict[str, Any]) -> dict[str, Any] | None:
    """The stored answers, or None where the file is damaged or of other inputs (it is then made again)."""
    try:
        with opened_arrays(path) as stored:
            known = json.loads(str(stored["provenance"])) == facts
            return {name: stored[name] for name in ANSWERS} if known else None
    except DAMAGED:
        return None
