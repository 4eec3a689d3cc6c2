"""What a stage draws at a time code: its meshes, gprims and instancers, each as triangles in the space of the stage."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdLux, UsdSkel

from ....arrays import F64, I64
from ..checks import broken
from ..polygons import Piece
from .prims import IN_PROTOTYPE, Node, nodes_of, samples, times_of, vary
from .shapes import SIZES, Polygons, Shape, Skin, Skinned, Tessellated, array, bindings

MOST_NESTED = 32  # most PointInstancers within each other
MOST_INSTANCED = 1 << 25  # triangles, with those of instances: nested instancers of a small file could have any number
MOST_INSTANCES = 1 << 22  # largest number of placed shapes of one instancer: each has a matrix of 128 bytes
_BLOCK = 1 << 18  # positions of instances that are transformed at a time

_OF_INSTANCES = (  # the attributes of a PointInstancer that have a value for each instance
    "positions", "orientations", "orientationsf", "scales", "velocities", "accelerations", "angularVelocities", "ids",
)  # fmt: skip

_IDENTITY = np.eye(4)

_EMPTY = (UsdGeom.Xform, UsdGeom.Scope, UsdGeom.Camera, UsdSkel.Root, UsdSkel.Skeleton)


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


@dataclass
class Library:
    """What the drawings of one stage share: shapes and prototypes, each made once, and what was found on the way.

    shapes    a prim of an instance shares the shape of its prototype
    counts    how many prims there were of what is noted
    left_out  how many prims there were of each type that is not drawn
    """

    path: Path
    shapes: list[Shape] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    left_out: Counter[str] = field(default_factory=Counter)
    _known: dict[tuple[str, str], Shape] = field(default_factory=dict)
    _prototypes: dict[tuple[str, str], Drawing] = field(default_factory=dict)
    _within: list[str] = field(default_factory=list)

    def shape(self, prim: Any, skin: Skin | None) -> Shape:
        """The shape of a mesh or gprim, after its skin."""
        origin = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        is_mesh = prim.IsA(UsdGeom.Mesh)
        self.counts["tessellated"] += not is_mesh
        self.counts["cages"] += is_mesh and str(UsdGeom.Mesh(origin).GetSubdivisionSchemeAttr().Get()) != "none"
        opacity = UsdGeom.Gprim(origin).GetDisplayOpacityAttr()
        self.counts["opacities"] += bool((array(opacity, Usd.TimeCode.EarliestTime(), np.float32) < 1).any())
        key = str(origin.GetPath()), str(prim.GetPath()) if skin else ""
        if key not in self._known:
            rest: Shape = Polygons(self.path, origin) if is_mesh else Tessellated(origin)
            made = self._known[key] = Skinned(self.path, rest, skin) if skin else rest
            made.number = len(self.shapes)
            self.shapes.append(made)
        return self._known[key]

    def instancer(self, prim: Any, purpose: str) -> Instancer:
        """The instancer of a prim. Raises :class:`UserError` where it instances itself or is nested too deep."""
        name = str(prim.GetPath())
        if name in self._within or len(self._within) == MOST_NESTED:
            problem = "instances itself" if name in self._within else f"lies within {MOST_NESTED} instancers"
            raise broken(self.path, f"{name}: {problem}")
        self._within.append(name)
        targets = UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets()
        prototypes = [self._prototype(prim.GetStage().GetPrimAtPath(target), purpose) for target in targets]
        self._within.pop()
        return Instancer(self.path, prim, prototypes, self.shapes)

    def _prototype(self, prim: Any, purpose: str) -> Drawing:
        key = str(prim.GetPath()) if prim else "", purpose
        if key not in self._prototypes:
            roots = [prim] if prim and IN_PROTOTYPE(prim) else []
            self._prototypes[key] = Drawing(self, roots, IN_PROTOTYPE, purpose)
            self.counts["empty"] += not self._prototypes[key].parts
        return self._prototypes[key]


class Instancer:
    """The instances of a prim: those that are neither inactive nor invisible, in the order of their arrays.

    times, moves  as of :class:`.shapes.Shape`
    """

    def __init__(self, path: Path, prim: Any, prototypes: Sequence[Drawing], shapes: Sequence[Shape]) -> None:
        """``shapes``: those of the stage."""
        self._path, self._prototypes, self._shapes = path, prototypes, shapes
        own = self._prim = UsdGeom.PointInstancer(prim)
        self._lengths = [prim.GetAttribute(name) for name in _OF_INSTANCES]
        read = [*self._lengths, own.GetProtoIndicesAttr(), own.GetInvisibleIdsAttr()]
        self.times = samples(read).union(*(prototype.times for prototype in prototypes))
        self.moves = vary(read) or any(prototype.moves for prototype in prototypes)

    def placed(self, time: float) -> Placed:
        """The shapes of all instances, in the instancer's space. Raises :class:`UserError` for arrays that disagree."""
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


@dataclass(slots=True, eq=False)
class Part:
    """Something drawn.

    node    its own, which says whether it is visible
    place   the node in whose space it is: its own, or that of the skeleton that bends it
    still   what it looks like, where that is the same at all times
    """

    node: Node
    place: Node
    source: Shape | Instancer
    still: Piece | None = None

    @property
    def moves(self) -> bool:
        return self.source.moves or self.node.changes or self.place.changes

    def placed(self, time: float) -> Placed:
        matrix = self.place.matrix[None]
        if isinstance(self.source, Shape):
            return Placed(np.array([self.source.number]), matrix)
        own = self.source.placed(time)
        with np.errstate(over="ignore", invalid="ignore"):
            return Placed(own.shapes, own.matrices @ matrix)


class Drawing:
    """Some prims of a stage and all below them, as they are drawn at one time code after another.

    nodes  of the prims that have a place
    parts  what is drawn, in the order of the stage
    times  the time codes of all samples that it depends on
    moves  whether it differs between times
    """

    def __init__(self, library: Library, roots: list[Any], predicate: Any, purpose: str = "") -> None:
        self._library = library
        self._time: float | None = None
        self._placed: tuple[float, Placed] | None = None
        self.nodes = nodes_of(library.path, roots, predicate, purpose, library.counts)
        self._skins: dict[str, Skin] = {}
        self._skeletons: dict[str, Node] = {}
        for node in self.nodes:
            if node.prim.IsA(UsdSkel.Root):
                self._skins |= bindings(node.prim, predicate)
            elif node.prim.IsA(UsdSkel.Skeleton):
                self._skeletons[str(node.prim.GetPath())] = node
        self.parts = [part for part in map(self._part, self.nodes) if part is not None]
        self.times = times_of(node for part in self.parts for node in (part.node, part.place))
        self.times = self.times.union(*(part.source.times for part in self.parts))
        self.moves = any(part.moves for part in self.parts)

    def _part(self, node: Node) -> Part | None:
        """What a prim draws; if that is nothing, it is counted where a reader would expect something."""
        prim, counts = node.prim, self._library.counts
        kind = str(prim.GetTypeName())
        is_shape = prim.IsA(UsdGeom.Mesh) or kind in SIZES
        if not (is_shape or prim.IsA(UsdGeom.PointInstancer)):
            if node.drawn and (prim.IsA(UsdGeom.Boundable) or (kind and not prim.IsA(Usd.Typed))):
                silent = any(map(prim.IsA, _EMPTY)) or prim.HasAPI(UsdLux.LightAPI)
                self._library.left_out[kind] += not silent
            return None
        if not node.drawn:
            counts["invisible" if node.hidden else "unseen"] += 1
            return None
        if not is_shape:
            return Part(node, node, self._library.instancer(prim, node.purpose))
        skin = self._skins.get(str(prim.GetPath()))
        shape = self._library.shape(prim, skin)
        if skin is None or not skin.jointed:
            return Part(node, node, shape)
        if skin.path not in self._skeletons:
            problem = f"{prim.GetPath()}: its skeleton {skin.path} is not drawn with it"
            raise broken(self._library.path, problem)
        return Part(node, self._skeletons[skin.path], shape)

    def at(self, time: float) -> None:
        """Find the places of its nodes at a time code."""
        for node in self.nodes if time != self._time else ():
            if self._time is None or node.changes:
                node.at(time)
        self._time = time

    def pieces(self, time: float) -> Iterator[Piece | None]:
        """Each part at a time code; None where it is invisible or has no triangles."""
        self.at(time)
        for part in self.parts:
            piece = self._piece(part, time) if part.node.visible else None
            yield piece if piece and len(piece[1]) else None

    def _piece(self, part: Part, time: float) -> Piece:
        if part.still is not None:
            return part.still
        if isinstance(part.source, Shape):
            points, faces = part.source.at(time)
            piece = _moved(points, part.place.matrix), faces
        else:
            piece = _mesh_of(part.placed(time), self._library.shapes, time)
        part.still = None if part.moves else piece
        return piece

    def placed(self, time: float) -> Placed:
        """All its shapes at a time code, at their places."""
        if self._placed is None or self._placed[0] != time:
            self.at(time)
            self._placed = time, Placed.joined([part.placed(time) for part in self.parts if part.node.visible])
        return self._placed[1]


def _mesh_of(placed: Placed, shapes: Sequence[Shape], time: float) -> Piece:
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
            positions[to] = _moved(points, placed.matrices[some])
            corners[starts[1, some, None] + np.arange(len(faces))] = faces + starts[0, some, None, None]
    return positions, corners


def _moved(points: NDArray, matrix: F64) -> NDArray:
    """Positions [n, 3] after a matrix [4, 4], or [m, n, 3] after each of [m, 4, 4]; unchanged by one identity."""
    if matrix.ndim == 2 and (matrix == _IDENTITY).all():
        return points
    with np.errstate(over="ignore", invalid="ignore"):
        # USD multiplies row vectors by the matrix on their right.
        return points.astype(np.float64) @ matrix[..., :3, :3] + matrix[..., None, 3, :3]
