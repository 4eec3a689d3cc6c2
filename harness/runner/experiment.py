"""What to run: an experiment's declaration, the points that follow from it, and the keys of their records.

A point is one method with its settings on one scene at one size on one device. Its key is a readable prefix and a
hash of the whole configuration, so that whatever would invalidate a record gives another key.
"""

from __future__ import annotations

import dataclasses
import importlib
import pkgutil
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import UserError, did_you_mean
from ..frame import registry
from ..results.record import Record
from ..scene.overrides import Lighting

PACKAGE = __name__.rsplit(".", 3)[0] + ".experiments"

MOST_PIXELS = 2**31 - 1
"""Pixels of an image at most: they are counted with int32."""


@dataclass(frozen=True)
class Entry:
    """A method in an experiment. ``settings`` are texts as ``--set`` gives them; ``label`` heads its column."""

    method: str
    settings: Mapping[str, str] = field(default_factory=dict)
    label: str = ""


@dataclass(frozen=True)
class Preset:
    """One size of an experiment.

    frames         frames of an animated scene, spread evenly from its first to its last, or its middle one; a static
                   scene has one
    samples        whole-frame samples a frame and round at least, ``most`` at most (see :class:`.runner.timing.Sampling`)
    rounds         how often every point is measured anew, interleaved with the others in balanced random order
    budget_s       seconds a point may spend on samples, over all its frames and rounds
    timeout_s      seconds after which a silent worker is given up
    lightings      lights to put in place of each scene's own: every method on every scene under each of them
    memory         bytes a method may take for its structures, where the call does not say
    maps           keep what each pixel cost (tests of its primary ray) as a map of each point's last frame
    wrong_maps     keep where each point's last frame is wrong, as a map of classes, and how it looks (FLIP)
    also           presets that are run after this one, into the same folder: other sizes, scenes, lights
    """

    width: int
    height: int
    scenes: tuple[str, ...]
    methods: tuple[Entry, ...]
    frames: int = 3
    samples: int = 5
    most: int = 5
    deviation: float | None = None
    stage_samples: int = 2
    rounds: int = 2
    budget_s: float = 60.0
    timeout_s: float = 300.0
    lightings: tuple[Lighting, ...] = (Lighting(),)
    maps: bool = False
    memory: int | None = None
    wrong_maps: bool = False
    also: tuple[Preset, ...] = ()

    def parts(self) -> tuple[Preset, ...]:
        """This preset alone, and those that come after it."""
        return (dataclasses.replace(self, also=()), *self.also)


@dataclass(frozen=True)
class Experiment:
    """A named declaration: what to run (a preset a name) and how to draw it (from a results folder).

    ``after``: untimed work of its own, told the options of the run once every point has its record. ``measure``: what it
    measures where that is no method on a scene; told the options and whom to report to, it returns its records.
    """

    name: str
    title: str
    presets: Mapping[str, Preset]
    draw: Callable[[Path], Any] | None = None
    after: Callable[[Any], None] | None = None
    measure: Callable[[Any, Any], list[Record]] | None = None
    cpu: str = "quick"
    gpu: str = "paper"


def experiment_names() -> list[str]:
    """Every experiment that can be run: the modules of the experiments package."""
    package = importlib.import_module(PACKAGE)
    names = [module.name for module in pkgutil.iter_modules(package.__path__)]
    return sorted(name for name in names if not name.startswith("_"))


def find_experiment(name: str) -> Experiment:
    """The declaration of an experiment. Raises :class:`UserError` for an unknown name."""
    if name not in experiment_names():
        raise UserError(f"no experiment {name!r}{did_you_mean(name, experiment_names())}")
    return importlib.import_module(f"{PACKAGE}.{name}").EXPERIMENT


def find_preset(experiment: Experiment, name: str | None, device: str) -> tuple[str, Preset]:
    """A preset by name; by default the one declared for the kind of device."""
    if not experiment.presets:
        raise UserError(
            f"{experiment.name} measures nothing; run the others, then `shadowbench show {experiment.name} DIR`"
        )
    chosen = name or (experiment.gpu if device.startswith("cuda") else experiment.cpu)
    if chosen not in experiment.presets:
        raise UserError(
            f"{experiment.name} has no preset {chosen!r}{did_you_mean(chosen, experiment.presets)}"
        )
    return chosen, experiment.presets[chosen]


def choose_methods(entries: tuple[Entry, ...], names: list[str] | None) -> tuple[Entry, ...]:
    """The entries of the methods named; a method that the experiment does not declare is added with its defaults."""
    if not names:
        return entries
    chosen: list[Entry] = []
    for name in dict.fromkeys(names):
        if name not in registry.method_names():
            raise UserError(f"no method {name!r}{did_you_mean(name, registry.method_names())}")
        chosen += [entry for entry in entries if entry.method == name] or [Entry(name)]
    return tuple(chosen)


def parse_size(text: str) -> tuple[int, int]:
    """Width and height of ``256x256``. Raises :class:`UserError` for more pixels than an int32 can count."""
    match = re.fullmatch(r"([1-9]\d{0,4})x([1-9]\d{0,4})", text)
    if not match:
        raise UserError(f"--size {text!r}: write it as WIDTHxHEIGHT, each 1 to 99999, such as 256x256")
    width, height = int(match[1]), int(match[2])
    if width * height > MOST_PIXELS:
        raise UserError(
            f"--size {text}: {width * height:,} pixels are more than the {MOST_PIXELS:,} that can be indexed; give fewer"
        )
    return width, height
