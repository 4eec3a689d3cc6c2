"""The prims of a stage that have a place, and the transform and visibility that they inherit at a time code.

These are the rules of usdview: prims that are inactive or abstract, or only an ``over``, are not there; below a prim of a
type without a place, such as a material, nothing is drawn; visibility and purpose are inherited.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdShade

from ....arrays import F64
from ..checks import broken
from .shapes import samples

MOST_PRIMS = 1 << 20
"""Largest number of prims, those of instances included."""

DRAWN = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
IN_PROTOTYPE = Usd.TraverseInstanceProxies(
    Usd.PrimIsActive & Usd.PrimHasDefiningSpecifier & Usd.PrimIsLoaded & ~Usd.PrimIsAbstract
)
"""A prototype may lie below an ``over``, which keeps it from being drawn where it stands."""

_IDENTITY = Gf.Matrix4d(1.0)


@dataclass(slots=True)
class Node:
    """A prim and what it inherits.

    parent     index of its parent's node, -1 at the top
    purpose    authored on it or on the nearest prim above; "": none
    hidden     it is invisible at all times
    transform  its UsdGeom.Xformable, or None
    apart      it does not inherit its parent's transform
    shows      its visibility attribute, where that has values
    changes    whether its place or visibility differs between times
    """

    prim: Any
    parent: int
    purpose: str
    hidden: bool
    transform: Any
    apart: bool
    shows: Any
    changes: bool

    @property
    def drawn(self) -> bool:
        """Whether it is drawn at any time."""
        return not self.hidden and self.purpose not in ("guide", "proxy")


def _see_through(material: Any) -> bool:
    """Whether the opacity of a material's surface is a texture, or a number other than 1."""
    shader = material.ComputeSurfaceSource()[0]
    opacity = shader.GetInput("opacity") if shader else None
    sources = opacity.GetValueProducingAttributes() if opacity else ()
    output = UsdShade.AttributeType.Output
    return any(UsdShade.Utils.GetType(one.GetName()) == output or one.Get() not in (None, 1) for one in sources)


class Prims:
    """Prims and all below them, depth first, in the order of the stage.

    nodes   every prim that has a place; nothing below a PointInstancer
    """

    def __init__(self, path: Path, roots: Sequence[Any], predicate: Any, purpose: str, counts: Counter[str]) -> None:
        """``purpose``: what the roots inherit. ``counts``: how many prims there were is added to it."""
        self.nodes: list[Node] = []
        waiting = [(root, -1) for root in reversed(roots)]
        while waiting:
            prim, parent = waiting.pop()
            counts["prims"] += 1
            if counts["prims"] > MOST_PRIMS:
                problem = f"has more than {MOST_PRIMS} prims with instances"
                raise broken(path, problem, "export a part of it")
            if prim.IsA(Usd.Typed) and not prim.IsA(UsdGeom.Imageable):
                if prim.IsA(UsdShade.Material):
                    counts["materials"] += 1
                    counts["opacities"] += _see_through(UsdShade.Material(prim))
                continue
            if prim.HasAPI(UsdGeom.ModelAPI):
                mode = UsdGeom.ModelAPI(prim).GetModelDrawModeAttr().Get()
                counts["draw modes"] += mode not in (None, "inherited", "default")
            self.nodes.append(self._node(prim, parent, purpose))
            if not prim.IsA(UsdGeom.PointInstancer):
                here = len(self.nodes) - 1
                waiting += [(child, here) for child in reversed(prim.GetFilteredChildren(predicate))]
        self._matrices: list[Any] = [_IDENTITY] * len(self.nodes)
        self._visible = [True] * len(self.nodes)
        self._time: float | None = None

    def _node(self, prim: Any, parent: int, purpose: str) -> Node:
        above = self.nodes[parent] if parent >= 0 else None
        purpose = above.purpose if above else purpose
        transform = UsdGeom.Xformable(prim) if prim.IsA(UsdGeom.Xformable) else None
        shows = None
        if prim.IsA(UsdGeom.Imageable):
            imageable = UsdGeom.Imageable(prim)
            if imageable.GetVisibilityAttr().HasAuthoredValue():
                shows = imageable.GetVisibilityAttr()
            if imageable.GetPurposeAttr().HasAuthoredValue():
                purpose = str(imageable.GetPurposeAttr().Get())
        turns = transform is not None and transform.TransformMightBeTimeVarying()
        blinks = shows is not None and shows.ValueMightBeTimeVarying()
        invisible = shows is not None and not blinks and shows.Get(Usd.TimeCode.EarliestTime()) == "invisible"
        return Node(
            prim,
            parent,
            purpose,
            invisible or (above is not None and above.hidden),
            transform,
            transform is not None and transform.GetResetXformStack(),
            shows,
            turns or blinks or (above is not None and above.changes),
        )

    def times(self, indices: Iterable[int]) -> set[float]:
        """The time codes of all samples that the places and visibility of some nodes depend on."""
        found: set[float] = set()
        seen = {-1}
        for index in indices:
            while index not in seen:
                seen.add(index)
                node = self.nodes[index]
                found |= samples([node.shows])
                found.update(node.transform.GetTimeSamples() if node.transform else ())
                index = node.parent
        return found

    def at(self, time: float) -> None:
        """Find the places at a time code, for :meth:`matrix` and :meth:`visible`."""
        if time == self._time:
            return
        for i, node in enumerate(self.nodes):
            if self._time is not None and not node.changes:
                continue
            above, shown = _IDENTITY, True
            if node.parent >= 0:
                above, shown = self._matrices[node.parent], self._visible[node.parent]
            if node.apart:
                above = _IDENTITY
            self._matrices[i] = above
            if node.transform is not None:
                self._matrices[i] = node.transform.GetLocalTransformation(time) * above
            self._visible[i] = shown and (node.shows is None or node.shows.Get(time) != "invisible")
        self._time = time

    def matrix(self, index: int) -> F64:
        """The transform of a node to the space of the roots, float64 [4, 4]; row vectors are multiplied by it."""
        return np.array(self._matrices[index])

    def visible(self, index: int) -> bool:
        """Whether a node and all above it are visible."""
        return self._visible[index]
