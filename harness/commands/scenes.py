"""``shadowbench scenes fetch``: originals of the paper's scenes, from the archives that have them."""

from __future__ import annotations

import re
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from ..errors import UserError, did_you_mean, say
from ..scene import catalogue
from ..scene.archives import unpack
from ..scene.download import downloaded
from ..scene.readers.apart import load, load_sequence
from ..texts import numbered
from .options import SceneDir

ARCHIVES = "archives"
"""The folder, in the folder of scenes, that keeps the downloads and their checksums."""


@dataclass(frozen=True)
class Source:
    """Where an original is.

    url      of the archive; "" if it must be fetched by hand
    files    pattern of the meshes in the archive; several are the frames of an animation, in the order of their numbers
    terms    whose it is, and under what terms
    sha256   of the archive; "" where it is not known: it is recorded at first use
    """

    url: str
    files: str
    terms: str
    sha256: str = ""


MCGUIRE = "https://casual-effects.com/g3d/data10/research/model"
STANFORD = "https://graphics.stanford.edu/pub/3Dscanrep"
UNC = "http://gamma.cs.unc.edu/SR/benchmarks"
"""Not encrypted: what arrives is checked as any file is, and must stay the same from then on."""
CREDIT = "Stanford Computer Graphics Laboratory: for research, with credit; not for commercial use"

SOURCES = {
    "sibenik": Source(
        f"{MCGUIRE}/sibenik/sibenik.zip", "*sibenik.obj", "M. Dabrovic; McGuire archive: CC BY-NC"
    ),
    "conference": Source(
        f"{MCGUIRE}/conference/conference.zip", "*conference.obj", "see the McGuire archive, casual-effects.com/data"
    ),
    "buddha": Source(
        f"{STANFORD}/happy/happy_recon.tar.gz", "*/happy_vrip.ply", CREDIT,
        "409cd294efbfd8244e15a382b95a9423f153b7776e736c9b09f19ec9d3c10ed0",
    ),
    "bunny": Source(f"{STANFORD}/bunny.tar.gz", "*/bun_zipper.ply", CREDIT),
    "cloth": Source(f"{UNC}/cloth_ball.plys.zip", "*.ply", "see gamma.cs.unc.edu/DYNAMICB"),
    "bunny_dragon": Source(f"{UNC}/dragbun.plys.zip", "*.ply", "see gamma.cs.unc.edu/DYNAMICB"),
    "fairy": Source("", "", "Utah 3D Animation Repository, http://www.sci.utah.edu/~wald/animrep/"),
}  # fmt: skip


def scenes(
    action: Annotated[str, typer.Argument(help="fetch")],
    names: Annotated[list[str], typer.Argument(help="Names of scenes; see shadowbench list scenes.")],
    scene_dir: SceneDir = None,
) -> int:
    """Fetch originals of scenes into the folder of scenes, where they replace the stand-ins.

    A download that was cut off is continued. Its checksum is compared with the pinned one, or with the one that was
    recorded when it was first fetched.
    """
    if action != "fetch":
        raise UserError(f"scenes {action!r}: there is only scenes fetch NAME ...")
    for name in names:
        if name not in SOURCES:
            raise UserError(f"no scene {name!r} to fetch{did_you_mean(name, SOURCES)}")
    if scene_dir is not None:
        try:
            scene_dir.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(f"--scene-dir {scene_dir}: cannot write ({error.strerror}); choose another") from error
    folder = catalogue.folder(scene_dir)
    if folder is None:
        raise UserError(f"scenes fetch: give --scene-dir FOLDER, or set {catalogue.FOLDER_VARIABLE}")
    missing = [name for name in names if not fetched(name, folder)]
    return 1 if missing else 0


def fetched(name: str, folder: Path) -> bool:
    """Fetch one scene unless it is there. False if it must be fetched by hand; the instructions are printed."""
    source = SOURCES[name]
    if catalogue.original(name, folder):
        say(f"{name}: already in {folder}")
        return True
    if not source.url:
        print(
            f"{name}: has to be fetched by hand: {source.terms}. Put its frames into {folder} as {name}_001.obj, "
            f"{name}_002.obj ...",
            file=sys.stderr,
        )
        return False
    say(f"{name}: {source.url} ({source.terms})")
    try:
        with (
            downloaded(source.url, folder / ARCHIVES, source.sha256 or None) as archive,
            tempfile.TemporaryDirectory(dir=folder, prefix=f".{name}.") as place,
        ):
            files = in_order(unpack(archive, source.files, Path(place)))
            _ = load(files[0]) if len(files) == 1 else load_sequence(files)  # nothing unreadable is put in place
            for number, file in enumerate(files, 1):
                ending = "" if len(files) == 1 else f"_{number:03}"
                file.replace(folder / f"{name}{ending}{file.suffix.lower()}")
    except OSError as error:
        raise UserError(f"{folder}: cannot write ({error.strerror}); choose another --scene-dir") from error
    say(f"{name}: {numbered(len(files), 'file')} in {folder}")
    return True


def in_order(files: list[Path]) -> list[Path]:
    """Frames by the last number in their names: frame 10 comes after frame 9."""
    return sorted(files, key=lambda file: (int((re.findall(r"\d+", file.stem) or ["0"])[-1]), file.name))
