"""A scene: geometry over time, a camera, lights and effects. Immutable, and the same for every method. Lengths are
metres unless the file says otherwise; coordinates are right-handed; angles in declarations are in degrees. A scene is
float64 until :mod:`.scene.prepared` recentres and rounds it once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, TypeVar

import numpy as np

from ..arrays import F32, I32, U8, Floats, Ints
from ..errors import UserError, did_you_mean

T = TypeVar("T")
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Camera:
    """A pinhole camera, or an orthographic one.

    fov     vertical field of view of a pinhole camera, degrees
    up      must not be parallel to the view
    height  of an orthographic camera, the height of what the image shows; None: a pinhole camera. Its rays are parallel to
            the view and start in the plane through the eye that is perpendicular to the view
    """

    eye: Vector
    target: Vector
    up: Vector = (0.0, 1.0, 0.0)
    fov: float = 45.0
    height: float | None = None


@dataclass(frozen=True)
class Spot:
    """The directions that a light is limited to: a cone, or a rectangle of azimuth and elevation about its direction
    (Figure 6).

    direction   where it points; any length
    angle       half-angle of the cone, degrees in 0..180; or half-width of the rectangle in azimuth
    rise        half-width of the rectangle in elevation, degrees in 0..90; None: a cone
    up          what elevation is measured towards; must not be parallel to ``direction``
    falloff     exponent of the cosine from the direction, for pictures only; 0: none

    Hit points outside are not receivers: they have no shadow ray and their shadow bit is 0 (:mod:`.judge.receivers`).
    """

    direction: Vector
    angle: float
    rise: float | None = None
    up: Vector = (0.0, 1.0, 0.0)
    falloff: float = 0.0


SHAPES = ("rectangle", "disc", "sphere")  # shapes of a light with an area
FARTHEST = 1e38  # coordinate of an eye or a light, and size of a light: sums of them are in the range of float32
MOST_SAMPLES = 1024  # largest number of samples of a light: a frame has passes and shadow bits for each one


@dataclass(frozen=True)
class Light:
    """A point light, one with an area, or a directional one.

    position     its position, of an area its middle; of a directional light the direction from the scene to it, any length
    shadows      whether it has shadow rays; otherwise no structure is built and no ray is sorted for it
    color, intensity  for pictures only
    spot         the directions it is limited to; None: all directions
    directional  the limit of a light infinitely far away: all its rays are parallel (:func:`.scene.prepared.light_point`)
    shape        of its area, of :data:`SHAPES`; "": a point
    size         side of a square, width and height of a rectangle, diameter of a disc or a sphere
    samples      number of targets, the points of its area that shadow rays are traced to (:mod:`.scene.targets`)
    towards      direction that a rectangle or a disc is perpendicular to; None: towards the scene's middle
    across       direction that the width of a rectangle is measured along; None: horizontal
    """

    position: Vector
    shadows: bool = True
    color: Vector = (1.0, 1.0, 1.0)
    intensity: float = 1.0
    spot: Spot | None = None
    directional: bool = False
    shape: str = ""
    size: float | tuple[float, float] = 0.0
    samples: int = 1
    towards: Vector | None = None
    across: Vector | None = None

    def __post_init__(self) -> None:
        if self.directional and (self.spot is not None or self.shape):
            what = "have an area" if self.shape else "be a spot"
            raise ValueError(f"a directional light cannot {what}: it stands nowhere")
        if self.shape not in ("", *SHAPES):
            raise ValueError(f"shape {self.shape!r}: it is one of {', '.join(SHAPES)}")
        pair = isinstance(self.size, tuple)
        if pair and (self.shape != "rectangle" or len(self.size) != 2):  # type: ignore[arg-type]
            raise ValueError(f"size {self.size}: give one number, or width and height of a rectangle")
        if not all(0.0 <= side < np.inf for side in self.extent):
            raise ValueError(f"size {self.size}: it must be finite and not negative")
        if type(self.samples) is not int or not 1 <= self.samples <= MOST_SAMPLES:
            raise ValueError(f"samples {self.samples!r}: give 1 to {MOST_SAMPLES}")
        if not self.shape and (any(self.extent) or self.samples > 1):
            raise ValueError(f"an area needs a shape: {', '.join(SHAPES)}")

    @property
    def extent(self) -> tuple[float, float]:
        """Width and height of its area."""
        return self.size if isinstance(self.size, tuple) else (self.size, self.size)

    def moved(self, position: Vector) -> Light:
        """The same light at another position."""
        return replace(self, position=position)

    def resized(self, scale: float) -> Light:
        """The same light with ``scale`` times its size."""
        size = self.size
        return replace(self, size=(scale * size[0], scale * size[1]) if isinstance(size, tuple) else scale * size)


class LightPath(Protocol):
    """Moves the lights of a scene over its frames (:class:`.scene.light_paths.Orbit`). A frozen dataclass."""

    def at(self, lights: tuple[Light, ...], share: float) -> tuple[Light, ...]:
        """The lights at ``share`` of the animation: 0 is its first frame, 1 its last."""


@dataclass(frozen=True)
class Moves:
    """How a mesh moves.

    kind      "rigid" or "deforming"
    vertices  first and end of what moves, None: all
    bodies    of a rigid motion, which triangles move together as one body: a number for each, int [triangle_count]; what
              rests is a body, too. None: not known
    """

    kind: str
    vertices: tuple[int, int] | None = None
    bodies: Ints | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if self.kind not in ("rigid", "deforming"):
            raise ValueError(f"motion {self.kind!r}: it is rigid or deforming")
        if self.kind != "rigid" and self.bodies is not None:
            raise ValueError(f"motion {self.kind!r}: only a rigid one has bodies")


@dataclass(frozen=True, eq=False)
class AlphaMask:
    """Triangles with holes: a hit counts only where the bitmap is opaque (:mod:`.scene.alpha`).

    triangles    uint8 [triangle_count]: 1 = masked, 0 = opaque everywhere
    coordinates  float32 [triangle_count, 3, 2]: texture coordinates of the corners; the bitmap repeats
    opaque       uint8 [rows, columns]: 1 = opaque, row 0 at coordinate v = 0
    """

    triangles: U8
    coordinates: F32
    opaque: U8


@dataclass(frozen=True, eq=False)
class Geometry:
    """A triangle mesh over time: fixed topology, one array of positions per frame.

    ``faces``: int32, shape [triangle_count, 3], indices in range (checked by :func:`.scene.prepared.check_faces`).
    ``positions(k)``: float64 or float32, shape [vertex_count, 3], for frame k in 0..frame_count-1. May hold
    NaN or infinite coordinates: such triangles are never hit and keep their index.
    ``motion``: how it moves, for display and for ``plan``; None: where it moves, all of it deforms.
    ``still``: it has the same positions in every frame; its lights may move.
    """

    faces: I32
    positions: Callable[[int], Floats]
    frame_count: int = 1
    motion: Moves | None = None
    still: bool = False

    @property
    def moves(self) -> bool:
        """Whether its positions may differ from frame to frame."""
        return self.frame_count > 1 and not self.still

    def lasting(self, frames: int) -> Geometry:
        """The same mesh with this number of frames, if it does not move."""
        if self.moves:
            return self
        return Geometry(self.faces, lambda k: self.positions(0), frames, still=True)

    @staticmethod
    def static(vertices: Floats, faces: Ints) -> Geometry:
        """A mesh that does not move."""
        fixed = np.ascontiguousarray(vertices)
        return Geometry(np.ascontiguousarray(faces, dtype=np.int32), lambda k: fixed, 1)


@dataclass(frozen=True)
class Source:
    """Where a scene's geometry came from; goes into every record.

    ``kind`` is ``procedural`` or ``file``. ``sha256`` is the hash of all files that were read (empty for procedural
    geometry; the hash of the arrays is taken apart from this, in :mod:`.scene.prepared`). ``asked``: what was asked of the
    files beyond their triangles (:meth:`.readers.checks.Wanted.facts`). ``left_out``: what of them was left out or
    approximated, in one line.
    """

    kind: str = "procedural"
    file: str = ""
    sha256: str = ""
    asked: Mapping[str, Any] = field(default_factory=dict)
    left_out: str = ""


@dataclass(frozen=True, eq=False)
class Scene:
    """One entry of the catalogue, or a file given on the command line.

    name       the name on the command line; lower case, no spaces
    title      the name in tables; for a stand-in it ends in "(stand-in)"
    geometry   makes the mesh; called once, may take seconds
    stand_in   None for the original; otherwise one line that says what it stands in for
    closed     True only if the surface is closed and consistently oriented (then culling is valid)
    light_path a path of :mod:`.scene.light_paths` that moves ``lights`` over the animation, or None for fixed lights
    camera_moves  whether the camera counts as moving, which decides what a frame may reuse
    facing     only hit points that face a light, as the eye sees them, have a shadow ray (:mod:`.judge.receivers`)
    alpha      makes the alpha mask of the geometry, or None: every triangle is opaque
    mirror     makes the mirrors of the geometry, uint8 [triangle_count], or None: nothing reflects
    bounces    how many times a ray is mirrored; 0: mirrors are seen as plain surfaces
    outputs    the outputs of a frame, of :data:`OUTPUTS`
    cameras    cameras that its file offers, by name (``--camera-of``)
    lamps      lights that its file offers, by name (``--light-of``)
    rate       frames a second of its animation, where the file says so
    """

    name: str
    title: str
    geometry: Callable[[], Geometry]
    camera: Camera
    lights: tuple[Light, ...]
    stand_in: str | None = None
    closed: bool = False
    light_path: LightPath | None = None
    source: Source = field(default_factory=Source)
    notes: str = ""
    camera_moves: bool = False
    facing: bool = False
    alpha: Callable[[Geometry], AlphaMask] | None = None
    mirror: Callable[[Geometry], U8] | None = None
    bounces: int = 0
    outputs: tuple[str, ...] = ("depth", "ids", "shadows")
    cameras: Mapping[str, Camera] = field(default_factory=dict)
    lamps: Mapping[str, Light] = field(default_factory=dict)
    rate: float | None = None


def offered(title: str, kind: str, known: Mapping[str, T], name: str) -> T:
    """The camera or light of this name that a scene offers. Raises :class:`UserError` if it offers none of that name."""
    if name in known:
        return known[name]
    if not known:
        raise UserError(f"{title}: has no {kind} {name!r}; its file offers none")
    raise UserError(f"{title}: has no {kind} {name!r}{did_you_mean(name, known)}")
