"""The cameras and lights of a declaration: written out, or those of its file by their names."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..errors import UserError
from .declared_values import known, listed, made, typed, with_path
from .moment import ray_tables
from .scene import FARTHEST, Camera, Light, Scene, Spot, Vector, offered
from .spotlight import spot_row

T = TypeVar("T")

BRIGHTEST = 1e12
"""Largest intensity and colour; float32 can hold their product."""

KINDS = ("perspective", "orthographic")
"""Kinds of camera."""

CAMERA = ("of", "kind", "eye", "target", "up", "fov", "height")
"""Keys of a camera."""


def camera_of(path: Path, where: str, table: dict[str, Any], base: Scene) -> Camera:
    """The camera of a table with the keys :data:`CAMERA`. What it leaves out is as in the camera of the scene that it is
    ``of``, else as in the scene's own.
    """
    given = dict(table)
    start = base.camera
    if "of" in given:
        start = _named(path, where, base.title, "camera", base.cameras, given.pop("of"))
    fields = {**dataclasses.asdict(start), **_lens(path, where, given, start)}
    camera: Camera = made(path, where, Camera, fields)
    _near(path, f"{where}.eye", camera.eye)
    with_path(path, "", lambda: ray_tables(camera, 1, 1, np.zeros(3)))
    return camera


def named_cameras(path: Path, tables: Any, base: Scene) -> dict[str, Camera]:
    """The cameras of ``[[cameras]]``, by name."""
    cameras: dict[str, Camera] = {}
    for i, table in enumerate(listed(path, "cameras", tables)):
        where = f"cameras[{i}]"
        known(path, where, table, ("name", *CAMERA))
        given = dict(table)
        name = _name(path, where, given.pop("name", None), cameras)
        cameras[name] = camera_of(path, where, given, base)
    return cameras


def lights_of(path: Path, tables: Any, base: Scene) -> tuple[tuple[Light, ...], dict[str, Light]]:
    """The lights of ``[[lights]]``, and those of them that have a name."""
    lights: list[Light] = []
    names: dict[str, Light] = {}
    for i, table in enumerate(listed(path, "lights", tables)):
        where = f"lights[{i}]"
        known(path, where, table, ("name", "of", *(field.name for field in dataclasses.fields(Light))))
        given = dict(table)
        name = given.pop("name", None)
        lights.append(_light(path, where, given, base))
        if name is not None:
            names[_name(path, where, name, names)] = lights[-1]
    return tuple(lights), names


def _light(path: Path, where: str, given: dict[str, Any], base: Scene) -> Light:
    if "of" in given:
        start = _named(path, where, base.title, "light", base.lamps, given.pop("of"))
        given = {**{field.name: getattr(start, field.name) for field in dataclasses.fields(Light)}, **given}
    if "position" not in given:
        raise UserError(f"{path}: {where}: add its position (of a directional light: the direction towards it)")
    if isinstance(given.get("spot"), dict):
        known(path, f"{where}.spot", given["spot"], tuple(field.name for field in dataclasses.fields(Spot)))
        spot = made(path, f"{where}.spot", Spot, given["spot"])
        if spot.falloff < 0.0:
            raise UserError(f"{path}: {where}.spot.falloff must not be negative")
        with_path(path, f"{where}: ", lambda: spot_row(spot))
        given["spot"] = spot
    elif not isinstance(given.get("spot"), Spot | None):
        raise UserError(f"{path}: {where}.spot must be a table")
    light: Light = made(path, where, Light, given)
    for name, values in (("color", light.color), ("intensity", (light.intensity,))):
        if not 0.0 <= min(values) <= max(values) <= BRIGHTEST:
            raise UserError(f"{path}: {where}.{name} must lie in 0..{BRIGHTEST:g}")
    if not light.directional:
        _near(path, f"{where}.position", light.position)
        _near(path, f"{where}.size", (*light.extent, 0.0))
    elif not any(light.position):
        raise UserError(f"{path}: {where}.position: the direction of a directional light must not be zero")
    return light


def _lens(path: Path, where: str, given: dict[str, Any], start: Camera) -> dict[str, Any]:
    """The fields of a camera table, without its kind: an orthographic camera has a height, a pinhole camera a fov."""
    given = dict(given)
    kind = given.pop("kind", KINDS[0] if start.height is None else KINDS[1])
    if kind not in KINDS:
        raise UserError(f"{path}: {where}.kind {kind!r} is not one of {', '.join(KINDS)}")
    asked, other = ("height", "fov") if kind == "orthographic" else ("fov", "height")
    if other in given:
        raise UserError(f"{path}: {where}.{other} does not apply to a camera of kind {kind}; give {asked}")
    if kind == "perspective":
        return {**given, "height": None}
    if "height" not in given and start.height is None:
        raise UserError(f"{path}: {where}: add its height, what the image shows from bottom to top")
    return given


def _named(path: Path, where: str, title: str, kind: str, offers: Mapping[str, T], name: Any) -> T:
    """What the scene offers under the name that stands in ``of``."""
    try:
        return offered(title, kind, offers, typed(path, f"{where}.of", name, str))
    except UserError as error:
        raise UserError(f"{path}: {where}.of: {error}") from error


def _name(path: Path, where: str, name: Any, taken: Mapping[str, Any]) -> str:
    """A name to offer something under."""
    if not isinstance(name, str) or not name or not name.isprintable():
        raise UserError(f"{path}: {where}: add its name, one line of text")
    if name in taken:
        raise UserError(f"{path}: {where}: the name {name!r} is taken")
    return name


def _near(path: Path, where: str, point: Vector) -> None:
    if max(abs(x) for x in point) > FARTHEST:
        raise UserError(f"{path}: {where} {point} is outside the range of float32")
