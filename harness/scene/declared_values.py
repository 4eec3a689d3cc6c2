"""Values of a declaration, checked: each error names the file and where in it the value stands."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from ..errors import UserError, did_you_mean

MOST = 2**31 - 1

TYPES = {int: "a whole number", bool: "true or false", str: "a text in quotes", list: "a list in brackets"}
"""What a declaration calls the types of its values."""

VECTORS = ("eye", "target", "up", "position", "direction", "color", "centre", "axis", "towards", "across")
"""Fields that are three numbers."""


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
