"""Bumpy balls over rolling ground, with any number of triangles: the same surfaces, sampled finer or coarser.

They are used to measure how time grows with the number of triangles. Ten million triangles are generated in seconds. The
balls occlude one another and cast shadows on one another and on the ground.
"""

from __future__ import annotations

import functools
import re

import numpy as np
from numpy.typing import NDArray

from ..scene import Camera, Geometry, Light, Scene

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]

NAME = re.compile(r"balls-([1-9]\d*)(k|m)?")
BALLS = 24
GROUND_SHARE = 0.4
"""Share of the triangles that belong to the ground; the balls share the rest equally."""
HALF = 6.0
"""Half the ground's side in metres."""


def count_of(name: str) -> int | None:
    """The triangle count in a name such as ``balls-30k`` or ``balls-10m``; None for another name."""
    match = NAME.fullmatch(name)
    if not match:
        return None
    return int(match[1]) * {"": 1, "k": 1000, "m": 1_000_000}[match[2] or ""]


def scene(name: str) -> Scene:
    """The scene of such a name; its triangle count is within 10 % of the number in the name."""
    count = count_of(name)
    assert count is not None
    return Scene(
        name=name,
        title=f"Balls {name.removeprefix('balls-')}",
        geometry=functools.partial(geometry, count),
        camera=Camera(eye=(7.5, 4.2, 8.5), target=(0.0, 0.7, 0.0), fov=42.0),
        lights=(Light((-5.0, 9.0, 4.0)),),
        notes="balls over rolling ground: the same surfaces at every triangle count",
    )


def geometry(count: int) -> Geometry:
    """About ``count`` triangles, 100 at least."""
    count = max(count, 100)
    side = max(2, round((GROUND_SHARE * count / 2) ** 0.5))
    # A ball of n squares around and n / 2 rows has n^2 - 2 n triangles.
    around = max(4, round(1 + (1 + (1 - GROUND_SHARE) * count / BALLS) ** 0.5))
    random = np.random.default_rng(7)
    parts = [ground(side)]
    for k in range(BALLS):
        angle, radius = 2.4 * k, 0.42 + 0.95 * k**0.5
        centre = np.array([radius * np.cos(angle), 0.9 + random.uniform(0.0, 1.6), radius * np.sin(angle)])
        parts.append(
            ball(centre, random.uniform(0.3, 0.6), random.uniform(3, 9, 3), max(2, around // 2), around)
        )
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    vertices = np.concatenate([vertices for vertices, _ in parts])
    faces = np.concatenate([f + start for (_, f), start in zip(parts, starts, strict=False)])
    return Geometry.static(vertices.astype(np.float32), faces.astype(np.int32))


def ground(side: int) -> tuple[F64, I32]:
    """Rolling ground of ``side`` x ``side`` squares."""
    along = np.linspace(-HALF, HALF, side + 1)
    x, z = np.meshgrid(along, along, indexing="ij")
    y = (
        0.25 * np.sin(1.3 * x + 0.4 * z)
        + 0.2 * np.cos(0.9 * z - 0.5 * x)
        + 0.03 * np.sin(7 * x) * np.sin(6 * z)
    )
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), squares(side, side, side + 1)


def ball(centre: F64, radius: float, waves: F64, rows: int, around: int) -> tuple[F64, I32]:
    """A bumpy ball of ``rows`` x ``around`` squares; those at the poles degenerate to one triangle."""
    theta = np.linspace(0.0, np.pi, rows + 1)[:, None]
    phi = np.linspace(0.0, 2 * np.pi, around + 1)[None, :]
    x, y, z = np.sin(theta) * np.cos(phi), np.cos(theta) + 0.0 * phi, np.sin(theta) * np.sin(phi)
    bump = 1.0 + 0.06 * np.sin(waves[0] * x) * np.sin(waves[1] * y) + 0.03 * np.sin(2 * waves[2] * z)
    points = centre + radius * bump[..., None] * np.stack([x, y, z], axis=-1)
    faces = squares(rows, around, around + 1)
    # The first triangle of a square at the top and the second of one at the bottom have no area.
    first, last = np.arange(around) * 2, (len(faces) // 2 - around + np.arange(around)) * 2 + 1
    return points.reshape(-1, 3), np.delete(faces, np.concatenate([first, last]), axis=0)


def squares(rows: int, columns: int, stride: int) -> I32:
    """Two triangles per square of a lattice of points, row by row: (a, b, c) and (b, d, c)."""
    a = (np.arange(rows)[:, None] * stride + np.arange(columns)[None, :]).ravel()
    b, c, d = a + 1, a + stride, a + stride + 1
    return np.stack([a, b, c, b, d, c], axis=1).reshape(-1, 3).astype(np.int32)
