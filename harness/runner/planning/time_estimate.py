"""A rough estimate of the work of a scene, for the order of the scenes and the remaining time."""

import re
import time
from collections.abc import Callable, Iterable
from pathlib import Path

from ...scene.names import ANIMATED, TRIANGLES
from ...scene.standins import balls
from .experiment import Preset

PIXEL = 1.75  # cost of a pixel relative to a triangle, roughly, for the methods of Table 1 on a CPU
BYTES = 50  # bytes of a mesh file per triangle, roughly
UNKNOWN = 100_000  # assumed number of triangles if the name does not tell: a declared scene, a folder of frames

# All that follows are rough seconds, measured on two cores and an H200.

OVERHEAD = 2.0  # the total time of a point over that of its samples: loading, warming up, checking the answers
ONCE_S = 1.0  # of a point whatever its size: it is prepared, and its answers are written and read
SCENE_S = 2.0  # of a scene with one lighting, shared by its points: it is made, and its reference computed
CPU_S = 7.5e-7  # of one frame per unit of work on two CPU cores; a median over methods

REFERENCE_S = 8.0
"""Of the reference per frame and 2^20 pixels on the host of a GPU. It is computed once for all methods of a scene
with one lighting, so it is most of the time of an experiment with a single method.
"""

ANSWERS_S = 1.0  # per point, frame and 2^20 pixels of a run on a GPU: answers are copied, written, read and compared
ROUND_S = 0.1  # of the samples of a point per frame and round on a GPU; they do not depend on the scene
COSTS = 2.2  # for each second that a preset asks for its costs: idle, replayed, alone and together in flight


def expected_triangles(scene: str) -> int:
    """Triangles of a scene, given as on the command line; of a file as a PLY's header says, else as its size tells."""
    path = Path(scene)
    triangles = TRIANGLES.get(scene) or balls.count_of(scene)
    if triangles is not None:
        return triangles
    if path.suffix == ".toml" or not path.is_file():
        return UNKNOWN
    with path.open("rb") as stream:
        told = re.search(rb"^ply\b.*?^element face (\d{1,9})\s", stream.read(4096), re.DOTALL | re.MULTILINE)
    return int(told[1]) if told else path.stat().st_size // BYTES


def frames_of(scene: str, preset: Preset) -> int:
    return preset.frames if scene in ANIMATED else 1


def expected_work(scene: str, preset: Preset) -> float:
    """The work of one method on a scene with one lighting, in triangles. ``scene`` as on the command line."""
    pixels = preset.width * preset.height
    return frames_of(scene, preset) * preset.rounds * (expected_triangles(scene) + PIXEL * pixels)


def guess(scene: str, preset: Preset, lights: int, device: str, rate: float | None = None) -> float:
    """Seconds of one point with its part of what the points of a scene share, from sizes.

    Right within a factor of two for the quick presets of the experiments on two cores, and for most paper presets on a
    GPU. ``lights``: how many lights or targets replace the scene's own; 0: none. ``rate``: measured seconds of samples per
    unit of work.
    """
    frames, work = frames_of(scene, preset), expected_work(scene, preset)
    more = (1 + max(1, lights)) / 2
    if device.startswith("cuda"):
        pixels = more * frames * preset.width * preset.height / 2**20
        shared = SCENE_S + REFERENCE_S * pixels
        sampling = (ROUND_S + COSTS * preset.costs_s) * frames * preset.rounds if rate is None else rate * work
        own = ANSWERS_S * pixels + min(sampling, preset.budget_s)
    else:
        runs = 1 + preset.samples + preset.stage_samples + 1
        shared, seconds = SCENE_S, CPU_S * runs * work * more if rate is None else OVERHEAD * rate * work
        own = min(seconds, OVERHEAD * preset.budget_s)
    return ONCE_S + shared / max(1, len(preset.methods)) + own


def guess_of_scene(scene: str, preset: Preset, device: str) -> float:
    """Seconds of all points of a scene: of every method with every lighting."""
    return sum(len(preset.methods) * guess(scene, preset, one.targets, device) for one in preset.lightings)


def points_of(preset: Preset) -> int:
    """Points of a preset, without the presets that follow it."""
    return len(preset.scenes) * len(preset.lightings) * len(preset.methods)


def steps_of(preset: Preset) -> int:
    """Steps of a point: it is prepared, measured in rounds, and judged."""
    return preset.rounds + 2


class Estimate:
    """Estimates the time of the scenes to come: what :func:`guess` says of them, by how much longer or shorter those already
    measured took than it says.

    to_do  the guesses of the scenes to be measured, seconds each, in any order
    clock  seconds, in which waiting for other runs does not count
    once   seconds of the scene under way that are spent once for all: starting processes, compiling; they do not count
    """

    def __init__(self, guesses: Iterable[float], clock: Callable[[], float] = time.monotonic):
        self.to_do, self.clock, self.once = list(guesses), clock, 0.0
        self._guessed = self._took = 0.0

    def begin(self, guessed: float, points: int) -> None:
        """``points``: how many the scene has."""
        self.to_do.remove(guessed)
        self._each, self._began, self.once = guessed / points, self.clock(), 0.0

    def spent(self) -> float:
        """Seconds that the scene under way has taken."""
        seconds = self.clock() - self._began
        return max(seconds - self.once, 0.1 * seconds)

    def finish(self, measured: int) -> None:
        """``measured`` points of the scene under way were measured; its others had their records."""
        if measured:
            self._guessed, self._took = self._guessed + measured * self._each, self._took + self.spent()

    def left(self) -> float | None:
        """Seconds of the scenes to be measured, or None before anything was measured."""
        return sum(self.to_do) * self._took / self._guessed if self._guessed else None

    def left_within(self, measured: int, rest: float) -> float:
        """Seconds, while ``measured`` points of the scene under way are measured, expected to take ``rest`` more."""
        took, guessed = self._took + self.spent() + rest, self._guessed + measured * self._each
        return rest + sum(self.to_do) * took / guessed
