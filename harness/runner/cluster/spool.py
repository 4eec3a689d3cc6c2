"""The folder in which a worker measures a shard, on the worker's own disk, until the results are delivered.

It is a results folder. A shard that was interrupted (its worker was killed, its scheduler ended, its network failed)
continues there as an interrupted run continues in its folder, if the same card gets it again. Another card starts again:
all rounds of a point are of one card.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import shutil
import tempfile
import time
from pathlib import Path, PurePosixPath

from ...files import digest, plain, write_bytes
from ..job import Options

PLACE = "SHADOWBENCH_SHARDS"
"""The environment variable that gives the folder of the shards of a machine."""

KEPT_S = 14 * 24 * 3600.0
"""Seconds after which results that were not fetched are removed."""

DELIVERED = ("records", "environments", "images", "maps", "answers", "truth")
"""Folders of a results folder that are delivered; of ``truth``, the exact references, which are large, only the disputes."""

SINGLE = ("scenes.json",)

Files = dict[str, bytes]


def place() -> Path:
    """The folder of the shards of this machine and user."""
    return Path(os.environ.get(PLACE) or Path(tempfile.gettempdir()) / f"shadowbench-shards-{os.getuid()}")


def name_of(options: Options, card: str) -> str:
    """The name of a shard's folder: the same for the same points on the same card, in whichever run."""
    asked = {
        "experiment": options.experiment.name,
        "preset": [options.preset_name, plain(dataclasses.asdict(options.preset))],
        "options": [
            options.scene_dir,
            options.seed,
            options.save_answers,
            options.score,
            options.view.facts(),
        ],
        "device": options.device,
        "card": card,
    }
    return digest(plain(asked))[:16]


def held() -> list[str]:
    """The names of the folders that wait on this machine; folders that are too old are removed."""
    names = []
    for folder in sorted(place().glob("*")):
        with contextlib.suppress(OSError):
            if time.time() - folder.stat().st_mtime > KEPT_S:
                shutil.rmtree(folder, ignore_errors=True)
            else:
                names.append(folder.name)
    return names


def forget(name: str) -> None:
    """Remove the folder of a shard whose results have been written elsewhere."""
    if name and name == PurePosixPath(name).name:
        shutil.rmtree(place() / name, ignore_errors=True)


def fill(folder: Path, files: Files) -> None:
    """Write the known files into the folder. Files that the folder already has are newer, and stay."""
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
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
