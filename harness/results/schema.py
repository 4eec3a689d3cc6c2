"""Reading records: every declared field is checked (:mod:`.results.record`), and a fault is one line.

A file that another program wrote, a hand edited or a disk damaged is refused by its name and by the field that is wrong.
"""

from __future__ import annotations

import json
import lzma
import math
import types
from collections.abc import Iterable
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints, is_typeddict

from ..errors import UserError
from ..files import write_bytes
from .record import SCHEMA, Record

ARCHIVE = "kept.jsonl.xz"
"""All records of a folder that is kept, in its ``records/``: one a line, a seventh of the size of single files."""

ARCHIVES = "*.jsonl.xz"
"""All files of that kind: what is measured for a kept folder later can be laid beside what is there."""

CALLED = {
    str: "text",
    int: "a whole number",
    float: "a number",
    bool: "true or false",
    list: "a list",
    dict: "an object",
}
"""What a person calls the types of JSON."""


class WrongFieldError(ValueError):
    """A value is not what a field holds: the text names both."""


def checked(kind: Any, value: Any, name: str = "") -> Any:
    """``value``, which JSON gave, as an instance of the type ``kind``: dataclasses are made, all else is checked.

    ``kind``: a dataclass, a TypedDict (its undeclared fields are kept as they are), or what :mod:`.results.record` uses
    of Python's types. Numbers must be finite. Raises :class:`WrongFieldError`.
    """
    origin, arguments = get_origin(kind), get_args(kind)
    if kind is Any:
        return value
    if origin in (Union, types.UnionType):
        return None if value is None else checked(arguments[0], value, name)
    if origin is list or origin is dict:
        _require(origin, value, name)
        if origin is list:
            return [checked(arguments[0], one, f"{name}[{i}]") for i, one in enumerate(value)]
        return {key: checked(arguments[1], one, f"{name}[{key}]") for key, one in value.items()}
    if origin is Annotated:
        if checked(arguments[0], value, name) < arguments[1]:
            raise WrongFieldError(f"{name} is {value}, not a time")
        return value
    if is_dataclass(kind) or is_typeddict(kind):
        return _object(kind, value, name)
    _require(kind, value, name)
    return value


def _require(kind: type, value: Any, name: str) -> None:
    # JSON's true and false are no numbers, though Python's are.
    fits = isinstance(value, (int, float) if kind is float else kind) and isinstance(value, bool) <= (
        kind is bool
    )
    if not fits or (kind is float and not math.isfinite(value)):
        shown = repr(value)
        shown = shown if len(shown) <= 40 else shown[:37] + "..."
        raise WrongFieldError(f"{name or 'all of it'} is {shown}, not {CALLED[kind]}")


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


def read_records(folder: Path | str) -> list[Record]:
    """Every finished record of a results folder, by key. Raises :class:`UserError` where there is none.

    A folder that is kept has them in one file (:data:`ARCHIVE`); what was measured in it since has a file each.
    """
    place = Path(folder) / "records"
    try:
        paths = sorted(path for path in place.iterdir() if path.name[0] != ".")
    except (FileNotFoundError, NotADirectoryError):
        paths = []
    except OSError as error:
        raise UserError(f"{place}: cannot be read ({error.strerror}); change its permissions") from error
    found = archived(place)
    for path in paths:
        if path.suffix == ".json":
            record = read_record(path)
            found[record.key] = record
    if not found:
        raise UserError(f"{folder}: no records here; name a folder that `shadowbench run` wrote")
    return [found[key] for key in sorted(found)]


def archived(place: Path) -> dict[str, Record]:
    """By key the records in the archives of a folder ``records/``; of two that have one, the later name's."""
    paths = sorted(place.glob(ARCHIVES))
    return {record.key: record for path in paths for record in read_archive(path)}


def read_record(path: Path) -> Record:
    """A finished record. Raises :class:`UserError`, one line that names the file, for what is none."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror}); remove it and run again") from error
    except ValueError as error:
        raise UserError(f"{path}: not a record ({error}); remove it and run again") from error
    return _record_in(text, str(path))


def whole_record(path: Path) -> Record | None:
    """The record in a file; None where there is no such file, or it holds none."""
    try:
        return read_record(path)
    except UserError:
        return None


def read_archive(path: Path) -> list[Record]:
    """The records of a kept folder, one a line. Raises :class:`UserError` as :func:`read_record` does."""
    try:
        with lzma.open(path, "rt", encoding="utf-8") as file:
            lines = file.read().splitlines()
    except OSError as error:
        reason = error.strerror or str(error)
        raise UserError(f"{path}: cannot be read ({reason}); fetch it again") from error
    except (lzma.LZMAError, EOFError, ValueError) as error:
        raise UserError(f"{path}: damaged ({error}); fetch it again") from error
    return [
        _record_in(line, f"{path}, line {number}", "fetch it again") for number, line in enumerate(lines, 1)
    ]


def write_archive(path: Path, records: Iterable[Record]) -> None:
    """Records as one compressed file, by key, as :func:`read_archive` reads it. The same records give the same bytes."""
    ordered = sorted(records, key=lambda record: record.key)
    text = "".join(json.dumps(record.to_json(), allow_nan=False) + "\n" for record in ordered)
    write_bytes(path, lzma.compress(text.encode(), preset=9 | lzma.PRESET_EXTREME))


def _record_in(text: str, where: str, remedy: str = "remove it and run again") -> Record:
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise UserError(f"{where}: not a record ({error}); {remedy}") from error
    if isinstance(found, dict) and found.get("schema") != SCHEMA:
        raise UserError(
            f"{where}: schema {found.get('schema')}, this version reads {SCHEMA}; run again into a new folder"
        )
    try:
        return checked(Record, found)
    except WrongFieldError as error:
        raise UserError(f"{where}: not a record ({error}); {remedy}") from error
