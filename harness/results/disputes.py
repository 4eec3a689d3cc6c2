"""What was decided of each scored frame, from which errors that methods share with the reference are added to the records
of a folder (:mod:`.judge.shared_errors`).

It lies in ``truth/``, beside Embree's answers and ignored by git. From all of it :func:`charge_folder` rewrites the records
whose counts change. A run does this at its end, and ``shadowbench score`` after scoring. Then it is needed again only if
more points are scored in the same folder.
"""

import json
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

import numpy as np

from ..files import DAMAGED, opened_arrays, write_arrays, write_atomic
from ..judge.shared_errors import Disputes, charge, charged_pixels, pooled
from .folder import ResultsFolder
from .pixel_maps import mark_wrong, wrong_path
from .record import Record
from .schema import read_record

ARRAYS = ("state", "pixels", "hit", "primary", "shadow")
FACTS = tuple(one.name for one in fields(Disputes) if one.name not in ARRAYS)


def disputes_path(folder: Path, key: str, frame: int) -> Path:
    """The file of the disputes of a point's frame."""
    return folder / "truth" / f"disputes-{key}-{frame}.npz"


def write_disputes(folder: Path, key: str, frame: int, disputes: Sequence[Disputes]) -> None:
    """Write the disputes of a frame's score, atomically. Their size is about a hundredth of the frame's answers."""
    path = disputes_path(folder, key, frame)
    facts = {"key": key, "frame": frame, "of": [{name: getattr(one, name) for name in FACTS} for one in disputes]}
    arrays = {f"{i}_{name}": getattr(one, name) for i, one in enumerate(disputes) for name in ARRAYS}
    write_arrays(path, {"facts": np.array(json.dumps(facts)), **arrays})


def read_disputes(path: Path, state: bool = True) -> tuple[str, int, list[Disputes]] | None:
    """Key, frame and disputes of a file; None where it is damaged. ``state``: False leaves those arrays empty."""
    try:
        with opened_arrays(path) as stored:
            facts = json.loads(str(stored["facts"]))
            names = ARRAYS if state else ARRAYS[1:]
            left = [] if state else [np.zeros(0, dtype=np.uint8)]
            found = [
                Disputes(*one.values(), *left, *(stored[f"{i}_{name}"] for name in names))
                for i, one in enumerate(facts["of"])
            ]
    except DAMAGED:
        return None
    return facts["key"], facts["frame"], found


def charge_folder(folder: Path) -> dict[str, Record]:
    """Add shared errors to the records of a folder. Returns the records that changed, by key, as they were rewritten.
    Records are written atomically, so that a run that is stopped here updates the rest when it is resumed.
    """
    files = sorted((folder / "truth").glob("disputes-*.npz"))
    known = [(path, found) for path in files if (found := read_disputes(path, state=False))]
    pool = pooled(one for _, (_, _, disputes) in known for one in disputes)
    changed: dict[str, Record] = {}
    for path, (key, frame, _) in known:
        place = folder / "records" / f"{key}.json"
        if not place.is_file():
            continue  # its point is being measured, or does not belong to this folder
        record = read_record(place)
        scored = record.frame(frame)
        whole = read_disputes(path) if scored and scored.score else None
        if scored is None or scored.score is None or whole is None:
            continue
        charged = charge(scored.score, whole[2], pool)
        if charged is not scored.score:
            scored.score = charged
            write_atomic(place, record.to_json())
            changed[key] = record
        mark_wrong(wrong_path(folder, key, frame), *charged_pixels(whole[2], pool))
    return changed


def charged_records(folder: ResultsFolder, records: list[Record]) -> list[Record]:
    """The records, and their files, with the errors of their answers that the disputes of other points showed."""
    if not any((folder.path / "truth").glob("disputes-*.npz")):
        return records
    with folder.writing():
        changed = charge_folder(folder.path)
    return [changed.get(record.key, record) for record in records]
