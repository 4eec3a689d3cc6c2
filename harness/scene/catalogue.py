"""The catalogue: the paper's six scenes, the bunny, and any file in place of a name.

A scene of the paper is a procedural stand-in until a file of its name lies in the folder of originals.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from ..errors import UserError, did_you_mean, warn
from .declaration import SUFFIX, declared_scene
from .names import BUNNY, NAMES, scene_names
from .readers import usd
from .readers.checks import Loaded, exists, is_file, within_range
from .readers.load import SUFFIXES, load, load_sequence, source
from .readers.sequences import numbered
from .scene import Camera, Light, Scene
from .standins import balls
from .views import Shape, inside, outside, shape_of, view

FOLDER_VARIABLE = "SHADOWBENCH_SCENES"

TITLES = {
    "fairy": "Fairy Forest",
    "sibenik": "Sibenik",
    "bunny_dragon": "Bunny/Dragon",
    "conference": "Conference",
    "cloth": "Cloth",
    "buddha": "Buddha",
    BUNNY: "Bunny",
}

View = Callable[[Shape], tuple[Camera, tuple[Light, ...]]]

VIEWS: dict[str, View] = {
    "sibenik": inside,
    # A room is lower than it is wide, whichever axis its file takes as up.
    "conference": lambda shape: inside(replace(shape, up=shape.thinnest), along=0.06, height=0.55),
    "cloth": lambda shape: outside(shape, azimuth=25.0, elevation=28.0),
    "buddha": lambda shape: outside(shape, azimuth=12.0, elevation=8.0),
}
"""Views of originals, by name: buildings are seen from within. All others get the view for any mesh."""


def resolve(name: str | Path, scene_dir: str | Path | None = None, within: tuple[Path, ...] = ()) -> Scene:
    """The scene of a catalogue name, a mesh file, a folder of numbered frames, or a file that declares one (TOML).

    A name such as ``balls-300k`` is a scene of so many triangles (:mod:`.scene.standins.balls`). The original of a name
    takes its stand-in's place where a file of that name lies in ``scene_dir``, or in the folder that the environment
    variable SHADOWBENCH_SCENES names. Raises :class:`UserError` for an unknown name, a missing folder and a file that
    cannot be used: a broken original is never replaced by its stand-in. ``within``: the declarations whose mesh this
    is, so that none is its own.
    """
    text = str(name)
    if text in scene_names():
        files = original(text, scene_dir)
        if files:
            return _from_files(files, text, TITLES[text])
        return (
            _bunny() if text == BUNNY else importlib.import_module(f".standins.{text}", __package__).scene()
        )
    if balls.count_of(text) is not None:
        return balls.scene(text)
    path = Path(text)
    if path.suffix.lower() == SUFFIX:
        try:
            here = path.resolve()
        except (OSError, RuntimeError) as error:  # a link that leads to itself
            raise UserError(f"{path}: cannot read ({' '.join(str(error).split())})") from error
        if here in within:
            raise UserError(f"{path}: its mesh leads back to itself; name a mesh file or a scene")
        scene = declared_scene(path, lambda mesh: resolve(mesh, scene_dir, (*within, here)))
        # What is declared about a scene of the paper is another scene: the paper's numbers are not for it.
        plain = _plain(path.stem)
        return replace(scene, name=f"{plain}-declared" if plain in scene_names() else plain)
    if exists(path) or path.suffix.lower() in SUFFIXES or path.parent != Path("."):
        known = path.stem.lower()
        return _from_files(path, known if known in NAMES else _plain(path.stem), path.name)
    raise UserError(f"no scene or file {text!r}{did_you_mean(text, scene_names())}")


def folder(scene_dir: str | Path | None = None) -> Path | None:
    """The folder of originals: ``scene_dir``, else SHADOWBENCH_SCENES, else none."""
    given = scene_dir if scene_dir is not None else os.environ.get(FOLDER_VARIABLE) or None
    if given is None:
        return None
    path = Path(given)
    if not path.is_dir():
        way_out = "give an existing folder" if scene_dir is not None else f"mend or unset {FOLDER_VARIABLE}"
        raise UserError(f"{path}: no such folder of scenes; {way_out}")
    return path


def original(name: str, scene_dir: str | Path | None = None) -> Path | list[Path] | None:
    """What takes a stand-in's place, or None: ``name.npz``, ``name.ply`` and the other formats in the order
    of :data:`~.scene.readers.load.SUFFIXES`, then numbered frames ``name_001.ply ...``, then a folder ``name`` of such
    frames. Warns of what bears the name and is no file, and where there is more than one, says which is taken.
    """
    where = folder(scene_dir)
    if where is None:
        return None
    try:
        entries = {entry.name.lower(): entry for entry in sorted(where.iterdir(), reverse=True)}
    except OSError as error:
        raise UserError(f"{where}: cannot be read ({error.strerror}); mend its rights") from error
    named = [entries[name + suffix] for suffix in SUFFIXES if name + suffix in entries]
    files = [entry for entry in named if is_file(entry)]
    frames = [] if files else numbered(where, name)
    entry = entries.get(name)
    found: list[Path | list[Path]] = [*files, *([frames] if frames else [])]
    found += [entry] if entry is not None and entry.is_dir() else []
    taken = f"{_called(found[0])} is taken" if found else "the stand-in is taken, where there is one"
    for other in (entry for entry in named if entry not in files):
        what = "a folder" if other.is_dir() else "a link that leads nowhere, or no plain file"
        warn(f"{other}: {what}, not a mesh; {taken}")
    if len(found) > 1:
        warn(f"{where}: {' and '.join(map(_called, found))} are all {name}; {taken}")
    return found[0] if found else None


def _called(files: Path | list[Path]) -> str:
    """A file, a folder or a sequence in a few words."""
    return f"{files[0].name} ... {files[-1].name}" if isinstance(files, list) else files.name


def _from_files(files: Path | list[Path], name: str, title: str) -> Scene:
    """A scene of what was loaded now (a broken file is reported here), with a view chosen from its shape."""
    loaded: Loaded = load_sequence(files) if isinstance(files, list) else load(files)
    within_range(loaded)
    camera, lights = VIEWS.get(name, view)(shape_of(loaded))
    return Scene(
        name, title, loaded.geometry, camera, lights, source=source(loaded.files), notes=loaded.notes
    )


def _bunny() -> Scene:
    """The bunny of the warp-lang package."""
    spec = importlib.util.find_spec("warp")
    if spec is None or not spec.submodule_search_locations:
        raise UserError(
            "bunny: it ships inside the package warp-lang, which is not installed; pip install warp-lang"
        )
    path = Path(next(iter(spec.submodule_search_locations))) / "examples" / "assets" / "bunny.usd"
    if not path.is_file():
        raise UserError(
            f"bunny: this warp-lang has no {path.name}; put a bunny.ply into the folder of scenes"
        )
    if not usd.available():
        raise UserError(f"bunny: {usd.MISSING}")
    return replace(_from_files(path, BUNNY, TITLES[BUNNY]), notes="bunny.usd of the warp-lang package")


def _plain(stem: str) -> str:
    """A file's name as a scene's: lower case, no spaces."""
    return re.sub(r"[^a-z0-9_.-]+", "_", stem.lower()).strip("_") or "file"
