"""Pieces that the cathedral is built from: arches, ribs, windows, a rose window, columns. Metres, y up."""

import numpy as np
from numpy.typing import ArrayLike

from .shapes import Mesh, box, join, lathe, patch, transform, tube

COLUMN_HEIGHT = 5.2  # from the floor to the top of the abacus


def arch(profile: ArrayLike, segments: int) -> Mesh:
    """A half ring over the x axis: profile [(radius, z), ...] swept from x = +radius over the top to -radius."""
    return transform(lathe(profile, segments, start=-90.0, sweep=180.0), rotate=((1.0, 0.0, 0.0), -90.0))


def rib(start: ArrayLike, end: ArrayLike, rise: float, radius: float, segments: int, sides: int = 8) -> Mesh:
    """A round rib along half an ellipse from ``start`` to ``end`` at one height, ``rise`` metres high."""
    angle = np.linspace(0.0, np.pi, segments + 1)[:, None]
    middle, reach = (np.add(start, end)) / 2, np.subtract(end, start) / 2
    return tube(middle - np.cos(angle) * reach + np.sin(angle) * np.array([0.0, rise, 0.0]), radius, sides, caps=False)


def window(half: float, height: float) -> Mesh:
    """A round-headed window in a wall at z = 0 facing +z: splayed reveal, round frame, mullion and sill."""
    angle = np.linspace(0.0, np.pi, 13)
    x = np.concatenate([[half], half * np.cos(angle), [-half]])
    y = np.concatenate([[0.0], height + half * np.sin(angle), [0.0]])
    path = np.stack([x, y, np.full_like(x, 0.06)], axis=-1)
    inner = path * (0.82, 0.93, 0.0) + (0.0, 0.05, 0.0)
    frame = tube(path, 0.09, 5)
    mullion = box((-0.04, 0.0, 0.0), (0.04, height + half, 0.08))
    sill = box((-half - 0.15, -0.2, 0.0), (half + 0.15, 0.0, 0.25))
    return join([patch(np.stack([path, inner], axis=1)), frame, mullion, sill])


def rose(radius: float) -> Mesh:
    """A round window in a wall at z = 0: three rings and twelve spokes."""
    turn = 2 * np.pi * np.arange(30) / 30
    rings = [
        tube(np.stack([r * np.cos(turn), r * np.sin(turn), 0 * turn + 0.05], axis=-1), thick, 6, closed=True)
        for r, thick in ((radius, 0.14), (0.62 * radius, 0.06), (0.25 * radius, 0.07))
    ]
    spoke = np.array([[0.25 * radius, 0.0, 0.05], [0.6 * radius, 0.0, 0.05], [radius, 0.0, 0.05]])
    spokes = [transform(tube(spoke, 0.045, 6), rotate=((0.0, 0.0, 1.0), 30.0 * k)) for k in range(12)]
    return join(rings + spokes)


def turned_column() -> Mesh:
    """Plinth, Attic base, tapered shaft, capital with a collar, eight leaves and an abacus."""
    turn = np.linspace(-np.pi / 2, np.pi / 2, 7)
    torus = [(0.46 + 0.08 * np.cos(a), 0.33 + 0.08 * np.sin(a)) for a in turn]
    scotia = [(0.44 - 0.06 * np.cos(a), 0.48 + 0.05 * np.sin(a)) for a in turn[1:-1]]
    upper = [(0.41 + 0.05 * np.cos(a), 0.58 + 0.05 * np.sin(a)) for a in turn]
    shaft = [(0.4, 0.64), (0.35, 4.24)]  # one band of long thin triangles
    collar = [(0.35 + 0.04 * np.cos(a), 4.3 + 0.04 * np.sin(a)) for a in turn]
    bell = [(0.35 + 0.22 * s**2.2, 4.36 + 0.5 * s) for s in np.linspace(0.0, 1.0, 7)]
    turned = lathe(torus + scotia + upper + shaft + collar + bell, 22)
    leaves = []
    for k in range(8):
        curl = np.array([[0.0, 4.38, 0.36], [0.0, 4.6, 0.42], [0.0, 4.76, 0.54], [0.0, 4.74, 0.62]])
        leaves.append(transform(tube(curl, [0.05, 0.09, 0.06, 0.03], 5), rotate=((0.0, 1.0, 0.0), 45.0 * k)))
    plinth = box((-0.56, 0.0, -0.56), (0.56, 0.25, 0.56))
    abacus = [box((-0.6, 4.86, -0.6), (0.6, 4.98, 0.6)), box((-0.56, 4.98, -0.56), (0.56, COLUMN_HEIGHT, 0.56))]
    return join([plinth, turned, *leaves, *abacus])
