"""Files that go from a results folder to a worker and back; they are stored as a run on one machine stores them."""

import contextlib
import json
from pathlib import Path, PurePosixPath

from ...errors import UserError
from ...files import write_atomic, write_bytes
from ...results.folder import ResultsFolder, image_name, read_json
from ...results.record import Record
from ...results.schema import each_record, record_in
from ..planning.planned_point import Options, describe_method
from ..planning.survey import forget_unmade, is_unmade, known_scene, unmade_scene
from ..workers.protocol import load_command

SCENES = "scenes.json"
DELIVERED = ("records", "environments", "images", "maps", "answers", "truth")
"""Folders of a results folder that are delivered; of ``truth``, the references, which are large, only the disputes."""

Files = dict[str, bytes]


def fill(folder: Path, files: Files) -> None:
    """Write the known files into a worker's folder."""
    for name, content in files.items():
        write_bytes(folder / name, content)


def fresh(folder: Path, known: Files) -> Files:
    """The files to be delivered: those that were not sent, or that have changed since."""
    patterns = (SCENES, *(f"{part}/disputes-*.npz" if part == "truth" else f"{part}/*" for part in DELIVERED))
    paths = [path for pattern in patterns for path in sorted(folder.glob(pattern)) if path.is_file()]
    files = ((path.relative_to(folder).as_posix(), path.read_bytes()) for path in paths if path.name[0] != ".")
    return {name: content for name, content in files if known.get(name) != content}


def allowed(name: str) -> bool:
    """Whether a delivered file may be written into the results folder under this name."""
    path = PurePosixPath(name)
    return name == SCENES or (len(path.parts) == 2 and path.parts[0] in DELIVERED and path.parts[1] not in (".", ".."))


def known_files(folder: ResultsFolder, options: Options) -> Files:
    """The files of the folder that concern a shard: its records, its pictures, and the facts of scenes."""
    preset = options.preset
    try:
        scene = options.described(preset.scenes[0]).name
    except UserError:
        return {}  # the worker reports what is wrong with the scene
    size = preset.width, preset.height
    found: Files = {}
    with contextlib.suppress(UserError):  # no record yet, or an invalid file, whose point is measured again
        for record in each_record(folder.path):
            if (record.scene["name"], record.point["width"], record.point["height"]) == (scene, *size):
                found[f"records/{record.key}.json"] = json.dumps(record.to_json()).encode()
    for name in (SCENES, *(f"images/{image_name(scene, one.label, *size)}" for one in preset.lightings)):
        if (folder.path / name).is_file():
            found[name] = (folder.path / name).read_bytes()
    return found


def write(folder: ResultsFolder, files: Files) -> list[Record]:
    """Write what a worker delivers, records last, so that a record has its files. Returns the new records. A record is
    checked by the schema before it is stored; storing it removes a journal that an earlier run left.
    """
    if odd := [name for name in files if not allowed(name)]:
        raise UserError(f"{odd[0]}: a worker delivered a file of this name, which no results folder has")
    records = [record_in(content, name) for name, content in files.items() if name.startswith("records/")]
    with folder.writing():
        for name, content in files.items():
            path = folder.path / name
            if name == SCENES:
                write_atomic(path, {**(read_json(path) or {}), **json.loads(content)})
            elif not name.startswith("records/"):
                write_bytes(path, content)
    for record in records:
        folder.keep_record(record, folder.journal(record.key))
    forget_unmade(folder, [(one.key, one.method.get("label")) for one in records if not is_unmade(one)])
    return records


def failed(folder: ResultsFolder, options: Options, device: tuple[str, str], reason: str) -> list[Record]:
    """Records for the points of a shard that no worker could finish. Records that are there stay.

    device  its name, and that of the product, which this machine need not have
    """
    records = []
    (name,) = options.preset.scenes
    for lighting in options.preset.lightings:
        facts = known_scene(folder, load_command(options, folder, lighting, name))
        for entry in options.preset.methods:
            method = describe_method(entry, "cpu")
            if device[0] != "cpu" and not method.get("broken"):
                method |= {"device": device[0], "asked_device": device[0], "device_name": device[1]}
            point = options.point(entry, facts or unmade_scene(options, name, lighting), method)
            kept = folder.record(point.key)
            if kept is None:
                kept = options.record(point, status="failed", reason=reason)
                folder.keep_record(kept, folder.journal(point.key))
            records.append(kept)
    return records
