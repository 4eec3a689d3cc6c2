"""``shadowbench list``: what there is to name on the command line."""

from __future__ import annotations

import dataclasses
import typing
from typing import Any

from ..errors import UserError, did_you_mean
from ..frame.registry import method_class, method_names
from ..runner.experiment import experiment_names, find_experiment
from ..scene.catalogue import TITLES, resolve, scene_names

KINDS = ("methods", "scenes", "experiments")


def listing(kind: str) -> list[dict[str, Any]]:
    """Rows of one kind. Raises :class:`UserError` for an unknown one."""
    if kind not in KINDS:
        raise UserError(f"list {kind!r}: there is nothing of that kind{did_you_mean(kind, KINDS)}")
    return {"methods": methods, "scenes": scenes, "experiments": experiments}[kind]()


def methods() -> list[dict[str, Any]]:
    """Every method with its devices and its parameters and their defaults."""
    rows = []
    for name in method_names():
        try:
            cls = method_class(name)
        except Exception as error:  # a broken package of someone else's must not hide the others
            rows.append({"name": name, "title": f"cannot be used: {error}", "devices": [], "parameters": {}})
            continue
        blocks = (cls.Build(), cls.Trace())
        parameters = {f.name: getattr(block, f.name) for block in blocks for f in dataclasses.fields(block)}
        rows.append(
            {"name": name, "title": cls.title, "devices": list(cls.devices), "parameters": parameters}
        )
    return rows


def scenes() -> list[dict[str, Any]]:
    """The catalogue, and what a stand-in stands in for. Files can be given instead of a name."""
    rows = []
    for name in scene_names():
        try:
            found = resolve(name)
            rows.append({"name": name, "title": TITLES[name], "stand_in": found.stand_in})
        except (
            UserError
        ) as error:  # a broken original, or a package that is missing, must not hide the others
            rows.append({"name": name, "title": f"{TITLES[name]}: {error}", "stand_in": None})
    return rows


def experiments() -> list[dict[str, Any]]:
    """Every experiment with its presets."""
    rows = []
    for name in experiment_names():
        declared = find_experiment(name)
        presets = {key: f"{preset.width}x{preset.height}" for key, preset in declared.presets.items()}
        rows.append({"name": name, "title": declared.title, "presets": presets})
    return rows


def as_text(rows: list[dict[str, Any]]) -> str:
    """Rows for a person: one line each, parameters and presets beneath."""
    lines = []
    width = max((len(row["name"]) for row in rows), default=0)
    for row in rows:
        devices = f"  [{', '.join(row['devices'])}]" if row.get("devices") else ""
        lines.append(f"{row['name']:{width}}  {row['title']}{devices}")
        if row.get("stand_in"):
            lines.append(f"{'':{width}}    {row['stand_in']}")
        details: typing.Mapping[str, Any] = row.get("parameters") or row.get("presets") or {}
        lines += [f"{'':{width}}    {key} = {value}" for key, value in details.items()]
    return "\n".join(lines)
