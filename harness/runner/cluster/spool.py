"""The folder in which a worker measures a shard, on the worker's own disk, until the results are delivered.

It is a results folder. A shard that was interrupted (its worker was killed, its scheduler ended, its network failed)
continues there as an interrupted run continues in its folder, if the same card gets it again. Another card starts again:
all rounds of a point are of one card.
"""

import contextlib
import dataclasses
import os
import re
import shutil
import stat
import tempfile
import time
from pathlib import Path, PurePosixPath

from ...errors import UserError
from ...files import digest, plain, write_bytes
from ..planning.planned_point import Options

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
