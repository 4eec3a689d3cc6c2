"""Values of a declaration, checked: each error names the file and where in it the value stands."""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import UserError, did_you_mean

MOST = 2**31 - 1


def whole(path: Path, where: str, value: Any, most: int = MOST) -> int:
    if not 1 <= typed(path, where, value, int) <= most:
        raise UserError(f"{path}: {where} must lie in 1..{most}")
    return int(value)


def known(path: Path, where: str, table: Any, names: tuple[str, ...]) -> None:
    if not isinstance(table, dict):
        raise UserError(f"{path}: {where} must be a table")
    for name in table:
        if name not in names:
            spot = f"{where}: " if where else ""
            raise UserError(f"{path}: {spot}unknown key {name!r}{did_you_mean(name, names)}")


def typed(path: Path, where: str, value: Any, kind: type) -> Any:
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise UserError(f"{path}: {where} must have type {kind.__name__}, not {value!r}")
    return value


def number(path: Path, where: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise UserError(f"{path}: {where} must be a number, not {value!r}")
    try:
        number = float(value)
    except OverflowError:  # TOML integers have no limit
        number = math.inf
    if not math.isfinite(number):
        raise UserError(f"{path}: {where} must be finite, not {value!r}")
    return number


def vector(path: Path, where: str, value: Any) -> tuple[float, float, float]:
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise UserError(f"{path}: {where} must be three numbers, not {value!r}")
    x, y, z = (number(path, where, part) for part in value)
    return (x, y, z)


def listed(path: Path, where: str, tables: Any) -> list[Any]:
    """The tables of an array of tables."""
    if not isinstance(tables, list):
        raise UserError(f"{path}: write [[{where}]] before each of the {where}")
    return tables


VECTORS = ("eye", "target", "up", "position", "direction", "color", "centre", "axis", "towards", "across")
"""Fields that are three numbers."""


def made(path: Path, where: str, kind: type, given: dict[str, Any]) -> Any:
    """A frozen dataclass made from TOML values; the name of each field determines its type."""
    missing = dataclasses.MISSING
    for field in dataclasses.fields(kind):
        if field.default is missing and field.default_factory is missing and field.name not in given:
            raise UserError(f"{path}: {where}: add its {field.name}")
    values: dict[str, Any] = {}
    for name, value in given.items():
        if value is None:  # of a light of the scene that this one is based on
            values[name] = None
        elif name in VECTORS:
            values[name] = vector(path, f"{where}.{name}", value)
        elif name in ("shadows", "directional"):
            values[name] = typed(path, f"{where}.{name}", value, bool)
        elif name == "size" and isinstance(value, list | tuple):
            values[name] = tuple(number(path, f"{where}.size", side) for side in value)
        elif name in ("spot", "shape", "samples"):
            values[name] = value
        else:
            values[name] = number(path, f"{where}.{name}", value)
    try:
        return kind(**values)
    except (TypeError, ValueError) as error:
        raise UserError(f"{path}: {where}: {error}") from error


def with_path(path: Path, where: str, rule: Callable[[], Any]) -> None:
    """Apply a check that would otherwise fail only when a frame is made, and add the file to its error."""
    try:
        rule()
    except UserError as error:
        raise UserError(f"{path}: {where}{error}") from error
