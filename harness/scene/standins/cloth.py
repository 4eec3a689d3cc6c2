"""Stand-in for the UNC Cloth/Ball: a square sheet falls on a ball that begins to turn, and winds up in folds.

The motion is simulated by :mod:`.scene.standins.cloth_solver` on a coarse sheet and refined by Catmull-Rom
interpolation. Sheet 90,738 triangles, ball 1,470, ground 2: together 92,210, against 92,230 of the original.
"""

from functools import lru_cache

import numpy as np

from ...arrays import F64, I64
from ..scene import Geometry, Moves
from .cloth_solver import ClothSettings, simulate

FRAMES = 16
FRAME_TIME = 0.15
SETTINGS = ClothSettings()
REFINE = 3
BALL_SEGMENTS, BALL_RINGS = 35, 22
GROUND_HALF = 2.5


def geometry() -> Geometry:
    count = SETTINGS.cells * REFINE + 1
    sheet_faces = _grid_faces(count)
    ball, ball_faces = _ball()
    ground = np.array([[-1.0, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]]) * GROUND_HALF
    ground_faces = np.array([[0, 2, 1], [0, 3, 2]])
    ball_start = count * count
    ground_start = ball_start + len(ball)
    faces = np.concatenate([sheet_faces, ball_faces + ball_start, ground_faces + ground_start]).astype(np.int32)

    def positions(k: int) -> F64:
        angle = SETTINGS.ball_angle(k * FRAME_TIME)
        turned = ball.copy()
        turned[:, 0] = ball[:, 0] * np.cos(angle) + ball[:, 2] * np.sin(angle)
        turned[:, 2] = ball[:, 2] * np.cos(angle) - ball[:, 0] * np.sin(angle)
        return np.concatenate([_refined(_simulated()[k]), turned, ground])

    return Geometry(faces, positions, FRAMES, Moves("deforming", (0, ground_start)))


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
    values = np.moveaxis(values, axis, -1)
    before = 2 * values[..., :1] - values[..., 1:2]
    after = 2 * values[..., -1:] - values[..., -2:-1]
    padded = np.concatenate([before, values, after], axis=-1)
    a, b, c, d = (padded[..., i : padded.shape[-1] - 3 + i] for i in range(4))
    fine = np.empty((*values.shape[:-1], (values.shape[-1] - 1) * REFINE + 1))
    fine[..., -1] = values[..., -1]
    for i in range(REFINE):
        s = i / REFINE
        fine[..., i:-1:REFINE] = b + 0.5 * s * ((c - a) + s * ((2 * a - 5 * b + 4 * c - d) + s * (3 * (b - c) + d - a)))
    return np.moveaxis(fine, -1, axis)


def _grid_faces(count: int) -> I64:
    """Two triangles for each cell of a square grid of ``count`` by ``count`` vertices, diagonals alternating."""
    i, j = np.meshgrid(np.arange(count - 1), np.arange(count - 1), indexing="ij")
    a = (i * count + j).ravel()
    b, c, d = a + 1, a + count + 1, a + count
    odd = ((i + j) % 2 == 1).ravel()[:, None]
    one = np.where(odd, np.stack([a, b, d], -1), np.stack([a, b, c], -1))
    two = np.where(odd, np.stack([b, c, d], -1), np.stack([a, c, d], -1))
    return np.stack([one, two], 1).reshape(-1, 3)


def _ball() -> tuple[F64, I64]:
    """A sphere of rings and segments standing on the ground: vertices and faces, normals outward."""
    rise = np.pi * np.arange(1, BALL_RINGS) / BALL_RINGS
    turn = 2 * np.pi * np.arange(BALL_SEGMENTS) / BALL_SEGMENTS
    ring = np.stack(
        [
            np.outer(np.sin(rise), np.cos(turn)),
            np.repeat(np.cos(rise)[:, None], BALL_SEGMENTS, 1),
            np.outer(np.sin(rise), np.sin(turn)),
        ],
        -1,
    ).reshape(-1, 3)
    points = np.concatenate([[[0.0, 1, 0]], ring, [[0.0, -1, 0]]])
    points = (points + (0.0, 1.0, 0.0)) * SETTINGS.ball_radius
    here = np.arange(BALL_SEGMENTS)
    after = (here + 1) % BALL_SEGMENTS
    faces = [np.stack([np.zeros_like(here), 1 + after, 1 + here], -1)]
    for r in range(BALL_RINGS - 2):
        a, b = 1 + r * BALL_SEGMENTS + here, 1 + r * BALL_SEGMENTS + after
        c, d = b + BALL_SEGMENTS, a + BALL_SEGMENTS
        faces += [np.stack([a, b, c], -1), np.stack([a, c, d], -1)]
    last = 1 + (BALL_RINGS - 2) * BALL_SEGMENTS
    faces.append(np.stack([last + here, last + after, np.full_like(here, len(points) - 1)], -1))
    return points, np.concatenate(faces)
