"""Stand-in for the UNC Cloth/Ball: a square sheet falls on a ball that begins to turn, and winds up in folds.

The motion is simulated by :mod:`.scene.standins.cloth_solver` on a coarse sheet and refined by Catmull-Rom
interpolation. Sheet 90,738 triangles, ball 1,470, ground 2: together 92,210, against 92,230 of the original.
"""

from functools import lru_cache

import numpy as np

from ...arrays import F64, I32
from ..scene import Geometry, Moves
from .bodies import curve
from .cloth_solver import ClothSettings, simulate
from .shapes import Mesh, join

FRAMES = 16
FRAME_TIME = 0.15
SETTINGS = ClothSettings()
REFINE = 3
BALL_SEGMENTS, BALL_RINGS = 35, 22
GROUND_HALF = 2.5


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
