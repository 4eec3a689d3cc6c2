"""USD at one time: what is drawn is read where it stands, with the bounds of UsdGeom.BBoxCache; the rest is named."""

import itertools

import numpy as np
import pytest
from helpers.mesh_files import refused, written
from helpers.usd_stages import HEAD, POINTS, TRIANGLE, bounds, bounds_of_library, lefts, mesh, moved_by, needs_usd, read
from shadowbench.harness.scene.readers.load import load

pytestmark = needs_usd


@pytest.mark.parametrize(("text", "places"), [
    (mesh("A", kind="over") + mesh("B", moved_by(2)), [2]),
    (mesh("A", kind="class") + mesh("B", moved_by(2)), [2]),
    (mesh("A", meta="(active = false)") + mesh("B", moved_by(2)), [2]),
    (mesh("A", '    token visibility = "invisible"\n') + mesh("B", moved_by(2)), [2]),
    ('def Scope "S" {\n    token visibility = "invisible"\n' + mesh("A") + "}\n" + mesh("B", moved_by(2)), [2]),
    ('def Material "M" {\n' + mesh("A") + "}\n" + mesh("B", moved_by(2)), [2]),
    ('def "Untyped" {\n' + mesh("A") + "}\n" + mesh("B", moved_by(2)), [0, 2]),
    ('def Unheard "Of" {\n' + mesh("A") + "}\n" + mesh("B", moved_by(2)), [0, 2]),
    (mesh("A", '    uniform token purpose = "guide"\n') + mesh("B", moved_by(2)), [2]),
    (mesh("A", '    uniform token purpose = "proxy"\n') + mesh("B", moved_by(2)), [2]),
    (mesh("A", '    uniform token purpose = "render"\n') + mesh("B", moved_by(2)), [0, 2]),
    (
        'def Xform "G" {\n    uniform token purpose = "guide"\n'
        + mesh("A")
        + mesh("C", '    uniform token purpose = "default"\n' + moved_by(1))
        + "}\n",
        [1],
    ),
    (
        'def Xform "G" {\n'
        + moved_by(10)
        + mesh("A", moved_by(1))
        + mesh("B", moved_by(2).replace('["', '["!resetXformStack!", "'))
        + "}\n",
        [11, 2],
    ),
])  # fmt: skip
def test_what_is_drawn(tmp_path, text, places):
    assert lefts(read(tmp_path, text)) == places


def test_what_is_not_moved_stays_as_it_is_stored_and_a_mesh_without_faces_is_named(tmp_path):
    loaded = read(tmp_path, mesh("A") + mesh("B"))
    assert (loaded.frames[0].dtype, loaded.notes) == (np.float32, ())
    none = mesh("None").replace("[3]", "[]").replace("[0, 1, 2]", "[]")
    assert read(tmp_path, mesh("A") + none).notes == ("in no frame, empty or invisible: /None",)


def test_concave_polygons_are_cut_and_holes_left_out(tmp_path):
    text = """def Mesh "M" {
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [5, 3, 3]
    int[] faceVertexIndices = [0, 1, 2, 3, 4, 0, 1, 2, 0, 1, 3]
    int[] holeIndices = [1]
    point3f[] points = [(4, 4, 0), (-4, 4, 0), (-4, -4, 0), (4, -4, 0), (1, 1, 0)]
}
"""
    loaded = read(tmp_path, text)
    corners = loaded.frames[0][loaded.faces[:3]].astype(float)
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] / 2
    assert (areas > 0).all()
    assert (areas.sum(), loaded.faces[3].tolist(), len(loaded.faces)) == (64.0 - 12.0, [0, 1, 3], 4)


def test_notes_say_what_is_left_out_or_approximated(tmp_path):
    text = (
        HEAD.replace("(\n", "(\n    metersPerUnit = 0.01\n")
        + f"""def Mesh "Cage" {{
{TRIANGLE.replace("none", "catmullClark")}{POINTS}}}
def Cube "Box" {{
}}
def BasisCurves "Hair" {{
}}
def Points "Dust" {{
}}
def Volume "Smoke" {{
}}
def Unheard "Of" {{
}}
def Scope "Looks" {{
def Material "Red" {{
}}
}}
{mesh("Hidden", '    token visibility = "invisible"' + chr(10))}
{mesh("Guide", '    uniform token purpose = "guide"' + chr(10))}
def Xform "Card" (prepend apiSchemas = ["GeomModelAPI"]) {{
    uniform token model:drawMode = "cards"
}}
def SphereLight "Sun" {{
}}
def DomeLight "Sky" {{
}}
"""
    )
    assert read(tmp_path, text, "").notes == (
        "lights not offered: 1 (DomeLight)",
        "lights with an area: 1; each shines from its middle unless it is given more targets",
        "tessellated gprims: 1 (32 segments around, 16 from pole to pole)",
        "subdivision surfaces read as their cages: 1",
        "draw modes not used: 1",
        "materials not read: 1",
        "left out: 1 BasisCurves, 1 Points, 1 Unheard, 1 Volume",
        "left out: 1 invisible, 1 of purpose guide or proxy",
        "lengths in units of 0.01 m",
    )


SHADER = """def Material "{name}" {{
    float inputs:opacity = {value}
    token outputs:surface.connect = <{name}/S.outputs:surface>
    def Shader "S" {{
        uniform token info:id = "UsdPreviewSurface"
        float inputs:opacity{given}
        token outputs:surface
    }}
    def Shader "T" {{
        uniform token info:id = "UsdUVTexture"
        float outputs:a
    }}
}}
"""


@pytest.mark.parametrize(("value", "given", "opaque"), [
    (1, " = 1", True), (1, " = 0.5", False), (1, ".connect = </M.inputs:opacity>", True),
    (0, ".connect = </M.inputs:opacity>", False), (1, ".connect = </M/T.outputs:a>", False),
])  # fmt: skip
def test_opacities_are_noted(tmp_path, value, given, opaque):
    text = SHADER.format(name="M", value=value, given=given).replace("<M/", "</M/")
    said = "opacities of materials and shapes not read: "
    notes = read(tmp_path, mesh("A") + text).notes
    assert notes == ("materials not read: 1", *(() if opaque else (f"{said}1",)))
    shown = f"    float[] primvars:displayOpacity = [{value}]\n"
    assert read(tmp_path, mesh("A", shown)).notes == (() if value else (f"{said}1",))


@pytest.mark.parametrize(("text", "word"), [
    (mesh("A", points=""), "/A: a face names vertex 2, but there are 0"),
    (mesh("A").replace("[0, 1, 2]", "[0, 1, -2]"), "vertex -2"),
    (mesh("A").replace("[3]", "[2]"), "/A: face 0 has 2 vertices"),
    (mesh("A").replace("[3]", "[-1]"), "face 0 has -1 vertices"),
    (mesh("A").replace("[3]", "[3, 3]"), "6 corners are declared, but there are 3"),
    ('def BasisCurves "B" {\n}\n', "no visible mesh (1 BasisCurves left out)"),
    ('def Xform "X" {\n', "a.usda:"),
])  # fmt: skip
def test_stages_that_contradict_themselves(tmp_path, text, word):
    refused(written(tmp_path, "a.usda", HEAD + text), word)


def test_too_many_prims_are_refused(tmp_path, monkeypatch):
    from shadowbench.harness.scene.readers.usd import prims

    monkeypatch.setattr(prims, "MOST_PRIMS", 3)
    refused(written(tmp_path, "a.usda", HEAD + "".join(map(mesh, "ABCD"))), "more than 3 prims")


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
