"""USD at one time: what is drawn is read where it stands, and nothing else; the rest is refused or named."""

import numpy as np
import pytest
from helpers.mesh_files import refused, written
from helpers.usd_stages import HEAD, POINTS, TRIANGLE, lefts, mesh, moved_by, needs_usd, read

pytestmark = needs_usd


@pytest.mark.parametrize(
    ("text", "places"),
    [
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
    ],
)  # fmt: skip
def test_what_is_drawn(tmp_path, text, places):
    assert lefts(read(tmp_path, text)) == places


def test_what_is_not_moved_stays_as_it_is_stored_and_a_mesh_without_faces_is_named(tmp_path):
    loaded = read(tmp_path, mesh("A") + mesh("B"))
    assert (loaded.frames[0].dtype, loaded.notes) == (np.float32, ())
    none = mesh("None").replace("[3]", "[]").replace("[0, 1, 2]", "[]")
    assert read(tmp_path, mesh("A") + none).notes == ("in no frame, empty or invisible: /None",)


def test_instances_of_the_scene_graph_nested(tmp_path):
    text = f"""class "Leaf" {{
{mesh("M", moved_by(1))}}}
class Xform "Branch" {{
def Xform "A" (instanceable = true
 references = </Leaf>) {{
{moved_by(10)}}}
def Xform "B" (instanceable = true
 references = </Leaf>) {{
{moved_by(20)}}}
}}
def Xform "X" (instanceable = true
 references = </Branch>) {{
{moved_by(100)}}}
def Xform "Y" (instanceable = true
 references = </Branch>) {{
{moved_by(200)}}}
"""
    assert lefts(read(tmp_path, text)) == [111, 121, 211, 221]


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
    assert areas.sum() == 64.0 - 12.0
    assert loaded.faces[3].tolist() == [0, 1, 3]
    assert len(loaded.faces) == 4


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


@pytest.mark.parametrize(
    ("value", "given", "opaque"),
    [
        (1, " = 1", True),
        (1, " = 0.5", False),
        (1, ".connect = </M.inputs:opacity>", True),
        (0, ".connect = </M.inputs:opacity>", False),
        (1, ".connect = </M/T.outputs:a>", False),
    ],
)
def test_opacities_are_noted(tmp_path, value, given, opaque):
    text = SHADER.format(name="M", value=value, given=given).replace("<M/", "</M/")
    said = "opacities of materials and shapes not read: "
    notes = read(tmp_path, mesh("A") + text).notes
    assert notes == ("materials not read: 1", *(() if opaque else (f"{said}1",)))
    shown = f"    float[] primvars:displayOpacity = [{value}]\n"
    assert read(tmp_path, mesh("A", shown)).notes == (() if value else (f"{said}1",))


@pytest.mark.parametrize(
    ("text", "word"),
    [
        (mesh("A", points=""), "/A: a face names vertex 2, but there are 0"),
        (mesh("A").replace("[0, 1, 2]", "[0, 1, -2]"), "vertex -2"),
        (mesh("A").replace("[3]", "[2]"), "/A: face 0 has 2 vertices"),
        (mesh("A").replace("[3]", "[-1]"), "face 0 has -1 vertices"),
        (mesh("A").replace("[3]", "[3, 3]"), "6 corners are declared, but there are 3"),
        ('def BasisCurves "B" {\n}\n', "no visible mesh (1 BasisCurves left out)"),
        ('def Xform "X" {\n', "a.usda:"),
    ],
)
def test_stages_that_contradict_themselves(tmp_path, text, word):
    refused(written(tmp_path, "a.usda", HEAD + text), word)


def test_too_many_prims_are_refused(tmp_path, monkeypatch):
    from shadowbench.harness.scene.readers.usd import prims

    monkeypatch.setattr(prims, "MOST_PRIMS", 3)
    refused(written(tmp_path, "a.usda", HEAD + "".join(map(mesh, "ABCD"))), "more than 3 prims")
