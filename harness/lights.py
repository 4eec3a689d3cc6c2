"""Light paths shared by every method: where the lights are at a share s in [0, 1] of an animation or a sweep."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .scene import Light, Vector


class LightPath(Protocol):
    """Moves all lights of a scene. ``share`` runs from 0 (first frame) to 1 (last frame)."""

    def at(self, lights: tuple[Light, ...], share: float) -> tuple[Light, ...]: ...


@dataclass(frozen=True)
class Fixed:
    """Lights that stay where the scene puts them."""

    def at(self, lights: tuple[Light, ...], share: float) -> tuple[Light, ...]:
        return lights


@dataclass(frozen=True)
class Orbit:
    """Every light turns about an axis through ``centre`` by ``turns`` full turns, at its own radius and height."""

    centre: Vector
    axis: Vector = (0.0, 1.0, 0.0)
    turns: float = 1.0

    def at(self, lights: tuple[Light, ...], share: float) -> tuple[Light, ...]:
        axis = np.asarray(self.axis, dtype=np.float64)
        axis /= np.linalg.norm(axis)
        angle = 2 * math.pi * self.turns * share
        moved = []
        for light in lights:
            arm = np.asarray(light.position, dtype=np.float64) - self.centre
            turned = (
                arm * math.cos(angle)
                + np.cross(axis, arm) * math.sin(angle)
                + axis * float(arm @ axis) * (1 - math.cos(angle))
            )
            moved.append(light.moved(_vector(turned + self.centre)))
        return tuple(moved)


@dataclass(frozen=True)
class DistanceSweep:
    """Every light moves away from ``centre`` along ``direction``, distances spaced evenly in their logarithm."""

    centre: Vector
    direction: Vector
    nearest: float
    farthest: float

    def at(self, lights: tuple[Light, ...], share: float) -> tuple[Light, ...]:
        direction = np.asarray(self.direction, dtype=np.float64)
        direction /= np.linalg.norm(direction)
        distance = self.nearest * (self.farthest / self.nearest) ** share
        place = _vector(np.asarray(self.centre) + direction * distance)
        return tuple(light.moved(place) for light in lights)


def spread(light: Light, centre: Vector, count: int) -> tuple[Light, ...]:
    """``count`` lights from one: turned evenly about the vertical through ``centre``, intensity shared out."""
    path = Orbit(centre)
    return tuple(
        Light(path.at((light,), i / count)[0].position, light.shadows, light.color, light.intensity / count)
        for i in range(count)
    )


def _vector(array: np.ndarray) -> Vector:
    return (float(array[0]), float(array[1]), float(array[2]))
