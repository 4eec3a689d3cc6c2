"""The catalogue: the paper's six scenes and the bunny. A file can be given instead of a name. A scene of the paper is a
procedural stand-in, unless the folder of original scenes has a file of its name. Any other file there is a scene of its
name, too.
"""

import importlib.util
import os
import re
from collections.abc import Callable
from dataclasses import replace
from os.path import exists, isfile
from pathlib import Path
from typing import Any

from ..errors import UserError, did_you_mean, install, note, one_line, warn
from ..texts import visible
from .declaration import declared_scene
from .facts import triangles
from .names import BUNNY, NAMES, TITLES, scene_names, stand_in
from .offered import FURTHER
from .readers import usd
from .readers.apart import load, load_sequence
from .readers.checks import ALL, Loaded, Wanted, not_finite, within_range
from .readers.load import DECLARATION, READERS, SUFFIXES, source
from .readers.sequences import is_pattern, matching, numbered, plain_name
from .scene import Camera, Light, Scene
from .shape import Shape, shape_of
from .standins import balls
from .views import inside, outside, view

FOLDER_VARIABLE = "SHADOWBENCH_SCENES"

BUNNY_NOTES = "a real mesh, bunny.usd of the warp-lang package"

View = Callable[[Shape], tuple[Camera, tuple[Light, ...]]]

VIEWS: dict[str, View] = {
    "sibenik": inside,
    # A room is lower than it is wide, so its thinnest axis is up, whatever its file says.
    "conference": lambda shape: inside(replace(shape, up=shape.thinnest), along=0.06, height=0.55),
    "cloth": lambda shape: outside(shape, azimuth=25.0, elevation=28.0),
    "buddha": lambda shape: outside(shape, azimuth=12.0, elevation=8.0),
}
"""Camera and lights of original scenes, by name; buildings are seen from inside. Others get the default view."""


def resolve(name: str | Path, scene_dir: str | Path | None = None, wanted: Wanted = ALL) -> Scene:
    """The scene of a catalogue name, a mesh file, a folder of numbered frames, a pattern of their names, or a file
    that declares one (TOML).

    A name such as ``balls-300k`` is a scene of that many triangles (:mod:`.scene.standins.balls`). An original replaces
    its stand-in if ``scene_dir``, or the folder in the environment variable SHADOWBENCH_SCENES, has a file of its name.
    Raises :class:`UserError` for an unknown name, a missing folder and an unusable file: a broken original is never
    replaced by its stand-in. ``wanted``: what is asked of the file; frames of what has no file are refused.
    """
    scene = _found(name, scene_dir, wanted)
    if wanted.rate is None or scene.rate is not None:
        return scene
    said = "--rate does nothing, because there is one frame"
    note(f"{scene.title}: {said}")
    left_out = "; ".join(filter(None, (scene.source.left_out, said)))
    return replace(scene, source=replace(scene.source, left_out=left_out))


def _found(name: str | Path, scene_dir: str | Path | None, wanted: Wanted, within: tuple[Path, ...] = ()) -> Scene:
    """What :func:`resolve` finds. ``within``: the declarations that refer to this one, to detect a cycle."""
    text = str(name)
    if not text:
        raise UserError("the name of the scene is empty; give a scene or a mesh file")
    if text in scene_names():
        files = original(text, scene_dir)
        if files:
            return _from_files(files, text, TITLES[text], wanted)
        if text == BUNNY:
            return replace(_from_files(bunny_file(), BUNNY, TITLES[BUNNY], wanted), notes=BUNNY_NOTES)
        _without_file(text, wanted)
        return stand_in(text)
    if balls.count_of(text) is not None:
        _without_file(text, wanted)
        return balls.scene(text)
    path = Path(text)
    if path.suffix.lower() == DECLARATION:
        try:
            here = path.resolve()
        except (OSError, RuntimeError) as error:  # a cycle of links
            raise UserError(f"{path}: cannot read ({one_line(error)})") from error
        if here in within:
            raise UserError(f"{path}: its mesh refers back to this file; name a mesh file or a scene")
        scene = declared_scene(path, lambda mesh, asked: _found(mesh, scene_dir, asked, (*within, here)), wanted)
        return replace(scene, name=name_in(path))
    if is_pattern(text):
        return _from_files(matching(text, READERS), _plain(plain_name(text)), visible(path.name), wanted)
    if exists(path) or path.suffix.lower() in SUFFIXES or path.parent != Path("."):
        return _from_files(path, name_in(path), visible(path.name), wanted)
    if files := original(text, scene_dir):
        return _from_files(files, _plain(text), visible(text.replace("_", " ").title()), wanted)
    if text in FURTHER:
        raise UserError(f"{text}: not in the folder of scenes; shadowbench scenes fetch {text} --scene-dir FOLDER")
    raise UserError(f"no scene or file {text!r}{did_you_mean(text, [*scene_names(), balls.EXAMPLE])}")


def is_of_files(name: str) -> bool:
    """Whether :func:`resolve` takes a name for a file, a folder of frames, or a pattern of their names."""
    return name not in scene_names() and balls.count_of(name) is None and (exists(Path(name)) or is_pattern(name))


def _without_file(name: str, wanted: Wanted) -> None:
    """Raise :class:`UserError` if frames are asked of a scene that is no file."""
    if wanted.frames is not None or wanted.rate is not None:
        option = "--frames A:B:STEP" if wanted.frames is not None else "--rate"
        raise UserError(f"{name}: {option} is for files; this scene is procedural, leave it out")


def folder(scene_dir: str | Path | None = None) -> Path | None:
    """The folder of originals: ``scene_dir``, else SHADOWBENCH_SCENES, else none."""
    given = scene_dir if scene_dir is not None else os.environ.get(FOLDER_VARIABLE) or None
    if given is None:
        return None
    path = Path(given)
    if not path.is_dir():
        way_out = "give an existing folder" if scene_dir is not None else f"correct or unset {FOLDER_VARIABLE}"
        raise UserError(f"{path}: no such folder of scenes; {way_out}")
    return path


def original(name: str, scene_dir: str | Path | None = None) -> Path | list[Path] | None:
    """The original that replaces a stand-in, or another scene of a name in the folder of scenes, or None.

    The first that exists of: ``name.npz``, ``name.ply`` and the other formats in the order of
    :data:`~.scene.readers.load.SUFFIXES`; numbered frames ``name_001.ply ...``; a folder ``name`` of such frames. Warns
    if there are several, and if an entry of that name is not a file.
    """
    where = folder(scene_dir)
    if where is None:
        return None
    try:
        entries = {entry.name.lower(): entry for entry in sorted(where.iterdir(), reverse=True)}
    except OSError as error:
        raise UserError(f"{where}: cannot be read ({error.strerror}); check its permissions") from error
    named = [entries[name + suffix] for suffix in SUFFIXES if name + suffix in entries]
    files = [entry for entry in named if isfile(entry)]
    frames = [] if files else numbered(where, READERS, name)
    entry = entries.get(name)
    found: list[Path | list[Path]] = [*files, *([frames] if frames else [])]
    found += [entry] if entry is not None and entry.is_dir() else []
    taken = f"using {_called(found[0])}" if found else "using the stand-in, if there is one"
    for other in (entry for entry in named if entry not in files):
        what = "a folder" if other.is_dir() else "a broken link or a special file"
        warn(f"{other}: {what}, not a mesh; {taken}")
    if len(found) > 1:
        warn(f"{where}: {' and '.join(map(_called, found))} are all originals of {name}; {taken}")
    return found[0] if found else None


def _called(files: Path | list[Path]) -> str:
    """The name of a file or folder, or the first and last name of a sequence."""
    return f"{files[0].name} ... {files[-1].name}" if isinstance(files, list) else files.name


def _from_files(files: Path | list[Path], name: str, title: str, wanted: Wanted = ALL) -> Scene:
    """A scene loaded from files, with a view chosen from its shape. Raises :class:`UserError` for a broken file."""
    loaded: Loaded = load_sequence(files, wanted) if isinstance(files, list) else load(files, wanted)
    within_range(loaded)
    shape = shape_of(loaded.geometry(), loaded.up)
    far = [f"{triangles(shape.far)} too far from the others for the automatic view"] if shape.far else []
    left_out = visible("; ".join([*loaded.notes, *not_finite(loaded), *far]))
    if left_out:
        note(f"{title}: {left_out}")
    known = replace(source(loaded.files, wanted), left_out=left_out)
    offers: dict[str, Any] = {"cameras": loaded.cameras, "lamps": loaded.lights, "rate": loaded.rate}
    return Scene(name, title, loaded.geometry, *VIEWS.get(name, view)(shape), source=known, **offers)


def bunny_file() -> Path:
    """The bunny of the warp-lang package. Raises :class:`UserError` where it is missing or cannot be read."""
    spec = importlib.util.find_spec("warp")
    if spec is None or not spec.submodule_search_locations:
        raise UserError(f"bunny: it is part of the package warp-lang, which is not installed; {install('warp-lang')}")
    path = Path(next(iter(spec.submodule_search_locations))) / "examples" / "assets" / "bunny.usd"
    if not path.is_file():
        raise UserError(
            f"bunny: this version of warp-lang has no {path.name}; put a bunny.ply into the folder of scenes"
        )
    if not usd.available():
        raise UserError(f"bunny: {usd.missing()}")
    return path


def name_in(path: Path) -> str:
    """The name of the scene in a file."""
    known, plain = path.stem.lower(), _plain(path.stem)
    if path.suffix.lower() == DECLARATION:
        # A scene of the paper with other lights or effects gets another name: the paper's numbers do not apply.
        return f"{plain}-declared" if plain in scene_names() else plain
    return known if known in NAMES else plain


def _plain(stem: str) -> str:
    """A scene name made from a file name: lower case, no spaces."""
    return re.sub(r"[^a-z0-9_.-]+", "_", stem.lower()).strip("_.") or "file"
