"""Several meshes as one scene: ``[[meshes]]`` of a declaration, each a file or a scene in its place, at rest or moving.

    [[meshes]]                        # docs/files.md shows several
    file = "dancer/%04d.ply"          # a file, a folder or a pattern of frames beside the declaration, or a scene
    frames = "0:90:10"
    transform = {scale = 0.01, rotate = [90, 0, 0], translate = [0, 0, 2]}

A transform is a scale (one number, or one for each axis), then rotations about x, y and z in degrees, in this order, then
a translation; or a ``matrix`` of four rows that column vectors are multiplied by. A mesh with fewer frames than the
longest stays as in its last one.
"""

import functools
import hashlib
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import F64, I32, Floats
from ..errors import UserError, note
from .declared_views import Table, listed, with_path
from .light_paths import vector
from .readers.checks import LARGEST, MAX_TRIANGLES, Wanted, frames_of
from .scene import Camera, Geometry, Moves, Scene, Source
from .shape import shape_of
from .views import view

MATRIX = F64  # float64 [4, 4]: what column vectors are multiplied by


@dataclass(frozen=True, eq=False)
class Part:
    """A mesh in its place. ``name``: as the declaration names it."""

    name: str
    scene: Scene
    matrix: MATRIX


def declared_parts(path: Path, tables: Any, resolve: Callable[[str, Wanted], Scene], wanted: Wanted) -> list[Part]:
    """The meshes of ``[[meshes]]``. ``resolve`` finds each; ``wanted``: what is asked of all. Raises :class:`UserError`."""
    parts = []
    for i, table in enumerate(listed(path, "meshes", tables)):
        given = Table(path, f"meshes[{i}]", table, ("file", "transform", "frames"))
        file, own = given.values.get("file"), replace(wanted, frames=None)
        if not isinstance(file, str) or not file:
            raise UserError(f'{given}: add its file: file = "FILE or name of a scene"')
        if "frames" in given.values:
            frames = given.typed("frames", str)
            try:
                own = replace(own, frames=frames_of(frames))
            except UserError as error:
                raise UserError(f"{given}.frames: {str(error).removeprefix('--frames ')}") from error
        scene = with_path(path, f"{given.where}: ", functools.partial(resolve, file, own))
        if scene.alpha is not None or scene.mirror is not None:
            raise UserError(f"{given}: has holes or mirrors of its own; declare [alpha] and [mirror] here instead")
        parts.append(Part(file, scene, matrix_of(path, f"{given.where}.transform", given.values.get("transform", {}))))
    if not parts:
        raise UserError(f"{path}: meshes: give at least one")
    return parts


def matrix_of(path: Path, where: str, table: Any) -> MATRIX:
    given = Table(path, where, table, ("scale", "rotate", "translate", "matrix"))
    if "matrix" in table:
        if len(table) > 1:
            raise UserError(f"{given}: give either a matrix, or scale, rotate and translate")
        rows = given.typed("matrix", list)
        if len(rows) != 4 or any(not isinstance(row, list) or len(row) != 4 for row in rows):
            raise given.error("matrix", "must be four rows of four numbers")
        matrix = np.array([given.numbers("matrix", row) for row in rows])
        if matrix[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
            raise UserError(f"{given}.matrix: its last row must be 0, 0, 0, 1")
        return matrix
    matrix, nothing = np.eye(4), (0.0, 0.0, 0.0)
    scale = given.vector("scale") if isinstance(table.get("scale"), list) else given.number("scale", 1.0)
    matrix[:3, :3] = np.diag(np.broadcast_to(scale, 3))
    for axis, degrees in enumerate(given.vector("rotate", nothing)):
        matrix[:3, :3] = _turn(axis, degrees) @ matrix[:3, :3]
    matrix[:3, 3] = given.vector("translate", nothing)
    return matrix


def _turn(axis: int, degrees: float) -> F64:
    """The rotation about a coordinate axis, counterclockwise seen from its tip; exact for multiples of 90 degrees."""
    quarters, rest = divmod(degrees, 90.0)
    angle = np.radians(rest)
    c, s = np.cos(angle), np.sin(angle)
    for _ in range(int(quarters) % 4):
        c, s = -s, c
    one, other = (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    turn[one, one], turn[one, other], turn[other, one], turn[other, other] = c, -s, s, c
    return turn


def assembled(path: Path, parts: Sequence[Part], wanted: Wanted) -> Scene:
    """The scene of several meshes, with a view chosen from its shape; of its frames those ``wanted``. Its cameras and
    lights are those of all meshes; the second of one name is "NAME 2"."""
    geometry = joined(path, parts, wanted)
    scenes = [part.scene for part in parts]
    shape = shape_of(geometry, scenes[0].camera.up)
    if max(-shape.low.min(), shape.high.max()) > LARGEST:
        raise UserError(f"{path}: meshes: have coordinates too large for float32 rays; choose other transforms")
    named = [scene.source.file or scene.name for scene in scenes]
    sources = list(zip(named, (scene.source for scene in scenes), strict=True))
    hashes = "\n".join(f"{name} {one.sha256}" for name, one in sources)
    left_out = [f"{name}: {one.left_out}" for name, one in sources if one.left_out]
    rates = list(dict.fromkeys(scene.rate for scene in scenes if scene.rate))
    if len(rates) > 1:
        said = f"rates of {' and '.join(f'{rate:g}' for rate in rates)} frames a second read frame by frame"
        note(f"{path}: {said}")
        left_out.append(said)
    step = wanted.frames[2] if wanted.frames else 1
    digest = hashlib.sha256(hashes.encode()).hexdigest()
    return Scene(
        path.stem, " + ".join(scene.title for scene in scenes), lambda: geometry, *view(shape),
        stand_in="; ".join(dict.fromkeys(scene.stand_in for scene in scenes if scene.stand_in)) or None,
        closed=all(scene.closed for scene in scenes),
        source=Source("file", " + ".join(named), digest, wanted.facts(), "; ".join(left_out)),
        cameras=_offers(parts, "cameras"), lamps=_offers(parts, "lamps"),
        rate=rates[0] / step if rates and geometry.frame_count > 1 else None,
    )  # fmt: skip


def joined(path: Path, parts: Sequence[Part], wanted: Wanted) -> Geometry:
    """The meshes as one, in their order; of its frames those ``wanted``. Positions are float64."""
    meshes = [part.scene.geometry() for part in parts]
    placed = list(zip(meshes, (part.matrix for part in parts), strict=True))
    starts = np.cumsum([0, *(len(mesh.positions(0)) for mesh in meshes)])
    triangles = sum(len(mesh.faces) for mesh in meshes)
    if triangles > MAX_TRIANGLES or starts[-1] >= 2**31:
        raise UserError(
            f"{path}: meshes: {triangles:,} triangles together are more than can be indexed; leave out some"
        )
    faces = [
        _outwards(mesh.faces, matrix) + np.int32(start) for (mesh, matrix), start in zip(placed, starts, strict=False)
    ]
    chosen = wanted.chosen(path, max(mesh.frame_count for mesh in meshes))

    def positions(frame: int) -> F64:
        k = chosen[frame]
        return np.concatenate(
            [_placed(mesh.positions(min(k, mesh.frame_count - 1)), matrix) for mesh, matrix in placed]
        )

    moving = [i for i, mesh in enumerate(meshes) if mesh.frame_count > 1]
    motion = None
    if len(chosen) > 1 and moving:
        bodies = _bodies(meshes)
        span = (int(starts[moving[0]]), int(starts[moving[-1] + 1])) if len(meshes) > 1 else None
        if bodies is not None:
            motion = Moves("rigid", span, bodies)
        elif len(moving) == 1 and span:
            motion = Moves("deforming", span)
    return Geometry(np.concatenate(faces), positions, len(chosen), motion)


def _bodies(meshes: Sequence[Geometry]) -> I32 | None:
    """Which triangles of all meshes move together: each body of a mesh, and all that rest, body 0. None: unknown."""
    parts, count = [], 1
    for mesh in meshes:
        if not mesh.moves:
            parts.append(np.zeros(len(mesh.faces), dtype=np.int32))
        elif mesh.motion is not None and mesh.motion.bodies is not None:
            own = np.unique(mesh.motion.bodies, return_inverse=True)[1].ravel().astype(np.int32)
            parts.append(own + count)
            count += int(own.max(initial=0)) + 1
        else:
            return None
    return np.concatenate(parts)


def _outwards(faces: I32, matrix: MATRIX) -> I32:
    """The triangles of a mesh, turned round where the matrix mirrors: the front of a closed mesh stays its outside."""
    return faces[:, [0, 2, 1]] if np.linalg.det(matrix[:3, :3]) < 0.0 else faces


def _placed(points: Floats, matrix: MATRIX) -> F64:
    placed: F64 = points.astype(np.float64)
    if not np.array_equal(matrix, np.eye(4)):
        with np.errstate(over="ignore", invalid="ignore"):
            placed = placed @ matrix[:3, :3].T + matrix[:3, 3]
    return placed


def _offers(parts: Sequence[Part], kind: str) -> dict[str, Any]:
    """The cameras or lights of all meshes, in their places."""
    offers: dict[str, Any] = {}
    for part in parts:
        for name, one in getattr(part.scene, kind).items():
            names = itertools.chain([name], (f"{name} {n}" for n in itertools.count(2)))
            offers[next(free for free in names if free not in offers)] = _moved(one, part.matrix)
    return offers


def _moved(one: Any, matrix: MATRIX) -> Any:
    """A camera or a light in the place of its mesh."""
    turn, size = matrix[:3, :3], float(np.abs(np.linalg.det(matrix[:3, :3]))) ** (1 / 3)
    if isinstance(one, Camera):
        eye, target = (vector(turn @ place + matrix[:3, 3]) for place in (one.eye, one.target))
        height = one.height and one.height * size
        return replace(one, eye=eye, target=target, up=vector(turn @ one.up), height=height)
    place = turn @ one.position + (0.0 if one.directional else matrix[:3, 3])
    spot = one.spot and replace(one.spot, direction=vector(turn @ one.spot.direction), up=vector(turn @ one.spot.up))
    towards, across = (way and vector(turn @ way) for way in (one.towards, one.across))
    return replace(one.resized(size), position=vector(place), spot=spot, towards=towards, across=across)
