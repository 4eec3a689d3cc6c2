"""Meshes bent by skeletons and blend shapes are those that UsdSkel.BakeSkinning makes of them."""

import numpy as np
import pytest
from helpers.mesh_files import refused
from helpers.usd_figure import skinned
from helpers.usd_stages import HEAD, needs_usd
from shadowbench.harness.scene.readers.load import load

pytestmark = needs_usd


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
