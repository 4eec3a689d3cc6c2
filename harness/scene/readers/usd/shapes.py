"""What one prim is made of at a time code: the triangles of a mesh, or of a tessellated sphere, cube ..."""

from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom

from ....arrays import I32
from ..checks import broken
from ..polygons import polygon_sizes, triangulate
from ..topology import Piece
from .gprims import SURFACES, surface


class Shape(Protocol):
    """The surface of a prim in its own space.

    times  the time codes of all samples that it depends on
    moves  whether it differs between times
    """

    times: set[float]
    moves: bool

    def at(self, time: float) -> Piece:
        """Its positions and triangles. While the topology stays, the array of triangles is the same object."""


def samples(attributes: list[Any]) -> set[float]:
    """The time codes of the samples of attributes."""
    return {time for attribute in attributes if attribute for time in attribute.GetTimeSamples()}


def array(attribute: Any, time: Any, kind: type, width: int = 0) -> NDArray:
    """The values of an array attribute, [n] or [n, width]; empty where it has none. Not to be written to."""
    value = attribute.Get(time) if attribute else None
    result = np.zeros(0, dtype=kind) if value is None else np.asarray(value)
    if result.dtype.kind != np.dtype(kind).kind:
        result = result.astype(kind)
    return result.reshape(-1, width) if width else result


class Polygons:
    """A mesh: its polygons cut into triangles, holes left out. A subdivision surface is its cage."""

    def __init__(self, path: Path, prim: Any) -> None:
        mesh = UsdGeom.Mesh(prim)
        self._path, self._mesh, self._name = path, mesh, str(prim.GetPath())
        self._topology = [mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr(), mesh.GetHoleIndicesAttr()]
        self._changes = any(attribute.ValueMightBeTimeVarying() for attribute in self._topology)
        points = mesh.GetPointsAttr()
        self.times = samples([points, *self._topology])
        self.moves = self._changes or points.ValueMightBeTimeVarying()
        self._polygons: list[NDArray] = []
        self._cut = np.zeros((0, 3), dtype=np.int32)

    def at(self, time: float) -> Piece:
        points = array(self._mesh.GetPointsAttr(), time, np.float32, 3)
        if self.moves and not len(points):  # no value at this time
            return points, np.zeros((0, 3), dtype=np.int32)
        if self._changes or not self._polygons:
            self._read_polygons(points, time)
        self._require_points(points)
        return points, self._cut

    def _read_polygons(self, points: NDArray, time: float) -> None:
        """Cut the polygons into triangles, unless they are those of the time before."""
        counts, corners, holes = own = [array(attribute, time, np.int32) for attribute in self._topology]
        if self._polygons and all(map(np.array_equal, own, self._polygons)):
            return
        polygon_sizes(self._path, counts, f"{self._name}: ")
        declared = int(counts.sum(dtype=np.int64))
        if declared != len(corners):
            problem = f"{self._name}: {declared} corners are declared, but there are {len(corners)}"
            raise broken(self._path, problem)
        self._polygons = own
        self._lowest, self._highest = (int(corners.min()), int(corners.max())) if declared else (0, -1)
        self._require_points(points)
        self._cut = triangulate(points, counts, corners)
        if len(holes):
            self._cut = self._cut[~np.isin(np.repeat(np.arange(len(counts)), counts - 2), holes)]

    def _require_points(self, points: NDArray) -> None:
        """Raise :class:`UserError` if a corner names no point."""
        if self._lowest < 0 or self._highest >= len(points):
            bad = self._lowest if self._lowest < 0 else self._highest
            raise broken(self._path, f"{self._name}: a face names vertex {bad}, but there are {len(points)}")


class Tessellated:
    """A sphere, cube, cone, cylinder, capsule or plane as triangles (:mod:`.gprims`)."""

    def __init__(self, prim: Any) -> None:
        self._kind = str(prim.GetTypeName())
        self._sizes = {name: prim.GetAttribute(name) for name in SURFACES[self._kind][1]}
        axis = prim.GetAttribute("axis")
        self._axis = str(axis.Get()) if axis else "Z"
        self.times = samples(list(self._sizes.values()))
        self.moves = any(attribute.ValueMightBeTimeVarying() for attribute in self._sizes.values())
        self._faces: I32 | None = None

    def at(self, time: float) -> Piece:
        sizes = {name: float(attribute.Get(time) or 0.0) for name, attribute in self._sizes.items()}
        points, faces = surface(self._kind, sizes, self._axis)
        self._faces = faces if self._faces is None else self._faces
        return points, self._faces
