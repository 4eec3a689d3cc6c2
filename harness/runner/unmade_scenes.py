"""Points of a scene that could not be made: what their records say of it, and their end once it is made.

The facts of a scene, which are part of a point's key, come from the worker that makes it. Where that fails, the points get
records all the same, with other keys: these must go when the scene is there, or tables would show it twice.
"""

from __future__ import annotations

import glob
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..errors import UserError
from ..results.folder import ResultsFolder
from ..results.record import FAILURES, Record
from ..results.schema import whole_record
from ..scene.catalogue import TITLES, name_in
from ..scene.overrides import Lighting
from .planning.run_options import Options


def unmade_scene(options: Options, name: str, lighting: Lighting) -> dict[str, Any]:
    """The facts of a scene, given as ``name``, that are known though it could not be made."""
    try:
        scene = options.described(name)
        called = {"name": scene.name, "title": scene.title}
    except UserError:
        called = {"name": name_in(Path(name)), "title": TITLES.get(name, Path(name).name)}
    return {**called, "source": {"kind": "", "file": name}, "lighting": lighting.facts()}


def forget_unmade(folder: ResultsFolder, made: Iterable[tuple[str, str | None]]) -> None:
    """Remove the failures to make the scene of points whose scene has been made.

    ``made``: the keys of these points, and the labels of their methods.
    """
    with folder.writing():
        for key, label in made:
            # All but the hash of the configuration, which says whether there was a scene.
            alike = f"{glob.escape(key.rpartition('-')[0])}-*.json"
            for path in (folder.path / "records").glob(alike):
                record = whole_record(path)
                if record is not None and record.method.get("label") == label and is_unmade(record):
                    path.unlink(missing_ok=True)


def is_unmade(record: Record) -> bool:
    """Whether a record says that its scene could not be made."""
    return record.status in FAILURES and not record.scene.get("arrays_sha256")
