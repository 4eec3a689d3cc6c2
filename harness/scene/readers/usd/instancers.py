"""PointInstancers: where each instance stands at a time code, and many placed shapes as one mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom

from ....arrays import F64, I64
from ..checks import broken
from ..topology import Piece
from .prims import samples, vary
from .shapes import Shape, array

MOST_INSTANCED = 1 << 25
"""Largest number of triangles including instances; through nested instancers a small file could have any number."""

MOST_INSTANCES = 1 << 22
"""Largest number of placed shapes of one instancer: each has a matrix of 128 bytes."""

_BLOCK = 1 << 18
"""Positions of instances that are transformed at a time."""

_IDENTITY = np.eye(4)


@dataclass(frozen=True, eq=False)
class Placed:
    """Shapes at places, in order.

    shapes    int64 [n], indices into the stage's list of shapes
    matrices  float64 [n, 4, 4], by which row vectors are multiplied from the left
    """

    shapes: I64
    matrices: F64

    @staticmethod
    def joined(parts: Sequence[Placed]) -> Placed:
        if len(parts) == 1:
            return parts[0]
        none = Placed(np.zeros(0, dtype=np.int64), np.zeros((0, 4, 4)))
        all_parts = [none, *parts]
        return Placed(np.concatenate([p.shapes for p in all_parts]), np.concatenate([p.matrices for p in all_parts]))


class Prototype(Protocol):
    """What an instancer draws many times: a subtree of the stage.

    times, moves  as of :class:`.shapes.Shape`
    """

    times: set[float]
    moves: bool

    def placed(self, time: float) -> Placed:
        """The shapes that it has at a time code."""


class Instancer:
    """The instances of a prim: those that are neither inactive nor invisible, in the order of their arrays.

    times, moves  as of :class:`.shapes.Shape`
    """

    def __init__(self, path: Path, prim: Any, prototypes: Sequence[Prototype], shapes: Sequence[Shape]) -> None:
        """``shapes``: those of the stage."""
        self._path, self._prototypes, self._shapes = path, prototypes, shapes
        own = self._prim = UsdGeom.PointInstancer(prim)
        self._lengths = [
            own.GetPositionsAttr(),
            own.GetOrientationsAttr(),
            prim.GetAttribute("orientationsf"),
            own.GetScalesAttr(),
            own.GetVelocitiesAttr(),
            own.GetAccelerationsAttr(),
            own.GetAngularVelocitiesAttr(),
            own.GetIdsAttr(),
        ]
        read = [*self._lengths, own.GetProtoIndicesAttr(), own.GetInvisibleIdsAttr()]
        self.times = samples(read).union(*(prototype.times for prototype in prototypes))
        self.moves = vary(read) or any(prototype.moves for prototype in prototypes)

    def placed(self, time: float) -> Placed:
        """The shapes of all instances, in the instancer's space.

        Raises :class:`UserError` if the arrays contradict each other or the instances have too many triangles.
        """
        which = array(self._prim.GetProtoIndicesAttr(), time, np.int64)
        if not len(which):
            return Placed.joined([])
        self._check(which, time)
        mask = np.array(self._prim.ComputeMaskAtTime(time), dtype=bool)
        chosen = np.flatnonzero(mask) if len(mask) else np.arange(len(which))
        which = which[chosen]
        how = UsdGeom.PointInstancer.ExcludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
        places = np.array(self._prim.ComputeInstanceTransformsAtTime(time, time, *how)).reshape(-1, 4, 4)[chosen]
        own = [prototype.placed(time) for prototype in self._prototypes]
        counts = np.array([len(p.shapes) for p in own])
        sizes = [
            sum(int(n) * len(self._shapes[shape].at(time)[1]) for shape, n in enumerate(np.bincount(p.shapes)) if n)
            for p in own
        ]
        for each, what, most in ((sizes, "triangles", MOST_INSTANCED), (counts, "meshes", MOST_INSTANCES)):
            total = int(np.bincount(which, minlength=len(own)) @ np.array(each, dtype=object))
            if total > most:
                problem = f"{self._prim.GetPath()}: {total} {what} with instances, more than {most}"
                raise broken(self._path, problem, "export a part of it")
        drawn = Placed.joined(own)
        instance = np.repeat(np.arange(len(which)), counts[which])
        first = (np.cumsum(counts) - counts)[which]
        within = np.arange(len(instance)) - np.repeat(np.cumsum(counts[which]) - counts[which], counts[which])
        index = first[instance] + within
        with np.errstate(over="ignore", invalid="ignore"):
            return Placed(drawn.shapes[index], drawn.matrices[index] @ places[instance])

    def _check(self, which: NDArray, time: float) -> None:
        """Raise :class:`UserError` for arrays of another length than ``which``, which the library would read beyond."""
        name = self._prim.GetPath()
        for attribute in self._lengths:
            value = attribute.Get(time) if attribute else None
            if value is None or (not len(value) and attribute.GetName() != "positions"):
                continue
            if len(value) != len(which):
                problem = f"{name}: {len(which)} instances, but {len(value)} {attribute.GetName()}"
                raise broken(self._path, problem)
        if self._prim.GetPositionsAttr().Get(time) is None:
            raise broken(self._path, f"{name}: {len(which)} instances have no positions")
        low, high = int(which.min()), int(which.max())
        if low < 0 or high >= len(self._prototypes):
            problem = f"{name}: an instance names prototype {high if low >= 0 else low}"
            raise broken(self._path, f"{problem}, but there are {len(self._prototypes)}")


def mesh_of(placed: Placed, shapes: Sequence[Shape], time: float) -> Piece:
    """All placed shapes as one mesh at a time code, in order, float64."""
    own = {kind: shapes[kind].at(time) for kind in np.unique(placed.shapes).tolist()}
    sizes = np.zeros((2, max(own, default=0) + 1), dtype=np.int64)
    for kind, (points, faces) in own.items():
        sizes[:, kind] = len(points), len(faces)
    counts = sizes[:, placed.shapes]
    starts = np.cumsum(counts, axis=1) - counts
    positions = np.empty((counts[0].sum(), 3))
    corners = np.empty((counts[1].sum(), 3), dtype=np.int32)
    for kind, (points, faces) in own.items():
        rows = np.flatnonzero(placed.shapes == kind)
        step = max(1, _BLOCK // max(1, len(points), len(faces)))
        for some in np.split(rows, range(step, len(rows), step)):
            to = starts[0, some, None] + np.arange(len(points))
            positions[to] = moved(points, placed.matrices[some])
            corners[starts[1, some, None] + np.arange(len(faces))] = faces + starts[0, some, None, None]
    return positions, corners


def moved(points: NDArray, matrix: F64) -> NDArray:
    """Positions [n, 3] after a matrix [4, 4], or [m, n, 3] after each of [m, 4, 4]; unchanged by one identity."""
    if matrix.ndim == 2 and (matrix == _IDENTITY).all():
        return points
    with np.errstate(over="ignore", invalid="ignore"):
        # USD multiplies row vectors by the matrix on their right.
        return points.astype(np.float64) @ matrix[..., :3, :3] + matrix[..., None, 3, :3]
