"""A scene declared in a file of its own: a mesh or a catalogue scene, and what it calls for (TOML).

    mesh = "room.ply"                 # a file or folder beside this one, or a scene of the catalogue
    title = "Room at night"
    closed = false
    facing = true                     # shadow rays only where a surface faces the light
    outputs = ["ids", "shadows"]      # of depth, ids, shadows, color, counters

    [camera]
    eye = [0, 1.7, 4]
    target = [0, 1, 0]
    fov = 50

    [[lights]]
    position = [0, 2.4, 0]
    spot = {direction = [0, -1, 0], angle = 40}

    [[lights]]
    position = [1, 3, 0.5]            # the way to it
    directional = true
    shadows = false

    [orbit]                           # every light turns about an axis, over the frames
    centre = [0, 1, 0]
    turns = 1
    frames = 12                       # of a mesh that does not move itself

    [alpha]
    every = 4                         # every fourth triangle has holes
    holes = 4

    [mirror]
    share = 0.5                       # the largest triangles, which make half of the area
    bounces = 1

What is not declared stays as the mesh has it.
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
from .effects import OUTPUTS
from .light_paths import Orbit
from .moment import ray_tables
from .readers.checks import exists
from .scene import Camera, Light, Scene, Spot
from .spotlight import spot_row
from .surface_rules import largest_triangles, perforated

SUFFIX = ".toml"

MOST_BOUNCES = 64
"""A frame has passes and buffers for every bounce that is declared, so that absurd numbers must end somewhere."""

FARTHEST = 1e38
"""What float32 holds, about: an eye or a light beyond it would stand at infinity."""

BRIGHTEST = 1e12
"""Intensity and colour end somewhere: float32 holds their product."""

MOST = 2**31 - 1

MOST_HOLES = 2**20
"""More along a side of a triangle are no picture any more, and soon beyond what texels can be told by."""

TOP = ("mesh", "title", "closed", "facing", "outputs", "camera", "lights", "orbit", "alpha", "mirror")


def declared_scene(path: Path, resolve: Callable[[str], Scene]) -> Scene:
    """The scene that a file declares; ``resolve`` finds its mesh. Raises :class:`UserError` for whatever is wrong."""
    if exists(path) and not path.is_file():
        raise UserError(f"{path}: is not a file")
    try:
        data = path.read_bytes()
        told = tomllib.loads(data.decode("utf-8-sig"))  # editors put a mark before the text
    except OSError as error:
        raise UserError(f"{path}: cannot read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:  # of TOML, of its text, of a number's digits, of its depth
        raise UserError(f"{path}: not TOML: {' '.join(str(error).split())}") from error
    _known(path, "", told, TOP)
    mesh = told.get("mesh")
    if not isinstance(mesh, str) or not mesh:
        raise UserError(f'{path}: say which mesh: mesh = "FILE or scene"')
    beside = path.parent / mesh
    try:
        base = resolve(str(beside) if exists(beside) else mesh)
    except UserError as error:
        raise UserError(f"{path}: mesh: {error}") from error
    fields: dict[str, Any] = {
        "title": _title(path, told.get("title", f"{base.title} ({path.name})")),
        "closed": _typed(path, "closed", told.get("closed", base.closed), bool),
        "facing": _typed(path, "facing", told.get("facing", base.facing), bool),
        "source": dataclasses.replace(
            base.source, file=f"{path.name}: {base.source.file or base.name}", sha256=_hash(base, data)
        ),
    }
    if "outputs" in told:
        fields["outputs"] = _outputs(path, told["outputs"])
    if "camera" in told:
        _known(path, "camera", told["camera"], ("eye", "target", "up", "fov", "moves"))
        given = dict(told["camera"])
        fields["camera_moves"] = _typed(path, "camera.moves", given.pop("moves", False), bool)
        camera = _made(path, "camera", Camera, {**dataclasses.asdict(base.camera), **given})
        _near(path, "camera.eye", camera.eye)
        _told_at_once(path, "", lambda: ray_tables(camera, 1, 1, np.zeros(3)))
        fields["camera"] = camera
    if "lights" in told:
        if not isinstance(told["lights"], list):
            raise UserError(f"{path}: lights are tables of their own: write [[lights]]")
        fields["lights"] = tuple(_light(path, i, light) for i, light in enumerate(told["lights"]))
        fields["light_path"] = None
    if "orbit" in told:
        _known(path, "orbit", told["orbit"], ("centre", "axis", "turns", "frames"))
        given = dict(told["orbit"])
        frames = _whole(path, "orbit.frames", given.pop("frames", 1))
        orbit = _made(path, "orbit", Orbit, given)
        if not any(orbit.axis):
            raise UserError(f"{path}: orbit.axis must not be zero")
        fields["light_path"] = orbit
        fields["geometry"] = lambda: base.geometry().lasting(frames)
    if "alpha" in told:
        _known(path, "alpha", told["alpha"], ("every", "holes"))
        for name, value in told["alpha"].items():
            _whole(path, f"alpha.{name}", value, MOST_HOLES if name == "holes" else MOST)
        fields["alpha"] = functools.partial(perforated, **told["alpha"])
    if "mirror" in told:
        _known(path, "mirror", told["mirror"], ("share", "bounces"))
        share = _number(path, "mirror.share", told["mirror"].get("share", 0.5))
        if not 0.0 < share <= 1.0:
            raise UserError(f"{path}: mirror.share {share} must lie above 0 and not above 1")
        fields["mirror"] = functools.partial(largest_triangles, share=share)
        fields["bounces"] = _typed(path, "mirror.bounces", told["mirror"].get("bounces", 1), int)
        if not 0 <= fields["bounces"] <= MOST_BOUNCES:
            raise UserError(f"{path}: mirror.bounces {fields['bounces']} must lie in 0..{MOST_BOUNCES}")
    return dataclasses.replace(base, **fields)


def _light(path: Path, index: int, told: Any) -> Light:
    where = f"lights[{index}]"
    _known(path, where, told, tuple(field.name for field in dataclasses.fields(Light)))
    given = dict(told)
    if "position" not in given:
        raise UserError(f"{path}: {where}: say its position (of a directional light: the way to it)")
    if "spot" in given:
        _known(path, f"{where}.spot", given["spot"], tuple(field.name for field in dataclasses.fields(Spot)))
        spot = _made(path, f"{where}.spot", Spot, given["spot"])
        if spot.falloff < 0.0:
            raise UserError(f"{path}: {where}.spot.falloff must not be negative")
        _told_at_once(path, f"{where}: ", lambda: spot_row(spot))
        given["spot"] = spot
    light: Light = _made(path, where, Light, given)
    for name, values in (("color", light.color), ("intensity", (light.intensity,))):
        if not 0.0 <= min(values) <= max(values) <= BRIGHTEST:
            raise UserError(f"{path}: {where}.{name} must lie in 0..{BRIGHTEST:g}")
    if not light.directional:
        _near(path, f"{where}.position", light.position)
    elif not any(light.position):
        raise UserError(f"{path}: {where}.position: the way to a directional light must not be zero")
    return light


def _told_at_once(path: Path, where: str, rule: Callable[[], Any]) -> None:
    """Try a rule that a frame goes by, so that the file is named and nothing starts before."""
    try:
        rule()
    except UserError as error:
        raise UserError(f"{path}: {where}{error}") from error


def _near(path: Path, where: str, point: tuple[float, float, float]) -> None:
    if max(abs(x) for x in point) > FARTHEST:
        raise UserError(f"{path}: {where} {point} is outside the range of float32")


def _made(path: Path, where: str, kind: type, given: dict[str, Any]) -> Any:
    """A frozen dataclass of plain values, each of the kind of its field's name."""
    missing = dataclasses.MISSING
    for field in dataclasses.fields(kind):
        if field.default is missing and field.default_factory is missing and field.name not in given:
            raise UserError(f"{path}: {where}: say its {field.name}")
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


def _outputs(path: Path, told: Any) -> tuple[str, ...]:
    names = tuple(_typed(path, "outputs", told, list))
    for name in names:
        if name not in OUTPUTS:
            raise UserError(f"{path}: output {name!r} is not one{did_you_mean(str(name), OUTPUTS)}")
    if not names or len(set(names)) < len(names):
        raise UserError(f"{path}: outputs: name at least one of {', '.join(OUTPUTS)}, each once")
    return names


def _title(path: Path, told: Any) -> str:
    title: str = _typed(path, "title", told, str)
    if not title.strip() or not title.isprintable():
        raise UserError(f"{path}: title must be one line of text")
    return title


def _whole(path: Path, where: str, value: Any, most: int = MOST) -> int:
    if not 1 <= _typed(path, where, value, int) <= most:
        raise UserError(f"{path}: {where} must lie in 1..{most}")
    return int(value)


def _known(path: Path, where: str, told: Any, names: tuple[str, ...]) -> None:
    if not isinstance(told, dict):
        raise UserError(f"{path}: {where} must be a table")
    for name in told:
        if name not in names:
            spot = f"{where}: " if where else ""
            raise UserError(f"{path}: {spot}unknown key {name!r}{did_you_mean(name, names)}")


def _typed(path: Path, where: str, value: Any, kind: type) -> Any:
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise UserError(f"{path}: {where} must be of kind {kind.__name__}, not {value!r}")
    return value


def _number(path: Path, where: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise UserError(f"{path}: {where} must be a number, not {value!r}")
    try:
        number = float(value)
    except OverflowError:  # TOML's whole numbers have no end
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
    """Of the mesh and of what is declared about it."""
    return hashlib.sha256(base.source.sha256.encode() + data).hexdigest()
