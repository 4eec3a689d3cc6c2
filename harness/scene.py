"""What a scene is: geometry over time, a camera, lights, and what it calls for. Frozen, and the same for everyone.

Lengths are metres unless the file says otherwise; right-handed coordinates; angles in degrees where a person
writes them. Nothing here is rounded: a scene is float64 until :mod:`.moment` recentres and rounds it once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Camera:
    """A pinhole camera. ``fov`` is the vertical field of view in degrees; ``up`` must not be parallel to the view."""

    eye: Vector
    target: Vector
    up: Vector = (0.0, 1.0, 0.0)
    fov: float = 45.0


@dataclass(frozen=True)
class Spot:
    """What a light is limited to: a cone, or a rectangle of azimuth and elevation about its direction (Figure 6).

    direction   where it points; any length
    angle       half-angle of the cone, degrees in 0..180; or half-width of the rectangle in azimuth
    rise        half-width of the rectangle in elevation, degrees in 0..90; None: a cone
    up          what elevation is measured towards; must not be parallel to ``direction``
    falloff     exponent of the cosine from the direction, for pictures only; 0: none

    Hit points outside are no receivers: they cast no shadow ray and their bit is 0 (:mod:`.spot`).
    """

    direction: Vector
    angle: float
    rise: float | None = None
    up: Vector = (0.0, 1.0, 0.0)
    falloff: float = 0.0


@dataclass(frozen=True)
class Light:
    """A point light. ``shadows``: whether it asks for shadow rays. ``color`` and ``intensity`` are for pictures only.

    ``spot``: what it is limited to; None shines everywhere.
    """

    position: Vector
    shadows: bool = True
    color: Vector = (1.0, 1.0, 1.0)
    intensity: float = 1.0
    spot: Spot | None = None

    def moved(self, position: Vector) -> Light:
        """The same light elsewhere."""
        return replace(self, position=position)


@dataclass(frozen=True, eq=False)
class Geometry:
    """A triangle mesh over time: fixed topology, one array of positions a frame.

    ``faces``: int32, shape [triangle_count, 3], indices in range (checked by :func:`validate`).
    ``positions(k)``: float64 or float32, shape [vertex_count, 3], for frame k in 0..frame_count-1. May hold
    NaN or infinite coordinates: such triangles are never hit and keep their index.
    """

    faces: NDArray[np.int32]
    positions: Callable[[int], NDArray[np.floating]]
    frame_count: int = 1

    @staticmethod
    def static(vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> Geometry:
        """A mesh that does not move."""
        fixed = np.ascontiguousarray(vertices)
        return Geometry(np.ascontiguousarray(faces, dtype=np.int32), lambda k: fixed, 1)


@dataclass(frozen=True)
class Source:
    """Where a scene's geometry came from; goes into every record.

    ``kind`` is ``procedural`` or ``file``. ``sha256`` is the file's hash (empty for procedural geometry; the
    hash of the arrays is taken apart from this, in :mod:`.moment`).
    """

    kind: str = "procedural"
    file: str = ""
    sha256: str = ""


@dataclass(frozen=True, eq=False)
class Scene:
    """One entry of the catalogue, or a file given on the command line.

    name       what a person types; lower case, no spaces
    title      what a table prints; for a stand-in it ends in "(stand-in)"
    geometry   makes the mesh; called once, may take seconds
    stand_in   None for the real thing; otherwise one line saying what it stands in for
    closed     True only if the surface is closed and consistently oriented (culling is legal then)
    light_path a path of :mod:`.lights` that moves ``lights`` over the animation, or None for fixed lights
    """

    name: str
    title: str
    geometry: Callable[[], Geometry]
    camera: Camera
    lights: tuple[Light, ...]
    stand_in: str | None = None
    closed: bool = False
    light_path: object | None = None
    source: Source = field(default_factory=Source)
    notes: str = ""


@dataclass(frozen=True)
class Effects:
    """What a frame must simulate, derived from a scene: nothing else is run.

    shadows   one flag a light: does it ask for shadow rays
    """

    shadows: tuple[bool, ...]

    @staticmethod
    def of(scene: Scene) -> Effects:
        """The effects that ``scene`` calls for."""
        return Effects(shadows=tuple(light.shadows for light in scene.lights))


@dataclass(frozen=True)
class Limits:
    """What a method may take. ``memory``: bytes for its structures, counted by the method before it allocates."""

    memory: int = 8 << 30
