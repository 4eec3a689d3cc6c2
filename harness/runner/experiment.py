"""What to run: an experiment's declaration, the points that follow from it, and the keys of their records.

A point is one method with its settings on one scene at one size on one device. Its key is a readable prefix and a
hash of the whole configuration, so that whatever would invalidate a record gives another key.
"""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import inspect
import pkgutil
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from ..errors import UserError, did_you_mean
from ..frame import registry
from ..frame.method import Method
from ..frame.warp_init import start_warp
from ..results.record import SCHEMA, digest
from ..scene.overrides import Lighting

PACKAGE = __name__.rsplit(".", 3)[0] + ".experiments"
CONVENTIONS = (
    "frame/frame", "frame/method", "scene/prepared", "frame/passes", "frame/schedule", "frame/receivers", "frame/session",
    "frame/specialise", "judge/receivers", "runner/timing", "scene/light_paths", "scene/overrides", "scene/scene",
    "frame/vectors",
)  # fmt: skip
"""Modules of the harness that every measurement depends on; their text is hashed into a method's source hash."""

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
    measure: Callable[[Any, Any], list[dict[str, Any]]] | None = None
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


def find_device(name: str | None) -> str:
    """The device to run on: ``cuda:0`` where there is one, else ``cpu``, unless ``name`` says which."""
    start_warp()
    if name is None:
        return "cuda:0" if wp.is_cuda_available() else "cpu"
    known = ["cpu", *(device.alias for device in wp.get_cuda_devices())]
    chosen = "cuda:0" if name == "cuda" else name
    if chosen not in known:
        raise UserError(
            f"no device {name!r} on this machine; there is {' and '.join(known)}: give --device {known[-1]}"
        )
    return chosen


def parse_settings(texts: list[str], entries: tuple[Entry, ...]) -> tuple[Entry, ...]:
    """Entries with ``method.param=value`` settings added to every entry of that method, each checked at once."""
    result = list(entries)
    for text in texts:
        match = re.fullmatch(r"([\w-]+)\.(\w+)=(.*)", text)
        if not match:
            raise UserError(f"--set {text!r}: write it as method.param=value")
        method, key, value = match.groups()
        if method not in {entry.method for entry in entries}:
            known = {entry.method for entry in entries}
            raise UserError(
                f"--set {text!r}: {method!r} is not among the methods run{did_you_mean(method, known)}"
            )
        result = [
            dataclasses.replace(e, settings={**e.settings, key: value}) if e.method == method else e
            for e in result
        ]
    return check_entries(tuple(result))


def check_entries(entries: tuple[Entry, ...]) -> tuple[Entry, ...]:
    """The same entries. Raises :class:`UserError` for an unknown method or parameter, or a value of a wrong type."""
    for entry in entries:
        describe_method(entry, "cpu")
    return entries


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


def spread_frames(frame_count: int, wanted: int) -> list[int]:
    """``wanted`` frames spread evenly from the first to the last; all of them where there are fewer; one: the middle.

    An animation's first frame is often its simplest, such as a cloth before it falls.
    """
    if wanted < 1:
        raise UserError(f"frames {wanted}: at least 1")
    count = min(wanted, frame_count)
    if count == 1:
        return [round((frame_count - 1) / 2)]
    return sorted({round(float(x)) for x in np.linspace(0, frame_count - 1, count)})


def device_for(cls: type[Method], device: str) -> str:
    """The device a method runs on: the one asked for where it can, else the CPU (the record says so)."""
    kind = device.split(":")[0]
    if kind not in cls.devices and "cpu" in cls.devices:
        return "cpu"
    return device


def device_title(device: str) -> str:
    """The name a person knows a device by."""
    if not device.startswith("cuda"):
        from .machine import cpu_model

        return cpu_model()
    return str(wp.get_device(device).name)


def source_hash(cls: type[Method]) -> str:
    """Sha256 of what a method's answers and times depend on: its package, the methods' common code, the contract."""
    module = inspect.getmodule(cls)
    file = Path(inspect.getfile(cls)).resolve()
    package = (module.__package__ if module else "") or ""
    # A class in a package takes the folder with it; one in a lone module takes that file.
    own = sorted(file.parent.rglob("*.py")) if package and (file.parent / "__init__.py").exists() else [file]
    common = importlib.import_module(f"{registry.PACKAGE}.common")
    shared = sorted(Path(str(common.__file__)).parent.rglob("*.py"))
    here = Path(__file__).parents[1]
    total = hashlib.sha256()
    for path in [*own, *shared, *(here / f"{name}.py" for name in CONVENTIONS)]:
        total.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return total.hexdigest()


def describe_method(entry: Entry, device: str) -> dict[str, Any]:
    """What a record says of a method before it runs. ``broken`` says why one cannot even be made."""
    facts: dict[str, Any] = {
        "name": entry.method,
        "title": entry.method,
        "label": entry.label or entry.method,
        "settings": dict(entry.settings),
        "parameters": {},
        "capturable": None,
        "device": device,
        "asked_device": device,
        "source_sha256": "",
    }
    try:
        method = registry.make_method(entry.method, dict(entry.settings))
        cls = type(method)
        place = device_for(cls, device)
        facts.update(
            title=cls.title or entry.method,
            label=entry.label or cls.title or entry.method,
            parameters={name: dataclasses.asdict(getattr(method, name)) for name in ("build", "trace")},
            capturable=bool(method.capturable),
            known_inexact=getattr(method, "known_inexact", None),
            device=place,
            source_sha256=source_hash(cls),
        )
    except UserError:
        raise
    except Exception as error:  # a stranger's package may fail in any way; it costs its own points only
        facts["broken"] = f"cannot be made: {type(error).__name__}: {' '.join(str(error).split())}"
    return {**facts, "device_name": device_title(facts["device"])}


@dataclass(frozen=True, eq=False)
class Point:
    """One planned measurement. ``configuration`` is everything its key is made of."""

    key: str
    entry: Entry
    scene: dict[str, Any]
    method: dict[str, Any]
    configuration: dict[str, Any]
    frames: tuple[int, ...]
    preset: Preset


def make_point(
    experiment: str, preset: Preset, entry: Entry, scene: dict[str, Any], method: dict[str, Any], seed: int
) -> Point:
    """The point of a method on a scene, whose facts a worker gave (see :func:`.scene.facts.scene_facts`)."""
    frames = tuple(scene.get("frames") or ())
    configuration = {
        "schema": SCHEMA,
        "experiment": experiment,
        "scene": scene["name"],
        "arrays_sha256": scene.get("arrays_sha256"),
        "moments_sha256": scene.get("moments_sha256"),
        "camera": scene.get("camera"),
        "lights": scene.get("lights"),
        "light_path": scene.get("light_path"),
        "effects": scene.get("effects"),
        "method": entry.method,
        "label": method["label"],
        "settings": method["settings"],
        "parameters": method["parameters"],
        "method_sha256": method["source_sha256"],
        "device": method["device"],
        "device_name": method["device_name"],
        "warp": wp.__version__,
        "width": preset.width,
        "height": preset.height,
        "frames": list(frames),
        "samples": preset.samples,
        "most": preset.most,
        "deviation": preset.deviation,
        "stage_samples": preset.stage_samples,
        "rounds": preset.rounds,
        "budget_s": preset.budget_s,
        "seed": seed,
        **{name: scene[name] for name in ("lighting", "surfaces_sha256") if scene.get(name)},
        **({"maps": True} if preset.maps else {}),
        **({"memory": preset.memory} if preset.memory else {}),
        **({"wrong_maps": True} if preset.wrong_maps else {}),
    }
    words = [scene["name"], (scene.get("lighting") or {}).get("label", ""), entry.method, entry.label]
    stem = "-".join(word for word in words if word)
    readable = re.sub(r"[^a-z0-9_.-]+", "-", stem.lower()).strip("-.")[:60]
    key = f"{readable}-{preset.width}x{preset.height}-{digest(configuration)[:16]}"
    return Point(key, entry, scene, method, configuration, frames, preset)


def orders(count: int, rounds: int, seed: int) -> list[list[int]]:
    """A random order of ``count`` points for each round, balanced: over rounds each stands in each place alike.

    Rows of a cyclic Latin square over a random first order, every second one reversed, so that neighbours change.
    """
    first = np.random.default_rng(seed).permutation(count).tolist()
    result = []
    for number in range(rounds):
        shift = (number // 2) % count if count else 0
        row = first[shift:] + first[:shift]
        result.append(row[::-1] if number % 2 else row)
    return result
