"""USD stages for tests: short text, small meshes, and what UsdGeom.BBoxCache says of a file."""

from pathlib import Path

import numpy as np
import pytest
from shadowbench.harness.scene.readers import usd
from shadowbench.harness.scene.readers.checks import Loaded
from shadowbench.harness.scene.readers.load import load

from .mesh_files import written

needs_usd = pytest.mark.skipif(not usd.available(), reason="usd-core is not installed")

HEAD = '#usda 1.0\n(\n    upAxis = "Y"\n)\n'

TRIANGLE = """
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    uniform token subdivisionScheme = "none"
"""
POINTS = "    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n"


def moved_by(x: float, y: float = 0.0, z: float = 0.0) -> str:
    """The lines that move a prim."""
    order = 'uniform token[] xformOpOrder = ["xformOp:translate"]'
    return f"    double3 xformOp:translate = ({x}, {y}, {z})\n    {order}\n"


def mesh(name: str, more: str = "", points: str = POINTS, meta: str = "", kind: str = "def") -> str:
    """A mesh of one triangle, 1 wide and high."""
    return f'{kind} Mesh "{name}" {meta}\n{{{TRIANGLE}{points}{more}}}\n'


def read(folder: Path, text: str, head: str = HEAD) -> Loaded:
    """What a stage of this text is read as."""
    return load(written(folder, "a.usda", head + text))


def lefts(loaded: Loaded) -> list[float]:
    """The least x of each triangle, in order."""
    return loaded.frames[0][loaded.faces][..., 0].min(axis=1).tolist()


def bounds(loaded: Loaded, frame: int = 0) -> list[list[float]]:
    """Least and largest coordinates of the triangles that are there at a frame."""
    corners = loaded.frames[frame][loaded.faces].reshape(-1, 3)
    corners = corners[np.isfinite(corners).all(axis=1)]
    return [corners.min(axis=0).tolist(), corners.max(axis=0).tolist()]


def bounds_of_library(path: Path, time: float) -> list[list[float]]:
    """What BBoxCache finds at a time code: the union over all that is drawn, each on its own, so that it is tight."""
    from pxr import Gf, Usd, UsdGeom

    stage = Usd.Stage.Open(str(path))
    cache = UsdGeom.BBoxCache(Usd.TimeCode(time), ["default", "render"])
    total = Gf.Range3d()
    walk = iter(Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()))
    for prim in walk:
        if prim.IsA(UsdGeom.PointInstancer):
            walk.PruneChildren()
        image = UsdGeom.Imageable(prim)
        if not prim.IsA(UsdGeom.Boundable) or image.ComputeVisibility(time) == "invisible":
            continue
        total.UnionWith(cache.ComputeWorldBound(prim).ComputeAlignedRange())
    return [list(total.GetMin()), list(total.GetMax())]


JOINTS = ["root", "root/arm", "root/arm/hand"]


def transform(rng, size: float = 0.3):
    from pxr import Gf

    matrix = np.eye(4)
    matrix[:3, :3], _ = np.linalg.qr(np.eye(3) + rng.uniform(-size, size, (3, 3)))
    matrix[:3, :3] *= np.sign(np.linalg.det(matrix[:3, :3]))
    matrix[3, :3] = rng.uniform(-1, 1, 3)
    return Gf.Matrix4d(matrix)


def skinned(path, seed: int, root: str = "/Root", skeleton_moves: bool = True, rigid: bool = False) -> None:
    """A SkelRoot with two meshes on one moving skeleton; one has blend shapes with an in-between."""
    from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

    rng = np.random.default_rng(seed)
    stage = Usd.Stage.CreateNew(str(path))
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(4)
    UsdSkel.Root.Define(stage, root).AddTransformOp().Set(transform(rng))
    skeleton = UsdSkel.Skeleton.Define(stage, f"{root}/Skeleton")
    skeleton.AddTransformOp().Set(transform(rng))
    skeleton.CreateJointsAttr(JOINTS)
    skeleton.CreateBindTransformsAttr([transform(rng) for _ in JOINTS])
    skeleton.CreateRestTransformsAttr([transform(rng) for _ in JOINTS])
    motion = UsdSkel.Animation.Define(stage, f"{root}/Motion")
    motion.CreateJointsAttr(JOINTS[::-1])
    for time in (0, 4) if skeleton_moves else (0,):
        motion.SetTransforms([transform(rng) for _ in JOINTS], time)
        motion.CreateBlendShapesAttr(["smile", "frown"])
        motion.CreateBlendShapeWeightsAttr().Set(rng.uniform(0, 1, 2).tolist(), time)
    binding = UsdSkel.BindingAPI.Apply(skeleton.GetPrim())
    binding.CreateAnimationSourceRel().SetTargets([motion.GetPath()])
    for k in range(2):
        body = UsdGeom.Mesh.Define(stage, f"{root}/Body{k}")
        body.AddTransformOp().Set(transform(rng))
        body.CreateSubdivisionSchemeAttr("none")
        points = rng.uniform(-1, 1, (30, 3)).astype(np.float32)
        body.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
        body.CreateFaceVertexCountsAttr([3] * 10)
        body.CreateFaceVertexIndicesAttr(list(range(30)))
        own = UsdSkel.BindingAPI.Apply(body.GetPrim())
        own.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
        own.CreateGeomBindTransformAttr(transform(rng))
        if k:
            own.CreateJointsAttr(JOINTS[1:])
        if rigid:
            own.CreateJointIndicesPrimvar(True, 1).Set([1])
            own.CreateJointWeightsPrimvar(True, 1).Set([1.0])
        else:
            indices = rng.integers(0, len(JOINTS) - k, 60)
            own.CreateJointIndicesPrimvar(False, 2).Set(indices.tolist())
            weights = rng.uniform(0.1, 1, (30, 2))
            weights /= weights.sum(axis=1, keepdims=True)
            own.CreateJointWeightsPrimvar(False, 2).Set(weights.ravel().tolist())
        if k == 0:
            for name in ("smile", "frown"):
                shape = UsdSkel.BlendShape.Define(stage, f"{body.GetPath()}/{name}")
                shape.CreateOffsetsAttr([Gf.Vec3f(*rng.uniform(-1, 1, 3)) for _ in range(5)])
                shape.CreatePointIndicesAttr(rng.choice(30, 5, replace=False).tolist())
                inbetween = shape.CreateInbetween("half")
                inbetween.SetWeight(0.5)
                inbetween.SetOffsets([Gf.Vec3f(*rng.uniform(-1, 1, 3)) for _ in range(5)])
            own.CreateBlendShapesAttr(["smile", "frown"])
            own.CreateBlendShapeTargetsRel().SetTargets(
                [Sdf.Path(f"{body.GetPath()}/{name}") for name in ("smile", "frown")]
            )
    stage.Save()
