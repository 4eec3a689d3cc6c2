"""Meshes that a skeleton bends, and blend shapes: their positions at a time code, as the library UsdSkel computes them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pxr import UsdSkel, Vt

from ..checks import broken
from ..topology import Piece
from .shapes import Shape, samples


@dataclass(frozen=True, eq=False)
class Skin:
    """The library's queries of a skeleton and of a prim that it bends, and the path of the skeleton."""

    skeleton: Any
    query: Any
    path: str

    @property
    def jointed(self) -> bool:
        """Whether joints bend it; otherwise only blend shapes do."""
        return self.query.HasJointInfluences()


def bindings(root: Any, predicate: Any) -> dict[str, Skin]:
    """The skins below a SkelRoot, by the path of the prim."""
    cache = UsdSkel.Cache()
    cache.Populate(UsdSkel.Root(root), predicate)
    return {
        str(query.GetPrim().GetPath()): Skin(
            cache.GetSkelQuery(found.GetSkeleton()), query, str(found.GetSkeleton().GetPath())
        )
        for found in cache.ComputeSkelBindings(UsdSkel.Root(root), predicate)
        for query in found.GetSkinningTargets()
    }


class Skinned:
    """A shape after its blend shapes, then its joints. If it has joints, its positions are in the skeleton's space."""

    def __init__(self, path: Path, rest: Shape, skin: Skin) -> None:
        self._path, self._rest, self._skin, self._query = path, rest, skin, skin.query
        own = [
            skin.query.GetJointIndicesPrimvar().GetAttr(),
            skin.query.GetJointWeightsPrimvar().GetAttr(),
            skin.query.GetGeomBindTransformAttr(),
        ]
        self.times = rest.times | samples(own)
        self.moves = rest.moves or any(a and a.ValueMightBeTimeVarying() for a in own)
        self._motion = skin.skeleton.GetAnimQuery()
        if self._motion:
            self.times |= {*self._motion.GetJointTransformTimeSamples()}
            self.times |= {*self._motion.GetBlendShapeWeightTimeSamples()}
            self.moves |= self._motion.JointTransformsMightBeTimeVarying()
            self.moves |= self._motion.BlendShapeWeightsMightBeTimeVarying()
        self._blends = (
            UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(skin.query.GetPrim())) if skin.query.HasBlendShapes() else None
        )
        if self._blends:
            self._indices = self._blends.ComputeBlendShapePointIndices()
            self._offsets = self._blends.ComputeSubShapePointOffsets()

    def at(self, time: float) -> Piece:
        points, faces = self._rest.at(time)
        if not len(faces):
            return points, faces
        bent = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, dtype=np.float32))
        fits = self._blend(bent, time)
        if fits and self._skin.jointed:
            joints = self._skin.skeleton.ComputeSkinningTransforms(time)
            fits = self._query.ComputeSkinnedPoints(joints, bent, time)
        if not fits:
            problem = f"{self._query.GetPrim().GetPath()}: its skin contradicts its points or its skeleton"
            raise broken(self._path, problem)
        return np.array(bent), faces

    def _blend(self, points: Any, time: float) -> bool:
        """Add the blend shapes to ``points``. False if they contradict each other."""
        if not self._blends or not self._motion:
            return True
        weights = self._motion.ComputeBlendShapeWeights(time)
        own = self._query.GetBlendShapeMapper().Remap(weights) if weights else None
        if own is None:
            return True
        shares = self._blends.ComputeSubShapeWeights(own)
        return self._blends.ComputeDeformedPoints(*shares, self._indices, self._offsets, points)
