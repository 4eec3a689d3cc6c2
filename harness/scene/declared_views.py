"""The values of a declaration, checked: each error names the file and where in it the value stands. And its cameras and
lights: written out, or those of its file by their names.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Container, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..errors import UserError, did_you_mean
from .moment import ray_tables
from .scene import FARTHEST, Camera, Light, Scene, Spot, Vector, offered
from .spotlight import spot_row

MOST = 2**31 - 1

TYPES = {int: "a whole number", bool: "true or false", str: "a text in quotes", list: "a list in brackets"}
"""What a declaration calls the types of its values."""

VECTORS = ("eye", "target", "up", "position", "direction", "color", "centre", "axis", "towards", "across")
"""Fields that are three numbers."""

T = TypeVar("T")

BRIGHTEST = 1e12  # largest intensity and colour; float32 can hold their product
KINDS = ("perspective", "orthographic")  # kinds of camera
CAMERA = ("of", "kind", "eye", "target", "up", "fov", "height")  # keys of a camera

LIGHT = tuple(field.name for field in dataclasses.fields(Light))


class Table:
    """A table of a declaration with the keys ``names``. ``where``: in the file; "" for the whole of it."""

    def __init__(self, path: Path, where: str, values: Any, names: Iterable[str]):
        self.path, self.where = path, where
        if not isinstance(values, dict):
            raise UserError(f"{self} must be a table")
        for name in values:
            if name not in names:
                raise UserError(f"{self}: unknown key {name!r}{did_you_mean(name, names)}")
        self.values: dict[str, Any] = dict(values)

    def __str__(self) -> str:
        return f"{self.path}: {self.where}" if self.where else str(self.path)

    def error(self, name: str, said: str) -> UserError:
        return UserError(f"{self}.{name} {said}" if self.where else f"{self}: {name} {said}")

    def table(self, name: str, names: Iterable[str]) -> Table:
        return Table(self.path, f"{self.where}.{name}" if self.where else name, self.values[name], names)

    def typed(self, name: str, kind: type, default: Any = None) -> Any:
        value = self.values.get(name, default)
        if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
            raise self.error(name, f"must be {TYPES[kind]}, not {value!r}")
        return value

    def whole(self, name: str, default: int, most: int = MOST) -> int:
        value = self.typed(name, int, default)
        if not 1 <= value <= most:
            raise self.error(name, f"must lie in 1..{most}")
        return int(value)

    def number(self, name: str, default: Any = None) -> float:
        return self._number(name, self.values.get(name, default))

    def _number(self, name: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(name, f"must be a number, not {value!r}")
        try:
            number = float(value)
        except OverflowError:  # TOML integers have no limit
            number = math.inf
        if not math.isfinite(number):
            raise self.error(name, f"must be finite, not {value!r}")
        return number

    def numbers(self, name: str, value: Any) -> tuple[float, ...]:
        return tuple(self._number(name, part) for part in value)

    def vector(self, name: str, default: Any = None) -> Any:
        value = self.values.get(name, default)
        if not isinstance(value, list | tuple) or len(value) != 3:
            raise self.error(name, f"must be three numbers, not {value!r}")
        return self.numbers(name, value)

    def made(self, kind: type) -> Any:
        """A frozen dataclass made from the values; the name of each field determines its type."""
        missing = dataclasses.MISSING
        for field in dataclasses.fields(kind):
            if field.default is missing and field.default_factory is missing and field.name not in self.values:
                raise UserError(f"{self}: add its {field.name}")
        made = {name: self._field(name, value) for name, value in self.values.items()}
        try:
            return kind(**made)
        except (TypeError, ValueError) as error:
            raise UserError(f"{self}: {error}") from error

    def _field(self, name: str, value: Any) -> Any:
        if value is None or name in ("spot", "shape"):  # None: of a light that this one is based on
            return value
        if name in VECTORS:
            return self.vector(name)
        if name == "samples":
            return self.typed(name, int)
        if name in ("shadows", "directional"):
            return self.typed(name, bool)
        if name == "size" and isinstance(value, list | tuple):
            return self.numbers(name, value)
        return self.number(name)


def listed(path: Path, where: str, tables: Any) -> list[Any]:
    """The tables of an array of tables."""
    if not isinstance(tables, list):
        raise UserError(f"{path}: write [[{where}]] before each of the {where}")
    return tables


def with_path(path: Path, where: str, rule: Callable[[], Any]) -> Any:
    """What a rule gives, with the file and the place in it before its error."""
    try:
        return rule()
    except UserError as error:
        raise UserError(f"{path}: {where}{error}") from error


def camera_of(given: Table, base: Scene) -> Camera:
    """The camera of a table (:data:`CAMERA`); what it leaves out is as in the one it is ``of``, or the scene's."""
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
    """The lights of ``[[lights]]``, and the same by name: "light", "light 2" and so on where they have none."""
    lights: list[Light] = []
    names: list[str | None] = []
    for i, table in enumerate(listed(path, "lights", tables)):
        given = Table(path, f"lights[{i}]", table, ("name", "of", *LIGHT))
        names.append(_name(given, names) if given.values.get("name") is not None else None)
        lights.append(_light(given, base))
    numbered = itertools.chain(["light"], (f"light {number}" for number in itertools.count(2)))
    free = (name for name in numbered if name not in names and name not in base.lamps)
    return tuple(lights), {name or next(free): light for name, light in zip(names, lights, strict=True)}


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


def _name(given: Table, taken: Container[str | None]) -> str:
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
