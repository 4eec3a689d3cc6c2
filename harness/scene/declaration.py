"""A scene declared in a TOML file: a mesh or a catalogue scene with its own camera, lights and effects.

    mesh = "room.ply"                 # a file or folder beside this one, or a scene of the catalogue
    title = "Room at night"
    closed = false
    facing = true                     # shadow rays only where a surface faces the light
    outputs = ["ids", "shadows"]      # any of depth, ids, shadows, color, counters

    [camera]
    eye = [0, 1.7, 4]
    target = [0, 1, 0]
    fov = 50

    [[lights]]
    position = [0, 2.4, 0]
    spot = {direction = [0, -1, 0], angle = 40}

    [[lights]]
    position = [1, 3, 0.5]            # of a directional light: the direction towards it
    directional = true
    shadows = false

    [orbit]                           # every light turns about an axis during the animation
    centre = [0, 1, 0]
    turns = 1
    frames = 12                       # number of frames, if the mesh is static

    [alpha]
    every = 4                         # every fourth triangle has holes
    holes = 4

    [mirror]
    share = 0.5                       # the largest triangles that together have half of the area are mirrors
    bounces = 1

Everything else is taken from the mesh.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import math
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import UserError, did_you_mean
from ..files import read_regular
from ..texts import visible
from .effects import OUTPUTS
from .light_paths import Orbit
from .moment import ray_tables
from .readers.checks import exists
from .scene import Camera, Light, Scene, Spot
from .spotlight import spot_row
from .surface_rules import largest_triangles, perforated

SUFFIX = ".toml"

MOST_BYTES = 1 << 20
"""Longest declaration, bytes."""

MOST_BOUNCES = 64
"""Largest number of bounces: a frame has passes and buffers for each one."""

FARTHEST = 1e38
"""Largest coordinate of an eye or a light, about the largest float32."""

BRIGHTEST = 1e12
"""Largest intensity and colour; float32 can hold their product."""

MOST = 2**31 - 1

MOST_HOLES = 2**20
"""Largest number of holes along a side of a triangle; with more, texel numbers would leave the range of int32."""

KINDS = ("perspective", "orthographic")
"""Kinds of camera."""

TOP = ("mesh", "title", "closed", "facing", "outputs", "camera", "lights", "orbit", "alpha", "mirror")


def declared_scene(path: Path, resolve: Callable[[str], Scene]) -> Scene:
    """The scene that a file declares. ``resolve`` finds its mesh. Raises :class:`UserError` for any mistake in it."""
    if exists(path) and not path.is_file():
        raise UserError(f"{path}: not a file")
    try:
        data = read_regular(path, MOST_BYTES)
        table = tomllib.loads(data.decode("utf-8-sig"))  # some editors write a byte order mark
    except OSError as error:
        raise UserError(f"{path}: cannot read ({error.strerror})") from error
    except (
        ValueError,
        RecursionError,
    ) as error:  # wrong syntax or encoding, a number too long, nesting too deep
        raise UserError(f"{path}: not valid TOML: {' '.join(str(error).split())}") from error
    _known(path, "", table, TOP)
    mesh = table.get("mesh")
    if not isinstance(mesh, str) or not mesh:
        raise UserError(f'{path}: add the mesh: mesh = "FILE or name of a scene"')
    beside = path.parent / mesh
    try:
        base = resolve(str(beside) if exists(beside) else mesh)
    except UserError as error:
        raise UserError(f"{path}: mesh: {error}") from error
    fields: dict[str, Any] = {
        "title": _title(path, table.get("title", f"{base.title} ({visible(path.name)})")),
        "closed": _typed(path, "closed", table.get("closed", base.closed), bool),
        "facing": _typed(path, "facing", table.get("facing", base.facing), bool),
        "source": dataclasses.replace(
            base.source,
            file=f"{visible(path.name)}: {base.source.file or base.name}",
            sha256=_hash(base, data),
        ),
    }
    if "outputs" in table:
        fields["outputs"] = _outputs(path, table["outputs"])
    if "camera" in table:
        _known(path, "camera", table["camera"], ("kind", "eye", "target", "up", "fov", "height", "moves"))
        given = dict(table["camera"])
        fields["camera_moves"] = _typed(path, "camera.moves", given.pop("moves", False), bool)
        camera = _made(path, "camera", Camera, {**dataclasses.asdict(base.camera), **_lens(path, given)})
        _near(path, "camera.eye", camera.eye)
        _with_path(path, "", lambda: ray_tables(camera, 1, 1, np.zeros(3)))
        fields["camera"] = camera
    if "lights" in table:
        if not isinstance(table["lights"], list):
            raise UserError(f"{path}: write [[lights]] before each light")
        fields["lights"] = tuple(_light(path, i, light) for i, light in enumerate(table["lights"]))
        fields["light_path"] = None
    if "orbit" in table:
        _known(path, "orbit", table["orbit"], ("centre", "axis", "turns", "frames"))
        given = dict(table["orbit"])
        frames = _whole(path, "orbit.frames", given.pop("frames", 1))
        orbit = _made(path, "orbit", Orbit, given)
        if not any(orbit.axis):
            raise UserError(f"{path}: orbit.axis must not be zero")
        fields["light_path"] = orbit
        fields["geometry"] = lambda: base.geometry().lasting(frames)
    if "alpha" in table:
        _known(path, "alpha", table["alpha"], ("every", "holes"))
        for name, value in table["alpha"].items():
            _whole(path, f"alpha.{name}", value, MOST_HOLES if name == "holes" else MOST)
        fields["alpha"] = functools.partial(perforated, **table["alpha"])
    if "mirror" in table:
        _known(path, "mirror", table["mirror"], ("share", "bounces"))
        share = _number(path, "mirror.share", table["mirror"].get("share", 0.5))
        if not 0.0 < share <= 1.0:
            raise UserError(f"{path}: mirror.share {share} must be greater than 0 and at most 1")
        fields["mirror"] = functools.partial(largest_triangles, share=share)
        fields["bounces"] = _typed(path, "mirror.bounces", table["mirror"].get("bounces", 1), int)
        if not 0 <= fields["bounces"] <= MOST_BOUNCES:
            raise UserError(f"{path}: mirror.bounces {fields['bounces']} must lie in 0..{MOST_BOUNCES}")
    return dataclasses.replace(base, **fields)


def _lens(path: Path, given: dict[str, Any]) -> dict[str, Any]:
    """The fields of a camera table, without its kind: an orthographic camera has a height, a pinhole camera a fov."""
    given = dict(given)
    kind = given.pop("kind", "perspective")
    if kind not in KINDS:
        raise UserError(f"{path}: camera.kind {kind!r} is not one of {', '.join(KINDS)}")
    asked, other = ("height", "fov") if kind == "orthographic" else ("fov", "height")
    if other in given:
        raise UserError(f"{path}: camera.{other} does not apply to a camera of kind {kind}; give {asked}")
    if kind == "orthographic" and "height" not in given:
        raise UserError(f"{path}: camera: add its height, what the image shows from bottom to top")
    return given if kind == "orthographic" else {**given, "height": None}


def _light(path: Path, index: int, table: Any) -> Light:
    where = f"lights[{index}]"
    _known(path, where, table, tuple(field.name for field in dataclasses.fields(Light)))
    given = dict(table)
    if "position" not in given:
        raise UserError(
            f"{path}: {where}: add its position (of a directional light: the direction towards it)"
        )
    if "spot" in given:
        _known(path, f"{where}.spot", given["spot"], tuple(field.name for field in dataclasses.fields(Spot)))
        spot = _made(path, f"{where}.spot", Spot, given["spot"])
        if spot.falloff < 0.0:
            raise UserError(f"{path}: {where}.spot.falloff must not be negative")
        _with_path(path, f"{where}: ", lambda: spot_row(spot))
        given["spot"] = spot
    light: Light = _made(path, where, Light, given)
    for name, values in (("color", light.color), ("intensity", (light.intensity,))):
        if not 0.0 <= min(values) <= max(values) <= BRIGHTEST:
            raise UserError(f"{path}: {where}.{name} must lie in 0..{BRIGHTEST:g}")
    if not light.directional:
        _near(path, f"{where}.position", light.position)
    elif not any(light.position):
        raise UserError(f"{path}: {where}.position: the direction of a directional light must not be zero")
    return light


def _with_path(path: Path, where: str, rule: Callable[[], Any]) -> None:
    """Apply a check that would otherwise fail only when a frame is made, and add the file to its error."""
    try:
        rule()
    except UserError as error:
        raise UserError(f"{path}: {where}{error}") from error


def _near(path: Path, where: str, point: tuple[float, float, float]) -> None:
    if max(abs(x) for x in point) > FARTHEST:
        raise UserError(f"{path}: {where} {point} is outside the range of float32")


def _made(path: Path, where: str, kind: type, given: dict[str, Any]) -> Any:
    """A frozen dataclass made from TOML values; the name of each field determines its type."""
    missing = dataclasses.MISSING
    for field in dataclasses.fields(kind):
        if field.default is missing and field.default_factory is missing and field.name not in given:
            raise UserError(f"{path}: {where}: add its {field.name}")
    values: dict[str, Any] = {}
    for name, value in given.items():
        if name in ("eye", "target", "up", "position", "direction", "color", "centre", "axis"):
            values[name] = _vector(path, f"{where}.{name}", value)
        elif name in ("shadows", "directional"):
            values[name] = _typed(path, f"{where}.{name}", value, bool)
        elif name == "spot" or value is None:
            values[name] = value
        else:
            values[name] = _number(path, f"{where}.{name}", value)
    try:
        return kind(**values)
    except (TypeError, ValueError) as error:
        raise UserError(f"{path}: {where}: {error}") from error


def _outputs(path: Path, table: Any) -> tuple[str, ...]:
    names = tuple(_typed(path, "outputs", table, list))
    for name in names:
        if name not in OUTPUTS:
            raise UserError(f"{path}: unknown output {name!r}{did_you_mean(str(name), OUTPUTS)}")
    if not names or len(set(names)) < len(names):
        raise UserError(f"{path}: outputs: give at least one of {', '.join(OUTPUTS)}, each once")
    return names


def _title(path: Path, table: Any) -> str:
    title: str = _typed(path, "title", table, str)
    if not title.strip() or not title.isprintable():
        raise UserError(f"{path}: title must be one line of text")
    return title


def _whole(path: Path, where: str, value: Any, most: int = MOST) -> int:
    if not 1 <= _typed(path, where, value, int) <= most:
        raise UserError(f"{path}: {where} must lie in 1..{most}")
    return int(value)


def _known(path: Path, where: str, table: Any, names: tuple[str, ...]) -> None:
    if not isinstance(table, dict):
        raise UserError(f"{path}: {where} must be a table")
    for name in table:
        if name not in names:
            spot = f"{where}: " if where else ""
            raise UserError(f"{path}: {spot}unknown key {name!r}{did_you_mean(name, names)}")


def _typed(path: Path, where: str, value: Any, kind: type) -> Any:
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise UserError(f"{path}: {where} must have type {kind.__name__}, not {value!r}")
    return value


def _number(path: Path, where: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise UserError(f"{path}: {where} must be a number, not {value!r}")
    try:
        number = float(value)
    except OverflowError:  # TOML integers have no limit
        number = math.inf
    if not math.isfinite(number):
        raise UserError(f"{path}: {where} must be finite, not {value!r}")
    return number


def _vector(path: Path, where: str, value: Any) -> tuple[float, float, float]:
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise UserError(f"{path}: {where} must be three numbers, not {value!r}")
    x, y, z = (_number(path, where, part) for part in value)
    return (x, y, z)


def _hash(base: Scene, data: bytes) -> str:
    """A hash of the mesh and of the declaration."""
    return hashlib.sha256(base.source.sha256.encode() + data).hexdigest()
