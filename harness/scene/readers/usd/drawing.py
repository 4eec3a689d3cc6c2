"""What a stage draws at a time code: its meshes, gprims and instancers, each as triangles in the space of the stage."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom, UsdLux, UsdSkel

from ..checks import broken
from ..topology import Piece
from .instancers import Instancer, Placed, mesh_of, moved
from .prims import IN_PROTOTYPE, Node, nodes_of, times_of
from .shapes import SIZES, Polygons, Shape, Skin, Skinned, Tessellated, array, bindings

MOST_NESTED = 32
"""Most PointInstancers within each other."""

_EMPTY = (UsdGeom.Xform, UsdGeom.Scope, UsdGeom.Camera, UsdSkel.Root, UsdSkel.Skeleton)


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
            piece = moved(points, part.place.matrix), faces
        else:
            piece = mesh_of(part.placed(time), self._library.shapes, time)
        part.still = None if part.moves else piece
        return piece

    def placed(self, time: float) -> Placed:
        """All its shapes at a time code, at their places."""
        if self._placed is None or self._placed[0] != time:
            self.at(time)
            self._placed = time, Placed.joined([part.placed(time) for part in self.parts if part.node.visible])
        return self._placed[1]
