"""A USD figure with a skeleton, blend shapes and an animation."""

import numpy as np

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
