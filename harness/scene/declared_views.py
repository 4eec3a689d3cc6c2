"""The cameras and lights of a declaration: written out, or those of its file by their names."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..errors import UserError
from .declared_values import Table, listed, with_path
from .moment import ray_tables
from .scene import FARTHEST, Camera, Light, Scene, Spot, Vector, offered
from .spotlight import spot_row

T = TypeVar("T")

BRIGHTEST = 1e12  # largest intensity and colour; float32 can hold their product
KINDS = ("perspective", "orthographic")  # kinds of camera
CAMERA = ("of", "kind", "eye", "target", "up", "fov", "height")  # keys of a camera

LIGHT = tuple(field.name for field in dataclasses.fields(Light))


def camera_of(given: Table, base: Scene) -> Camera:
    """The camera of a table with the keys :data:`CAMERA`. What it leaves out is as in the camera of the scene that it is
    ``of``, else as in the scene's own.
    """
    start = _of(given, base.title, "camera", base.cameras) if "of" in given.values else base.camera
    given.values = {**dataclasses.asdict(start), **_lens(given, start)}
    camera: Camera = given.made(Camera)
    _near(given, "eye", camera.eye)
    with_path(given.path, "", lambda: ray_tables(camera, 1, 1, np.zeros(3)))
    return camera


def named_cameras(path: Path, tables: Any, base: Scene) -> dict[str, Camera]:
    """The cameras of ``[[cameras]]``, by name."""
    cameras: dict[str, Camera] = {}
    for i, table in enumerate(listed(path, "cameras", tables)):
        given = Table(path, f"cameras[{i}]", table, ("name", *CAMERA))
        name = _name(given, cameras)
        cameras[name] = camera_of(given, base)
    return cameras


def lights_of(path: Path, tables: Any, base: Scene) -> tuple[tuple[Light, ...], dict[str, Light]]:
    """The lights of ``[[lights]]``, and those of them that have a name."""
    lights: list[Light] = []
    names: dict[str, Light] = {}
    for i, table in enumerate(listed(path, "lights", tables)):
        given = Table(path, f"lights[{i}]", table, ("name", "of", *LIGHT))
        name = _name(given, names) if given.values.get("name") is not None else None
        lights.append(_light(given, base))
        if name is not None:
            names[name] = lights[-1]
    return tuple(lights), names


def _light(given: Table, base: Scene) -> Light:
    if "of" in given.values:
        start = _of(given, base.title, "light", base.lamps)
        given.values = {**{name: getattr(start, name) for name in LIGHT}, **given.values}
    if "position" not in given.values:
        raise UserError(f"{given}: add its position (of a directional light: the direction towards it)")
    if isinstance(given.values.get("spot"), dict):
        told = given.table("spot", [field.name for field in dataclasses.fields(Spot)])
        given.values["spot"] = spot = told.made(Spot)
        if spot.falloff < 0.0:
            raise told.error("falloff", "must not be negative")
        with_path(given.path, f"{given.where}: ", lambda: spot_row(spot))
    elif not isinstance(given.values.get("spot"), Spot | None):
        raise given.error("spot", "must be a table")
    light: Light = given.made(Light)
    for name, values in (("color", light.color), ("intensity", (light.intensity,))):
        if not 0.0 <= min(values) <= max(values) <= BRIGHTEST:
            raise given.error(name, f"must lie in 0..{BRIGHTEST:g}")
    if not light.directional:
        _near(given, "position", light.position)
        _near(given, "size", (*light.extent, 0.0))
    elif not any(light.position):
        raise UserError(f"{given}.position: the direction of a directional light must not be zero")
    return light


def _lens(given: Table, start: Camera) -> dict[str, Any]:
    """The fields of a camera table, without its kind: an orthographic camera has a height, a pinhole camera a fov."""
    fields = dict(given.values)
    kind = fields.pop("kind", KINDS[0] if start.height is None else KINDS[1])
    if kind not in KINDS:
        raise given.error("kind", f"{kind!r} is not one of {', '.join(KINDS)}")
    asked, other = ("height", "fov") if kind == "orthographic" else ("fov", "height")
    if other in fields:
        raise given.error(other, f"does not apply to a camera of kind {kind}; give {asked}")
    if kind == "perspective":
        return {**fields, "height": None}
    if "height" not in fields and start.height is None:
        raise UserError(f"{given}: add its height, what the image shows from bottom to top")
    return fields


def _of(given: Table, title: str, kind: str, offers: Mapping[str, T]) -> T:
    """What the scene offers under the name that stands in ``of``, which is taken out of the table."""
    name = given.typed("of", str)
    del given.values["of"]
    found: T = with_path(given.path, f"{given.where}.of: ", lambda: offered(title, kind, offers, name))
    return found


def _name(given: Table, taken: Mapping[str, Any]) -> str:
    """A name to offer something under, which is taken out of the table."""
    name = given.values.pop("name", None)
    if not isinstance(name, str) or not name or not name.isprintable():
        raise UserError(f"{given}: add its name, one line of text")
    if name in taken:
        raise UserError(f"{given}: the name {name!r} is taken")
    return name


def _near(given: Table, name: str, point: Vector) -> None:
    if max(abs(x) for x in point) > FARTHEST:
        raise given.error(name, f"{point} is outside the range of float32")
