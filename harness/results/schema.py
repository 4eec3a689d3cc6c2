"""Reading records: every declared field is checked (:mod:`.results.record`), and a fault is one line that names the file
and the field. Of several records for one table entry, the one that a run used last is selected.
"""

import json
import lzma
import os
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from ..errors import UserError
from ..files import open_regular, read_regular, write_atomic, write_bytes
from ..frame.registry import current_name, label_of, present_settings
from ..texts import all_visible, may_hide
from ..typed_json import WrongFieldError, checked
from .record import SCHEMA, Record

INSTANTS = ("started", "noted")  # of a record, seconds since 1970
HOST_MS = ("wall_ms", "submitted_ms")

ARCHIVE = "kept.jsonl.xz"  # all records of a packed folder, one per line, in `records/`: a seventh of the size
ARCHIVES = "*.jsonl.xz"  # more of these may lie beside the first: results that were measured later
MOST_RECORD = 64 << 20  # bytes of JSON: bounds the memory, as the records of a folder are read one after another
MOST_UNPACKED = 4 << 30  # bytes that an archive may unpack to: a small file could unpack to any number
MOST_DICTIONARY = 256 << 20  # memory for unpacking, bytes; `write_archive` needs a quarter of it

BLOCK = 1 << 20

T = TypeVar("T")


def read_records(folder: Path | str) -> list[Record]:
    """Every finished record of a results folder, by key. Raises :class:`UserError` where there is none. A packed folder
    has them in one file (:data:`ARCHIVE`); records measured in it later have a file each.
    """
    return sorted(each_record(folder), key=lambda record: record.key)


def each_record(folder: Path | str) -> Iterator[Record]:
    """The records of :func:`read_records`, one after another and each once, without holding them all."""
    place = Path(folder) / "records"
    try:
        paths = sorted(path for path in place.iterdir() if path.name[0] != ".")
    except (FileNotFoundError, NotADirectoryError):
        paths = []
    except OSError as error:
        raise UserError(f"{place}: cannot be read ({error.strerror}); change its permissions") from error
    seen: set[str] = set()
    # What was measured later counts: a file of its own before an archive, and of two the one that is named later.
    for path in reversed([path for path in paths if path.suffix == ".json"]):
        record = read_record(path)
        if record.key not in seen:
            seen.add(record.key)
            yield record
    yield from archived(place, seen)
    if not seen:
        raise UserError(f"{folder}: no records here; name a folder that `shadowbench run` wrote")


def folders_with_records(folder: Path | str) -> list[Path]:
    """The folder and those in it, however deep, with records, each once. Raises :class:`UserError` for none."""
    folder, seen, places = Path(folder), set[str](), list[Path]()
    if not folder.is_dir():
        raise UserError(f"{folder}: no such folder; name a folder of results")
    for place, names, _ in os.walk(folder, followlinks=True):
        real = os.path.realpath(place)
        names[:] = [] if real in seen else sorted(name for name in names if name[0] != ".")
        if real not in seen and any(Path(place, "records").glob("*.json*")):
            places.append(Path(place))
        seen.add(real)
    if not places:
        raise UserError(f"{folder}: no records in it or in its folders; name a folder of results")
    return places


def place_name(place: Path, folder: Path) -> str:
    """What a results folder is called in ``folder``: the way there, links and all, or the own name of ``folder``."""
    return Path(os.path.abspath(folder)).name if place == folder else place.relative_to(folder).as_posix()


def archived(place: Path, seen: set[str]) -> Iterator[Record]:
    """The records in the archives of a folder ``records/`` whose keys are not among ``seen``, which they join. If two
    archives have a key, the later file name counts, and in one archive the later line.
    """
    for path in sorted(place.glob(ARCHIVES), reverse=True):
        own: dict[str, Record] = {}
        for record in read_archive(path):
            if record.key not in seen:
                own[record.key] = record
        seen.update(own)
        yield from own.values()


def read_record(path: Path) -> Record:
    """A finished record. Raises :class:`UserError`, one line that names the file, if the file is not a record."""
    try:
        content = read_regular(path, MOST_RECORD)
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror}); remove it and run again") from error
    return record_in(content, str(path))


def whole_record(path: Path) -> Record | None:
    """The record in a file; None where there is no such file, or it holds none."""
    try:
        return read_record(path)
    except UserError:
        return None


def read_archive(path: Path) -> Iterator[Record]:
    """The records of a packed folder, one per line. Raises :class:`UserError` as :func:`read_record` does."""
    try:
        for number, line in enumerate(_lines(path), 1):
            yield record_in(line, f"{path}, line {number}", "fetch it again")
    except OSError as error:
        reason = error.strerror or str(error)
        raise UserError(f"{path}: cannot be read ({reason}); fetch it again") from error
    except (lzma.LZMAError, EOFError, ValueError) as error:
        raise UserError(f"{path}: damaged ({error}); fetch it again") from error


def _lines(path: Path) -> Iterator[bytes]:
    """The lines of a compressed file, unpacked as they are read. The module lzma alone would not limit the memory."""
    decoder, rest, total = lzma.LZMADecompressor(lzma.FORMAT_XZ, MOST_DICTIONARY), b"", 0
    with open_regular(path) as file:
        while not decoder.eof:
            packed = file.read(BLOCK) if decoder.needs_input else b""
            if decoder.needs_input and not packed:
                raise EOFError("it ends too early")
            block = decoder.decompress(packed, BLOCK)
            total += len(block)
            if total > MOST_UNPACKED or len(rest) > MOST_RECORD:
                raise ValueError(f"more than {MOST_RECORD:,} bytes in a line or {MOST_UNPACKED:,} in all")
            *whole, rest = (rest + block).split(b"\n")
            yield from whole
        if decoder.unused_data or file.read(1):
            raise ValueError("bytes follow its end")
    if rest:
        yield rest


def write_archive(path: Path, records: Iterable[Record]) -> None:
    """Records as one compressed file, by key, as :func:`read_archive` reads it. The same records give the same bytes."""
    ordered = sorted(records, key=lambda record: record.key)
    text = "".join(json.dumps(_told(record.to_json()), allow_nan=False) + "\n" for record in ordered)
    write_bytes(path, lzma.compress(text.encode(), preset=9 | lzma.PRESET_EXTREME))


def _told(value: Any, name: str = "") -> Any:
    """Part of a record with the digits that the host's clock carries: four of a duration, a tenth of a second of an instant.
    What a device's clock measured keeps all. An archive takes a fifth less.
    """
    if isinstance(value, dict):
        return {key: _told(part, key) for key, part in value.items()}
    if isinstance(value, list):
        return [_told(part, name) for part in value]
    if isinstance(value, float) and name in INSTANTS:
        return round(value, 1)
    return float(f"{value:.4g}") if isinstance(value, float) and (name in HOST_MS or name.endswith("_s")) else value


def record_in(content: bytes, where: str, remedy: str = "remove it and run again") -> Record:
    """The record that JSON holds. Raises :class:`UserError`, one line that says ``where`` it is from, if it is not one."""
    try:
        text = content.decode("utf-8")
        found = json.loads(text)
        if may_hide(text):
            found = all_visible(found)
    except (ValueError, RecursionError) as error:
        raise UserError(f"{where}: not a record ({error}); {remedy}") from error
    if isinstance(found, dict) and found.get("schema") != SCHEMA:
        raise UserError(
            f"{where}: schema {str(found.get('schema'))[:40]}, this version reads {SCHEMA}; run again into a new folder"
        )
    try:
        record = checked(Record, found)
    except (WrongFieldError, RecursionError) as error:
        raise UserError(f"{where}: not a record ({error}); {remedy}") from error
    name = current_name(record.method["name"])
    given = record.method.get("settings")
    record.method.update(name=name, **({"settings": present_settings(name, given)} if given else {}))
    return record


def settings_text(settings: dict[str, Any] | None) -> str:
    """Settings as one phrase, "constructor sah, threads 2"; a dash where there are none."""
    if not settings:
        return "-"
    return ", ".join(f"{key.replace('_', ' ')} {value}" for key, value in settings.items())


def entry_of(record: Record) -> tuple[Any, ...]:
    """What two records of one table entry have in common: scene, lights, method, settings, device and size."""
    scene, method, point = record.scene, record.method, record.point
    return (
        *(scene["name"], scene.get("title"), (scene.get("lighting") or {}).get("label", "")),
        *(method["name"], label_of(method), method["device"], settings_text(method.get("settings"))),
        *(point["width"], point["height"]),
    )


def newest(folder: Path | str) -> tuple[list[Record], int]:
    """The records of a folder, for each table entry the one asked for last; and the number of the others.

    A changed method or scene has another key, and its older records stay in the folder. A record is asked for when it is
    measured, and when a run takes it from the folder though another has come since (:func:`prefer`). Raises
    :class:`~.errors.UserError` as :func:`.results.schema.read_records` does.
    """
    return newest_as(folder, lambda record: record)


def newest_as(folder: Path | str, made_of: Callable[[Record], T]) -> tuple[list[T], int]:
    """What is made of each record of :func:`newest`, by key. The records are read one after another and not held."""
    chosen: dict[tuple[Any, ...], tuple[float, str, T]] = {}
    count = 0
    for record in each_record(folder):
        count += 1
        entry = entry_of(record)
        path = Path(folder) / "records" / f"{record.key}.json"
        noted = [one["noted"] for one in record.rounds or () if "noted" in one]
        when = max(noted, default=path.stat().st_mtime if path.exists() else 0.0)
        when = max(when, record.asked or 0.0)
        if entry not in chosen or (when, record.key) > chosen[entry][:2]:
            chosen[entry] = (when, record.key, made_of(record))
    ordered = sorted(chosen.values(), key=lambda one: one[1])
    return [made for _, _, made in ordered], count - len(chosen)


def prefer(folder: Path | str, records: Iterable[Record]) -> None:
    """Mark the records of a run as asked for last, before those that came into its folder in between."""
    shown = set(newest_as(folder, lambda record: record.key)[0])
    for record in records:
        if record.key not in shown:
            record.asked = time.time()
            write_atomic(Path(folder) / "records" / f"{record.key}.json", record.to_json())
