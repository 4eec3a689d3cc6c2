"""A clearing: ground, trees, mushrooms, grass, ferns and leaves, for the Fairy Forest stand-in. The clearing is flat (y
= 0) where anything stands. Blades and leaves are made all at once as arrays.
"""

import numpy as np
from numpy.random import Generator

from ...arrays import F64, Ints
from .motion import Part, Sway
from .shapes import Mesh, grid, join, lathe, noise, patch, transform, tube

GROUND_SIDE = 24.0
TREES = (
    # x, z, radius at breast height, height, lean in x and z
    (-2.3, -3.2, 0.34, 10.0, 0.10, -0.04), (1.6, -4.6, 0.42, 11.0, -0.06, 0.0), (4.1, -2.4, 0.30, 9.0, -0.12, 0.05),
    (-5.2, -1.0, 0.38, 10.5, 0.12, 0.02), (-0.6, -8.5, 0.45, 12.0, 0.04, 0.0), (6.5, -7.0, 0.40, 11.0, -0.05, 0.0),
    (-6.8, -7.5, 0.42, 11.5, 0.05, 0.02), (3.6, -10.5, 0.40, 12.0, 0.0, 0.0), (-4.2, -12.0, 0.44, 12.0, 0.0, 0.03),
)  # fmt: skip
MUSHROOMS = (
    # x, z, height, cap radius
    (-1.05, -0.25, 0.72, 0.38), (-1.42, 0.28, 0.42, 0.25), (-0.80, 0.30, 0.26, 0.15), (1.30, -0.70, 0.92, 0.48),
    (1.62, -0.05, 0.40, 0.22), (1.08, 0.10, 0.22, 0.13), (-2.30, -1.20, 0.85, 0.42), (2.55, -1.60, 0.70, 0.40),
    (0.35, -1.95, 0.55, 0.30), (-0.55, -2.30, 0.38, 0.22), (0.95, 0.85, 0.20, 0.12), (-1.75, 0.95, 0.24, 0.14),
    (-3.20, 0.10, 0.50, 0.30), (3.05, 0.20, 0.46, 0.26),
)  # fmt: skip


def ground() -> Mesh:
    """24 m of ground in few triangles: flat for 8 m around the middle, a bank beyond."""
    half = GROUND_SIDE / 2
    mesh = grid((-half, 0, -half), (0, 0, GROUND_SIDE), (GROUND_SIDE, 0, 0), 14, 14)
    x, z = mesh.vertices[:, 0], mesh.vertices[:, 2]
    beyond = np.clip((np.sqrt(x * x + z * z) - 8.0) / 4.0, 0.0, 1.0)
    mesh.vertices[:, 1] = beyond * (1.2 + 0.8 * noise(mesh.vertices / 6.0, 3))
    return mesh


def trees() -> Mesh:
    """Trunks with roots and rough bark, and a few boughs each."""
    rng = np.random.default_rng(21)
    return join(part for row in TREES for part in _tree(*row, rng))


def _tree(x: float, z: float, radius: float, height: float, lean_x: float, lean_z: float, rng: Generator) -> list[Mesh]:
    around, up = 38, 34
    angle = 2 * np.pi * np.arange(around)[:, None] / around
    level = height * (np.arange(up)[None, :] / (up - 1)) ** 1.8  # close together near the roots, which are seen
    root = np.exp(-level / (1.1 * radius))
    turn = rng.random() * 6.28
    wide = radius * (1.0 - 0.55 * level / height) * (1.0 + root * (0.7 + 0.55 * np.cos(5 * angle + turn)))
    where = np.stack(np.broadcast_arrays(np.cos(angle) * 3.5, level * 1.2, np.sin(angle) * 3.5), axis=-1)
    wide = wide * (1.0 + 0.11 * noise(where + rng.random() * 20, 7, 2) + 0.035 * np.cos(13 * angle + 2 * level))
    across, back = x + wide * np.cos(angle) + lean_x * level, z - wide * np.sin(angle) + lean_z * level
    parts = [patch(np.stack([across, level + 0 * angle - 0.05, back], axis=-1), wrap_u=True)]
    for _ in range(4):
        begin, heading = height * rng.uniform(0.25, 0.8), rng.uniform(0, 6.28)
        reach = np.linspace(0.0, rng.uniform(1.2, 2.4), 9)
        along = x + lean_x * begin + reach * np.cos(heading) + 0.05 * np.sin(4 * reach)
        aside = z + lean_z * begin + reach * np.sin(heading)
        line = np.stack([along, begin + 0.45 * reach + 0.10 * reach**2, aside], axis=-1)
        parts.append(tube(line, 0.30 * radius * np.linspace(1.0, 0.15, 9), 9))
    return parts


def mushrooms() -> Mesh:
    """Toadstools, each a stem with a ring and a cap with gills' edge, as one lathed profile; warped a little."""
    rng = np.random.default_rng(22)
    parts = []
    for x, z, height, cap in MUSHROOMS:
        stem = 0.22 * cap
        bend = 1.0 - np.cos(np.linspace(0.0, np.pi / 2, 12))
        dome = [(cap * np.sqrt(max(1.0 - b * b, 0.0)), height - 0.42 * cap * (1.0 - b) + 0.10 * cap) for b in bend]
        dome[-1] = (0.0, dome[-1][1])
        profile = [
            *[(1.60 * stem, -0.02), (1.50 * stem, 0.06 * height), (1.05 * stem, 0.20 * height)],
            *[(0.92 * stem, 0.45 * height), (0.88 * stem, 0.58 * height), (1.70 * stem, 0.56 * height)],
            *[(1.75 * stem, 0.58 * height), (0.88 * stem, 0.64 * height), (0.85 * stem, height - 0.24 * cap)],
            *[(0.60 * cap, height - 0.34 * cap), (0.93 * cap, height - 0.37 * cap), *dome],
        ]
        mesh = lathe(profile, 27)
        share = mesh.vertices[:, 1] / height
        mesh.vertices[:, 0] += 0.12 * height * share * share * rng.uniform(-1, 1)
        mesh.vertices[:] += 0.02 * cap * noise(mesh.vertices * (3.0 / cap) + 9, 4)[:, None]
        parts.append(transform(mesh, rotate=((0, 1, 0), rng.uniform(0, 360)), translate=(x, 0.0, z)))
    return join(parts)


def grass(count: int) -> Part:
    """``count`` bent blades of 5 triangles, thicker in tufts, thinner towards the edge of the clearing."""
    rng = np.random.default_rng(23)
    tufts = _places(rng, count // 9 + 1, 0.5, 7.0)
    tuft = rng.integers(0, len(tufts), count)
    foot = tufts[tuft] + rng.normal(0, 0.075, (count, 2))
    heading = rng.uniform(0, 2 * np.pi, count)
    tall = rng.uniform(0.10, 0.26, count) * (0.7 + 0.6 * rng.random(len(tufts))[tuft])
    bend = tall * rng.uniform(0.15, 0.75, count)
    wide = rng.uniform(0.006, 0.011, count)
    along = np.stack([np.cos(heading), np.zeros(count), np.sin(heading)], axis=-1)
    side = np.stack([-np.sin(heading), np.zeros(count), np.cos(heading)], axis=-1)
    points = np.empty((count, 7, 3))
    for i in range(7):
        level = (0.0, 0.0, 0.4, 0.4, 0.75, 0.75, 1.0)[i]
        half = wide * (1.0 - 0.45 * level) * (0.0 if i == 6 else (-1.0, 1.0)[i % 2])
        points[:, i] = along * (bend * level * level)[:, None] + side * half[:, None]
        points[:, i, 1] += tall * level * (1.0 - 0.25 * level)
        points[:, i, ::2] += foot
    faces = np.array([[0, 1, 3], [0, 3, 2], [2, 3, 5], [2, 5, 4], [4, 5, 6]])
    mesh = _many(points, faces)
    reach = mesh.vertices[:, 1:2] ** 2 * (0.9, 0.0, 0.4)
    return Part(mesh, [Sway(reach, _wind(np.repeat(foot, 7, axis=0)))])


def leaves(count: int) -> Part:
    """``count`` leaves of 4 triangles: fronds of ferns, litter on the ground, crowns of the trees, a few falling."""
    rng = np.random.default_rng(24)
    ferns, litter, crowns = (int(share * count) for share in (0.48, 0.17, 0.34))
    groups = [_fern_leaves(rng, ferns), _litter(rng, litter), _crown_leaves(rng, crowns)]
    groups.append(_falling_leaves(rng, count - ferns - litter - crowns))
    points, swings = (np.concatenate(parts) for parts in zip(*groups, strict=True))
    swing = np.repeat(swings, 5)
    faces = np.array([[0, 2, 3], [0, 3, 1], [3, 2, 4], [3, 4, 1]])
    mesh = _many(points, faces)
    reach = swing[:, None] * np.array([1.0, 0.5, 0.6])
    foot = np.repeat(points[:, 0, ::2], 5, axis=0)
    return Part(mesh, [Sway(reach, _wind(foot))])


Leaves = tuple[F64, F64]  # points [n, 5, 3] and how far each leaf sways [n] in metres


def _leaf(foot: F64, ahead: F64, side: F64, length: F64, width: F64) -> F64:
    """Points [n, 5, 3] of leaves: foot, left, right, middle and tip, folded along the middle and drooping."""
    ahead, side = _unit(ahead), _unit(side)
    up = np.cross(ahead, side)
    up *= np.where(up[:, 1:2] < 0, -1.0, 1.0)
    middle = foot + ahead * (0.5 * length)[:, None]
    wing = side * (0.5 * width)[:, None] + up * (0.22 * width)[:, None]
    other = -side * (0.5 * width)[:, None] + up * (0.22 * width)[:, None]
    tip = foot + ahead * length[:, None] - up * (0.16 * length)[:, None]
    return np.stack([foot, middle + other, middle + wing, middle, tip], axis=1)


def _fern_leaves(rng: Generator, count: int) -> Leaves:
    """Arching fronds from common roots, leaflets in pairs that shorten towards the tip."""
    per_frond, per_fern = 22, 9
    ferns = _places(rng, count // (per_frond * per_fern) + 1, 1.1, 5.0)
    frond = np.arange(count) // per_frond
    fern = frond // per_fern
    size = rng.uniform(0.45, 0.85, len(ferns))[fern]
    heading = (frond % per_fern) * (2 * np.pi / per_fern) + rng.normal(0, 0.2, frond[-1] + 1)[frond]
    rise = rng.uniform(0.8, 1.25, frond[-1] + 1)[frond]
    share = 0.12 + 0.88 * (np.arange(count) % per_frond // 2) / (per_frond // 2)
    ahead = np.stack([np.cos(heading), rise * (1.1 - 2.0 * share), np.sin(heading)], axis=-1)
    foot = np.zeros((count, 3))
    foot[:, ::2] = ferns[fern] + ahead[:, ::2] * (size * share)[:, None]
    foot[:, 1] = size * rise * (1.1 * share - share * share) + 0.01
    flank = np.where(np.arange(count) % 2 == 0, 1.0, -1.0)
    out = np.stack([-np.sin(heading), np.zeros(count), np.cos(heading)], axis=-1) * flank[:, None]
    length = size * 0.30 * (1.05 - share)
    return _leaf(foot, out + 0.45 * _unit(ahead), ahead, length, 0.34 * length + 0.01), 0.05 * share * size


def _litter(rng: Generator, count: int) -> Leaves:
    heading = rng.uniform(0, 2 * np.pi, count)
    tilt = rng.normal(0, 0.15, (count, 2))
    foot = np.zeros((count, 3))
    foot[:, ::2] = _places(rng, count, 0.2, 6.0)
    foot[:, 1] = rng.uniform(0.008, 0.03, count)
    ahead = np.stack([np.cos(heading), np.abs(tilt[:, 0]), np.sin(heading)], axis=-1)
    side = np.stack([-np.sin(heading), tilt[:, 1], np.cos(heading)], axis=-1)
    length = rng.uniform(0.06, 0.13, count)
    return _leaf(foot, ahead, side, length, 0.55 * length), np.zeros(count)


def _crown_leaves(rng: Generator, count: int) -> Leaves:
    rows = np.array(TREES)
    row = rows[rng.integers(0, len(rows), count)]
    level = row[:, 3] * rng.uniform(0.40, 1.02, count)
    spread = rng.normal(0, 1.0, (count, 3)) * np.array([1.3, 0.5, 1.3])
    foot = np.stack([row[:, 0] + row[:, 4] * level, level, row[:, 1] + row[:, 5] * level], axis=-1) + spread
    length = rng.uniform(0.16, 0.32, count)
    return _leaf(foot, rng.normal(0, 1, (count, 3)), rng.normal(0, 1, (count, 3)), length, 0.6 * length), 0.4 * length


def _falling_leaves(rng: Generator, count: int) -> Leaves:
    foot = np.empty((count, 3))
    foot[:, ::2] = _places(rng, count, 0.6, 3.5)
    foot[:, 1] = rng.uniform(0.3, 3.2, count)
    length = rng.uniform(0.05, 0.10, count)
    return _leaf(foot, rng.normal(0, 1, (count, 3)), rng.normal(0, 1, (count, 3)), length, 0.6 * length), 1.5 * length


def _places(rng: Generator, count: int, near: float, far: float) -> F64:
    """Places [n, 2] around the middle, ever thinner from ``near`` to ``far`` metres; more of them at the back."""
    distance = near + (far - near) * rng.random(count) ** 1.4
    heading = rng.uniform(0, 2 * np.pi, count)
    return np.stack([distance * np.cos(heading), distance * np.sin(heading) - 0.12 * distance], axis=-1)


def _wind(places: F64) -> F64:
    """Shift of the swaying at places [n, 2]: gusts run across the clearing."""
    return 0.28 * places[:, 0] + 0.11 * places[:, 1]


def _unit(vectors: F64) -> F64:
    length = np.sqrt(vectors[:, 0] ** 2 + vectors[:, 1] ** 2 + vectors[:, 2] ** 2)
    return vectors / np.maximum(length, 1e-12)[:, None]


def _many(points: F64, faces: Ints) -> Mesh:
    """Copies of one small topology: points [n, m, 3], faces [f, 3] within one copy."""
    count, each = points.shape[:2]
    every = faces[None] + (np.arange(count) * each)[:, None, None]
    return Mesh(points.reshape(-1, 3), every.reshape(-1, 3).astype(np.int32))
