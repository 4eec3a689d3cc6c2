"""Lights and effects that replace those of a scene in experiments: number, distance, spot, path and effects; and rules
that choose triangles of any mesh, for effects whose surfaces the scene does not define.

A lighting consists of plain numbers, so that an experiment can declare it, a worker can receive it and a record can store
it. It is applied to a prepared scene, because distances are in radii of the scene from its centre.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np

from ..arrays import U8
from .light_paths import Orbit, as_directional, as_point, as_spot, at_distance, spread, vector
from .prepared import Prepared, under
from .scene import AlphaMask, Geometry, Scene, Vector
from .targets import SHAPE

HOLES = 4  # holes along a side of a triangle that has some

MOVED: dict[str, frozenset[str]] = {
    "nothing": frozenset(), "camera": frozenset({"camera"}), "light": frozenset({"light"}),
    "part": frozenset({"points"}), "all": frozenset({"points", "camera", "light"}),
}  # fmt: skip
"""Inputs that can have changed since the last frame; of the lights the first one. For a method that ignores parts, a part of
the geometry is all of it.
"""


def largest_triangles(geometry: Geometry, share: float = 0.5) -> U8:
    """1 for the largest triangles of the first frame that together make ``share`` of its area, uint8 [triangles]."""
    points = np.asarray(geometry.positions(0), dtype=np.float64)
    a, b, c = (points[geometry.faces[:, i]] for i in range(3))
    with np.errstate(invalid="ignore", over="ignore"):
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    area = np.nan_to_num(area, posinf=0.0)
    order = np.argsort(-area, kind="stable")
    count = int(np.searchsorted(np.cumsum(area[order]), share * area.sum())) + 1
    chosen = np.zeros(len(area), dtype=np.uint8)
    chosen[order[:count]] = area[order[:count]] > 0.0
    return chosen


def perforated(geometry: Geometry, every: int = 2, holes: int = 4) -> AlphaMask:
    """A mask for any mesh: triangle 0 and every ``every``-th after it become a chequerboard with ``holes`` fields per
    side.

    The fields lie along two edges of the triangle itself, so that the pattern follows it as it moves. ``every`` = 1
    masks them all. Raises ValueError unless both are at least 1.
    """
    if every < 1 or holes < 1:
        raise ValueError("every and holes must be at least 1")
    count = len(geometry.faces)
    masked = (np.arange(count) % every == 0).astype(np.uint8)
    corners = np.array([[0, 0], [holes / 2, 0], [0, holes / 2]], dtype=np.float32)
    coordinates = np.broadcast_to(corners, (count, 3, 2)).copy()
    return AlphaMask(masked, coordinates, np.array([[1, 0], [0, 1]], dtype=np.uint8))


@dataclass(frozen=True)
class Lighting:
    """Changes of a scene's lights and effects; the default changes nothing.

    label     names it in tables and file names; "" only for the default
    count     number of lights: copies of the scene's first one, turned evenly about the vertical through the scene's
              middle
    distance  of every light from the scene's middle, in radii of the scene, in the direction where it stands
    target    a point, in the scene's coordinates, that every light is turned into a spot towards
    angle     half-angle of the spot's cone, degrees; or half-width of its rectangle in azimuth
    rise      half-width of the spot's rectangle in elevation, degrees; None: a cone
    falloff   exponent of the cosine from the spot's direction, for pictures
    turns     full turns of every light about the vertical through the middle, over the frames
    frames    number of positions of the light for static geometry, which then has that number of frames
    spot      half-angle, degrees, of a spot that every light becomes, towards what the camera looks at; 0: none
    shadows   whether lights have shadow rays
    directional  every light becomes directional, shining as it does at the scene's middle
    facing    only hit points that face a light have a shadow ray
    color     the frame is shaded
    alpha     every n-th triangle has holes (:func:`.scene.overrides.perforated`); 0: none
    bounces   number of bounces of rays mirrored by the scene's largest triangles; 0: nothing reflects
    size      diameter of the sphere that every light becomes, in radii of the scene
    samples   number of targets of each of these spheres; 0: lights are points, as they are
    moved     the only input that has changed since the last frame, of :data:`MOVED`: only the passes that depend on it
              are timed; None: all
    """

    label: str = ""
    count: int = 0
    distance: float = 0.0
    target: Vector | None = None
    angle: float = 20.0
    rise: float | None = None
    falloff: float = 0.0
    turns: float = 0.0
    frames: int = 1
    spot: float = 0.0
    shadows: bool = True
    directional: bool = False
    facing: bool = False
    color: bool = False
    alpha: int = 0
    bounces: int = 0
    moved: str | None = None
    size: float = 0.0
    samples: int = 0

    def __post_init__(self) -> None:
        if not self.label and self.changes:
            raise ValueError("a lighting that changes something needs a label")
        if self.count < 0 or self.distance < 0 or self.frames < 1:
            raise ValueError(f"lighting {self.label!r}: count, distance and frames must not be negative")
        if self.moved is not None and self.moved not in MOVED:
            raise ValueError(f"lighting {self.label!r}: moved is one of {', '.join(MOVED)}")

    @property
    def changes(self) -> bool:
        """Whether anything differs from the scene as it is."""
        return any(getattr(self, field.name) != field.default for field in fields(self) if field.name != "label")

    @property
    def targets(self) -> int:
        """Number of targets that it gives the scene, as far as it says; 0: as the scene has them."""
        return max(1, self.count) * self.samples if self.samples else self.count

    @property
    def changed(self) -> frozenset[str] | None:
        """The inputs that changed since the last frame, as passes name them; None: all."""
        if self.moved is None:
            return None
        targets = {f"light/{i}" for i in range(max(1, self.samples))}
        return frozenset().union(*(targets if name == "light" else {name} for name in MOVED[self.moved]))

    @staticmethod
    def read(facts: dict[str, Any] | None) -> Lighting:
        """The lighting with these :meth:`facts`."""
        known = dict(facts or {})
        if known.get("target"):
            known["target"] = tuple(known["target"])
        return Lighting(**known)

    def facts(self) -> dict[str, Any]:
        """Plain numbers, for a command, a record and a key; {} for the default."""
        area = () if self.samples else ("size", "samples")
        return {name: value for name, value in asdict(self).items() if name not in area} if self.label else {}

    def longer(self, scene: Scene) -> Scene:
        """The scene with as many frames as the light has places, where its geometry does not move."""
        if self.frames == 1:
            return scene
        return replace(scene, geometry=lambda: scene.geometry().lasting(self.frames))

    def applied(self, prepared: Prepared) -> Prepared:
        """The prepared scene (one whose scene :meth:`longer` gave) under these lights; geometry is shared."""
        if not self.changes:
            return prepared
        return under(prepared, self._scene(prepared))

    def _scene(self, prepared: Prepared) -> Scene:
        scene = prepared.scene
        middle = vector(prepared.middle + prepared.centre)
        lights = scene.lights
        if self.count and lights:
            lights = spread(lights[0], middle, self.count, scene.camera.up)
        if self.distance or self.target is not None or self.spot or self.samples:
            lights = tuple(as_point(light, middle, prepared.radius) for light in lights)
        if self.distance:
            lights = tuple(at_distance(light, middle, self.distance * prepared.radius) for light in lights)
        if self.target is not None:
            lights = tuple(
                as_spot(light, self.target, self.angle, scene.camera.up, self.rise, self.falloff) for light in lights
            )
        if self.spot:
            lights = tuple(as_spot(light, scene.camera.target, self.spot, scene.camera.up) for light in lights)
        if self.samples:
            size = self.size * prepared.radius
            lights = tuple(replace(light, shape=SHAPE, size=size, samples=self.samples) for light in lights)
        if self.directional:
            lights = tuple(as_directional(light, middle) for light in lights)
        if not self.shadows:
            lights = tuple(replace(light, shadows=False) for light in lights)
        changed: dict[str, Any] = {"lights": lights, "facing": scene.facing or self.facing}
        if self.turns:
            changed["light_path"] = Orbit(middle, scene.camera.up, self.turns)
        if self.alpha:
            changed["alpha"] = lambda geometry: perforated(geometry, self.alpha, HOLES)
        if self.bounces:
            changed |= {"mirror": largest_triangles, "bounces": self.bounces}
        if self.color:
            changed["outputs"] = (*scene.outputs, "color")
        return replace(scene, **changed)
