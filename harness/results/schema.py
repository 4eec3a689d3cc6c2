"""Reading a record: what it must look like, the type of every field that tables, drawings and scores use.

A file that another program wrote or that a disk has damaged is told by its name and by the field that is wrong, not
by whatever comes of it later.
"""

from __future__ import annotations

import json
import lzma
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import UserError

SCHEMA = 1

ARCHIVE = "kept.jsonl.xz"
"""All records of a folder that is kept, in its ``records/``: one a line, a seventh of what they take apart."""

ARCHIVES = "*.jsonl.xz"
"""All files of that kind: what is measured for a kept folder later can be laid beside what is there."""

NUMBER = (int, float)


@dataclass(frozen=True)
class Maybe:
    """A field that may be absent or null."""

    shape: Any


@dataclass(frozen=True)
class Each:
    """A list, or the values of an object, of one shape."""

    shape: Any
    kind: type = list


PASS = {"name": str, "part": str, "ms": Each(NUMBER)}
SCORE = {
    "true_errors": int,
    "excused_share": NUMBER,
    "primary": {"pixels": int},
    "shadow": Each(dict),
    "reference_errors": Maybe(dict),
}
FRAME = {
    "frame": int,
    "total_ms": Each(NUMBER),
    "wall_ms": Each(NUMBER),
    "round": Each(int),
    "stage_round": Each(int),
    "passes": Each(PASS),
    "memory_bytes": Maybe(NUMBER),
    "regrown": int,
    "counters": Maybe(Each(NUMBER, dict)),
    "score": Maybe(SCORE),
    "unscored": Maybe(str),
    "shadow_rays": Maybe(NUMBER),
}
RECORD = {
    "key": str,
    "experiment": str,
    "status": str,
    "reason": str,
    "point": {"width": int, "height": int, "preset": Maybe(str)},
    "scene": {
        "name": str,
        "title": Maybe(str),
        "stand_in": Maybe(str),
        "triangles": Maybe(int),
        "invalid_triangles": Maybe(int),
        "lights": Maybe(list),
        "lighting": Maybe(dict),
        "source": Maybe(dict),
    },
    "method": {
        "name": str,
        "title": Maybe(str),
        "label": Maybe(str),
        "device": str,
        "device_name": Maybe(str),
        "settings": Maybe(dict),
        "parameters": Maybe(Each(dict, dict)),
        "built": Maybe(dict),
    },
    "environment": str,
    "asked": Maybe(NUMBER),
    "compile_s": Maybe(NUMBER),
    "first_frame_s": Maybe(NUMBER),
    "peak_rss_bytes": Maybe(NUMBER),
    "stopped_by": str,
    "rounds": Maybe(Each(dict)),
    "frames": Each(FRAME),
    "frames_left_out": Maybe(list),
}


def fault(value: Any, shape: Any = RECORD, name: str = "") -> str:
    """What is wrong with a value that JSON gave, "width is 'abc', not a whole number"; "" where nothing is."""
    if isinstance(shape, Maybe):
        return "" if value is None else fault(value, shape.shape, name)
    if isinstance(shape, Each):
        wrong = fault(value, shape.kind, name)
        if wrong:
            return wrong
        parts = value.items() if shape.kind is dict else enumerate(value)
        return next((f for k, part in parts if (f := fault(part, shape.shape, f"{name}[{k}]"))), "")
    if isinstance(shape, dict):
        wrong = fault(value, dict, name)
        if wrong:
            return wrong
        lead = f"{name}." if name else ""
        for key, inner in shape.items():
            if key not in value and not isinstance(inner, Maybe):
                return f"it has no {lead}{key}"
            wrong = fault(value.get(key), inner, f"{lead}{key}")
            if wrong:
                return wrong
        return ""
    if isinstance(value, shape):
        return ""
    shown = repr(value)
    shown = shown if len(shown) <= 40 else shown[:37] + "..."
    return f"{name or 'all of it'} is {shown}, not {CALLED[shape]}"


CALLED = {str: "text", int: "a whole number", NUMBER: "a number", list: "a list", dict: "an object"}
"""What a person calls the types of JSON."""


def read_records(folder: Path | str) -> list[dict[str, Any]]:
    """Every finished record of a results folder, by key. Raises :class:`UserError` where there is none.

    A folder that is kept has them in one file (:data:`ARCHIVE`); what was measured in it since has a file each.
    """
    place = Path(folder) / "records"
    try:
        paths = sorted(path for path in place.iterdir() if path.name[0] != ".")
    except (FileNotFoundError, NotADirectoryError):
        paths = []
    except OSError as error:
        raise UserError(f"{place}: cannot be read ({error.strerror}); mend its rights") from error
    found = archived(place)
    for path in paths:
        if path.suffix == ".json":
            record = read_record(path)
            found[record["key"]] = record
    if not found:
        raise UserError(f"{folder}: no records here; name a folder that `shadowbench run` wrote")
    return [found[key] for key in sorted(found)]


def archived(place: Path) -> dict[str, dict[str, Any]]:
    """By key the records in the archives of a folder ``records/``; of two that have one, the later name's."""
    paths = sorted(place.glob(ARCHIVES))
    return {record["key"]: record for path in paths for record in read_archive(path)}


def read_record(path: Path) -> dict[str, Any]:
    """A finished record. Raises :class:`UserError`, one line that names the file, for what is none."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror}); remove it and run again") from error
    except ValueError as error:
        raise UserError(f"{path}: not a record ({error}); remove it and run again") from error
    return _record_in(text, str(path))


def read_archive(path: Path) -> list[dict[str, Any]]:
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


def _record_in(text: str, where: str, remedy: str = "remove it and run again") -> dict[str, Any]:
    try:
        record = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise UserError(f"{where}: not a record ({error}); {remedy}") from error
    if isinstance(record, dict) and record.get("schema") != SCHEMA:
        raise UserError(
            f"{where}: schema {record.get('schema')}, this version reads {SCHEMA}; run again into a new folder"
        )
    wrong = fault(record)
    if wrong:
        raise UserError(f"{where}: not a record ({wrong}); {remedy}")
    return record
