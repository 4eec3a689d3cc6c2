"""``shadowbench cache``: the compiled kernels that Warp keeps on the disk: how many, and remove them."""

import json
import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

from ..errors import UserError
from ..runner.machine.lock import MACHINE
from ..texts import visible
from .options import command

MODULE = re.compile(r"wp_\w+|lto")  # folders of compiled modules in the folder of a Warp version; no others are touched

VERSION = re.compile(r"\d+\.\d+\.\d+\w*")


@command(
    """
    Show or clear the compiled kernels on the disk.
    shadowbench cache clear

    action  show, or clear: remove them all.
    """
)
def cache(action: str = "show", as_json: bool = False) -> int:
    """Show how much room the compiled kernels take, or clear them.

    Kernels are compiled once for each version of their code, of Warp and of the device, and kept; the folder only grows.
    What is cleared is compiled again when it is needed, which takes minutes for all methods.
    """
    if action not in ("show", "clear"):
        raise UserError(f"cache {action!r}: give show or clear")
    from ..frame.devices import kernel_cache

    place = kernel_cache()
    found = [(path, size(path)) for path in modules(place)]
    if action == "clear":
        MACHINE.share()  # no run measures meanwhile
        for path, _ in found:
            try:
                shutil.rmtree(path)
            except OSError as error:
                raise UserError(f"{path}: cannot be removed ({error.strerror}); correct its permissions") from error
    total = sum(count for _, count in found)
    if as_json:
        print(json.dumps({"folder": str(place), "modules": len(found), "bytes": total, "cleared": action == "clear"}))
    else:
        done = "removed from" if action == "clear" else "in"
        print(visible(f"{len(found)} compiled modules, {total / 1e6:.0f} MB, {done} {place}"))
    return 0


def modules(place: Path) -> Iterator[Path]:
    """The folders of compiled modules of this version of Warp, and of the others beside it."""
    beside = place.parent.iterdir() if VERSION.fullmatch(place.name) and place.parent.is_dir() else [place]
    for version in sorted(path for path in beside if path == place or VERSION.fullmatch(path.name)):
        if version.is_dir() and not version.is_symlink():
            for path in sorted(version.iterdir()):
                if MODULE.fullmatch(path.name) and path.is_dir() and not path.is_symlink():
                    yield path


def size(folder: Path) -> int:
    """Bytes of the files in a folder."""
    return sum(os.lstat(os.path.join(place, name)).st_size for place, _, names in os.walk(folder) for name in names)
