"""A small cloth simulation: one square sheet, one turning ball, the ground, and the sheet's contact with itself.

Extended position-based dynamics with many small steps and one pass over the constraints per step (Macklin et al.,
"Small Steps in Physics Simulation", SCA 2019; compliance as in Macklin et al., "XPBD", MIG 2016). A run
repeats bit for bit on one machine. Vertices are moved by float64 addition, multiplication, division and square
root alone, in a fixed order, so other platforms should agree; that has not been tried.

Arrays of the sheet are component first, shape [3, n, n], so that a batch of constraints is a slice.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...arrays import F64, I64


@dataclass(frozen=True)
class ClothSettings:
    """The experiment. Lengths in metres, times in seconds.

    cells            cells along one side of the sheet that is simulated
    side             length of one side of the sheet
    height           height at which the sheet starts, flat and at rest
    offset           where the middle of the sheet starts in x and z, beside the ball's axis
    ball_radius      the ball stands on the ground, centred on the vertical axis
    spin             angular speed of the ball about the vertical axis [rad/s], from ``spin_start`` on
    thickness        least distance kept between two vertices that are not neighbours, in cell sizes
    gap              distance kept from ball and ground
    steps_per_second simulation steps
    search_every     steps between two searches for vertices near each other
    seed             of the unevenness of the sheet at the start, which decides where it folds
    """

    cells: int = 71
    side: float = 2.0
    height: float = 0.82
    offset: tuple[float, float] = (0.04, -0.03)
    ball_radius: float = 0.36
    spin: float = 3.2
    spin_start: float = 0.7
    spin_ramp: float = 0.4
    thickness: float = 0.85
    gap: float = 0.012
    ball_friction: float = 0.6
    ground_friction: float = 0.3
    self_friction: float = 0.25
    shear_compliance: float = 2e-6
    bend_compliance: float = 4e-3
    damping: float = 0.8
    gravity: float = 9.81
    steps_per_second: int = 500
    search_every: int = 6
    seed: int = 1

    def ball_angle(self, time: float) -> float:
        """Angle the ball has turned through at ``time`` [rad]: rest, then an even start, then ``spin``."""
        since = max(time - self.spin_start, 0.0)
        if since < self.spin_ramp:
            return 0.5 * self.spin * since * since / self.spin_ramp
        return self.spin * (since - 0.5 * self.spin_ramp)

    def ball_speed(self, time: float) -> float:
        """Angular speed of the ball at ``time`` [rad/s]."""
        return self.spin * min(max((time - self.spin_start) / self.spin_ramp, 0.0), 1.0)


def simulate(settings: ClothSettings, frame_count: int, frame_time: float) -> F64:
    """Positions of the sheet, shape [frame_count, 3, cells + 1, cells + 1], ``frame_time`` seconds apart. Frame 0 is
    the flat sheet at rest."""
    sheet = _Sheet(settings)
    steps = round(frame_time * settings.steps_per_second)
    frames = [sheet.place.copy()]
    for _ in range(frame_count - 1):
        for _ in range(steps):
            sheet.step()
        frames.append(sheet.place.copy())
    return np.stack(frames)


class _Sheet:
    """The state of a run: ``place`` and ``speed``, shape [3, n, n]."""

    def __init__(self, settings: ClothSettings):
        self.settings = settings
        count = settings.cells + 1
        line = (np.arange(count) / settings.cells - 0.5) * settings.side
        self.place = np.empty((3, count, count))
        self.place[0] = line[:, None] + settings.offset[0]
        self.place[1] = settings.height
        self.place[2] = line[None, :] + settings.offset[1]
        rng = np.random.default_rng(settings.seed)
        self.place[1] += (rng.random((count, count)) - 0.5) * 0.0006
        self.speed = np.zeros_like(self.place)
        self.cell = settings.side / settings.cells
        self.time = 0.0
        self.step_index = 0
        self.batches = list(_batches(settings, count))
        self.pairs: I64 = np.empty((0, 2), dtype=np.int64)

    def step(self) -> None:
        """One small step: forces, one pass over the constraints, contacts, then speeds from the change of place."""
        settings, h = self.settings, 1.0 / self.settings.steps_per_second
        before = self.place.copy()
        self.speed[1] -= settings.gravity * h
        self.speed *= 1.0 - settings.damping * h
        self.place += self.speed * h
        for first, second, rest, softness in self.batches:
            _pull(self.place, first, second, rest, softness / (h * h))
        if self.step_index % settings.search_every == 0:
            self.pairs = self._near_pairs()
        self._keep_apart(before)
        self._ball_contact(before, h)
        self._ground_contact(before)
        self.speed = (self.place - before) / h
        self.time += h
        self.step_index += 1

    def _near_pairs(self) -> I64:
        """Pairs of vertices that may touch before the next search, shape [pair_count, 2], in a fixed order."""
        from scipy.spatial import cKDTree  # here: a scene is listed without it

        count = self.place.shape[1]
        points = self.place.reshape(3, -1).T
        pairs = cKDTree(points).query_pairs(1.5 * self.settings.thickness * self.cell, output_type="ndarray")
        row, column = pairs // count, pairs % count
        apart = np.maximum(np.abs(row[:, 0] - row[:, 1]), np.abs(column[:, 0] - column[:, 1])) > 1
        pairs = pairs[apart]
        return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]

    def _keep_apart(self, before: F64) -> None:
        """Push vertices of the near pairs apart to the thickness, and drag them along with each other."""
        if not len(self.pairs):
            return
        flat, old = self.place.reshape(3, -1), before.reshape(3, -1)
        first, second = self.pairs[:, 0], self.pairs[:, 1]
        between = flat[:, first] - flat[:, second]
        distance = _length(between)
        depth = self.settings.thickness * self.cell - distance
        touching = depth > 0
        if not touching.any():
            return
        first, second, between = first[touching], second[touching], between[:, touching]
        distance, depth = np.maximum(distance[touching], 1e-9), depth[touching]
        normal = between / distance
        push = normal * (0.5 * depth)
        slide = between - (old[:, first] - old[:, second])
        slide -= normal * _dot(slide, normal)
        push -= _limited(slide, self.settings.self_friction * depth) * 0.5
        size = flat.shape[1]
        share = np.maximum(np.bincount(first, minlength=size) + np.bincount(second, minlength=size), 1)
        for axis in range(3):
            moved = np.bincount(first, push[axis], size) - np.bincount(second, push[axis], size)
            # Averaged, not summed: a vertex in a pile is pushed by many others at once. 1.5 makes up for the delay.
            flat[axis] += 1.5 * moved / share

    def _ball_contact(self, before: F64, h: float) -> None:
        """Keep the sheet outside the ball; the turning surface drags it along by Coulomb friction."""
        settings = self.settings
        limit = settings.ball_radius + settings.gap
        arm = self.place.copy()
        arm[1] -= settings.ball_radius
        distance = _length(arm)
        depth = np.maximum(limit - distance, 0.0)
        normal = arm / np.maximum(distance, 1e-9)
        self.place += normal * depth
        turn = settings.ball_speed(self.time) * h
        slide = self.place - before
        slide[0] -= turn * self.place[2]
        slide[2] += turn * self.place[0]
        slide -= normal * _dot(slide, normal)
        self.place -= _limited(slide, settings.ball_friction * depth * 4.0)

    def _ground_contact(self, before: F64) -> None:
        """Keep the sheet above the ground, with Coulomb friction."""
        settings = self.settings
        depth = np.maximum(settings.gap - self.place[1], 0.0)
        self.place[1] += depth
        slide = self.place - before
        slide[1] = 0.0
        self.place -= _limited(slide, settings.ground_friction * depth * 4.0)


Batch = tuple[tuple[slice, ...], tuple[slice, ...], float, float]


def _batches(settings: ClothSettings, count: int) -> Iterator[Batch]:
    """Distance constraints in batches that share no vertex: (first ends, second ends, rest length, compliance)."""
    cell = settings.side / settings.cells
    every = slice(None)
    for start in (0, 1):
        first, second = _ends(count, start, 2, 1)
        yield (every, first, every), (every, second, every), cell, 0.0
        yield (every, every, first), (every, every, second), cell, 0.0
        left, right = slice(0, count - 1), slice(1, count)
        diagonal = cell * np.sqrt(2.0)
        yield (every, first, left), (every, second, right), diagonal, settings.shear_compliance
        yield (every, first, right), (every, second, left), diagonal, settings.shear_compliance
    for start in range(4):
        first, second = _ends(count, start, 4, 2)
        yield (every, first, every), (every, second, every), 2 * cell, settings.bend_compliance
        yield (every, every, first), (every, every, second), 2 * cell, settings.bend_compliance


def _ends(count: int, start: int, step: int, reach: int) -> tuple[slice, slice]:
    """Indices start, start + step, ... that have a partner ``reach`` further, and those partners."""
    return slice(start, count - reach, step), slice(start + reach, count, step)


def _pull(place: F64, first: tuple, second: tuple, rest: float, softness: float) -> None:
    """Move both ends of each constraint of a batch towards its rest length. ``softness``: compliance / step^2."""
    between = place[first] - place[second]
    length = _length(between)
    between *= (length - rest) / (np.maximum(length, 1e-9) * (2.0 + softness))
    place[first] -= between
    place[second] += between


def _dot(a: F64, b: F64) -> F64:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _length(vectors: F64) -> F64:
    return np.sqrt(_dot(vectors, vectors))


def _limited(vectors: F64, longest: F64) -> F64:
    """The vectors, shortened to at most ``longest``."""
    length = _length(vectors)
    return vectors * np.minimum(longest / np.maximum(length, 1e-12), 1.0)
