"""What one prim is made of at a time code: the triangles of a mesh, of a sphere, cube ..., and of what a skeleton bends."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom, UsdSkel, Vt

from ....arrays import F64, I32
from ...standins.shapes import box, grid, lathe
from ..checks import broken
from ..polygons import Piece, polygon_sizes, triangulate
from .prims import samples, vary

AROUND, POLE_TO_POLE = 32, 16  # segments of a circle, and from pole to pole; multiples of 4 keep a shape's bounds

RESOLUTION = f"{AROUND} segments around, {POLE_TO_POLE} from pole to pole"

SIZES = {  # for each type of prim that is tessellated the attributes that give its sizes
    "Sphere": ("radius",), "Cube": ("size",), "Cone": ("radius", "height"), "Cylinder": ("radius", "height"),
    "Cylinder_1": ("radiusTop", "radiusBottom", "height"), "Capsule": ("radius", "height"),
    "Capsule_1": ("radiusTop", "radiusBottom", "height"), "Plane": ("width", "length"),
}  # fmt: skip

_POLE = np.pi / 2


def array(attribute: Any, time: Any, kind: type, width: int = 0) -> NDArray:
    """The values of an array attribute, [n] or [n, width]; empty where it has none. Not to be written to."""
    value = attribute.Get(time) if attribute else None
    result = np.zeros(0, dtype=kind) if value is None else np.asarray(value)
    if result.dtype.kind != np.dtype(kind).kind:
        result = result.astype(kind)
    return result.reshape(-1, width) if width else result


class Shape:
    """The surface of a prim in its own space.

    times   the time codes of all samples that it depends on
    moves   whether it differs between times
    number  where it stands in the list of all shapes
    """

    number = -1

    def __init__(self, attributes: Sequence[Any]) -> None:
        self.times = samples(attributes)
        self.moves = vary(attributes)
        self._last: tuple[float, Piece] | None = None

    def at(self, time: float) -> Piece:
        """Its positions and triangles. While the topology stays, the array of triangles is the same object."""
        if self._last is None or (self.moves and self._last[0] != time):
            self._last = time, self._read(time)
        return self._last[1]

    def _read(self, time: float) -> Piece:
        raise NotImplementedError


class Polygons(Shape):
    """A mesh: its polygons cut into triangles, holes left out. A subdivision surface is its cage."""

    def __init__(self, path: Path, prim: Any) -> None:
        mesh = UsdGeom.Mesh(prim)
        self._path, self._name, self._points = path, str(prim.GetPath()), mesh.GetPointsAttr()
        self._topology = [mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr(), mesh.GetHoleIndicesAttr()]
        super().__init__([self._points, *self._topology])
        self._changes = vary(self._topology)
        self._polygons: list[NDArray] = []
        self._cut = np.zeros((0, 3), dtype=np.int32)

    def _read(self, time: float) -> Piece:
        points = array(self._points, time, np.float32, 3)
        if self.moves and not len(points):  # no value at this time
            return points, np.zeros((0, 3), dtype=np.int32)
        known = self._polygons
        if self._changes or not known:
            self._polygons = [array(attribute, time, np.int32) for attribute in self._topology]
        counts, corners, holes = self._polygons
        new = not known or (self._polygons is not known and not all(map(np.array_equal, self._polygons, known)))
        if new:
            polygon_sizes(self._path, counts, f"{self._name}: ")
            declared = int(counts.sum(dtype=np.int64))
            if declared != len(corners):
                problem = f"{self._name}: {declared} corners are declared, but there are {len(corners)}"
                raise broken(self._path, problem)
        low, high = int(corners.min(initial=0)), int(corners.max(initial=-1))
        if low < 0 or high >= len(points):
            named = f"a face names vertex {low if low < 0 else high}, but there are {len(points)}"
            raise broken(self._path, f"{self._name}: {named}")
        if new:
            self._cut = triangulate(points, counts, corners)
            if len(holes):
                self._cut = self._cut[~np.isin(np.repeat(np.arange(len(counts)), counts - 2), holes)]
        return points, self._cut


class Tessellated(Shape):
    """A sphere, cube, cone, cylinder, capsule or plane as triangles."""

    def __init__(self, prim: Any) -> None:
        self._kind = str(prim.GetTypeName())
        self._sizes = {name: prim.GetAttribute(name) for name in SIZES[self._kind]}
        super().__init__(list(self._sizes.values()))
        axis = prim.GetAttribute("axis")
        self._axis = str(axis.Get()) if axis else "Z"
        self._faces: I32 | None = None

    def _read(self, time: float) -> Piece:
        sizes = {name: float(attribute.Get(time) or 0.0) for name, attribute in self._sizes.items()}
        points, faces = surface(self._kind, sizes, self._axis)
        self._faces = faces if self._faces is None else self._faces
        return points, self._faces


def surface(kind: str, sizes: dict[str, float], axis: str) -> tuple[F64, I32]:
    """The surface of a prim about the origin and outwards. Its axis (of a plane: the normal) is "X", "Y" or "Z". All
    but cube and plane are surfaces of revolution: a profile of radii and heights, turned in :data:`AROUND` steps. The
    number of triangles does not depend on the sizes, so that a shape that grows keeps its topology.
    """
    if kind == "Plane":
        width, length = sizes["width"], sizes["length"]
        points, faces = grid((-width / 2, -length / 2, 0), (width, 0, 0), (0, length, 0))
        order = {"X": [2, 1, 0], "Y": [0, 2, 1]}.get(axis)  # of "X" the width lies along z, not y
        return (points, faces) if order is None else (points[:, order], faces[:, ::-1])
    half = sizes.get("size", sizes.get("height", 0.0)) / 2
    low, high = (sizes.get(name, sizes.get("radius", 0.0)) for name in ("radiusBottom", "radiusTop"))
    if kind == "Cube":
        points, faces = box((-half, -half, -half), (half, half, half))
    else:
        profile = np.column_stack(_profile(kind.removesuffix("_1"), half, low, high))
        profile[[0, -1], 0] = 0.0  # its first and last point lie on the axis and become one vertex each
        turned = lathe(profile, AROUND)
        points, faces = turned.vertices[:, [2, 0, 1]], turned.faces  # it turns about y
    return np.roll(points, {"X": 1, "Y": 2}.get(axis, 0), axis=1), faces


def _profile(kind: str, half: float, low: float, high: float) -> tuple[Any, Any]:
    """Radii and heights of a surface of half the height, and of these radii at its lower and its upper end."""
    if kind == "Sphere":
        return _arc(low, -_POLE, _POLE, POLE_TO_POLE)
    if kind == "Cone":
        return [0, low, 0], [-half, -half, half]
    if kind == "Cylinder":
        return [0, low, high, 0], [-half, -half, half, half]
    # The radii of a capsule are those of the ends of the cylinder, or of the cone that the spheres of both ends touch.
    slope = (high - low) / (2 * half) if half > 0.0 else 0.0
    touch, size = -math.atan(slope), math.hypot(1.0, slope)
    below = _arc(low * size, -_POLE, touch, POLE_TO_POLE // 2)
    above = _arc(high * size, touch, _POLE, POLE_TO_POLE // 2)
    heights = [below[1] - half + low * slope, above[1] + half + high * slope]
    return np.concatenate([below[0], above[0]]), np.concatenate(heights)


def _arc(radius: float, first: float, last: float, steps: int) -> tuple[NDArray, NDArray]:
    """Radii and heights of a circle's points from one latitude to another. The equator between them is one of them."""
    latitude = np.linspace(first, last, steps + 1)
    if first < 0.0 < last:
        latitude[1 + int(np.abs(latitude[1:-1]).argmin())] = 0.0
    return radius * np.cos(latitude), radius * np.sin(latitude)


class Skin(NamedTuple):
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
    skins = {}
    for found in cache.ComputeSkelBindings(UsdSkel.Root(root), predicate):
        skeleton = found.GetSkeleton()
        for query in found.GetSkinningTargets():
            skins[str(query.GetPrim().GetPath())] = Skin(cache.GetSkelQuery(skeleton), query, str(skeleton.GetPath()))
    return skins


class Skinned(Shape):
    """A shape after blend shapes, then joints, by UsdSkel; with joints, in the skeleton's space."""

    def __init__(self, path: Path, rest: Shape, skin: Skin) -> None:
        self._path, self._rest, self._skin, query = path, rest, skin, skin.query
        joints = [query.GetJointIndicesPrimvar().GetAttr(), query.GetJointWeightsPrimvar().GetAttr()]
        super().__init__([*joints, query.GetGeomBindTransformAttr()])
        self.times |= rest.times
        self.moves |= rest.moves
        self._motion = skin.skeleton.GetAnimQuery()
        if self._motion:
            self.times.update(self._motion.GetJointTransformTimeSamples())
            self.times.update(self._motion.GetBlendShapeWeightTimeSamples())
            self.moves |= self._motion.JointTransformsMightBeTimeVarying()
            self.moves |= self._motion.BlendShapeWeightsMightBeTimeVarying()
        blends = query.HasBlendShapes() and self._motion
        self._blends: Any = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(query.GetPrim())) if blends else None
        if self._blends:
            self._targets = self._blends.ComputeBlendShapePointIndices(), self._blends.ComputeSubShapePointOffsets()

    def _read(self, time: float) -> Piece:
        points, faces = self._rest.at(time)
        if not len(faces):
            return points, faces
        bent = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, dtype=np.float32))
        fits = self._blend(bent, time)
        if fits and self._skin.jointed:
            joints = self._skin.skeleton.ComputeSkinningTransforms(time)
            fits = self._skin.query.ComputeSkinnedPoints(joints, bent, time)
        if not fits:
            name = self._skin.query.GetPrim().GetPath()
            raise broken(self._path, f"{name}: its skin contradicts its points or its skeleton")
        return np.array(bent), faces

    def _blend(self, points: Any, time: float) -> bool:
        """Add the blend shapes to ``points``. False if they contradict each other."""
        weights = self._motion.ComputeBlendShapeWeights(time) if self._blends else None
        own = self._skin.query.GetBlendShapeMapper().Remap(weights) if weights else None
        if own is None:
            return True
        return self._blends.ComputeDeformedPoints(*self._blends.ComputeSubShapeWeights(own), *self._targets, points)
