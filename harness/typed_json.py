"""Dataclasses as JSON and back. Reading checks every field and names the first one that is wrong."""

from __future__ import annotations

import math
import types
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints, is_typeddict

OMITTED = {"omitted": True}
"""Metadata of a dataclass field that is left out of the JSON while it has its default."""

CALLED = {
    str: "text",
    int: "a whole number",
    float: "a number",
    bool: "true or false",
    list: "a list",
    dict: "an object",
}
"""Names of the types of JSON for error messages."""


_SCALARS = (float, int, str, bool)


class WrongFieldError(ValueError):
    """A value does not have the type of its field; the text names both."""


def checked(kind: Any, value: Any, name: str = "") -> Any:
    """``value``, which JSON gave, as an instance of the type ``kind``: dataclasses are made, all else is checked.

    ``kind``: a dataclass, a TypedDict (its undeclared fields are passed on unchanged), ``X | None``, ``list[X]``,
    ``tuple[X, ...]``, ``dict[str, X]``, a type of JSON, or ``Annotated[float, least]``.
    Numbers must be finite. Raises :class:`WrongFieldError`.
    """
    if type(value) is kind and kind in _SCALARS and (kind is not float or math.isfinite(value)):
        return value  # most values of a record
    if kind is Any:
        return value
    origin, arguments = _parts(kind)
    if origin in (Union, types.UnionType):
        return None if value is None else checked(arguments[0], value, name)
    if origin in (list, tuple):
        _require(list, value, name)
        if _all_plain(arguments[0], value):
            return origin(value)
        return origin(checked(arguments[0], one, f"{name}[{i}]") for i, one in enumerate(value))
    if origin is dict:
        _require(dict, value, name)
        return {key: checked(arguments[1], one, f"{name}[{key}]") for key, one in value.items()}
    if origin is Annotated:
        if checked(arguments[0], value, name) < arguments[1]:
            raise WrongFieldError(f"{name} is {value}: less than {arguments[1]:g}")
        return value
    if is_dataclass(kind) or is_typeddict(kind):
        return _object(kind, value, name)
    _require(kind, value, name)
    return value


def _require(kind: type, value: Any, name: str) -> None:
    # JSON's true and false are not numbers, unlike Python's.
    fits = isinstance(value, (int, float) if kind is float else kind) and isinstance(value, bool) <= (
        kind is bool
    )
    if not fits or (kind is float and not math.isfinite(value)):
        shown = repr(value)
        shown = shown if len(shown) <= 40 else shown[:37] + "..."
        raise WrongFieldError(f"{name or 'all of it'} is {shown}, not {CALLED[kind]}")


def _all_plain(kind: Any, values: list[Any]) -> bool:
    """Whether all are finite floats, or all whole numbers, as asked for: samples, the most of what a record holds."""
    return kind in (float, int) and {*map(type, values)} <= {kind} and all(map(math.isfinite, values))


@cache
def _parts(kind: Any) -> tuple[Any, tuple[Any, ...]]:
    """The origin of a generic type, and its arguments."""
    return get_origin(kind), get_args(kind)


@cache
def _declared(kind: Any) -> tuple[dict[str, Any], frozenset[str]]:
    """The types of a class's fields by name, and the names of those that must be there."""
    hints = get_type_hints(kind, include_extras=True)
    if is_typeddict(kind):
        return hints, kind.__required_keys__
    needed = [one.name for one in fields(kind) if one.default is MISSING and one.default_factory is MISSING]
    return hints, frozenset(needed)


def _object(kind: Any, value: Any, name: str) -> Any:
    _require(dict, value, name)
    lead = f"{name}." if name else ""
    hints, needed = _declared(kind)
    for missing in (one for one in hints if one in needed and one not in value):
        raise WrongFieldError(f"it has no {lead}{missing}")
    if is_typeddict(kind):
        known = {key: checked(hints[key], one, lead + key) for key, one in value.items() if key in hints}
        return {**value, **known}
    for unknown in (key for key in value if key not in hints):
        raise WrongFieldError(f"{lead}{unknown} is no field that this version knows")
    found = {key: checked(hints[key], one, lead + key) for key, one in value.items()}
    try:
        return kind(**found)
    except WrongFieldError:
        raise
    except ValueError as error:
        raise WrongFieldError(f"{name}: {error}" if name else str(error)) from error


def to_json(value: Any) -> Any:
    """Dataclasses as objects, tuples as lists; everything else as it is."""
    if is_dataclass(value) and not isinstance(value, type):
        kept = (
            one
            for one in fields(value)
            if "omitted" not in one.metadata or getattr(value, one.name) != one.default
        )
        return {one.name: to_json(getattr(value, one.name)) for one in kept}
    if isinstance(value, dict):
        return {key: to_json(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [to_json(part) for part in value]
    return value
