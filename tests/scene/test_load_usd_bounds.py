"""Bounds of generated stages are those of UsdGeom.BBoxCache; tessellated shapes are closed and as large as they say."""

import itertools

import numpy as np
import pytest
from helpers.usd_stages import bounds, bounds_of_library, needs_usd
from shadowbench.harness.scene.readers.load import load

pytestmark = needs_usd

CUBE = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
SIDES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def box_mesh(stage, path, rng):
    """A box with its corners as vertices: its box of bounds is tight however it is turned."""
    from pxr import UsdGeom, Vt

    mesh = UsdGeom.Mesh.Define(stage, path)
    points = CUBE * rng.uniform(0.1, 3.0, 3) + rng.uniform(-5, 5, 3)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr([4] * 6)
    mesh.CreateFaceVertexIndicesAttr([i for side in SIDES for i in side])
    return mesh


def any_transform(rng):
    from pxr import Gf

    matrix = np.eye(4)
    matrix[:3, :3] += rng.uniform(-1, 1, (3, 3))
    matrix[3, :3] = rng.uniform(-10, 10, 3)
    return Gf.Matrix4d(matrix)


def generated(path, seed: int) -> float:
    """Write a stage of random boxes, moving, hidden and of all purposes. The time that it is read at."""
    from pxr import Usd, UsdGeom

    rng = np.random.default_rng(seed)
    stage = Usd.Stage.CreateNew(str(path))
    start = float(rng.integers(-3, 4)) if seed % 3 else None
    if start is not None:
        stage.SetStartTimeCode(start)
        stage.SetEndTimeCode(start)
    above = [""]
    first = np.inf
    for i in range(12):
        name = f"{rng.choice(above)}/P{i}"
        if rng.random() < 0.4:
            prim = UsdGeom.Xform.Define(stage, name)
            above.append(name)
        elif rng.random() < 0.2:
            prim = UsdGeom.Cube.Define(stage, name)
            prim.CreateSizeAttr(float(rng.uniform(0.1, 4)))
        else:
            prim = box_mesh(stage, name, rng)
        image = UsdGeom.Imageable(prim)
        if rng.random() < 0.2:
            image.CreatePurposeAttr(str(rng.choice(["default", "render", "proxy", "guide"])))
        if rng.random() < 0.15:
            image.CreateVisibilityAttr("invisible")
        if rng.random() < 0.7:
            op = UsdGeom.Xformable(prim).AddTransformOp()
            if rng.random() < 0.5:
                for time in rng.uniform(-5, 5, 3):
                    op.Set(any_transform(rng), float(time))
            else:
                op.Set(any_transform(rng))
        if rng.random() < 0.1:
            UsdGeom.Xformable(prim).SetResetXformStack(True)
    box_mesh(stage, "/Always", rng)
    stage.Save()
    drawn = [
        prim
        for prim in stage.Traverse(Usd.PrimDefaultPredicate)
        if prim.IsA(UsdGeom.Boundable)
        and UsdGeom.Imageable(prim).ComputeVisibility() != "invisible"
        and UsdGeom.Imageable(prim).ComputePurpose() in ("default", "render")
    ]
    for prim in drawn:
        while not prim.IsPseudoRoot():
            first = min([first, *UsdGeom.Xformable(prim).GetTimeSamples()])
            prim = prim.GetParent()
    return start if start is not None else first if np.isfinite(first) else 0.0


@pytest.mark.parametrize("seed", range(15))
def test_generated_stages_have_the_bounds_of_the_library(tmp_path, seed):
    path = tmp_path / "a.usda"
    time = generated(path, seed)
    assert np.allclose(bounds(load(path)), bounds_of_library(path, time), rtol=1e-6, atol=1e-6)


GPRIMS = {
    "Sphere": ["radius"],
    "Cube": ["size"],
    "Cone": ["radius", "height"],
    "Cylinder": ["radius", "height"],
    "Cylinder_1": ["radiusTop", "radiusBottom", "height"],
    "Capsule": ["radius", "height"],
    "Capsule_1": ["radiusTop", "radiusBottom", "height"],
    "Plane": ["width", "length"],
}


def gprim(path, kind, axis, sizes):
    from pxr import Usd

    stage = Usd.Stage.CreateNew(str(path))
    prim = stage.DefinePrim("/G", kind)
    for name, value in zip(GPRIMS[kind], sizes, strict=False):
        prim.GetAttribute(name).Set(value)
    if prim.GetAttribute("axis"):
        prim.GetAttribute("axis").Set(axis)
    stage.Save()


@pytest.mark.parametrize("axis", "XYZ")
@pytest.mark.parametrize("kind", GPRIMS)
def test_gprims_have_the_bounds_of_the_library_and_face_outwards(tmp_path, kind, axis):
    path = tmp_path / "a.usda"
    gprim(path, kind, axis, (1.5, 0.5, 4.0))
    loaded = load(path)
    assert np.allclose(bounds(loaded), bounds_of_library(path, 0.0), atol=1e-12)
    corners = loaded.frames[0][loaded.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if kind == "Plane":
        assert (normal[:, "XYZ".index(axis)] > 0).all()
        return
    assert (np.einsum("ij,ij->i", normal, corners.mean(axis=1)) > 0).all()
    edges = np.sort(np.concatenate([loaded.faces[:, [0, 1]], loaded.faces[:, [1, 2]], loaded.faces[:, [2, 0]]]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()


@pytest.mark.parametrize(
    ("kind", "volume"), [("Sphere", 4 / 3 * 8), ("Cone", 4), ("Cylinder", 12), ("Capsule", 12 + 4 / 3 * 8)]
)
def test_gprims_enclose_almost_the_volume_that_they_stand_for(tmp_path, kind, volume):
    """Of radius 2 and height 3."""
    gprim(tmp_path / "a.usda", kind, "Z", (2.0, 3.0)[: len(GPRIMS[kind])])
    loaded = load(tmp_path / "a.usda")
    a, b, c = loaded.frames[0][loaded.faces].transpose(1, 0, 2)
    assert 0.97 * volume * np.pi < np.einsum("ij,ij->", a, np.cross(b, c)) / 6 <= volume * np.pi * (1 + 1e-12)
