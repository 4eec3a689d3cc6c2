"""Experiments and their presets. A point is one method with its settings on one scene at one image size on one device.
Its key is a readable prefix and a hash of the whole configuration, so that every change that would invalidate a record
gives another key.
"""

from __future__ import annotations

import ast
import dataclasses
import importlib
import importlib.util
import pkgutil
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import UserError, did_you_mean
from ...frame import registry
from ...scene.overrides import Lighting

if TYPE_CHECKING:  # experiments are listed without what reads records
    from ...results.record import Record

PACKAGE = __name__.rsplit(".", 4)[0] + ".experiments"

MOST_PIXELS = 2**31 - 1  # largest number of pixels of an image: pixel indices are int32


@dataclass(frozen=True)
class Entry:
    """A method in an experiment. ``settings`` are texts as in ``--set``; ``label`` is the title of its column."""

    method: str
    settings: Mapping[str, str] = field(default_factory=dict)
    label: str = ""


@dataclass(frozen=True)
class Preset:
    """One size of an experiment.

    frames         number of frames of an animated scene, evenly spaced from the first to the last; 1: the middle frame
    samples        minimum number of whole-frame samples per frame and round; ``most``: the maximum (see
                   :class:`.runner.measuring.timing.Sampling`)
    rounds         number of times that every point is measured, interleaved with the others in balanced random order
    budget_s       time limit for the samples of a point, over all frames and rounds, seconds
    timeout_s      seconds without a reply after which a worker is stopped
    lightings      lights that replace those of each scene: every method runs on every scene with each of them
    memory         memory limit of a method's structures, bytes, if the command line gives none
    maps           save a map of the cost of each pixel (tests of its primary ray) in the last frame of each point
    wrong_maps     save a map of the classes of wrong pixels in the last frame of each point, and its FLIP difference
    costs_s        seconds of further replays in which the energy of a frame is measured, in each round; then two frames in
                   flight are timed too, and tests of rays are counted. 0: none of it
    also           presets that are run after this one into the same folder: other sizes, scenes, lights
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
    costs_s: float = 0.0
    also: tuple[Preset, ...] = ()

    def parts(self) -> tuple[Preset, ...]:
        """This preset, then those of ``also``."""
        return (dataclasses.replace(self, also=()), *self.also)


@dataclass(frozen=True)
class Experiment:
    """A named experiment: its presets, and a function that draws its results from a folder.

    ``after``: a function for additional untimed work, called with the options of the run and the progress report when every
    point has its record; ``after_s``: its seconds on a CPU, roughly, from the options.
    ``extras``: names of more such work, each with what it is: it is done where ``run --with NAME`` asks for it.
    ``measure``: a function for measurements that are not a method on a scene; it is called with the options and the
    progress report, and returns its records.
    """

    name: str
    title: str
    presets: Mapping[str, Preset]
    draw: Callable[[Path], Any] | None = None
    after: Callable[[Any, Any], None] | None = None
    after_s: Callable[[Any], float] | None = None
    extras: Mapping[str, str] = field(default_factory=dict)
    measure: Callable[[Any, Any], list[Record]] | None = None


def experiment_names() -> list[str]:
    """The names of all experiments: the modules of the experiments package."""
    package = importlib.import_module(PACKAGE)
    names = [module.name for module in pkgutil.iter_modules(package.__path__)]
    return sorted(name for name in names if not name.startswith("_"))


def about(name: str) -> str:
    """What an experiment shows: the first sentence of its module, which is not imported for it."""
    if name not in experiment_names():
        find_experiment(name)
    found = importlib.util.find_spec(f"{PACKAGE}.{name}")
    source = Path(found.origin).read_text(encoding="utf-8") if found and found.origin else ""
    return registry.first_sentence(ast.get_docstring(ast.parse(source)) or name)


def find_experiment(name: str) -> Experiment:
    """The declaration of an experiment. Raises :class:`UserError` for an unknown name."""
    if name not in experiment_names():
        raise UserError(f"no experiment {name!r}{did_you_mean(name, experiment_names())}")
    return importlib.import_module(f"{PACKAGE}.{name}").EXPERIMENT


def find_preset(experiment: Experiment, name: str | None, device: str) -> tuple[str, Preset]:
    """A preset by name; by default "paper" for a GPU, "quick" for a CPU."""
    if not experiment.presets:
        raise UserError(
            f"{experiment.name} measures nothing; run other experiments, then `shadowbench show {experiment.name} DIR`"
        )
    default = "paper" if device.startswith("cuda") else "quick"
    chosen = default if name is None else name
    if chosen not in experiment.presets:
        raise UserError(f"{experiment.name} has no preset {chosen!r}{did_you_mean(chosen, experiment.presets)}")
    return chosen, experiment.presets[chosen]


def choose_methods(entries: tuple[Entry, ...], names: list[str] | None) -> tuple[Entry, ...]:
    """The entries of the given methods; a method that the experiment does not have is added with default settings."""
    if not names:
        return entries
    chosen: list[Entry] = []
    for name in dict.fromkeys(names):
        if name not in registry.method_names():
            raise UserError(f"no method {name!r}{did_you_mean(name, registry.method_names())}")
        chosen += [entry for entry in entries if entry.method == name] or [Entry(name)]
    return tuple(chosen)


def parse_size(text: str) -> tuple[int, int]:
    """Width and height from text such as ``256x256``. Raises :class:`UserError` for more than 2^31 - 1 pixels."""
    match = re.fullmatch(r"([1-9]\d*)x([1-9]\d*)", text)
    if not match:
        raise UserError(f"--size {text!r}: write it as WIDTHxHEIGHT, such as 256x256")
    if max(map(len, match.groups())) > 5:  # records have no larger ones
        raise UserError(f"--size {text}: a side has at most 99,999 pixels; give fewer")
    width, height = int(match[1]), int(match[2])
    if width * height > MOST_PIXELS:
        raise UserError(
            f"--size {text}: {width * height:,} pixels are more than the {MOST_PIXELS:,} that can be indexed; give fewer"
        )
    return width, height
