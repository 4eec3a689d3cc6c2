"""Mirrors: rays that start on surfaces, edges and corners, and shadows on surfaces that are only visible in a mirror.

The harness makes the rays (:mod:`..frame.effects.mirrors`); the cases test whether a method finds their closest hits.
"""

from collections.abc import Callable

import numpy as np

from ..arrays import U8
from ..scene.scene import Geometry
from .case import Counts, Trial, axes, hard, rows, view
from .shapes import ball, box, joined, plane, quad, soup

Mirrors = Callable[[Geometry], U8]


def first(count: int) -> Mirrors:
    return lambda geometry: (np.arange(len(geometry.faces)) < count).astype(np.uint8)


@hard(
    "M01{axis}", "a hall of mirrors: rays at its edges and corners",
    "a mirrored ray hits its own mirror again, or escapes where two mirrors meet", axes(), half=16.0,
)  # fmt: skip
@hard(
    "M02{end}", "a hall of mirrors, {what}",
    "a start moved by a fixed epsilon: too little far from the origin, too much in a small scene",
    rows("end what scale offset", ("", "small", 1e-4, 0.0), ("b", "large", 1e4, 0.0),
         ("c", "far from the origin", 1.0, 1e3)),
    half=1.0,
)  # fmt: skip
def hall(half: float, turn: int = 0, scale: float = 1.0, offset: float = 0.0) -> Trial:
    """A closed box of mirrors seen from its centre; with ``half`` = 16, rays meet its edges and corners exactly.

    A light outside lights the wall next to it through that wall's plane: 72 of 256 rays meet this wall.
    """
    return view(
        box(-1, 1), [(0.5, 0.25, 0.75), (0, 4, 0)], (0, 0, 0), (0, 0, -1), half, turn=turn, scale=scale,
        offset=(offset, -offset, 2 * offset), mirror=first(12), bounces=3,
        stated=Counts(256, (0, 184)) if half == 16.0 else Counts(256, (0, 256)),
    )  # fmt: skip


@hard(
    "M03{end}", "a mirror at a slant, scaled by {scale:g}",
    "the start lies in the mirror's plane as float32 has it, and its ray runs along it",
    rows("end scale", ("", 1.0), ("b", 1e-3)),
)  # fmt: skip
def at_a_slant(scale: float) -> Trial:
    """A wide mirror just below the eye, and balls on it that touch their reflections."""
    mesh = joined(
        plane(1, 0, 64), ball(0.5, (0, 0.5, -4)), ball(0.25, (1.25, 0.25, -3)),
        quad((-8, -1, -16), (8, -1, -16), (8, 3, -16), (-8, 3, -16)),
    )  # fmt: skip
    return view(mesh, [(2, 3, -1)], (0, 1 / 64, 0), (0, 0, -1), 0.5, scale=scale, mirror=first(2), bounces=2)


@hard("M04", "two mirrors in one place", "only the mirror that was hit is excluded, and the ray hits its duplicate")
def duplicates() -> Trial:
    """Two mirrors in one place with opposite orientation: a ray that starts on one starts on both."""
    square = [(-3, -3, -1), (3, -3, -1), (3, 3, -1), (-3, 3, -1)]
    mesh = joined(quad(*square), quad(*square[::-1]), plane(2, 3, 16))
    return view(mesh, [(0, 0, 2)], (0, 0, 0), (0, 0, -1), 1.0, mirror=first(4), bounces=2, stated=Counts(256, (0,)))


@hard("M05", "a shadow that only a mirror shows", "shadow rays that start at primary hits, not at mirrored ones")
def behind_the_eye() -> Trial:
    """A square and its shadow on a wall, both visible only in a mirror."""
    mesh = joined(plane(2, -1, 4), quad((-1, -1, 2), (1, -1, 2), (1, 1, 2), (-1, 1, 2)), plane(2, 4, 16))
    return view(mesh, [(0, 0, 1)], (0, 0, 0), (0, 0, -1), 0.5, mirror=first(2), bounces=1, stated=Counts(256, (0,)))


@hard("M06", "splinters of mirrors", "surfaces that cross where a ray starts", seed=4)
def splinters(seed: int) -> Trial:
    """Intersecting triangles of all sizes, all mirrors: rays start next to the triangles that cross them."""
    mesh = soup(seed, 200, 0.5)
    return view(mesh, [(2, 3, 1)], (0, 0, 3), (0, 0, -1), 0.5, mirror=first(len(mesh[1])), bounces=3)
