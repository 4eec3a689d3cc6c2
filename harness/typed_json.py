"""Dataclasses as JSON and back. Reading checks every field and names the first one that is wrong."""

import math
import re
import types
from collections.abc import Callable
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from typing import Annotated, Any, Required, Union, get_args, get_origin, get_type_hints, is_typeddict

OMITTED = {"omitted": True}  # metadata of a dataclass field that is left out of the JSON while it has its default

CALLED = {  # names of the types of JSON for error messages
    str: "text", int: "a whole number", float: "a number", bool: "true or false", list: "a list", dict: "an object",
}  # fmt: skip

LARGEST = 2**63 - 1  # largest whole number, and least with a minus: tables hold them as int64


class WrongFieldError(ValueError):
    """A value does not have the type of its field; the text names both."""


def checked(kind: Any, value: Any, name: str = "") -> Any:
    """``value``, which JSON gave, as an instance of the type ``kind``: dataclasses are made, all else is checked.

    ``kind``: a dataclass, a TypedDict (its undeclared fields are passed on unchanged), ``X | None``, ``list[X]``,
    ``tuple[X, ...]``, ``dict[str, X]``, a type of JSON, ``Annotated[float, least]``, ``Annotated[int, least, most]``, or
    ``Annotated[str, pattern, "what it is"]``. Numbers must be finite, also in values of any type. Raises
    :class:`WrongFieldError`.
    """
    return _check_of(kind)(value, name)


Check = Callable[[Any, str], Any]  # (value, name of its field for the message) to the value as it is to be


@cache
def _check_of(kind: Any) -> Check:
    """The function that checks values of a type: made once, as a record has thousands of values."""
    if kind is Any:
        return _anything
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return _optional(_check_of(arguments[0]))
    if origin in (list, tuple):
        return _sequence(origin, arguments[0])
    if origin is dict:
        return _mapping(_check_of(arguments[1]))
    if origin is Annotated:
        check = _check_of(arguments[0])
        return _matching(check, *arguments[1:]) if arguments[0] is str else _between(check, *arguments[1:])
    if is_dataclass(kind) or is_typeddict(kind):
        return _object(kind)
    return _scalar(kind)


def _scalar(kind: type) -> Check:
    accepted = (int, float) if kind is float else kind

    def check(value: Any, name: str) -> Any:
        # JSON's true and false are not numbers, unlike Python's.
        fits = isinstance(value, accepted) and isinstance(value, bool) <= (kind is bool)
        if not fits or (kind is float and not math.isfinite(value)):
            raise WrongFieldError(f"{name or 'all of it'} is {_shown(value)}, not {CALLED[kind]}")
        if kind is int and abs(value) > LARGEST:
            raise WrongFieldError(f"{name} is {_shown(value)}: more than 64 bits hold")
        return value

    return check


def _shown(value: Any) -> str:
    """The beginning of a value, whatever its size."""
    text = repr(value) if isinstance(value, str | float | bool | None) else _outline(value)
    return text if len(text) <= 40 else text[:37] + "..."


def _outline(value: Any) -> str:
    try:
        return repr(value)[:41]
    except (RecursionError, ValueError):  # nested too deep, or a number of thousands of digits
        return f"a large {type(value).__name__}"


def _anything(value: Any, name: str) -> Any:
    """A value of any type, whose numbers are finite."""
    if isinstance(value, float) and not math.isfinite(value):
        raise WrongFieldError(f"{name} is {value}, not a number")
    if isinstance(value, list | dict):
        for key, one in value.items() if isinstance(value, dict) else enumerate(value):
            _anything(one, f"{name}[{key}]")
    return value


def _optional(check: Check) -> Check:
    return lambda value, name: None if value is None else check(value, name)


def _between(check: Check, least: float, most: float = math.inf) -> Check:
    def checked_range(value: Any, name: str) -> Any:
        if not least <= check(value, name) <= most:
            side = f"less than {least:g}" if value < least else f"more than {most:g}"
            raise WrongFieldError(f"{name} is {value}: {side}")
        return value

    return checked_range


def _matching(check: Check, pattern: re.Pattern[str], called: str) -> Check:
    def checked_text(value: Any, name: str) -> Any:
        if not pattern.fullmatch(check(value, name)):
            raise WrongFieldError(f"{name} is {_shown(value)}, not {called}")
        return value

    return checked_text


def _sequence(made: type, kind: Any) -> Check:
    is_list, check = _scalar(list), _check_of(kind)
    plain = get_args(kind)[0] if get_origin(kind) is Annotated else kind
    least = get_args(kind)[1] if plain is not kind else -math.inf

    def checked_items(values: Any, name: str) -> Any:
        is_list(values, name)
        # Samples are most of what a record holds: all finite floats, or all whole numbers.
        if plain in (float, int) and {*map(type, values)} == {plain}:
            low, high = min(values), max(values)
            if least <= low and low >= -LARGEST and high <= LARGEST and not math.isnan(sum(values)):
                return made(values)
        return made(check(one, f"{name}[{i}]") for i, one in enumerate(values))

    return checked_items


def _mapping(check: Check) -> Check:
    is_dict = _scalar(dict)
    return lambda values, name: {key: check(one, f"{name}[{key}]") for key, one in is_dict(values, name).items()}


def _object(kind: Any) -> Check:
    """The check of a dataclass or a TypedDict."""
    hints, needed = _declared(kind)
    checks: dict[str, Check] = {}
    is_dict, open_ended = _scalar(dict), is_typeddict(kind)

    def checked_fields(value: Any, name: str) -> Any:
        is_dict(value, name)
        if not checks:  # not before: a type may refer to itself
            checks.update({field: _check_of(hint) for field, hint in hints.items()})
        lead = f"{name}." if name else ""
        for missing in (one for one in hints if one in needed and one not in value):
            raise WrongFieldError(f"it has no {lead}{missing}")
        found = {}
        for key, one in value.items():
            if key not in checks and not open_ended:
                raise WrongFieldError(f"{lead}{key} is no field that this version knows")
            found[key] = checks.get(key, _anything)(one, f"{lead}{key}")
        if open_ended:
            return found
        try:
            return kind(**found)
        except ValueError as error:
            text = str(error) if len(str(error)) <= 160 else str(error)[:157] + "..."
            raise WrongFieldError(f"{name}: {text}" if name else text) from error

    return checked_fields


def _declared(kind: Any) -> tuple[dict[str, Any], frozenset[str]]:
    """The types of a class's fields by name, and the names of those that must be there."""
    hints = get_type_hints(kind, include_extras=True)
    if is_typeddict(kind):
        marked = {name for name, hint in hints.items() if get_origin(hint) is Required}
        plain = {name: get_args(hint)[0] if name in marked else hint for name, hint in hints.items()}
        return plain, kind.__required_keys__ | marked
    needed = [one.name for one in fields(kind) if one.default is MISSING and one.default_factory is MISSING]
    return hints, frozenset(needed)


def to_json(value: Any) -> Any:
    """Dataclasses as objects, tuples as lists; everything else as it is."""
    if is_dataclass(value) and not isinstance(value, type):
        kept = (
            one for one in fields(value) if "omitted" not in one.metadata or getattr(value, one.name) != one.default
        )
        return {one.name: to_json(getattr(value, one.name)) for one in kept}
    if isinstance(value, dict):
        return {key: to_json(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [to_json(part) for part in value]
    return value
