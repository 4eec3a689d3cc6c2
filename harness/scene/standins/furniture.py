"""Pieces that the conference room is filled with: chairs, cups, laptops, lamps, a shrub. Each stands on y = 0. The
pieces are curved and finely tessellated, so that they hold most of the room's triangles.
"""

import numpy as np
from numpy.typing import NDArray

from .shapes import Mesh, box, cushion, cylinder, flip, grid, join, lathe, pairs, patch, place, sphere, transform, tube

X_AXIS, Z_AXIS = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def _bent(mesh: Mesh, dx: float = 0.0, dy: NDArray | float = 0.0, dz: NDArray | float = 0.0) -> Mesh:
    """The mesh with each vertex moved by its own amount."""
    x, y, z = mesh.vertices.T
    return Mesh(np.stack([x + dx, y + dy, z + dz], axis=-1), mesh.faces)


def chair() -> Mesh:
    """An office chair that faces +z: seat, bowed back, arms, gas spring, a star foot with five twin castors."""
    seat = cushion((0.52, 0.1, 0.5), 36, 18, 0.45)
    x, _, z = seat.vertices.T
    seat = _bent(seat, dy=0.25 * x**2 - 0.3 * np.maximum(z - 0.12, 0.0) ** 2)
    back = transform(cushion((0.5, 0.56, 0.08), 36, 24, 0.5), rotate=(X_AXIS, -8.0))
    x, y, _ = back.vertices.T
    back = _bent(back, dz=0.8 * x**2 + 0.03 * np.cos(9.0 * y))
    spine = [[0.0, 0.42, -0.1], [0.0, 0.43, -0.26], [0.0, 0.5, -0.34], [0.0, 0.66, -0.36], [0.0, 0.8, -0.36]]
    parts = [place(seat, 0.0, 0.46, 0.0), place(back, 0.0, 0.82, -0.3), tube(spine, 0.02, 10)]

    s = np.linspace(0.0, 1.0, 18)
    side = 0.27 + 0.03 * np.sin(np.pi * s)
    height = 0.44 + 0.24 * np.sin(0.5 * np.pi * np.minimum(2.2 * s, 1.0))
    arm = tube(np.stack([side, height, 0.18 - 0.46 * s + 0.05 * np.sin(2 * np.pi * s)], axis=-1), 0.014, 10)
    rest = place(cushion((0.075, 0.035, 0.28), 20, 10, 0.6), 0.3, 0.695, -0.03)
    parts += [arm, rest, transform(join([arm, rest]), scale=(-1.0, 1.0, 1.0))]

    parts += [place(cylinder(radius, height, 16), 0.0, 0.1, 0.0) for radius, height in ((0.028, 0.32), (0.05, 0.14))]
    leg = [[0.0, 0.12, 0.03], [0.0, 0.115, 0.1], [0.0, 0.1, 0.2], [0.0, 0.075, 0.3]]
    wheel = lathe(pairs(0, -0.01, 0.022, -0.01, 0.028, -0.005, 0.028, 0.005, 0.022, 0.01, 0, 0.01), 16)
    wheel = transform(wheel, rotate=(Z_AXIS, 90.0))
    star = [tube(leg, [0.03, 0.026, 0.02, 0.015], 12), place(cylinder(0.008, 0.045, 8), 0.0, 0.035, 0.3)]
    star += [place(wheel, x, 0.028, 0.3) for x in (-0.018, 0.018)]
    return join(parts + [place(join(star), 0.0, 0.0, 0.0, 72.0 * k) for k in range(5)])


def cup() -> Mesh:
    """A hollow coffee cup with a handle, on a saucer."""
    outside = pairs(0, 0.008, 0.024, 0.008, 0.027, 0.012, 0.036, 0.035, 0.041, 0.06, 0.042, 0.08)
    inside = pairs(0.039, 0.08, 0.037, 0.06, 0.032, 0.035, 0.02, 0.018, 0, 0.016)
    saucer = pairs(0, 0, 0.04, 0, 0.075, 0.012, 0.074, 0.015, 0.04, 0.005, 0, 0.005)
    turn = np.linspace(-1.4, 1.4, 13)
    handle = np.stack([0.036 + 0.026 * np.cos(turn), 0.045 + 0.025 * np.sin(turn), 0 * turn], axis=-1)
    return join([lathe(np.concatenate([outside, inside]), 28), lathe(saucer, 28), tube(handle, 0.004, 8)])


def laptop() -> Mesh:
    """Base with 70 keys and an open lid."""
    lid = transform(
        box((-0.16, 0.0, -0.004), (0.16, 0.22, 0.004)), rotate=(X_AXIS, -18.0), translate=(0.0, 0.016, -0.11)
    )
    key = box((0.0, 0.018, 0.0), (0.017, 0.021, 0.017))
    keys = [place(key, -0.145 + 0.0208 * i, 0.0, -0.085 + 0.022 * j) for i in range(14) for j in range(5)]
    return join([box((-0.16, 0.0, -0.11), (0.16, 0.018, 0.11)), lid, *keys])


def pad() -> Mesh:
    """A note pad with a pencil beside it."""
    pencil = tube([[0.0, 0.0, 0.0], [0.0, 0.0, 0.13], [0.0, 0.0, 0.14]], [0.005, 0.005, 0.001], 8)
    return join([box((-0.105, 0.0, -0.15), (0.105, 0.012, 0.15)), place(pencil, 0.13, 0.006, -0.07)])


def microphone() -> Mesh:
    """A microphone on a thin bent neck."""
    s = np.linspace(0.0, 1.0, 12)
    neck = np.stack([0 * s, 0.02 + 0.26 * s - 0.05 * s**3, 0.12 * s**2.5], axis=-1)
    foot = lathe(pairs(0, 0, 0.05, 0, 0.045, 0.02, 0, 0.025), 20)
    return join([foot, tube(neck, 0.004, 8), place(sphere(0.016, 16, 10), *neck[-1])])


def glass() -> Mesh:
    """A hollow tumbler."""
    return lathe(pairs(0, 0, 0.028, 0, 0.035, 0.12, 0.033, 0.12, 0.026, 0.006, 0, 0.006), 24)


def carafe() -> Mesh:
    """A stoppered carafe."""
    profile = pairs(0, 0, 0.07, 0, 0.085, 0.03, 0.08, 0.12, 0.045, 0.19, 0.04, 0.23, 0.055, 0.26, 0, 0.262)
    return lathe(profile, 32)


def telephone() -> Mesh:
    """A conference telephone with three arms."""
    arm = place(cushion((0.1, 0.05, 0.26), 24, 12, 0.6), 0.0, 0.025, 0.1)
    return join([place(arm, 0.0, 0.0, 0.0, 120.0 * k) for k in range(3)])


def downlight() -> Mesh:
    """A round ceiling lamp under y = 0: a rim and a bulb below it."""
    rim = pairs(0.08, 0, 0.095, -0.004, 0.105, -0.016, 0.12, -0.018, 0.13, -0.012, 0.135, 0)
    return join([flip(lathe(rim, 32)), place(sphere(0.06, 24, 14), 0.0, -0.065, 0.0)])


def louvred_lamp() -> Mesh:
    """A fluorescent tube under y = 0 between two long sides and 36 thin louvres."""
    sides = [box((-0.9, -0.09, z), (0.9, 0.0, z + 0.02)) for z in (-0.15, 0.13)]
    louvres = [box((x, -0.09, -0.13), (x + 0.006, -0.01, 0.13)) for x in np.linspace(-0.88, 0.87, 36)]
    lamp = transform(cylinder(0.014, 1.76, 12), rotate=(Z_AXIS, -90.0), translate=(-0.88, -0.03, 0.0))
    return join([*sides, *louvres, lamp])


def raised_field(low: tuple[float, float], high: tuple[float, float], back: float, front: float) -> Mesh:
    """A panel's field with bevelled edges, in the plane z = ``front``, facing +z; ``low``, ``high`` are (x, y)."""
    (x0, y0), (x1, y1), bevel = low, high, 0.04
    sign = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    outline = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    outer = np.column_stack([outline, np.full(4, back)])
    inner = np.column_stack([outline + bevel * sign, np.full(4, front)])
    field = grid(inner[0], inner[1] - inner[0], inner[3] - inner[0])
    return join([patch(np.stack([outer, inner], axis=1), wrap_u=True), field])


def shrub(seed: int) -> Mesh:
    """A tall pot with a shrub: bent leaves along thin stems."""
    pot = lathe(pairs(0, 0, 0.17, 0, 0.22, 0.4, 0.24, 0.42, 0.21, 0.42, 0.2, 0.36, 0, 0.36), 32)
    s, w = np.linspace(0.0, 1.0, 7)[:, None], np.linspace(-1.0, 1.0, 3)[None, :]
    wide = 0.012 + 0.05 * np.sin(np.pi * s**0.8)
    leaf = patch(np.stack([wide * w, 0.03 * np.abs(w) - 0.12 * s**2, 0.26 * s + 0 * w], axis=-1))
    random = np.random.default_rng(seed)
    parts = [pot]
    for turn, lean, tall in random.uniform((0.0, 0.1, 0.5), (360.0, 0.45, 1.5), (26, 3)):
        stem = [tube(np.linspace(0.0, 1.0, 6)[:, None] ** (1.0, 1.0, 1.6) * (0.0, tall, lean), 0.006, 6)]
        for spin, up in random.uniform((0.0, 0.45), (360.0, 1.0), (9, 2)):
            stem.append(place(leaf, 0.0, tall * up, lean * up**1.6, spin))
        parts.append(place(join(stem), 0.0, 0.36, 0.0, turn))
    return join(parts)
