"""The folder in which a worker measures a shard, on the worker's own disk, until the results are delivered; and the files
that go from a results folder to a worker and back.

It is a results folder. A shard that was interrupted (its worker was killed, its scheduler ended, its network failed)
continues there as an interrupted run continues in its folder, if the same card gets it again. Another card starts again:
all rounds of a point are of one card.
"""

import contextlib
import dataclasses
import json
import os
import re
import shutil
import stat
import tempfile
import time
from pathlib import Path, PurePosixPath

from ...errors import UserError
from ...files import digest, plain, write_atomic, write_bytes
from ...results.folder import ResultsFolder, image_name, read_json
from ...results.record import Record
from ...results.schema import each_record, record_in
from ..planning.planned_point import Options, describe_method
from ..planning.survey import forget_unmade, is_unmade, known_scene, unmade_scene
from ..workers.protocol import load_command

PLACE = "SHADOWBENCH_SHARDS"  # environment variable: where the folder of all shards of a machine is made
PREFIX = "shadowbench-shards"  # the name of that folder; without the variable, how it begins: the user's number follows
NAME = re.compile("[0-9a-f]{16}")  # the names of shards, see `name_of`
KEPT_S = 14 * 24 * 3600.0  # seconds after which results that were not fetched are removed

SCENES = "scenes.json"
DELIVERED = ("records", "environments", "images", "maps", "answers", "truth")
"""Folders of a results folder that are delivered; of ``truth``, the exact references, which are large, only the disputes."""

Files = dict[str, bytes]


def root() -> Path:
    """The folder of all shards of this machine and user. Nothing outside it is written to or removed. Raises
    :class:`UserError` where it is not closed to others: anybody may have made one of its name before."""
    given = os.environ.get(PLACE)
    folder = Path(os.path.abspath(given or tempfile.gettempdir())) / (PREFIX if given else f"{PREFIX}-{os.getuid()}")
    folder.parent.mkdir(parents=True, exist_ok=True)
    with contextlib.suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    here = folder.lstat()
    if not stat.S_ISDIR(here.st_mode) or here.st_uid != os.getuid() or here.st_mode & 0o077:
        name, place = folder.name, folder.parent
        raise UserError(f"{place}: it has no folder {name} that is closed to others; set {PLACE} to another folder")
    return folder


def shard_folder(name: str) -> Path:
    """The folder of a shard, which is made where there is none."""
    folder = root() / name
    folder.mkdir(exist_ok=True)
    return folder


def name_of(options: Options, card: str) -> str:
    """The name of a shard's folder: the same for the same points on the same card, in whichever run."""
    asked = {
        "experiment": options.experiment.name, "preset": [options.preset_name, dataclasses.asdict(options.preset)],
        "options": [options.scene_dir, options.seed, options.save_answers, options.score, options.view.facts()],
        "device": options.device, "card": card,
    }  # fmt: skip
    return digest(plain(asked))[:16]


def held() -> list[str]:
    """The names of the shards that wait on this machine; those that are too old are removed."""
    for folder in root().iterdir():
        with contextlib.suppress(OSError):
            if time.time() - folder.stat().st_mtime > KEPT_S:
                forget(folder.name)
    return sorted(folder.name for folder in root().iterdir())


def forget(name: str) -> None:
    """Remove the folder of a shard whose results have been written elsewhere."""
    if NAME.fullmatch(name):
        shutil.rmtree(root() / name, ignore_errors=True)


def fill(folder: Path, files: Files) -> None:
    """Write the known files into the folder. Files that the folder already has are newer, and stay."""
    os.utime(folder)
    for name, content in files.items():
        if not (folder / name).exists():
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
    checked by the schema before it is stored; storing it removes a journal that an earlier run left."""
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
