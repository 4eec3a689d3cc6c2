"""Of several records for one table entry, select the one that a run used last."""

import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

from ..files import write_atomic
from ..frame.registry import label_of
from .record import Record
from .schema import each_record

T = TypeVar("T")


def settings_text(settings: dict[str, Any] | None) -> str:
    """Settings as one phrase, "constructor sah, threads 2"; a dash where there are none."""
    if not settings:
        return "-"
    return ", ".join(f"{key.replace('_', ' ')} {value}" for key, value in settings.items())


def entry_of(record: Record) -> tuple[Any, ...]:
    """The properties that two records of one table entry have in common: scene, lights, method, settings, device and
    size."""
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
