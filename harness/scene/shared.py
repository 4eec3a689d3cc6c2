"""A prepared scene passed from one process to others, so that its mesh is made once and all have the same bytes."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ..arrays import F32, F64, U8
from ..errors import UserError
from ..files import write_arrays
from .alpha import arrays_of, from_arrays
from .prepared import Prepared
from .scene import Geometry, Moves, Scene


def store(path: Path, prepared: Prepared, frames: Iterable[int]) -> None:
    """Keep a prepared scene and the positions of some of its frames in one .npz file, written atomically.

    The first frame is always kept: trees that are refitted are built there. Its positions are passed on unchanged, too:
    rules that choose triangles (:mod:`.scene.overrides`) use it, and must make the same choice in every process.
    Where it has triangles that are not valid, all frames are kept: a tree leaves out those that are valid in none. Of a
    mesh that does not move the first stands for all.
    """
    arrays = {name: getattr(prepared, name) for name in ("faces", "mirror", "weld", "centre", "middle")}
    arrays["numbers"] = np.array([prepared.radius, prepared.frame_count, prepared.geometry.still])
    arrays["first"] = np.asarray(prepared.geometry.positions(0), dtype=np.float64).reshape(-1, 3)
    arrays |= arrays_of(prepared.alpha)
    motion = prepared.geometry.motion
    if motion is not None and motion.bodies is not None:
        arrays["bodies"] = np.asarray(motion.bodies)
    if not prepared.moves:
        frames = ()
    elif not prepared.points(0)[1].all():
        frames = range(prepared.frame_count)
    for frame in sorted({0, *frames}):
        arrays[f"points_{frame}"], arrays[f"valid_{frame}"] = prepared.points(frame)
    write_arrays(path, arrays, compressed=False)


def read_stored(path: Path, scene: Scene) -> Prepared:
    """The prepared scene that :func:`store` wrote. ``scene``: the one that was prepared. It has the frames that were
    stored; its ``points`` raises :class:`UserError` for others. Positions of frames after the first are those of
    float32.
    """
    with np.load(path) as kept:
        arrays = {name: kept[name] for name in kept.files}
    centre, first = arrays["centre"], arrays["first"]
    radius, frame_count, still = arrays["numbers"].tolist()
    frames = sorted(int(name.removeprefix("points_")) for name in arrays if name.startswith("points_"))

    def points(frame: int) -> tuple[F32, U8]:
        stored = 0 if still else frame
        if stored not in frames:
            raise UserError(f"{scene.name}: frame {frame} was not stored; there are {frames}")
        return arrays[f"points_{stored}"], arrays[f"valid_{stored}"]

    def positions(frame: int) -> F64:
        return first if still or frame == 0 else points(frame)[0].astype(np.float64) + centre

    motion = Moves("rigid", bodies=arrays["bodies"]) if "bodies" in arrays else None
    faces, weld, middle, mirror = (arrays[name] for name in ("faces", "weld", "middle", "mirror"))
    geometry = Geometry(faces, positions, int(frame_count), motion, bool(still))
    return Prepared(scene, geometry, faces, centre, weld, middle, radius, from_arrays(arrays), mirror, points)
