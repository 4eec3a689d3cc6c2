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
from .gprims import SURFACES
from .instancers import Instancer, Placed, mesh_of, moved
from .prims import IN_PROTOTYPE, Node, Prims
from .shapes import Polygons, Shape, Tessellated, array
from .skins import Skin, Skinned, bindings

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
    _known: dict[tuple[str, str], int] = field(default_factory=dict)
    _last: dict[int, tuple[float, Piece]] = field(default_factory=dict)
    _prototypes: dict[tuple[str, str], Drawing] = field(default_factory=dict)
    _within: list[str] = field(default_factory=list)

    def shape(self, prim: Any, skin: Skin | None) -> int:
        """The index of the shape of a mesh or gprim, after its skin."""
        origin = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        is_mesh = prim.IsA(UsdGeom.Mesh)
        if is_mesh and str(UsdGeom.Mesh(origin).GetSubdivisionSchemeAttr().Get()) != "none":
            self.counts["cages"] += 1
        elif not is_mesh:
            self.counts["tessellated"] += 1
        opacity = UsdGeom.Gprim(origin).GetDisplayOpacityAttr()
        self.counts["opacities"] += bool((array(opacity, Usd.TimeCode.EarliestTime(), np.float32) < 1).any())
        key = str(origin.GetPath()), str(prim.GetPath()) if skin else ""
        if key not in self._known:
            shape: Shape = Polygons(self.path, origin) if is_mesh else Tessellated(origin)
            self._known[key] = len(self.shapes)
            self.shapes.append(Skinned(self.path, shape, skin) if skin else shape)
        return self._known[key]

    def at(self, shape: int, time: float) -> Piece:
        """A shape at a time code."""
        if shape not in self._last or (self.shapes[shape].moves and self._last[shape][0] != time):
            self._last[shape] = time, self.shapes[shape].at(time)
        return self._last[shape][1]

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
        return Instancer(self.path, prim, prototypes)

    def _prototype(self, prim: Any, purpose: str) -> Drawing:
        key = str(prim.GetPath()) if prim else "", purpose
        if key not in self._prototypes:
            roots = [prim] if prim and IN_PROTOTYPE(prim) else []
            self._prototypes[key] = Drawing(self, roots, IN_PROTOTYPE, purpose)
            self.counts["empty"] += not self._prototypes[key].parts
        return self._prototypes[key]


@dataclass(slots=True)
class Part:
    """Something drawn.

    node    its own, which says whether it is visible
    place   the node in whose space it is: its own, or that of the skeleton that bends it
    shape   of the library, or ``instancer``
    still   what it looks like, where that is the same at all times
    """

    node: int
    place: int
    shape: int = -1
    instancer: Instancer | None = None
    moves: bool = False
    still: Piece | None = None


class Drawing:
    """Some prims of a stage and all below them, as they are drawn at one time code after another.

    prims  those that have a place
    parts  what is drawn, in the order of the stage
    times  the time codes of all samples that it depends on
    moves  whether it differs between times
    """

    def __init__(self, library: Library, roots: list[Any], predicate: Any, purpose: str = "") -> None:
        self._library = library
        self.prims = Prims(library.path, roots, predicate, purpose, library.counts)
        self._skins: dict[str, Skin] = {}
        self._skeletons: dict[str, int] = {}
        for i, node in enumerate(self.prims.nodes):
            if node.prim.IsA(UsdSkel.Root):
                self._skins |= bindings(node.prim, predicate)
            elif node.prim.IsA(UsdSkel.Skeleton):
                self._skeletons[str(node.prim.GetPath())] = i
        found = [self._part(i, node) for i, node in enumerate(self.prims.nodes)]
        self.parts = [part for part in found if part is not None]
        self.times = self.prims.times(i for part in self.parts for i in (part.node, part.place))
        for part in self.parts:
            source = part.instancer or library.shapes[part.shape]
            part.moves = source.moves or any(self.prims.nodes[i].changes for i in (part.node, part.place))
            self.times |= source.times
        self.moves = any(part.moves for part in self.parts)
        self._placed: tuple[float, Placed] | None = None

    def _part(self, index: int, node: Node) -> Part | None:
        """What a prim draws; if that is nothing, it is counted where a reader would expect something."""
        prim, counts = node.prim, self._library.counts
        kind = str(prim.GetTypeName())
        is_shape = prim.IsA(UsdGeom.Mesh) or kind in SURFACES
        if not (is_shape or prim.IsA(UsdGeom.PointInstancer)):
            if node.drawn and (prim.IsA(UsdGeom.Boundable) or (kind and not prim.IsA(Usd.Typed))):
                silent = any(map(prim.IsA, _EMPTY)) or prim.HasAPI(UsdLux.LightAPI)
                self._library.left_out[kind] += not silent
            return None
        if not node.drawn:
            counts["invisible" if node.hidden else "unseen"] += 1
            return None
        if not is_shape:
            return Part(index, index, instancer=self._library.instancer(prim, node.purpose))
        skin = self._skins.get(str(prim.GetPath()))
        part = Part(index, index, self._library.shape(prim, skin))
        if skin is not None and skin.jointed:
            if skin.path not in self._skeletons:
                problem = f"{prim.GetPath()}: its skeleton {skin.path} is not drawn with it"
                raise broken(self._library.path, problem)
            part.place = self._skeletons[skin.path]
        return part

    def pieces(self, time: float) -> Iterator[Piece | None]:
        """Each part at a time code; None where it is invisible or has no triangles."""
        self.prims.at(time)
        for part in self.parts:
            yield self._piece(part, time)

    def _piece(self, part: Part, time: float) -> Piece | None:
        if not self.prims.visible(part.node):
            return None
        if part.still is not None:
            piece = part.still
        elif part.instancer is not None:
            piece = mesh_of(self._place(part, time), lambda shape: self._library.at(shape, time))
        else:
            points, faces = self._library.at(part.shape, time)
            piece = moved(points, self.prims.matrix(part.place)), faces
        if not part.moves:
            part.still = piece
        return piece if len(piece[1]) else None

    def placed(self, time: float) -> Placed:
        """All its shapes at a time code, at their places."""
        if self._placed is None or self._placed[0] != time:
            self.prims.at(time)
            there = [part for part in self.parts if self.prims.visible(part.node)]
            self._placed = time, Placed.joined([self._place(part, time) for part in there])
        return self._placed[1]

    def _place(self, part: Part, time: float) -> Placed:
        matrix = self.prims.matrix(part.place)[None]
        if part.instancer is None:
            return Placed(np.array([part.shape]), matrix)
        own = part.instancer.placed(time, lambda shape: len(self._library.at(shape, time)[1]))
        with np.errstate(over="ignore", invalid="ignore"):
            return Placed(own.shapes, own.matrices @ matrix)
