"""The folder in which a worker measures a shard, on the worker's own disk, until the results are delivered.

It is a results folder. A shard that was interrupted (its worker was killed, its scheduler ended, its network failed)
continues there as an interrupted run continues in its folder, if the same card gets it again. Another card starts again:
all rounds of a point are of one card.
"""

from __future__ import annotations

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
from ..planning.run_options import Options

PLACE = "SHADOWBENCH_SHARDS"
"""The environment variable that gives the folder of the shards of a machine."""

PREFIX = "shadowbench-shards-"
"""How the name of that folder begins without the variable: the rest is random, as others may write beside it."""

MARKER = ".shadowbench-shard"
"""A file in every folder that this module made. Nothing without it is written to or removed."""

NAME = re.compile("[0-9a-f]{16}")
"""The names of shards, see :func:`name_of`."""

KEPT_S = 14 * 24 * 3600.0
"""Seconds after which results that were not fetched are removed."""

DELIVERED = ("records", "environments", "images", "maps", "answers", "truth")
"""Folders of a results folder that are delivered; of ``truth``, the exact references, which are large, only the disputes."""

SINGLE = ("scenes.json",)

Files = dict[str, bytes]


def places() -> list[Path]:
    """The folders of the shards of this machine and user: the one given, or those in the folder for temporary files.

    There is more than one of the latter where two workers made the first shard at the same time.
    """
    if given := os.environ.get(PLACE):
        return [Path(os.path.abspath(given))]
    return [path for path in sorted(Path(tempfile.gettempdir()).glob(f"{PREFIX}*")) if is_own(path)]


def is_own(folder: Path) -> bool:
    """Whether this module made a folder for this user: no link, closed to others, with the marker."""
    try:
        here, marker = folder.lstat(), (folder / MARKER).lstat()
    except OSError:
        return False
    ours = here.st_uid == marker.st_uid == os.getuid()
    return ours and _closed(here) and stat.S_ISREG(marker.st_mode)


def _closed(here: os.stat_result) -> bool:
    return stat.S_ISDIR(here.st_mode) and not here.st_mode & 0o077


def made(folder: Path) -> Path:
    """Make a folder of our own, or take the one that is there. Raises :class:`UserError` if that is not ours."""
    with contextlib.suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    here = folder.lstat()
    unmarked = _closed(here) and here.st_uid == os.getuid() and not any(folder.iterdir())
    if not unmarked and not is_own(folder):
        raise UserError(f"{folder}: it is not a folder of shadowbench; move it, or set {PLACE} to another folder")
    (folder / MARKER).touch()
    return folder


def shard_folder(name: str) -> Path:
    """The folder of a shard, which is made where there is none. Raises :class:`UserError` as :func:`made` does."""
    here = places()
    if not here:
        here = [made(Path(tempfile.mkdtemp(prefix=PREFIX)))]
    here[0].mkdir(mode=0o700, parents=True, exist_ok=True)
    return made(next((place / name for place in here if (place / name).exists()), here[0] / name))


def name_of(options: Options, card: str) -> str:
    """The name of a shard's folder: the same for the same points on the same card, in whichever run."""
    asked = {
        "experiment": options.experiment.name,
        "preset": [options.preset_name, plain(dataclasses.asdict(options.preset))],
        "options": [options.scene_dir, options.seed, options.save_answers, options.score, options.view.facts()],
        "device": options.device,
        "card": card,
    }
    return digest(plain(asked))[:16]


def held() -> list[str]:
    """The names of the shards that wait on this machine; those that are too old are removed."""
    names = []
    for folder in sorted(path for place in places() for path in place.glob("*")):
        if not NAME.fullmatch(folder.name) or not is_own(folder):
            continue
        with contextlib.suppress(OSError):
            if time.time() - folder.lstat().st_mtime > KEPT_S:
                shutil.rmtree(folder, ignore_errors=True)
            else:
                names.append(folder.name)
    return names


def forget(name: str) -> None:
    """Remove the folder of a shard whose results have been written elsewhere."""
    for folder in (place / name for place in places() if NAME.fullmatch(name)):
        if is_own(folder):
            shutil.rmtree(folder, ignore_errors=True)


def fill(folder: Path, files: Files) -> None:
    """Write the known files into the folder. Files that the folder already has are newer, and stay."""
    os.utime(folder)
    for name, content in files.items():
        if not (folder / name).exists():
            write_bytes(folder / name, content)


def fresh(folder: Path, known: Files) -> Files:
    """The files to be delivered: those that were not sent, or that have changed since."""
    paths = [folder / name for name in SINGLE]
    for part in DELIVERED:
        pattern = "disputes-*.npz" if part == "truth" else "*"
        paths += sorted((folder / part).glob(pattern))
    found: Files = {}
    for path in paths:
        name = path.relative_to(folder).as_posix()
        if path.is_file() and not path.name.startswith("."):
            content = path.read_bytes()
            if known.get(name) != content:
                found[name] = content
    return found


def allowed(name: str) -> bool:
    """Whether a delivered file may be written into the results folder under this name."""
    path = PurePosixPath(name)
    inside = len(path.parts) == 2 and path.parts[0] in DELIVERED and path.parts[1] not in (".", "..")
    return name in SINGLE or inside
