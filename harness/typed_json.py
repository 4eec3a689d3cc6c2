"""Dataclasses as JSON and back. Reading checks every field and names the first one that is wrong."""

from __future__ import annotations

import functools
import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any, TypeVar

T = TypeVar("T")

CALLED = {
    str: "text",
    int: "a whole number",
    float: "a number",
    bool: "true or false",
    list: "a list",
    dict: "an object",
}
"""What error messages call the types of JSON."""


class ShapeError(ValueError):
    """A JSON value does not have the fields or types of its dataclass. The message is one line."""


OMITTED = {"omitted": True}
"""Metadata of a dataclass field that is left out of the JSON while it has its default."""


def to_json(value: Any) -> Any:
    """Dataclasses as objects, tuples as lists; everything else as it is."""
    if is_dataclass(value) and not isinstance(value, type):
        return {one.name: to_json(getattr(value, one.name)) for one in fields(value) if _kept(value, one)}
    if isinstance(value, dict):
        return {key: to_json(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [to_json(part) for part in value]
    return value


def _kept(value: Any, one: Field) -> bool:
    return not (one.metadata.get("omitted") and getattr(value, one.name) == one.default)


def from_json(cls: type[T], value: Any, name: str = "") -> T:
    """The dataclass ``cls`` from a parsed JSON object; ``name`` is its path for messages.

    Fields without a default must be there; a field that ``cls`` does not have is an error. Types that are understood:
    str, int, float, bool, None, Any, ``X | None``, ``tuple[X, ...]``, ``list[X]``, ``dict[str, X]`` and dataclasses.
    Raises :class:`ShapeError`.
    """
    _check(value, dict, name)
    lead = f"{name}." if name else ""
    known = _types_of(typing.cast(type, cls))
    unknown = next((key for key in value if key not in known), None)
    if unknown is not None:
        raise ShapeError(f"{lead}{unknown} is no field of it")
    arguments = {}
    for key, (kind, needed) in known.items():
        if key in value:
            arguments[key] = _read(kind, value[key], f"{lead}{key}")
        elif needed:
            raise ShapeError(f"it has no {lead}{key}")
    return cls(**arguments)


@functools.cache
def _types_of(cls: type) -> dict[str, tuple[Any, bool]]:
    """By field of a dataclass: its type, and whether it must be given."""
    hints = typing.get_type_hints(cls)
    return {
        one.name: (hints[one.name], one.default is MISSING and one.default_factory is MISSING)
        for one in fields(cls)  # type: ignore[arg-type]
    }


def _read(kind: Any, value: Any, name: str) -> Any:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if kind is Any:
        return value
    if origin in (typing.Union, types.UnionType):
        if value is None:
            return None
        (kind,) = (one for one in arguments if one is not type(None))
        return _read(kind, value, name)
    if origin in (tuple, list, Sequence):
        _check(value, list, name)
        parts = [_read(arguments[0], part, f"{name}[{i}]") for i, part in enumerate(value)]
        return parts if origin is list else tuple(parts)
    if origin in (dict, Mapping):
        _check(value, dict, name)
        return {key: _read(arguments[1], part, f"{name}[{key}]") for key, part in value.items()}
    if is_dataclass(kind):
        return from_json(typing.cast(type, kind), value, name)
    _check(value, kind, name)
    return value


def _check(value: Any, kind: type, name: str) -> None:
    if isinstance(value, kind) or (kind is float and isinstance(value, int)):
        return
    shown = repr(value)
    shown = shown if len(shown) <= 40 else shown[:37] + "..."
    raise ShapeError(f"{name or 'all of it'} is {shown}, not {CALLED[kind]}")
