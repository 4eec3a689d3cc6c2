"""Light paths shared by every method: where the lights are at a share s in [0, 1] of an animation or a sweep."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
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
        axis = _unit(self.axis)
        angle = 2 * math.pi * self.turns * share
        moved = []
        for light in lights:
            # A directional light's position is the way to it: it turns about the axis alone.
            centre = np.zeros(3) if light.directional else np.asarray(self.centre)
            arm = np.asarray(light.position, dtype=np.float64) - centre
            turned = (
                arm * math.cos(angle)
                + np.cross(axis, arm) * math.sin(angle)
                + axis * float(arm @ axis) * (1 - math.cos(angle))
            )
            moved.append(light.moved(_vector(turned + centre)))
        return tuple(moved)


@dataclass(frozen=True)
class DistanceSweep:
    """Every light moves away from ``centre`` along ``direction``, distances spaced evenly in their logarithm."""

    centre: Vector
    direction: Vector
    nearest: float
    farthest: float

    def __post_init__(self) -> None:
        if not (0.0 < self.nearest < math.inf and 0.0 < self.farthest < math.inf):
            raise ValueError(f"distances {self.nearest} to {self.farthest}: both must be positive and finite")

    def at(self, lights: tuple[Light, ...], share: float) -> tuple[Light, ...]:
        direction = _unit(self.direction)
        distance = self.nearest * (self.farthest / self.nearest) ** share
        place = _vector(np.asarray(self.centre) + direction * distance)
        return tuple(light.moved(place) for light in lights)


def spread(light: Light, centre: Vector, count: int, axis: Vector = (0.0, 1.0, 0.0)) -> tuple[Light, ...]:
    """``count`` lights from one: turned evenly about ``axis`` through ``centre``, intensity shared out."""
    if count < 1:
        raise ValueError(f"{count} lights: there must be at least 1")
    path = Orbit(centre, axis)
    return tuple(
        replace(path.at((light,), i / count)[0], intensity=light.intensity / count) for i in range(count)
    )


def _unit(vector: Vector) -> np.ndarray:
    array = np.asarray(vector, dtype=np.float64)
    length = float(np.linalg.norm(array))
    if not 0.0 < length < math.inf:
        raise ValueError(f"direction {vector}: it must be finite and not zero")
    return array / length


def _vector(array: np.ndarray) -> Vector:
    return (float(array[0]), float(array[1]), float(array[2]))
