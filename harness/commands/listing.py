"""``shadowbench list``: the methods, scenes and experiments."""

from __future__ import annotations

import dataclasses
import shutil
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import UserError, did_you_mean
from ..files import plain
from ..frame.registry import about, method_class, method_names, parameters
from ..scene.names import TRIANGLES, scene_names
from ..texts import visible

if TYPE_CHECKING:  # each kind imports what it needs
    from ..runner.planning.experiment import Preset
    from ..scene.chosen_view import ChosenView

KINDS = ("methods", "scenes", "experiments")


def listing(kind: str) -> list[dict[str, Any]]:
    """Rows of one kind. Raises :class:`UserError` for an unknown one."""
    if kind not in KINDS:
        raise UserError(f"list {kind!r}: unknown kind{did_you_mean(kind, KINDS)}")
    return {"methods": methods, "scenes": scenes, "experiments": experiments}[kind]()


def rows_of(
    kind: str, names: list[str], seen: ChosenView, scene_dir: Path | None, brief: bool
) -> list[dict[str, Any]]:
    """The rows of ``list KIND NAME ...``. ``brief``: methods without names have a sentence each in place of parameters."""
    if kind == "methods" and (names or brief):
        return methods(names) if names else overview()
    return contents(kind, names, seen, scene_dir) if names else listing(kind)


def overview() -> list[dict[str, Any]]:
    """Every method with what it is, in a sentence."""
    rows = []
    for name in method_names():
        try:
            rows.append({"name": name, "title": about(name)})
        except (Exception, SystemExit) as error:  # one broken method must not hide the others
            rows.append({"name": name, "title": f"cannot be used: {error}"})
    return rows


def methods(names: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Every method, or those of ``names``, with its devices and its parameters: default, meaning and allowed values.

    Raises :class:`UserError` for a name that is not known.
    """
    rows = []
    for name in names:
        if name not in method_names():
            method_class(name)
    for name in names or method_names():
        try:
            cls = method_class(name)
            what = about(name)
            found = {p.name: dataclasses.asdict(p) for p in parameters(cls)}
        except (Exception, SystemExit) as error:  # one broken method must not hide the others
            rows.append({"name": name, "title": f"cannot be used: {error}", "devices": [], "parameters": {}})
            continue
        rows.append(
            {
                "name": name,
                "title": cls.title,
                "about": what,
                "devices": list(cls.devices),
                "parameters": found,
            }
        )
    return rows


def scenes() -> list[dict[str, Any]]:
    """The scenes of the catalogue and the family of balls; for a stand-in also what it replaces.

    A mesh file can be given instead of a name. ``triangles``: None where it is not known.
    """
    from ..scene.catalogue import TITLES, resolve
    from ..scene.facts import triangles
    from ..scene.standins import balls

    rows = []
    for name in scene_names():
        row: dict[str, Any] = {"name": name, "title": TITLES[name]}
        row |= {"stand_in": None, "about": "", "triangles": None}
        try:
            found = resolve(name)
            # A stand-in is not made to be counted.
            count = TRIANGLES[name] if found.stand_in else len(found.geometry().faces)
            row |= {"stand_in": found.stand_in, "about": found.stand_in or found.notes, "triangles": count}
            row["title"] = f"{TITLES[name]}: {triangles(count)}"
        except UserError as error:  # one broken original or a missing package must not hide the others
            row["title"] = f"{TITLES[name]}: {error}"
        rows.append(row)
    more = {
        "name": "balls-N",
        "title": "Balls over ground: about N triangles",
        "stand_in": None,
        "about": BALLS.format(balls.EXAMPLE),
        "triangles": None,
    }
    return [*rows, more]


def contents(kind: str, files: list[str], seen: ChosenView, scene_dir: Path | None) -> list[dict[str, Any]]:
    """A row for each scene or file: its triangles and frames, and the cameras and lights that it offers.

    Raises :class:`UserError` unless ``kind`` is "scenes".
    """
    if kind != "scenes":
        raise UserError(
            f"list {kind} {files[0]}: only methods and scenes have details; leave out {files[0]}, or write list scenes "
            f"{files[0]}"
        )
    from ..scene.facts import triangles

    rows = []
    for name in files:
        found = seen.resolved(name, scene_dir)
        geometry = found.geometry()
        frames, rate = geometry.frame_count, f" at {found.rate:g} a second" if found.rate else ""
        moves = f", {frames} frames{rate}" if frames > 1 else ""
        rows.append(
            {
                "name": found.name,
                "title": f"{found.title}: {triangles(len(geometry.faces))}{moves}",
                "stand_in": found.stand_in,
                "about": found.stand_in or found.notes or found.source.left_out,
                "triangles": len(geometry.faces),
                "frames": frames,
                "rate": found.rate,
                "cameras": {key: plain(dataclasses.asdict(one)) for key, one in found.cameras.items()},
                "lights": {key: plain(dataclasses.asdict(one)) for key, one in found.lamps.items()},
            }
        )
    return rows


def camera_text(camera: dict[str, Any]) -> str:
    """A camera in words."""
    shows = (
        f"{camera['fov']:g} degrees"
        if camera["height"] is None
        else f"orthographic, {camera['height']:g} high"
    )
    return f"from {place_text(camera['eye'])} to {place_text(camera['target'])}, {shows}"


def light_text(light: dict[str, Any]) -> str:
    """A light in words."""
    kind = "directional, from" if light["directional"] else "spot at" if light["spot"] else "at"
    return f"{kind} {place_text(light['position'])}"


def place_text(place: Sequence[float]) -> str:
    return ",".join(f"{x:.6g}" for x in place)


BALLS = (
    "procedural, with about N triangles, such as {0} or balls-2m; {0}-seen10: the ground is seen by 10 % of the pixels; "
    "{0}-moving30: 30 % of the triangles move"
)


def experiments() -> list[dict[str, Any]]:
    """Every experiment with its presets."""
    from ..runner.planning.experiment import experiment_names, find_experiment

    rows = []
    for name in experiment_names():
        declared = find_experiment(name)
        presets = {key: sizes(preset) for key, preset in declared.presets.items()}
        rows.append({"name": name, "title": declared.title, "presets": presets})
    return rows


def sizes(preset: Preset) -> str:
    """The size of a preset's images, as "1024x1024"; of several the least and the largest."""
    known = sorted({(part.width, part.height) for part in preset.parts()})
    return " to ".join(f"{width}x{height}" for width, height in dict.fromkeys((known[0], known[-1])))


def as_text(rows: list[dict[str, Any]], columns: int | None = None) -> str:
    """Rows as text, in lines of at most ``columns`` (default: the terminal's width), details indented."""
    columns = columns or max(40, shutil.get_terminal_size().columns)
    width = max((len(row["name"]) for row in rows), default=0) + 2
    lines = []

    def add(text: str, first: str = "", rest: str = "") -> None:
        lines.extend(
            textwrap.wrap(
                visible(text),
                columns,
                initial_indent=first,
                subsequent_indent=rest or first,
                break_on_hyphens=False,
            )
        )

    for row in rows:
        devices = f" [{', '.join(row['devices'])}]" if row.get("devices") else ""
        add(row["title"] + devices, f"{row['name']:{width}}", " " * width)
        if row.get("about"):
            add(row["about"], " " * width)
        if row.get("presets"):
            add(", ".join(f"{key}: {value}" for key, value in row["presets"].items()), " " * width)
        for name, one in row.get("cameras", {}).items():
            add(f"camera {name!r}: {camera_text(one)}", "  ", " " * 8)
        for name, one in row.get("lights", {}).items():
            add(f"light {name!r}: {light_text(one)}", "  ", " " * 8)
        for known in row.get("parameters", {}).values():
            rule = f" ({known['allowed']})" if known["allowed"] else ""
            add(f"{known['name']} = {known['default']}{rule}", "  ", " " * 8)
            add(known["meaning"], " " * 6)
    return "\n".join(lines)
