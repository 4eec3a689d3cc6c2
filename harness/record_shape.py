"""Reading a record: what it must look like, the type of every field that tables, drawings and scores use.

A file that another program wrote or that a disk has damaged is told by its name and by the field that is wrong, not
by whatever comes of it later.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .errors import UserError

SCHEMA = 1
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


def record_paths(folder: Path | str) -> list[Path]:
    """The files of a results folder's finished records, by key. Raises :class:`UserError` where there is none."""
    place = Path(folder) / "records"
    try:
        paths = sorted(path for path in place.iterdir() if path.suffix == ".json" and path.name[0] != ".")
    except (FileNotFoundError, NotADirectoryError):
        paths = []
    except OSError as error:
        raise UserError(f"{place}: cannot be read ({error.strerror}); mend its rights") from error
    if not paths:
        raise UserError(f"{folder}: no records here; name a folder that `shadowbench run` wrote")
    return paths


def read_record(path: Path) -> dict[str, Any]:
    """A finished record. Raises :class:`UserError`, one line that names the file, for what is none."""
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror}); remove it and run again") from error
    except (ValueError, RecursionError) as error:
        raise UserError(f"{path}: not a record ({error}); remove it and run again") from error
    if isinstance(record, dict) and record.get("schema") != SCHEMA:
        raise UserError(
            f"{path}: schema {record.get('schema')}, this version reads {SCHEMA}; run again into a new folder"
        )
    wrong = fault(record)
    if wrong:
        raise UserError(f"{path}: not a record ({wrong}); remove it and run again")
    return record
