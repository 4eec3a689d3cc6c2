"""``shadowbench list``: the methods, scenes and experiments; of those that are named also what belongs to each."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import UserError, did_you_mean
from ..files import plain
from ..frame import registry
from ..report.terminal import plain_console, tell
from ..texts import numbered, visible
from .options import command, view_of

if TYPE_CHECKING:  # each kind imports what it needs
    from ..runner.planning.experiment import Preset
    from ..scene.chosen_view import ChosenView
    from ..scene.scene import Scene

Row = dict[str, Any]
KINDS = ("methods", "scenes", "experiments")


@command(
    """
    List methods, scenes or experiments.
    shadowbench list methods bvh2

    kind  What to list: methods, scenes or experiments.
    NAME  Methods: their parameters. Experiments: their presets. Scenes or mesh files: what they hold, their cameras and
          lights.
    """
)
def list_(
    kind: str, name: list[str] | None = None, rate: float | None = None, allow_missing: bool = False,
    scene_dir: Path | None = None, as_json: bool = False,
) -> int:  # fmt: skip
    """List the methods, scenes or experiments; of a method its parameters; of an experiment its presets; of a file its
    triangles and frames, its cameras and its lights.
    """
    rows = rows_of(kind, name or [], lambda: view_of(rate=rate, allow_missing=allow_missing), scene_dir, not as_json)
    tell(rows, as_json, show)
    return 0


def rows_of(
    kind: str, names: list[str], seen: Callable[[], ChosenView], scene_dir: Path | None, brief: bool
) -> list[Row]:
    """The rows of ``list KIND NAME ...``. ``brief``: methods and experiments that are not named have a sentence each.

    Raises :class:`UserError` for an unknown kind or name.
    """
    if kind not in KINDS:
        raise UserError(f"list {kind!r}: unknown kind{did_you_mean(kind, KINDS)}")
    if kind == "scenes":
        return [contents(name, seen(), scene_dir) for name in names] if names else scenes()
    if kind == "methods":
        return _each(names, registry.method_names(), registry.about if brief and not names else method)
    from ..runner.planning.experiment import about, experiment_names

    return _each(names, experiment_names(), about if brief and not names else experiment)


def _each(names: list[str], known: Sequence[str], facts: Callable[[str], str | Row]) -> list[Row]:
    """A row for each name, or for all that are known: then one that is broken does not hide the others."""
    rows = []
    for name in names or known:
        try:
            found = facts(name)
        except (Exception, SystemExit) as error:
            if names:
                raise
            found = f"cannot be used: {error}"
        rows.append({"name": name, **({"title": found} if isinstance(found, str) else found)})
    return rows


def method(name: str) -> Row:
    """A method with its devices and its parameters: default, meaning and allowed values."""
    cls = registry.method_class(name)
    parameters = {one.name: dataclasses.asdict(one) for one in registry.parameters(cls)}
    return {
        "title": cls.title, "about": registry.about(name), "devices": list(cls.devices), "parameters": parameters,
    }  # fmt: skip


def experiment(name: str) -> Row:
    from ..runner.planning.experiment import about, find_experiment

    declared = find_experiment(name)
    presets = {key: sizes(preset) for key, preset in declared.presets.items()}
    return {"title": declared.title, "about": about(name), "presets": presets}


def sizes(preset: Preset) -> str:
    """The size of a preset's images, as "1024x1024"; of several the least and the largest."""
    known = sorted({(part.width, part.height) for part in preset.parts()})
    return " to ".join(f"{width}x{height}" for width, height in dict.fromkeys((known[0], known[-1])))


def scenes() -> list[Row]:
    """The scenes of the catalogue and the family of balls; for a stand-in also what it replaces.

    A mesh file can be given instead of a name. ``triangles``: None where it is not known.
    """
    from ..scene.catalogue import BUNNY_NOTES, bunny_file, original, resolve
    from ..scene.facts import triangles
    from ..scene.names import BUNNY, TITLES, TRIANGLES, scene_names
    from ..scene.standins import balls

    rows: list[Row] = []
    for name in scene_names():
        row: Row = {"name": name, "title": TITLES[name], "stand_in": None, "about": "", "triangles": None}
        try:  # what comes with the project is not made, or read, to be counted
            if name == BUNNY and not original(name):
                bunny_file()
                row |= {"about": BUNNY_NOTES, "triangles": TRIANGLES[name]}
            else:
                found = resolve(name)
                count = TRIANGLES[name] if found.stand_in else len(found.geometry().faces)
                row |= {"stand_in": found.stand_in, "about": told(found), "triangles": count}
            row["title"] = f"{TITLES[name]}: {triangles(row['triangles'])}"
        except UserError as error:  # one broken original or a missing package must not hide the others
            row["title"] = f"{TITLES[name]}: {error}"
        rows.append(row)
    family = {"name": "balls-N", "title": "Balls over ground: about N triangles", "stand_in": None, "triangles": None}
    return [*rows, family | {"about": BALLS.format(balls.EXAMPLE)}]


def told(scene: Scene) -> str:
    """What a scene is, and what of its file was left out or approximated."""
    return "; ".join(filter(None, (scene.stand_in or scene.notes, scene.source.left_out)))


def contents(name: str, seen: ChosenView, scene_dir: Path | None) -> Row:
    """A scene or file: its triangles and frames, and the cameras and lights that it offers."""
    from ..scene.facts import light_facts, triangles

    found = seen.resolved(name, scene_dir)
    geometry = found.geometry()
    frames, rate = geometry.frame_count, f" at {found.rate:g} a second" if found.rate else ""
    moves = f", {frames} frames{rate}" if frames > 1 else ""
    return {
        "name": found.name, "title": f"{found.title}: {triangles(len(geometry.faces))}{moves}",
        "stand_in": found.stand_in, "about": told(found), "triangles": len(geometry.faces), "frames": frames,
        "rate": found.rate, "cameras": {key: plain(dataclasses.asdict(one)) for key, one in found.cameras.items()},
        "lights": {key: light_facts(one) for key, one in found.lamps.items()},
    }  # fmt: skip


def camera_text(camera: Row) -> str:
    wide = f"{camera['fov']:g} degrees"
    shows = wide if camera["height"] is None else f"orthographic, {camera['height']:g} high"
    return f"from {place_text(camera['eye'])} to {place_text(camera['target'])}, {shows}"


def light_text(light: Row) -> str:
    kind = "directional, from" if light["directional"] else "spot at" if light["spot"] else "at"
    return f"{kind} {place_text(light['position'])}{area_text(light)}"


def area_text(light: Row) -> str:
    """Its area and its targets in words; "" for a point."""
    if not light.get("shape"):
        return ""
    size = light["size"]
    across = f"{size:g}" if isinstance(size, int | float) else " x ".join(f"{side:g}" for side in size)
    return f", {light['shape']} of {across} with {numbered(light['samples'], 'target')}"


def place_text(place: Sequence[float], exact: bool = False) -> str:
    """A place as options take it, with six digits, or with as many as give the same number again."""
    return ",".join(repr(float(x)).removesuffix(".0") if exact else f"{x:.6g}" for x in place)


BALLS = (
    "procedural, with about N triangles, such as {0} or balls-2m; {0}-seen10: the ground is seen by 10 % of the pixels; "
    "{0}-moving30: 30 % of the triangles move; {0}-swirl50: all is deformed, its middle turns by half a turn"
)


def show(rows: list[Row]) -> None:
    """Print rows as a table as wide as the terminal, with what belongs to each below it."""
    from rich.padding import Padding
    from rich.table import Table
    from rich.text import Text

    console = plain_console()
    width = max((len(row["name"]) for row in rows), default=0)
    for row in rows:
        devices = f" [{', '.join(row['devices'])}]" if row.get("devices") else ""
        presets = ", ".join(f"{key}: {value}" for key, value in row.get("presets", {}).items())
        words = filter(None, (row["title"] + devices, row.get("about"), presets))
        table = Table.grid(padding=(0, 2))
        table.add_column(width=width)
        table.add_column(overflow="fold")  # an address is told whole
        table.add_row(Text(visible(row["name"])), Text("\n".join(map(visible, words))))
        console.print(table)
        details = [f"camera {name!r}: {camera_text(one)}" for name, one in row.get("cameras", {}).items()]
        details += [f"light {name!r}: {light_text(one)}" for name, one in row.get("lights", {}).items()]
        for known in row.get("parameters", {}).values():
            rule = f" ({known['allowed']})" if known["allowed"] else ""
            details.append(f"{known['name']} = {known['default']}{rule}\n    {known['meaning']}")
        for text in details:
            console.print(Padding(Text("\n".join(map(visible, text.split("\n")))), (0, 0, 0, 2), expand=False))
