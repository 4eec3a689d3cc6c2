"""The prims of a stage that have a place, and the transform and visibility that they inherit at a time code. These are
the rules of usdview: prims that are inactive or abstract, or only an ``over``, are not there; below a prim of a type
without a place, such as a material, nothing is drawn; visibility and purpose are inherited.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdShade

from ....arrays import F64
from ..checks import broken

MOST_PRIMS = 1 << 20  # largest number of prims, those of instances included

DRAWN = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
IN_PROTOTYPE = Usd.TraverseInstanceProxies(
    Usd.PrimIsActive & Usd.PrimHasDefiningSpecifier & Usd.PrimIsLoaded & ~Usd.PrimIsAbstract
)
"""A prototype may lie below an ``over``, which keeps it from being drawn where it stands."""

_IDENTITY = Gf.Matrix4d(1.0)


class Node:
    """A prim, what it inherits, and where it is at the time code of the last :meth:`at`.

    above    the node of its parent, or None
    purpose  authored on it or on the nearest prim above; "": none
    hidden   it is invisible at all times
    changes  whether its place or visibility differs between times
    visible  whether it and all above it are visible
    """

    def __init__(self, prim: Any, above: Node | None, purpose: str) -> None:
        """``purpose``: what a node inherits that has none above."""
        self.prim, self.above = prim, above
        self.purpose: str = above.purpose if above else purpose
        self._transform = UsdGeom.Xformable(prim) if prim.IsA(UsdGeom.Xformable) else None
        self._apart = self._transform is not None and self._transform.GetResetXformStack()
        self._shows: Any = None
        if prim.IsA(UsdGeom.Imageable):
            imageable = UsdGeom.Imageable(prim)
            if imageable.GetVisibilityAttr().HasAuthoredValue():
                self._shows = imageable.GetVisibilityAttr()
            if imageable.GetPurposeAttr().HasAuthoredValue():
                self.purpose = str(imageable.GetPurposeAttr().Get())
        turns = self._transform is not None and self._transform.TransformMightBeTimeVarying()
        blinks = self._shows is not None and self._shows.ValueMightBeTimeVarying()
        invisible = not blinks and self._invisible(Usd.TimeCode.EarliestTime())
        self.hidden: bool = invisible or (above is not None and above.hidden)
        self.changes: bool = turns or blinks or (above is not None and above.changes)
        self._matrix, self.visible = _IDENTITY, True

    def _invisible(self, time: Any) -> bool:
        return self._shows is not None and self._shows.Get(time) == "invisible"

    @property
    def drawn(self) -> bool:
        """Whether it is drawn at any time."""
        return not self.hidden and self.purpose not in ("guide", "proxy")

    @property
    def matrix(self) -> F64:
        """The transform to the space of the roots, float64 [4, 4]; row vectors are multiplied by it."""
        return np.array(self._matrix)

    def at(self, time: float) -> None:
        """Find its place at a time code, after that of the node above."""
        self._matrix = _IDENTITY if self.above is None or self._apart else self.above._matrix
        if self._transform is not None:
            self._matrix = self._transform.GetLocalTransformation(time) * self._matrix
        self.visible = (self.above is None or self.above.visible) and not self._invisible(time)

    def times(self) -> set[float]:
        """The time codes of all samples of its own transform and visibility."""
        moves = set(self._transform.GetTimeSamples() if self._transform else ())
        return moves | samples([self._shows])


def nodes_of(path: Path, roots: Sequence[Any], predicate: Any, purpose: str, counts: Counter[str]) -> list[Node]:
    """Prims and all below them that have a place, depth first, in the order of the stage; nothing below a
    PointInstancer. ``purpose``: what the roots inherit. ``counts``: how many prims there were is added to it.
    """
    nodes: list[Node] = []
    waiting: list[tuple[Any, Node | None]] = [(root, None) for root in reversed(roots)]
    while waiting:
        prim, above = waiting.pop()
        counts["prims"] += 1
        if counts["prims"] > MOST_PRIMS:
            raise broken(path, f"has more than {MOST_PRIMS} prims with instances", "export a part of it")
        if prim.IsA(Usd.Typed) and not prim.IsA(UsdGeom.Imageable):
            if prim.IsA(UsdShade.Material):
                counts["materials"] += 1
                counts["opacities"] += _see_through(UsdShade.Material(prim))
            continue
        if prim.HasAPI(UsdGeom.ModelAPI):
            mode = UsdGeom.ModelAPI(prim).GetModelDrawModeAttr().Get()
            counts["draw modes"] += mode not in (None, "inherited", "default")
        nodes.append(Node(prim, above, purpose))
        if not prim.IsA(UsdGeom.PointInstancer):
            waiting += [(child, nodes[-1]) for child in reversed(prim.GetFilteredChildren(predicate))]
    return nodes


def times_of(nodes: Iterable[Node]) -> set[float]:
    """The time codes of all samples that the places and visibility of some nodes depend on."""
    found: set[float] = set()
    seen: set[Node | None] = {None}
    for node in nodes:
        at: Node | None = node
        while at is not None and at not in seen:
            seen.add(at)
            found |= at.times()
            at = at.above
    return found


def samples(attributes: Iterable[Any]) -> set[float]:
    """The time codes of the samples of attributes, which may be absent."""
    return {time for attribute in attributes if attribute for time in attribute.GetTimeSamples()}


def vary(attributes: Iterable[Any]) -> bool:
    """Whether one of some attributes, which may be absent, may differ between times."""
    return any(attribute and attribute.ValueMightBeTimeVarying() for attribute in attributes)


def _see_through(material: Any) -> bool:
    """Whether the opacity of a material's surface is a texture, or a number other than 1."""
    shader = material.ComputeSurfaceSource()[0]
    opacity = shader.GetInput("opacity") if shader else None
    sources = opacity.GetValueProducingAttributes() if opacity else ()
    output = UsdShade.AttributeType.Output
    return any(UsdShade.Utils.GetType(one.GetName()) == output or one.Get() not in (None, 1) for one in sources)
