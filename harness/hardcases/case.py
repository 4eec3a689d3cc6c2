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
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from ..arrays import F64
from ..scene.light_paths import vector
from ..scene.moment import Moment
from ..scene.prepared import Prepared, prepare
from ..scene.scene import Camera, Geometry, Light, Scene, Spot, Vector
from .shapes import Mesh, Point

ORIGIN = (0.0, 0.0, 0.0)

BESIDE = (0.3, 1.7, 3.1), (-0.1, -0.45, -1.0), 0.5
"""Eye, direction and half height of the picture that shows :func:`.shapes.ball_on_floor`."""

LAMPS = np.array([(1.0, 2.5, 0.5), (-0.4, 0.1, 0.7)])  # lights above and beside it

EXCUSABLE = 0.02
"""Largest share of the rays of a case whose answers may be excused because an edge is near. Many cases aim rays at edges.
With a triangle test that is exact, or that decides uncertain cases in float64, the share is at most 0.014.
"""


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


CASES: dict[str, list[HardCase]] = {}  # the cases by the module of their builders, in the order of their registration

Rows = Sequence[dict[str, Any]]


def rows(names: str, *values: Any) -> Rows:
    """Named values of several cases, a tuple for each: ``rows("seed turn", (5, 0), (6, 1))``; of one name bare values."""
    keys = names.split()
    return [dict(zip(keys, row if len(keys) > 1 else (row,), strict=True)) for row in values]


def axes(ends: str = " yz") -> Rows:
    """The axes as they are, permuted once and twice (``turn``); ``axis``: for the name of the case."""
    return [{"turn": turn, "axis": end.strip()} for turn, end in enumerate(ends)]


TURNED = rows("end turn scale", ("", 0, 1.0), (" y small", 1, 2.0**-30), (" z large", 2, 2.0**40))


PLACE = ("turn", "scale", "offset")  # the parameters of `view` that say where a case lies


def hard(
    name: str, title: str, breaks: str, *tables: Rows, refused: bool = False, excusable: float = EXCUSABLE,
    large: bool = False, **given: Any,
) -> Callable[[Callable[..., Trial]], Callable[..., Trial]]:  # fmt: skip
    """Register what a builder makes as a :class:`HardCase`: one for each combination of the rows of ``tables``. The
    texts name values in braces. The builder gets those of ``given`` and of the rows that are its parameters; if it has
    ``**place``, those of :data:`PLACE`, too.
    """

    def register(build: Callable[..., Trial]) -> Callable[..., Trial]:
        taken = {*inspect.signature(build).parameters}
        taken |= {*PLACE} if "place" in taken else set()
        own = CASES.setdefault(build.__module__.rpartition(".")[2], [])
        for parts in itertools.product(*tables):
            values = given | {key: value for part in parts for key, value in part.items()}
            make = partial(build, **{key: value for key, value in values.items() if key in taken})
            called, what, provoked = (text.format(**values) for text in (name, title, breaks))
            own.append(HardCase(called, what, provoked, make, refused, excusable, large))
        return build

    return register


def view(
    mesh: Mesh, lights: Iterable[Point | Light], eye: Point, towards: Point, half: float = 1.0,
    size: tuple[int, int] = (16, 16), up: Point | None = None, turn: int = 0, scale: float = 1.0,
    offset: Point | float = 0.0, height: float | None = None, stated: Counts | None = None,
    same_lights: tuple[tuple[int, int], ...] = (), watertight: bool = False, **fields: Any,
) -> Trial:  # fmt: skip
    """A trial from plain numbers.

    towards  direction of the view (not a point);  half: half height of the image plane at distance 1
    turn     number of times that the coordinates are permuted (x, y, z -> z, x, y), which moves seams and poles
    scale, offset  applied to mesh, eye and lights after the permutation, in float64; the offset is scaled, too
    height   of an orthographic camera, what it shows from bottom to top; ``half`` is then not used
    fields   further fields of the scene, such as ``closed``, ``alpha``, ``mirror``
    """
    towards = np.asarray(towards, dtype=np.float64)
    if up is None:
        up = (0.0, 1.0, 0.0) if abs(towards[1]) <= 0.9 * np.linalg.norm(towards) else (0.0, 0.0, 1.0)

    def turned(places: Any) -> F64:
        return np.roll(np.asarray(places, dtype=np.float64), turn, axis=-1)

    def placed(points: Any) -> F64:
        return turned(points) * scale + np.multiply(offset, scale)

    def lamp(light: Point | Light) -> Light:
        if not isinstance(light, Light):
            return Light(vector(placed(light)))
        position, spot, facing = light.position, light.spot, light.towards
        return replace(
            light.resized(scale),
            position=vector(turned(position) * scale if light.directional else placed(position)),
            spot=spot and replace(spot, direction=vector(turned(spot.direction)), up=vector(turned(spot.up))),
            towards=facing and vector(turned(facing)),
        )

    points, faces = placed(np.reshape(mesh[0], (-1, 3))), np.asarray(mesh[1], dtype=np.int64).reshape(-1, 3)
    target = placed(np.asarray(eye, dtype=np.float64) + towards)
    fov = math.degrees(2 * math.atan(half))
    camera = Camera(vector(placed(eye)), vector(target), vector(turned(up)), fov, height and height * scale)
    scene = Scene("case", "Case", lambda: Geometry.static(points, faces), camera, tuple(map(lamp, lights)), **fields)
    prepared = prepare(scene)
    return Trial(prepared, prepared.moment(0, *size), stated or Counts(), same_lights, watertight)


def played(trial: Trial, frames: Sequence[F64], last: int) -> Trial:
    """The trial whose mesh has the positions ``frames``, one after another; what is judged is frame ``last``."""
    geometry = Geometry(trial.prepared.geometry.faces, lambda k: frames[k], len(frames))
    prepared = prepare(replace(trial.prepared.scene, geometry=lambda: geometry))
    *before, moment = (prepared.moment(k, trial.moment.width, trial.moment.height) for k in range(last + 1))
    return replace(trial, prepared=prepared, moment=moment, before=tuple(before))


def spot_light(position: Vector, direction: Vector, angle: float, rise: float | None, up: Vector) -> Light:
    """A light limited to a spot (degrees)."""
    return Light(position, spot=Spot(direction, angle, rise, up))
