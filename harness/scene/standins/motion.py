"""Motions that repeat, for the animated stand-ins: swings about joints, swaying, drifting. A motion changes the
vertices of one part in place, for a phase from 0 to 1 of the period.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from ...arrays import F64
from ..scene import Geometry, Moves
from .shapes import Mesh, join


class Motion(Protocol):
    """Changes points [n, 3] in place."""

    def apply(self, points: F64, phase: float) -> None: ...


class Part(NamedTuple):
    """A mesh and what moves it, in the order in which it is applied."""

    mesh: Mesh
    motions: Sequence[Motion] = ()


@dataclass(frozen=True, eq=False)
class Swing:
    """Points turn about an axis through ``pivot``, each by its weight [n] of the angle at the time. The angle is
    ``mean`` + ``reach`` sin(2 pi (``beats`` phase + ``shift``)), in degrees.
    """

    pivot: Sequence[float]
    axis: Sequence[float]
    reach: float
    weight: F64 | None = None
    beats: int = 1
    shift: float = 0.0
    mean: float = 0.0

    def apply(self, points: F64, phase: float) -> None:
        angle = np.radians(self.mean + self.reach * np.sin(2 * np.pi * (self.beats * phase + self.shift)))
        chosen = slice(None) if self.weight is None else np.flatnonzero(self.weight)
        turn = angle * (np.ones(len(points)) if self.weight is None else self.weight[chosen])
        sine, rest = np.sin(turn)[:, None], (1 - np.cos(turn))[:, None]
        pivot = np.asarray(self.pivot, dtype=np.float64)
        axis = np.asarray(self.axis, dtype=np.float64)
        axis = axis / np.sqrt(axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2)
        arm = points[chosen] - pivot
        across = np.cross(axis, arm)
        # Rodrigues' formula: arm + sin a (n x arm) + (1 - cos a) n x (n x arm)
        points[chosen] = pivot + arm + sine * across + rest * np.cross(axis, across)


@dataclass(frozen=True, eq=False)
class Sway:
    """Points move to and fro: by ``reach`` [n, 3] times sin(2 pi (phase + ``shift`` [n]))."""

    reach: F64
    shift: F64 | float

    def apply(self, points: F64, phase: float) -> None:
        wave = np.sin(2 * np.pi * (phase + np.asarray(self.shift)))
        points += self.reach * (wave[:, None] if wave.ndim else wave)


@dataclass(frozen=True)
class Drift:
    """The part as a whole goes round an ellipse with half axes ``one`` and ``two``."""

    one: Sequence[float]
    two: Sequence[float] = (0.0, 0.0, 0.0)
    shift: float = 0.0

    def apply(self, points: F64, phase: float) -> None:
        angle = 2 * np.pi * (phase + self.shift)
        points += np.sin(angle) * np.asarray(self.one) + np.cos(angle) * np.asarray(self.two)


@dataclass(frozen=True)
class Carry:
    """The part stands ``by`` away from where it was modelled, at all times."""

    by: Sequence[float] | F64

    def apply(self, points: F64, phase: float) -> None:
        points += np.asarray(self.by, dtype=np.float64)


def animated(parts: Sequence[Part], frame_count: int) -> Geometry:
    """Parts joined into one mesh of fixed topology, whose motion repeats after its frames."""
    mesh = join(part.mesh for part in parts)
    ends = np.cumsum([len(part.mesh.vertices) for part in parts]).tolist()
    moving = [
        (end - len(one.mesh.vertices), end, one.motions) for one, end in zip(parts, ends, strict=True) if one.motions
    ]

    def positions(k: int) -> F64:
        points = mesh.vertices.copy()
        for start, end, motions in moving:
            for motion in motions:
                motion.apply(points[start:end], k / frame_count)
        return points

    # Parts that stand still may lie between those that move.
    return Geometry(mesh.faces, positions, frame_count, Moves("deforming", (moving[0][0], moving[-1][1])))
