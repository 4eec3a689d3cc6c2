"""What a user asks of a scene beyond its name: a camera and point lights in place of its own, and frames of its file."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import F64
from ..errors import UserError
from ..files import plain
from .catalogue import resolve
from .light_paths import vector
from .moment import ray_tables
from .readers.checks import ALL, Wanted
from .scene import Light, Scene, Vector, offered
from .targets import with_area


@dataclass(frozen=True)
class ChosenView:
    """The given camera and lights; the default changes nothing.

    camera     eye and target, in scene coordinates
    fov        vertical field of view, degrees
    lights     positions of point lights, in scene coordinates; with ``lights_of`` they replace the scene's lights and do
               not move
    wanted     what is asked of the scene's file
    camera_of  name of a camera that the scene's file offers
    lights_of  names of lights that it offers
    light_size, light_samples, light_shape  of an area that every light gets (:func:`.targets.with_area`)
    """

    camera: tuple[Vector, Vector] | None = None
    fov: float | None = None
    lights: tuple[Vector, ...] = ()
    wanted: Wanted = ALL
    camera_of: str | None = None
    lights_of: tuple[str, ...] = ()
    light_size: float | None = None
    light_samples: int | None = None
    light_shape: str | None = None

    @property
    def changes(self) -> bool:
        """Whether anything is given."""
        return self != ChosenView()

    def resolved(self, name: str | Path, scene_dir: str | Path | None = None) -> Scene:
        """The scene of a name or a file (:func:`.catalogue.resolve`), with this camera and these lights."""
        return self.applied(resolve(name, scene_dir, self.wanted))

    def applied(self, scene: Scene) -> Scene:
        """The scene with this camera and these lights. Raises :class:`UserError` for a degenerate camera, and for a name
        that the scene does not offer.
        """
        if self.lights or self.lights_of:
            lamps = tuple(offered(scene.title, "light", scene.lamps, name) for name in self.lights_of)
            scene = replace(scene, lights=(*lamps, *map(Light, self.lights)), light_path=None)
        lights = tuple(with_area(one, self.light_shape, self.light_size, self.light_samples) for one in scene.lights)
        if lights != scene.lights:
            scene = replace(scene, lights=lights)
        if self.camera_of is not None:
            chosen = offered(scene.title, "camera", scene.cameras, self.camera_of)
            scene = replace(scene, camera=chosen, camera_moves=False)
        if self.camera is None and self.fov is None:
            return scene
        if self.fov is not None and scene.camera.height is not None:
            raise UserError("--fov does not apply to an orthographic camera; set its height where it is declared")
        seen = scene.camera if self.fov is None else replace(scene.camera, fov=self.fov)
        if self.camera is not None:
            eye, target = self.camera
            seen = replace(seen, eye=eye, target=target, up=_upright(np.subtract(target, eye), seen.up))
        ray_tables(seen, 1, 1, np.zeros(3))
        return replace(scene, camera=seen)

    def facts(self) -> dict[str, Any]:
        """JSON types, as :meth:`read` reads them; {} if nothing is given."""
        given = {field.name: getattr(self, field.name) for field in fields(self)} | {"wanted": self.wanted.facts()}
        return {name: plain(value) for name, value in given.items() if value or value == 0.0}

    def text(self) -> str:
        """The given camera and lights, as a phrase for tables: "camera 0,1,5 to 0,0,0; light 2,3,4"; "" if nothing is."""

        def place(one: Vector) -> str:
            return ",".join(f"{x:g}" for x in one)

        return "; ".join(
            [
                *([f"camera {self.camera_of!r} of the file"] if self.camera_of is not None else []),
                *([f"camera {place(self.camera[0])} to {place(self.camera[1])}"] if self.camera else []),
                *([f"field of view {self.fov:g} degrees"] if self.fov is not None else []),
                *(f"light {name!r} of the file" for name in self.lights_of),
                *(f"light {place(one)}" for one in self.lights),
                *([f"lights as {self.light_shape}s"] if self.light_shape else []),
                *([f"lights of size {self.light_size:g}"] if self.light_size is not None else []),
                *([f"{self.light_samples} targets a light"] if self.light_samples else []),
            ]
        )

    @staticmethod
    def read(facts: dict[str, Any] | None) -> ChosenView:
        """The view with these :meth:`facts`."""
        known = dict(facts or {})
        places: dict[str, Any] = {
            name: tuple(map(vector, known.pop(name))) for name in ("camera", "lights") if name in known
        }
        lights_of, wanted = tuple(known.pop("lights_of", ())), Wanted.read(known.pop("wanted", {}))
        return ChosenView(**places, **known, lights_of=lights_of, wanted=wanted)


AS_IT_IS = ChosenView()  # the scene with its own camera and lights, and all of its file


def _upright(view: F64, up: Vector) -> Vector:
    """``up``; if it is parallel to the view direction, the coordinate axis most perpendicular to the view."""
    size = float(np.abs(view).max())
    if size and np.linalg.norm(np.cross(np.divide(view, size), up)) > 1e-6 * np.linalg.norm(up):
        return up
    return vector(np.eye(3)[np.abs(view).argmin()])
