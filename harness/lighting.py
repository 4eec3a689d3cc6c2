"""Lights in place of a scene's own, for experiments that sweep them: how many, how far, a spot, a path.

A lighting is a few plain numbers, so that an experiment can declare it, a worker can be told of it, and a record
can say it. It is applied to a scene that is prepared, because distances are told in radii of the scene from its
middle.
"""

from __future__ import annotations

import copy
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from .lights import Orbit, spread
from .moment import Prepared
from .scene import Geometry, Light, Scene, Spot, Vector


@dataclass(frozen=True)
class Lighting:
    """What is changed of a scene's lights; the default changes nothing.

    label     names it in tables and file names; "" only for the default
    count     so many lights: the scene's first one, turned evenly about the vertical through the scene's middle
    distance  of every light from the scene's middle, in radii of the scene, in the direction where it stands
    target    a point, in the scene's coordinates, that every light is turned into a spot towards
    angle     half-angle of the spot's cone, degrees
    turns     full turns of every light about the vertical through the middle, over the frames
    frames    places of the light over geometry that does not move: a static scene then has so many frames
    """

    label: str = ""
    count: int = 0
    distance: float = 0.0
    target: Vector | None = None
    angle: float = 20.0
    turns: float = 0.0
    frames: int = 1

    def __post_init__(self) -> None:
        if not self.label and self.changes:
            raise ValueError("a lighting that changes something needs a label")
        if self.count < 0 or self.distance < 0 or self.frames < 1:
            raise ValueError(f"lighting {self.label!r}: count, distance and frames must not be negative")

    @property
    def changes(self) -> bool:
        """Whether anything differs from the scene's own lights."""
        return bool(self.count or self.distance or self.target or self.turns or self.frames > 1)

    @staticmethod
    def read(facts: dict[str, Any] | None) -> Lighting:
        """The lighting that :meth:`facts` told of."""
        known = dict(facts or {})
        if known.get("target"):
            known["target"] = tuple(known["target"])
        return Lighting(**known)

    def facts(self) -> dict[str, Any]:
        """Plain numbers, for a command, a record and a key; {} for the default."""
        return asdict(self) if self.label else {}

    def longer(self, scene: Scene) -> Scene:
        """The scene with as many frames as the light has places, where its geometry does not move."""
        if self.frames == 1:
            return scene

        def geometry() -> Geometry:
            made = scene.geometry()
            if made.frame_count > 1:
                return made
            return Geometry(made.faces, lambda k: made.positions(0), self.frames)

        return replace(scene, geometry=geometry)

    def applied(self, prepared: Prepared) -> Prepared:
        """The prepared scene (one whose scene :meth:`longer` gave) under these lights; geometry is shared."""
        if not self.changes:
            return prepared
        lit = copy.copy(prepared)
        lit.scene = self._scene(prepared)
        return lit

    def _scene(self, prepared: Prepared) -> Scene:
        scene = prepared.scene
        middle = _vector(prepared.middle + prepared.centre)
        lights = scene.lights
        if self.count and lights:
            lights = spread(lights[0], middle, self.count, scene.camera.up)
        if self.distance:
            lights = tuple(_at(light, middle, self.distance * prepared.radius) for light in lights)
        if self.target is not None:
            lights = tuple(_spot(light, self.target, self.angle, scene.camera.up) for light in lights)
        path = Orbit(middle, scene.camera.up, self.turns) if self.turns else scene.light_path
        return replace(scene, lights=lights, light_path=path)


def _at(light: Light, middle: Vector, distance: float) -> Light:
    """The light at a distance from the middle, in the direction where it stands; above where it stands there."""
    away = np.subtract(light.position, middle)
    length = float(np.linalg.norm(away))
    direction = away / length if length > 0 else np.array([0.0, 1.0, 0.0])
    return light.moved(_vector(np.asarray(middle) + direction * distance))


def _spot(light: Light, target: Vector, angle: float, up: Vector) -> Light:
    return replace(light, spot=Spot(_vector(np.subtract(target, light.position)), angle, up=up))


def _vector(array: Any) -> Vector:
    return (float(array[0]), float(array[1]), float(array[2]))
