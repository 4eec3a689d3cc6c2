"""PointInstancers, drawn as usdview draws them; skeletons and blend shapes, as UsdSkel.BakeSkinning bends them."""

import numpy as np
import pytest
from helpers.mesh_files import refused, written
from helpers.usd_stages import HEAD, bounds, bounds_of_library, lefts, mesh, moved_by, needs_usd, read, skinned
from shadowbench.harness.scene.readers.load import load

pytestmark = needs_usd


def instancer(
    prototypes: str, which: str, positions: str, more: str = "", inside: str = "", name: str = "Field"
) -> str:
    return f"""def PointInstancer "{name}"
{{
    rel prototypes = {prototypes}
    int[] protoIndices = {which}
    point3f[] positions = {positions}
{more}{inside}}}
"""


def with_line(text: str, line: str) -> str:
    """The text with one more line in its first prim."""
    return text.replace("{\n", f"{{\n    {line}\n", 1)


ROW = "[(10, 0, 0), (20, 0, 0), (30, 0, 0)]"
AGAIN = instancer("</B>", "[0]", "[(0, 0, 0)]", name="C")
FIELD = instancer("</Field/Proto>", "[0, 0, 0]", ROW, inside=mesh("Proto"))


@pytest.mark.parametrize(("text", "places"), [
    (FIELD, [10, 20, 30]),
    # a prototype outside is drawn where it stands, too
    (mesh("P", moved_by(5)) + instancer("</P>", "[0, 0, 0]", ROW), [5, 15, 25, 35]),
    # unless it lies below an over; its own transform counts, those above it do not
    (
        'over "O" {\n' + moved_by(1000) + mesh("P", moved_by(5)) + "}\n" + instancer("</O/P>", "[0, 0, 0]", ROW),
        [15, 25, 35],
    ),
    (mesh("P", kind="class") + mesh("M") + instancer("</P>", "[0]", "[(9, 0, 0)]"), [0]),
    (mesh("P", meta="(active = false)") + mesh("M") + instancer("</P>", "[0]", "[(9, 0, 0)]"), [0]),
    (mesh("M") + instancer("</Nothing>", "[0]", "[(9, 0, 0)]"), [0]),
    # what lies below an instancer and is no prototype is not drawn
    (instancer("</Field/P>", "[0]", "[(9, 0, 0)]", inside=mesh("P") + mesh("Q")), [9]),
    # several prototypes; one is a subtree
    (
        instancer(
            "[</Field/P>, </Field/Two>]",
            "[1, 0, 1]",
            ROW,
            inside=mesh("P") + 'def Xform "Two" {\n' + moved_by(2) + mesh("A") + mesh("B", moved_by(1)) + "}\n",
        ),
        [12, 13, 20, 32, 33],
    ),
    (with_line(FIELD, "int64[] invisibleIds = [1]"), [10, 30]),
    (FIELD.replace('"Field"', '"Field" (\n    inactiveIds = [0]\n)'), [20, 30]),
    (with_line(FIELD, "int64[] ids = [7, 8, 9]\n    int64[] invisibleIds = [9, 1]"), [10, 20]),
    (with_line(FIELD, 'token visibility = "invisible"') + mesh("M"), [0]),
    (with_line(FIELD, moved_by(100)), [110, 120, 130]),
    (instancer("</Field/P>", "[]", "[]", inside=mesh("P")) + mesh("M"), [0]),
    # purpose is inherited by the prototypes
    (with_line(FIELD, 'uniform token purpose = "proxy"') + mesh("M"), [0]),
])  # fmt: skip
def test_what_instancers_draw(tmp_path, text, places):
    assert lefts(read(tmp_path, text)) == places


@pytest.mark.parametrize("prototype", ["</Nothing>", "</P>"])
def test_prototypes_and_instancers_that_draw_nothing_are_named(tmp_path, prototype):
    text = mesh("P", kind="class") + mesh("M") + instancer(prototype, "[0]", "[(9, 0, 0)]")
    loaded = read(tmp_path, text)
    assert loaded.notes == ("prototypes of instancers that draw nothing: 1", "in no frame, empty or invisible: /Field")


def test_orientations_and_scales(tmp_path):
    more = "    quath[] orientations = [(0.70710678, 0, 0, 0.70710678), (1, 0, 0, 0)]\n"
    more += "    float3[] scales = [(2, 1, 1), (1, 1, 3)]\n"
    text = instancer("</Field/P>", "[0, 0]", "[(10, 0, 0), (0, 0, 5)]", more, mesh("P"))
    loaded = read(tmp_path, text)
    expected = [[10, 0, 0], [10, 2, 0], [9, 0, 0], [0, 0, 5], [1, 0, 5], [0, 1, 5]]
    assert np.allclose(loaded.frames[0][loaded.faces].reshape(-1, 3), expected, atol=2e-3)  # halves hold 11 bits


def test_instancers_within_instancers_and_instances_of_the_scene_graph(tmp_path):
    inner = instancer("</Outer/Inner/P>", "[0, 0]", "[(1, 0, 0), (2, 0, 0)]", inside=mesh("P"), name="Inner")
    outer = instancer("</Outer/Inner>", "[0, 0]", "[(10, 0, 0), (20, 0, 0)]", inside=inner, name="Outer")
    assert lefts(read(tmp_path, outer)) == [11, 12, 21, 22]
    shared = f"""class "Kind" {{
{instancer("</Kind/Field/P>", "[0, 0]", "[(1, 0, 0), (2, 0, 0)]", inside=mesh("P"))}}}
"""
    for x in (10, 20):
        shared += f'def Xform "X{x}" (instanceable = true\n references = </Kind>) {{\n{moved_by(x)}}}\n'
    assert lefts(read(tmp_path, shared)) == [11, 12, 21, 22]


def test_native_instances_within_a_prototype(tmp_path):
    text = f"""class "Leaf" {{
{mesh("M")}}}
""" + instancer(
        "</Field/P>",
        "[0, 0]",
        "[(10, 0, 0), (20, 0, 0)]",
        inside='def Xform "P" {\n'
        + "".join(
            f'def Xform "L{i}" (instanceable = true\n references = </Leaf>) {{\n{moved_by(i)}}}\n' for i in (1, 2)
        )
        + "}\n",
    )
    assert lefts(read(tmp_path, text)) == [11, 12, 21, 22]


@pytest.mark.parametrize("seed", range(3))
def test_generated_instancers_have_the_bounds_of_the_library(tmp_path, seed):
    """Boxes that are not turned, since the library bounds the boxes of turned prototypes."""
    from pxr import Usd, UsdGeom, Vt

    rng = np.random.default_rng(seed)
    path = tmp_path / "a.usdc"
    stage = Usd.Stage.CreateNew(str(path))
    field = UsdGeom.PointInstancer.Define(stage, "/Above/Field")
    UsdGeom.XformCommonAPI(stage.DefinePrim("/Above", "Xform")).SetTranslate(tuple(rng.uniform(-9, 9, 3)))
    for k in range(3):
        UsdGeom.Xform.Define(stage, f"/Above/Field/P{k}").AddTranslateOp().Set(tuple(rng.uniform(-1, 1, 3)))
        UsdGeom.Cube.Define(stage, f"/Above/Field/P{k}/Cube").CreateSizeAttr(float(rng.uniform(0.1, 2)))
    field.CreatePrototypesRel().SetTargets([f"/Above/Field/P{k}" for k in range(3)])
    count = int(rng.integers(1, 300))
    field.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(rng.integers(0, 3, count, dtype=np.int32)))
    field.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(rng.normal(size=(count, 3)).astype(np.float32)))
    field.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(rng.uniform(0, 2, (count, 3)).astype(np.float32)))
    hidden = rng.choice(count, count // 3, replace=False).astype(np.int64)
    field.CreateInvisibleIdsAttr(Vt.Int64Array.FromNumpy(hidden))
    stage.Save()
    loaded = load(path)
    assert len(loaded.faces) == 12 * (count - len(hidden))
    assert np.allclose(bounds(loaded), bounds_of_library(path, 0.0), atol=1e-5)


@pytest.mark.parametrize(("text", "word"), [
    (FIELD.replace("[0, 0, 0]\n", "[0, 1, 0]\n", 1), "names prototype 1, but there are 1"),
    (FIELD.replace("[0, 0, 0]\n", "[0, -1, 0]\n", 1), "names prototype -1"),
    (FIELD.replace("[0, 0, 0]\n", "[0, 0]\n", 1), "2 instances, but 3 positions"),
    (with_line(FIELD, "float3[] scales = [(1, 1, 1)]"), "3 instances, but 1 scales"),
    (with_line(FIELD, "quath[] orientations = [(1, 0, 0, 0)]"), "1 orientations"),
    (with_line(FIELD, "int64[] ids = [1, 2]"), "3 instances, but 2 ids"),
    (FIELD.replace(f"    point3f[] positions = {ROW}\n", ""), "3 instances have no positions"),
    (instancer("</Field>", "[0]", "[(0, 0, 0)]"), "/Field: instances itself"),
    (
        instancer("</B/P>", "[0]", "[(0, 0, 0)]", name="A")
        + instancer("</A>", "[0]", "[(0, 0, 0)]", inside=f'def Xform "P" {{\n{AGAIN}}}\n', name="B"),
        "instances itself",
    ),
])  # fmt: skip
def test_instancers_that_contradict_themselves(tmp_path, text, word):
    refused(written(tmp_path, "a.usda", HEAD + text), word)


def test_few_bytes_that_name_many_triangles(tmp_path, monkeypatch):
    """Ten instances of ten instances of ten ...: 10^9 triangles."""
    from shadowbench.harness.scene.readers.usd import drawing

    monkeypatch.setattr(drawing, "MOST_INSTANCED", 1 << 16)
    text, path = mesh("P"), ""
    for level in range(9):
        path = "/" + "/".join(f"L{k}" for k in range(8, level, -1)) + f"/L{level}" if level < 8 else "/L8"
        below = path + ("/P" if level == 0 else f"/L{level - 1}")
        text = instancer(f"<{below}>", str([0] * 10), str([(0, 0, 0)] * 10), inside=text, name=f"L{level}")
    refused(written(tmp_path, "a.usda", HEAD + text), "instances, more than")


def baked(path, to, root: str = "/Root") -> None:
    from pxr import Usd, UsdSkel

    stage = Usd.Stage.Open(str(path))
    assert UsdSkel.BakeSkinning(UsdSkel.Root.Get(stage, root))
    stage.Export(str(to))


@pytest.mark.parametrize(("seed", "rigid", "frames"), [(0, False, 5), (1, False, 5), (2, True, 5), (9, False, 1)])
def test_skins_are_those_that_the_library_bakes(tmp_path, seed, rigid, frames):
    """A skeleton that stands still bends one frame."""
    skinned(tmp_path / "a.usda", seed, rigid=rigid, skeleton_moves=frames > 1)
    baked(tmp_path / "a.usda", tmp_path / "baked.usda")
    ours, theirs = load(tmp_path / "a.usda"), load(tmp_path / "baked.usda")
    assert len(ours.frames) == len(theirs.frames) == frames
    assert (np.ptp([frame[0] for frame in ours.frames], axis=0).max() > 0.1) == (frames > 1)
    for own, other in zip(ours.frames, theirs.frames, strict=True):
        assert np.allclose(own, other, atol=1e-5)
    assert ours.rate == (24 if frames > 1 else None)


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


def test_instances_with_animations_of_their_own(tmp_path):
    """A crowd: the animation is bound on each instance, outside what they share."""
    skinned(tmp_path / "figure.usda", 2)
    skinned(tmp_path / "other.usda", 5)
    text = (tmp_path / "figure.usda").read_text()
    bound = "rel skel:animationSource = </Root/Motion>"
    assert bound in text
    (tmp_path / "shared.usda").write_text(text.replace(bound, ""))
    crowd = HEAD.replace(")\n", "    startTimeCode = 0\n    endTimeCode = 4\n)\n")
    for name in ("figure", "other"):
        crowd += f'def "{name}_motion" (references = @{name}.usda@</Root/Motion>) {{\n}}\n'
        crowd += f"""def "{name}" (instanceable = true
    prepend apiSchemas = ["SkelBindingAPI"]
    references = @shared.usda@</Root>) {{
    rel skel:animationSource = </{name}_motion>
}}
"""
    (tmp_path / "crowd.usda").write_text(crowd)
    baked(tmp_path / "figure.usda", tmp_path / "baked.usda")
    loaded, alone = load(tmp_path / "crowd.usda"), load(tmp_path / "baked.usda")
    halves = [np.split(frame, 2) for frame in loaded.frames]
    for (first, second), own in zip(halves, alone.frames, strict=True):
        assert np.allclose(first, own, atol=1e-5)
        assert not np.allclose(first, second, atol=1e-2)


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
