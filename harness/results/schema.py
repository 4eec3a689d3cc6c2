"""Reading records: every declared field is checked (:mod:`.results.record`), and a fault is one line.

A file that was written by another program, edited by hand or damaged is refused; the message names the file and the wrong
field.
"""

from __future__ import annotations

import json
import lzma
from collections.abc import Iterable
from pathlib import Path

from ..errors import UserError
from ..files import write_bytes
from ..frame.registry import current_name
from ..typed_json import WrongFieldError, checked
from .record import SCHEMA, Record

ARCHIVE = "kept.jsonl.xz"
"""All records of a packed folder, in its ``records/``: one per line, a seventh of the size of single files."""

ARCHIVES = "*.jsonl.xz"
"""All files of that kind: results that are measured later for a packed folder can be added beside the first."""

def read_records(folder: Path | str) -> list[Record]:
    """Every finished record of a results folder, by key. Raises :class:`UserError` where there is none.

    A packed folder has them in one file (:data:`ARCHIVE`); records measured in it later have a file each.
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


def folders_with_records(folder: Path | str) -> list[Path]:
    """The folder, or the folders in it, that have records. Raises :class:`UserError` where there is none."""
    folder = Path(folder)
    if not folder.is_dir():
        raise UserError(f"{folder}: no such folder; name a folder of results")
    places = [path.parent for path in sorted([*folder.glob("records"), *folder.glob("*/records")])]
    places = [place for place in places if any((place / "records").glob("*.json*"))]
    if not places:
        raise UserError(f"{folder}: no records in it or in its folders; name a folder of results")
    return places


def archived(place: Path) -> dict[str, Record]:
    """The records in the archives of a folder ``records/``, by key; if two archives have a key, the later file name
    counts."""
    paths = sorted(place.glob(ARCHIVES))
    return {record.key: record for path in paths for record in read_archive(path)}


def read_record(path: Path) -> Record:
    """A finished record. Raises :class:`UserError`, one line that names the file, if the file is not a record."""
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
    """The records of a packed folder, one per line. Raises :class:`UserError` as :func:`read_record` does."""
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
        record = checked(Record, found)
    except WrongFieldError as error:
        raise UserError(f"{where}: not a record ({error}); {remedy}") from error
    record.method["name"] = current_name(record.method["name"])
    return record
