"""The method of a command that shows a scene and was given none."""

import importlib

from ..frame.devices import placed_method
from ..frame.registry import method_names
from ..runner.planning.experiment import PACKAGE, Entry
from ..runner.planning.planned_point import parse_settings
from ..scene.scene import Scene


def default_method(scene: Scene, device: str) -> str:
    """The first of the list of rivals; where it cannot trace the scene, the first method that can, else the former."""
    proposed: str = importlib.import_module(f"{PACKAGE}._rivals").OURS.method
    for name in (proposed, *method_names()):
        try:
            if placed_method(name, None, scene, device)[2] is None:
                return name
        except Exception:  # one broken method must not hide the others
            continue
    return proposed


def settings_by_method(texts: list[str]) -> dict[str, dict[str, str]]:
    """What ``--set METHOD.PARAM=VALUE`` gives to each method. Raises :class:`UserError` for an unknown one."""
    entries = parse_settings(texts, tuple(Entry(name) for name in method_names()))
    return {entry.method: dict(entry.settings) for entry in entries if entry.settings}
