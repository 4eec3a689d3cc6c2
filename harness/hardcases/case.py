"""Hard cases: a named scene, the errors it provokes, and the counts that are known by hand.

Rays through vertices and edges must be exact in float32. If the view is along an axis, the half width is a power of two
(or a small multiple) and the image side is a power of two, then the pixel centres are odd multiples of half / side:
:func:`.shapes.pixel_centres`. Rays then meet a plane at a dyadic depth in dyadic points.

To place receivers freely, the camera looks at a plane of receivers from the side that is away from the light. Visibility
is geometric: the plane does not shadow its own points, and the occluder does not hide them from the camera.
"""

import inspect
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from ..arrays import F64, U8
from ..scene.moment import Moment
from ..scene.prepared import Prepared, prepare
from ..scene.scene import AlphaMask, Camera, Geometry, Light, Scene, Spot, Vector
from .shapes import Mesh

ORIGIN = (0.0, 0.0, 0.0)

EXCUSABLE = 0.02
"""Largest share of the rays of a case whose answers may be excused because an edge is near. Many cases aim rays at edges.
With a triangle test that is exact, or that decides uncertain cases in float64, the share is at most 0.014."""


@dataclass(frozen=True)
class Counts:
    """Expected counts: pixels with a hit, and shadowed pixels of each light. None: not stated."""

    hit: int | None = None
    shadowed: tuple[int | None, ...] | None = None

    def __str__(self) -> str:
        parts = [] if self.hit is None else [f"{self.hit} hit"]
        if self.shadowed:
            parts.append(f"{' + '.join('?' if n is None else str(n) for n in self.shadowed)} shadowed")
        return ", ".join(parts) or "not stated"


@dataclass(frozen=True, eq=False)
class Trial:
    """One frame of a case, ready to trace.

    stated      counts derived by hand; a test compares them with the exact answer
    same_lights pairs of lights that must have the same shadow bits
    watertight  a miss is an error wherever the exact ray hits, and a lit pixel wherever the exact bit is shadowed, even
                if an edge is near. Every edge that a ray meets is shared by triangles on both of its sides; or (P08) it
                is the border of a flat sheet, and the decision is exact in float32
    before      moments of the same scene that the method runs first; their answers are not judged
    """

    prepared: Prepared
    moment: Moment
    stated: Counts = field(default_factory=Counts)
    same_lights: tuple[tuple[int, int], ...] = ()
    watertight: bool = False
    before: tuple[Moment, ...] = ()


@dataclass(frozen=True, eq=False)
class HardCase:
    """A named case. ``breaks``: the errors of a naive implementation that it provokes. ``make`` builds the scene.

    ``refused``: the scene is invalid; making it must raise :class:`~..errors.UserError`.
    ``excusable``: largest share of its rays whose answers may be excused; with more, the case fails.
    ``large``: it takes long; ``shadowbench check`` runs it, the tests and the accuracy experiment do not.
    """

    name: str
    title: str
    breaks: str
    make: Callable[[], Trial]
    refused: bool = False
    excusable: float = EXCUSABLE
    large: bool = False


CASES: dict[str, list[HardCase]] = {}
"""The cases by the module of their builders, in the order of their registration."""

Rows = Sequence[dict[str, Any]]


def rows(names: str, *values: Any) -> Rows:
    """Named values of several cases, a tuple for each: ``rows("seed turn", (5, 0), (6, 1))``; of one name bare values."""
    keys = names.split()
    return [dict(zip(keys, row if len(keys) > 1 else (row,), strict=True)) for row in values]


def axes(ends: str = " yz") -> Rows:
    """The axes as they are, permuted once and twice (``turn``); ``axis``: for the name of the case."""
    return [{"turn": turn, "axis": end.strip()} for turn, end in enumerate(ends)]


TURNED = rows("end turn scale", ("", 0, 1.0), (" y small", 1, 2.0**-30), (" z large", 2, 2.0**40))


def hard(
    name: str, title: str, breaks: str, *tables: Rows, refused: bool = False, excusable: float = EXCUSABLE,
    large: bool = False, **given: Any,
) -> Callable[[Callable[..., Trial]], Callable[..., Trial]]:  # fmt: skip
    """Register what a builder makes as a :class:`HardCase`: one for each combination of the rows of ``tables``.

    The texts name values in braces. The builder gets those of ``given`` and of the rows that are its parameters.
    """

    def register(build: Callable[..., Trial]) -> Callable[..., Trial]:
        parameters = inspect.signature(build).parameters
        own = CASES.setdefault(build.__module__.rpartition(".")[2], [])
        for parts in itertools.product(*tables):
            values = given | {key: value for part in parts for key, value in part.items()}
            called, what, provoked = (text.format(**values) for text in (name, title, breaks))
            make = partial(build, **{key: value for key, value in values.items() if key in parameters})
            own.append(HardCase(called, what, provoked, make, refused, excusable, large))
        return build

    return register


def view(
    mesh: Mesh,
    lights: Sequence[Vector | Light],
    eye: Sequence[float],
    towards: Sequence[float] | F64,
    half: float = 1.0,
    size: tuple[int, int] = (16, 16),
    up: Sequence[float] | F64 | None = None,
    turn: int = 0,
    scale: float = 1.0,
    stated: Counts | None = None,
    same_lights: tuple[tuple[int, int], ...] = (),
    watertight: bool = False,
    closed: bool = False,
    offset: Sequence[float] | F64 = (0.0, 0.0, 0.0),
    alpha: Callable[[Geometry], AlphaMask] | None = None,
    mirror: Callable[[Geometry], U8] | None = None,
    bounces: int = 0,
    height: float | None = None,
) -> Trial:
    """A trial from plain numbers.

    towards  direction of the view (not a point);  half: half height of the image plane at distance 1
    height   of an orthographic camera, what it shows from bottom to top; ``half`` is then not used
    turn     number of times that the coordinates are permuted (x, y, z -> z, x, y), which moves seams and poles
    scale, offset  applied to mesh, eye and lights after the permutation, in float64
    """
    towards = np.asarray(towards, dtype=np.float64)
    if up is None:
        up = (0.0, 1.0, 0.0) if abs(towards[1]) <= 0.9 * np.linalg.norm(towards) else (0.0, 0.0, 1.0)

    def placed(points: Any) -> F64:
        rolled = np.roll(np.asarray(points, dtype=np.float64).reshape(-1, 3), turn, axis=1)
        return rolled * scale + np.asarray(offset, dtype=np.float64)

    def turned(direction: Any) -> Vector:
        x, y, z = np.roll(np.asarray(direction, dtype=np.float64), turn).tolist()
        return (x, y, z)

    def vector(point: Any) -> Vector:
        x, y, z = placed(point)[0].tolist()
        return (x, y, z)

    def lamp(light: Vector | Light) -> Light:
        if not isinstance(light, Light):
            return Light(vector(light))
        spot = light.spot
        if spot is not None:
            spot = replace(spot, direction=turned(spot.direction), up=turned(spot.up))
        position = vector(light.position)
        if light.directional:  # a direction has no place
            x, y, z = turned(light.position)
            position = (x * scale, y * scale, z * scale)
        if light.shape:
            light = replace(light.resized(scale), towards=light.towards and turned(light.towards))
        return replace(light, position=position, spot=spot)

    points, faces = placed(mesh[0]), np.asarray(mesh[1], dtype=np.int64).reshape(-1, 3)
    aim = placed(np.asarray(eye, dtype=np.float64) + towards)[0]
    camera = Camera(vector(eye), (aim[0], aim[1], aim[2]), turned(up), math.degrees(2 * math.atan(half)))
    if height is not None:
        camera = replace(camera, height=height * scale)
    scene = Scene(
        "case", "Case", lambda: Geometry.static(points, faces), camera, tuple(lamp(x) for x in lights),
        closed=closed, alpha=alpha, mirror=mirror, bounces=bounces,
    )  # fmt: skip
    prepared = prepare(scene)
    return Trial(prepared, prepared.moment(0, *size), stated or Counts(), same_lights, watertight)


def spot_light(position: Vector, direction: Vector, angle: float, rise: float | None, up: Vector) -> Light:
    """A light limited to a spot (degrees)."""
    return Light(position, spot=Spot(direction, angle, rise, up))
