"""Meshes bent by skeletons and blend shapes are those that UsdSkel.BakeSkinning makes of them."""

import numpy as np
import pytest
from helpers.mesh_files import refused
from helpers.usd_stages import HEAD, needs_usd
from shadowbench.harness.scene.readers.load import load

pytestmark = needs_usd

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


def baked(path, to, root: str = "/Root") -> None:
    from pxr import Usd, UsdSkel

    stage = Usd.Stage.Open(str(path))
    assert UsdSkel.BakeSkinning(UsdSkel.Root.Get(stage, root))
    stage.Export(str(to))


@pytest.mark.parametrize("rigid", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_skins_are_those_that_the_library_bakes(tmp_path, seed, rigid):
    skinned(tmp_path / "a.usda", seed, rigid=rigid)
    baked(tmp_path / "a.usda", tmp_path / "baked.usda")
    ours, theirs = load(tmp_path / "a.usda"), load(tmp_path / "baked.usda")
    assert len(ours.frames) == len(theirs.frames) == 5
    assert np.ptp([frame[0] for frame in ours.frames], axis=0).max() > 0.1
    for own, other in zip(ours.frames, theirs.frames, strict=True):
        assert np.allclose(own, other, atol=1e-5)
    assert ours.rate == 24


def test_a_skeleton_that_stands_still_bends_one_frame(tmp_path):
    skinned(tmp_path / "a.usda", 9, skeleton_moves=False)
    baked(tmp_path / "a.usda", tmp_path / "baked.usda")
    ours, theirs = load(tmp_path / "a.usda"), load(tmp_path / "baked.usda")
    assert len(ours.frames) == 1
    assert np.allclose(ours.frames[0], theirs.frames[0], atol=1e-5)


def test_skinned_instances_and_prototypes(tmp_path):
    """The same figure by reference, as an instance of the scene graph, and as the prototype of an instancer."""
    skinned(tmp_path / "figure.usda", 2)
    text = HEAD.replace(")\n", "    startTimeCode = 0\n    endTimeCode = 4\n)\n")
    for x, meta in ((0, ""), (10, "instanceable = true\n")):
        text += f'def "X{x}" ({meta}    references = @figure.usda@</Root>) {{\n}}\n'
    text += """def PointInstancer "Field" {
    rel prototypes = </Field/P>
    int[] protoIndices = [0, 0]
    point3f[] positions = [(20, 0, 0), (30, 0, 0)]
    def "P" (references = @figure.usda@</Root>) {
    }
}
"""
    (tmp_path / "all.usda").write_text(text)
    alone, loaded = load(tmp_path / "figure.usda"), load(tmp_path / "all.usda")
    for frame, own in zip(loaded.frames, alone.frames, strict=True):
        for copy, x in zip(np.split(frame, 4), (0, 0, 20, 30), strict=True):
            assert np.allclose(copy, own + [x, 0, 0], atol=1e-5)


def test_a_skin_that_contradicts_its_mesh_is_refused(tmp_path):
    skinned(tmp_path / "a.usda", 3)
    text = (tmp_path / "a.usda").read_text()
    start = text.index("primvars:skel:jointWeights = [")
    end = text.index("]", start)
    (tmp_path / "b.usda").write_text(text[:start] + "primvars:skel:jointWeights = [1" + text[end:])
    refused(tmp_path / "b.usda", "/Root/Body0: its skin contradicts its points or its skeleton")


def test_a_mesh_below_no_skelroot_is_not_bent(tmp_path):
    skinned(tmp_path / "a.usda", 3)
    text = (tmp_path / "a.usda").read_text().replace('def SkelRoot "Root"', 'def Xform "Root"')
    (tmp_path / "b.usda").write_text(text)
    assert len(load(tmp_path / "b.usda").frames) == 1
