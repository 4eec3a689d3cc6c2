"""Positions of lights over an animation and in the sweeps of the experiments; the same for every method. Declared
scenes and the lightings of experiments (:mod:`.scene.overrides`) both take their lights from here.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .scene import Light, Spot, Vector


@dataclass(frozen=True)
class Orbit:
    """Every light turns about an axis through ``centre`` by ``turns`` full turns, at its own radius and height. The
    position of a directional light is a direction, which turns about the axis only.
    """

    centre: Vector
    axis: Vector = (0.0, 1.0, 0.0)
    turns: float = 1.0

    def at(self, lights: tuple[Light, ...], share: float) -> tuple[Light, ...]:
        """The lights at ``share`` of the animation: 0 is its first frame, 1 its last."""
        axis = np.asarray(self.axis, dtype=np.float64)
        length = float(np.linalg.norm(axis))
        if not 0.0 < length < math.inf:
            raise ValueError(f"axis {self.axis}: it must be finite and not zero")
        axis = axis / length
        angle = 2 * math.pi * self.turns * share
        moved = []
        for light in lights:
            centre = np.zeros(3) if light.directional else np.asarray(self.centre)
            arm = np.asarray(light.position, dtype=np.float64) - centre
            turned = (
                arm * math.cos(angle)
                + np.cross(axis, arm) * math.sin(angle)
                + axis * float(arm @ axis) * (1 - math.cos(angle))
            )
            moved.append(light.moved(vector(turned + centre)))
        return tuple(moved)


def spread(light: Light, centre: Vector, count: int, axis: Vector = (0.0, 1.0, 0.0)) -> tuple[Light, ...]:
    """``count`` lights from one: turned evenly about ``axis`` through ``centre``, intensity shared out."""
    if count < 1:
        raise ValueError(f"{count} lights: there must be at least 1")
    path = Orbit(centre, axis)
    return tuple(replace(path.at((light,), i / count)[0], intensity=light.intensity / count) for i in range(count))


def at_distance(light: Light, middle: Vector, distance: float) -> Light:
    """The light at a distance from ``middle``, in its own direction; above, if it is at ``middle`` itself."""
    away = np.subtract(light.position, middle)
    length = float(np.linalg.norm(away))
    direction = away / length if length > 0 else np.array([0.0, 1.0, 0.0])
    return light.moved(vector(np.asarray(middle) + direction * distance))


def as_point(light: Light, middle: Vector, radius: float) -> Light:
    """A directional light as a point two radii from ``middle``, where it shines from; others unchanged."""
    if not light.directional:
        return light
    way = np.asarray(light.position) / np.linalg.norm(light.position)
    return replace(light, position=vector(np.asarray(middle) + 2.0 * radius * way), directional=False)


def as_directional(light: Light, middle: Vector) -> Light:
    """A directional light with the direction of the light at ``middle``, without area; directional ones unchanged."""
    if light.directional:
        return light
    position = vector(np.subtract(light.position, middle))
    return replace(light, position=position, spot=None, directional=True, shape="", size=0.0, samples=1)


def as_spot(
    light: Light, target: Vector, angle: float, up: Vector, rise: float | None = None, falloff: float = 0.0
) -> Light:
    """The point light limited to a cone or rectangle towards ``target`` (:class:`.scene.scene.Spot`)."""
    direction = vector(np.subtract(target, light.position))
    return replace(light, spot=Spot(direction, angle, rise=rise, up=up, falloff=falloff))


def vector(array: Any) -> Vector:
    """Three plain floats."""
    return (float(array[0]), float(array[1]), float(array[2]))
