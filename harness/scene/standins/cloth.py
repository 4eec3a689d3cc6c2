"""Stand-in for the UNC Cloth/Ball: a square sheet falls on a ball that begins to turn, and winds up in folds.

The motion is simulated on a coarse sheet and refined by Catmull-Rom interpolation. Sheet 90,738 triangles, ball 1,470,
ground 2: together 92,210, against 92,230 of the original.

The simulation has one square sheet, one turning ball, the ground, and the sheet's contact with itself: extended
position-based dynamics with many small steps and one pass over the constraints per step (Macklin et al., "Small Steps in
Physics Simulation", SCA 2019; compliance as in Macklin et al., "XPBD", MIG 2016). A run repeats bit for bit on one
machine. Vertices are moved by float64 addition, multiplication, division and square root alone, in a fixed order, so
other platforms should agree; that has not been tried. Arrays of the sheet are component first, shape [3, n, n], so that a
batch of constraints is a slice.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ...arrays import F64, I32, I64
from ..scene import Geometry, Moves
from .bodies import curve
from .shapes import Mesh, join

FRAMES = 16
FRAME_TIME = 0.15

REFINE = 3
BALL_SEGMENTS, BALL_RINGS = 35, 22
GROUND_HALF = 2.5


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
    """The sheet, [frame_count, 3, cells + 1, cells + 1], ``frame_time`` seconds apart; frame 0 is flat, at rest."""
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


SETTINGS = ClothSettings()


def geometry() -> Geometry:
    count = SETTINGS.cells * REFINE + 1
    sheet, ball = Mesh(np.zeros((count * count, 3)), _grid_faces(count)), _ball()
    square = np.array([[-1.0, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]]) * GROUND_HALF
    ground = Mesh(square, np.array([[0, 2, 1], [0, 3, 2]]))
    x, y, z = ball.vertices.T

    def positions(k: int) -> F64:
        angle = SETTINGS.ball_angle(k * FRAME_TIME)
        c, s = np.cos(angle), np.sin(angle)
        turned = np.stack([x * c + z * s, y, z * c - x * s], axis=-1)
        return np.concatenate([_refined(_simulated()[k]), turned, square])

    moves = Moves("deforming", (0, len(sheet.vertices) + len(ball.vertices)))
    return Geometry(join([sheet, ball, ground]).faces, positions, FRAMES, moves)


@lru_cache(maxsize=1)
def _simulated() -> F64:
    """The animation of the coarse sheet; simulated once per process, when the first frame is needed."""
    return simulate(SETTINGS, FRAMES, FRAME_TIME)


def _refined(sheet: F64) -> F64:
    """The fine sheet through a coarse one, shape [n, 3]; pushed out of ball and ground where it cut a corner."""
    fine = _catmull_rom(_catmull_rom(sheet, 1), 2)
    least = 0.25 * SETTINGS.gap
    fine[1] = np.maximum(fine[1], least)
    arm = fine.copy()
    arm[1] -= SETTINGS.ball_radius
    distance = np.sqrt(arm[0] * arm[0] + arm[1] * arm[1] + arm[2] * arm[2])
    fine += arm * (np.maximum(SETTINGS.ball_radius + least - distance, 0.0) / np.maximum(distance, 1e-9))
    return np.ascontiguousarray(fine.reshape(3, -1).T)


def _catmull_rom(values: F64, axis: int) -> F64:
    """Interpolate ``REFINE`` times as densely along ``axis``; the line goes on straight beyond its ends."""
    lines = np.moveaxis(values, axis, 0)
    fine = curve(lines.reshape(len(lines), -1), REFINE)
    return np.moveaxis(fine.reshape(-1, *lines.shape[1:]), 0, axis)


def _grid_faces(count: int) -> I32:
    """Two triangles for each cell of a square grid of ``count`` by ``count`` vertices, diagonals alternating."""
    i, j = np.meshgrid(np.arange(count - 1), np.arange(count - 1), indexing="ij")
    a = (i * count + j).ravel()
    b, c, d = a + 1, a + count + 1, a + count
    odd = ((i + j) % 2 == 1).ravel()[:, None]
    one = np.where(odd, np.stack([a, b, d], -1), np.stack([a, b, c], -1))
    two = np.where(odd, np.stack([b, c, d], -1), np.stack([a, c, d], -1))
    return np.stack([one, two], 1).reshape(-1, 3).astype(np.int32)


def _ball() -> Mesh:
    """A sphere of rings and segments standing on the ground, normals outward."""
    rise = np.pi * np.arange(1, BALL_RINGS) / BALL_RINGS
    turn = 2 * np.pi * np.arange(BALL_SEGMENTS) / BALL_SEGMENTS
    level = np.repeat(np.cos(rise)[:, None], BALL_SEGMENTS, 1)
    rings = np.stack([np.outer(np.sin(rise), np.cos(turn)), level, np.outer(np.sin(rise), np.sin(turn))], -1)
    points = np.concatenate([[[0.0, 1, 0]], rings.reshape(-1, 3), [[0.0, -1, 0]]])
    here = np.arange(BALL_SEGMENTS)
    after, pole = (here + 1) % BALL_SEGMENTS, np.full(BALL_SEGMENTS, len(points) - 1)
    a, b = (1 + BALL_SEGMENTS * np.arange(BALL_RINGS - 2)[:, None] + ends for ends in (here, after))
    c, d = b + BALL_SEGMENTS, a + BALL_SEGMENTS
    belt = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], 1).reshape(-1, 3)
    last = 1 + (BALL_RINGS - 2) * BALL_SEGMENTS
    top, bottom = np.stack([0 * here, 1 + after, 1 + here], -1), np.stack([last + here, last + after, pole], -1)
    faces = np.concatenate([top, belt, bottom]).astype(np.int32)
    return Mesh((points + (0.0, 1.0, 0.0)) * SETTINGS.ball_radius, faces)
