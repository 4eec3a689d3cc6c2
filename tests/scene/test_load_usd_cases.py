"""Small stages that were once read wrongly without a word: their triangles and bounds, or the line that refuses them."""

import pytest
from helpers.mesh_files import refused, written
from helpers.usd_stages import bounds, needs_usd
from shadowbench.harness.scene.readers.load import load

pytestmark = needs_usd


def stage(text: str, start: str = "") -> str:
    return f'#usda 1.0\n(\n    upAxis = "Y"\n{start})\n{text}'


def mesh(name: str, more: str = "", counts: str = "[3]", corners: str = "[0, 1, 2]") -> str:
    return f"""def Mesh "{name}"
{{
    int[] faceVertexCounts = {counts}
    int[] faceVertexIndices = {corners}
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
{more}}}
"""


ORDER = '    uniform token[] xformOpOrder = ["xformOp:translate"]\n'
AT_ONE = "    startTimeCode = 1\n    endTimeCode = 1\n"
TO_TWO = "    startTimeCode = 1\n    endTimeCode = 2\n"
TO_THREE = "    startTimeCode = 1\n    endTimeCode = 3\n"

MOVED = "    double3 xformOp:translate.timeSamples = { 1: (5, 0, 0) }\n"
ARM = f"""def Xform "Arm"
{{
    matrix4d xformOp:transform.timeSamples = {{
        1: ( (3, 0, 0, 0), (0, 3, 0, 0), (0, 0, 3, 0), (0, 0, 10, 1) ),
        2: ( (3, 0, 0, 0), (0, 3, 0, 0), (0, 0, 3, 0), (0, 0, 20, 1) ),
    }}
    uniform token[] xformOpOrder = ["xformOp:transform"]
{mesh("M")}}}
"""
FIELD = f"""def PointInstancer "Field"
{{
    rel prototypes = </Field/Proto>
    int[] protoIndices = [0, 0, 0]
    point3f[] positions = [(10, 0, 0), (20, 0, 0), (30, 0, 0)]
{mesh("Proto")}}}
"""
GPRIMS = f"""def Cube "Box"
{{
    double size = 2
    double3 xformOp:translate = (8, 0, 0)
{ORDER}}}
def Sphere "Ball"
{{
    double radius = 1
    double3 xformOp:translate = (0, 8, 0)
{ORDER}}}
"""
MOVING = """def Mesh "M"
{
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points.timeSamples = {
        1: [(0,0,0),(1,0,0),(0,1,0)],
        2: [(0,0,1),(1,0,1),(0,1,1)],
        3: [(0,0,2),(1,0,2),(0,1,2)],
    }
}
"""


@pytest.mark.parametrize(
    ("text", "triangles", "at"),
    [
        (stage(mesh("Left") + mesh("Right", MOVED + ORDER), AT_ONE), 2, [[[0, 0, 0], [6, 1, 0]]]),
        (stage(ARM + mesh("Still"), TO_TWO), 2, [[[0, 0, 0], [3, 3, 10]], [[0, 0, 0], [3, 3, 20]]]),
        (stage(FIELD), 3, [[[10, 0, 0], [31, 1, 0]]]),
        (stage(mesh("Ground") + GPRIMS), 1 + 12 + 960, [[[-1, -1, -1], [9, 9, 1]]]),
        (stage(MOVING, TO_THREE), 1, [[[0, 0, z], [1, 1, z]] for z in range(3)]),
    ],
    ids=["samples", "samples above", "instancer", "gprims", "moving points"],
)
def test_stages_and_their_bounds_at_each_frame(tmp_path, text, triangles, at):
    loaded = load(written(tmp_path, "a.usda", text))
    assert len(loaded.faces) == triangles
    assert [bounds(loaded, k) for k in range(len(loaded.frames))] == at


def test_a_missing_reference_and_a_face_of_two_corners_are_refused(tmp_path):
    house = 'def Xform "House" (\n    prepend references = @./not_there.usda@\n)\n{\n}\n'
    refused(written(tmp_path, "a.usda", stage(mesh("Ground") + house)), "not_there.usda", "--allow-missing")
    refused(
        written(tmp_path, "b.usda", stage(mesh("M", "", "[3, 2]", "[0, 1, 2, 0, 1]"))),
        "face 1 has 2 vertices",
    )
