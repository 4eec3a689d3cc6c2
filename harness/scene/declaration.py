"""A scene declared in a TOML file: a mesh or a catalogue scene with its own camera, lights and effects.

    mesh = "room.ply"                 # a file or folder beside this one, or a scene of the catalogue

    [[lights]]
    position = [0, 2.4, 0]
    spot = {direction = [0, -1, 0], angle = 40}

docs/effects.md has all keys. What a file leaves out is taken from the mesh. [[cameras]] are offered by their names, and so
are lights with one. Instead of one mesh there may be several [[meshes]], each in its place, at rest or moving:

    [[meshes]]                        # docs/files.md shows several
    file = "dancer/%04d.ply"          # a file, a folder or a pattern of frames beside the declaration, or a scene
    frames = "0:90:10"
    transform = {scale = 0.01, rotate = [90, 0, 0], translate = [0, 0, 2]}

A transform is a scale (one number, or one for each axis), then rotations about x, y and z in degrees, in this order, then
a translation; or a ``matrix`` of four rows that column vectors are multiplied by. A mesh with fewer frames than the
longest stays as in its last one.
"""

import dataclasses
import functools
import hashlib
import itertools
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from os.path import exists
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import F64, I32, Floats
from ..errors import UserError, did_you_mean, note, one_line
from ..files import read_regular
from ..texts import visible
from .declared_views import CAMERA, Table, camera_of, lights_of, listed, named_cameras, with_path
from .effects import OUTPUTS
from .light_paths import Orbit, vector
from .overrides import largest_triangles, perforated
from .readers.checks import ALL, LARGEST, MAX_TRIANGLES, Wanted, frames_of, refuse_pointer
from .readers.sequences import is_pattern
from .scene import Camera, Geometry, Moves, Scene, Source
from .shape import shape_of
from .views import view

MATRIX = F64  # float64 [4, 4]: what column vectors are multiplied by

MOST_BYTES = 1 << 20  # longest declaration, bytes
MOST_BOUNCES = 64  # largest number of bounces: a frame has passes and buffers for each one
MOST_HOLES = 2**20  # along a side of a triangle; with more, texel numbers would leave the range of int32

TOP = (
    "mesh", "meshes", "title", "closed", "facing", "outputs", "camera", "cameras", "lights", "orbit", "alpha", "mirror",
)  # fmt: skip


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
    lights are those of all meshes; the second of one name is "NAME 2".
    """
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


def declared_scene(path: Path, resolve: Callable[[str, Wanted], Scene], wanted: Wanted = ALL) -> Scene:
    """The scene of a file. ``resolve`` finds a mesh. Raises :class:`UserError` for any mistake in it."""
    if exists(path) and not path.is_file():
        raise UserError(f"{path}: not a file")
    try:
        data = read_regular(path, MOST_BYTES)
        refuse_pointer(path, data)
        table = tomllib.loads(data.decode("utf-8-sig"))  # some editors write a byte order mark
    except OSError as error:
        raise UserError(f"{path}: cannot read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:  # wrong syntax or encoding, a number too long, nesting too deep
        raise UserError(f"{path}: not valid TOML: {one_line(error)}") from error
    top = Table(path, "", table, TOP)
    base = _base(top, resolve, wanted)
    said = f"{visible(path.name)}: {base.source.file or base.name}"
    digest = sha256(base.source.sha256.encode() + data).hexdigest()
    fields: dict[str, Any] = {
        "title": top.typed("title", str, f"{base.title} ({visible(path.name)})"),
        "closed": top.typed("closed", bool, base.closed),
        "facing": top.typed("facing", bool, base.facing),
        "source": dataclasses.replace(base.source, file=said, sha256=digest),
        "outputs": _outputs(top) if "outputs" in table else base.outputs,
    }
    if not fields["title"].strip() or not fields["title"].isprintable():
        raise top.error("title", "must be one line of text")
    if "cameras" in table:
        base = dataclasses.replace(base, cameras={**base.cameras, **named_cameras(path, table["cameras"], base)})
    if "camera" in table:
        camera = top.table("camera", (*CAMERA, "moves"))
        fields["camera_moves"] = camera.typed("moves", bool, False)
        camera.values.pop("moves", None)
        fields["camera"] = camera_of(camera, base)
    if "lights" in table:
        fields["lights"], named = lights_of(path, table["lights"], base)
        fields |= {"lamps": {**base.lamps, **named}, "light_path": None}
    if "orbit" in table:
        turning = top.table("orbit", ("centre", "axis", "turns", "frames"))
        frames = turning.whole("frames", 1)
        turning.values.pop("frames", None)
        fields["light_path"] = orbit = turning.made(Orbit)
        if not any(orbit.axis):
            raise turning.error("axis", "must not be zero")
        fields["geometry"] = lambda: base.geometry().lasting(frames)
    if "alpha" in table:
        holes = top.table("alpha", ("every", "holes"))
        every, side = holes.whole("every", 2), holes.whole("holes", 4, MOST_HOLES)
        fields["alpha"] = functools.partial(perforated, every=every, holes=side)
    if "mirror" in table:
        mirror = top.table("mirror", ("share", "bounces"))
        share, bounces = mirror.number("share", 0.5), mirror.typed("bounces", int, 1)
        if not 0.0 < share <= 1.0:
            raise mirror.error("share", f"{share} must be greater than 0 and at most 1")
        if not 0 <= bounces <= MOST_BOUNCES:
            raise mirror.error("bounces", f"{bounces} must lie in 0..{MOST_BOUNCES}")
        fields |= {"mirror": functools.partial(largest_triangles, share=share), "bounces": bounces}
    return dataclasses.replace(base, **fields)


def _base(top: Table, resolve: Callable[[str, Wanted], Scene], wanted: Wanted) -> Scene:
    """The scene of the declaration's mesh or meshes, to which it adds."""
    path, mesh = top.path, top.values.get("mesh")

    def beside(name: str, wanted: Wanted) -> Scene:
        place = str(path.parent / name)
        return resolve(place if exists(Path(place)) or is_pattern(name) else name, wanted)

    if "meshes" in top.values:
        if mesh is not None:
            raise UserError(f"{path}: give either mesh or [[meshes]]")
        return assembled(path, declared_parts(path, top.values["meshes"], beside, wanted), wanted)
    if not isinstance(mesh, str) or not mesh:
        raise UserError(f'{path}: add the mesh: mesh = "FILE or name of a scene"')
    found: Scene = with_path(path, "mesh: ", lambda: beside(mesh, wanted))
    return found


def _outputs(top: Table) -> tuple[str, ...]:
    names = tuple(top.typed("outputs", list))
    for name in names:
        if name not in OUTPUTS:
            raise UserError(f"{top}: unknown output {name!r}{did_you_mean(str(name), OUTPUTS)}")
    if not names or len(set(names)) < len(names):
        raise UserError(f"{top}: outputs: give at least one of {', '.join(OUTPUTS)}, each once")
    return names
