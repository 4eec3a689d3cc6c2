"""A scene declared in a TOML file: a mesh or a catalogue scene with its own camera, lights and effects.

    mesh = "room.ply"                 # a file or folder beside this one, or a scene of the catalogue

    [[lights]]
    position = [0, 2.4, 0]
    spot = {direction = [0, -1, 0], angle = 40}

docs/effects.md has all keys. What a file leaves out is taken from the mesh. [[cameras]] are offered by their names, and so
are lights with one. Instead of one mesh there may be several [[meshes]], see :mod:`.assembly`.
"""

import dataclasses
import functools
import tomllib
from collections.abc import Callable
from hashlib import sha256
from os.path import exists
from pathlib import Path
from typing import Any

from ..errors import UserError, did_you_mean, one_line
from ..files import read_regular
from ..texts import visible
from .assembly import assembled, declared_parts
from .declared_views import CAMERA, Table, camera_of, lights_of, named_cameras, with_path
from .effects import OUTPUTS
from .light_paths import Orbit
from .overrides import largest_triangles, perforated
from .readers.checks import ALL, Wanted, refuse_pointer
from .readers.sequences import is_pattern
from .scene import Scene

MOST_BYTES = 1 << 20  # longest declaration, bytes
MOST_BOUNCES = 64  # largest number of bounces: a frame has passes and buffers for each one
MOST_HOLES = 2**20  # along a side of a triangle; with more, texel numbers would leave the range of int32

TOP = (
    "mesh", "meshes", "title", "closed", "facing", "outputs", "camera", "cameras", "lights", "orbit", "alpha", "mirror",
)  # fmt: skip


def declared_scene(path: Path, resolve: Callable[[str, Wanted], Scene], wanted: Wanted = ALL) -> Scene:
    """The scene that a file declares. ``resolve`` finds a mesh; ``wanted``: what is asked of it. Raises :class:`UserError`
    for any mistake in it.
    """
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
