"""The files that a USD stage is made of: all count, none is missing in silence, and the library prints nothing."""

import shutil
import zipfile
from pathlib import Path

import pytest
from helpers.mesh_files import refused, written, zipped
from helpers.usd_stages import HEAD, bounds, mesh, moved_by, needs_usd
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.readers.checks import Wanted
from shadowbench.harness.scene.readers.load import load, source

pytestmark = needs_usd

WITH_DEFAULT = HEAD.replace("(\n", '(\n    defaultPrim = "G"\n')
PART = WITH_DEFAULT + 'def Xform "G" {\n' + mesh("M") + "}\n"


def names(loaded) -> list[str]:
    return [path.name for path in loaded.files]


def composed(folder: Path) -> Path:
    """A stage of sublayers, references of references, payloads, a package, instances, a variant and value clips."""
    written(folder, "under.usda", HEAD + mesh("Under", moved_by(-10)))
    written(folder, "leaf.usda", PART)
    written(folder, "branch.usda", WITH_DEFAULT + 'def Xform "G" (references = @./leaf.usda@) {\n}\n')
    written(folder, "payload.usda", PART)
    written(folder, "chosen.usda", PART)
    written(folder, "not_chosen.usda", PART)
    written(folder, "package.usdz", zipped({"inner.usda": PART}, zipfile.ZIP_STORED))
    topology = "int[] faceVertexCounts = [3]\n    int[] faceVertexIndices = [0, 1, 2]\n"
    written(folder, "manifest.usda", HEAD + 'def Mesh "C" {\n    point3f[] points\n}\n')
    for k in (1, 2):
        points = f"point3f[] points.timeSamples = {{ {k}: [(0, 0, {k}), (1, 0, {k}), (0, 1, {k})] }}\n"
        written(folder, f"clip{k}.usda", HEAD + f'def Mesh "C" {{\n    {points}}}\n')
    clips = """    clips = { dictionary default = {
        asset[] assetPaths = [@./clip1.usda@, @./clip2.usda@]
        asset manifestAssetPath = @./manifest.usda@
        string primPath = "/C"
        double2[] active = [(1, 0), (2, 1)]
        double2[] times = [(1, 1), (2, 2)]
    } }
"""
    head = HEAD.replace(")\n", "    subLayers = [@./under.usda@]\n    startTimeCode = 1\n    endTimeCode = 2\n)\n")
    text = f"""{head}def "Referred" (references = @./branch.usda@) {{
}}
def Xform "Paid" (payload = @./payload.usda@) {{
}}
def "Packed" (references = @./package.usdz@) {{
}}
def "Instance" (references = @./leaf.usda@
    instanceable = true) {{
}}
def "Varied" (prepend variantSets = "v"
    variants = {{ string v = "a" }}) {{
    variantSet "v" = {{
        "a" (references = @./chosen.usda@) {{
        }}
        "b" (references = @./not_chosen.usda@) {{
        }}
    }}
}}
def Mesh "C" ({clips}) {{
    {topology}}}
"""
    return written(folder, "root.usda", text)


def test_every_layer_that_is_read_counts(tmp_path):
    path = composed(tmp_path)
    loaded = load(path)
    assert names(loaded) == [
        "root.usda", "branch.usda", "chosen.usda", "clip1.usda", "clip2.usda", "leaf.usda", "manifest.usda",
        "package.usdz", "payload.usda", "under.usda",
    ]  # fmt: skip
    assert (len(loaded.faces), [bounds(loaded, k)[1][2] for k in range(2)]) == (7, [1, 2])
    before = source(loaded.files).sha256
    for name in names(loaded)[1:]:
        file = tmp_path / name
        kept = file.read_bytes()
        changed = kept.replace(b"(0, 1, 0)", b"(0, 2, 0)") if name == "package.usdz" else kept + b"\n"
        assert changed != kept
        file.write_bytes(changed)
        shutil.copystat(path, file)  # the time of a change does not matter
        assert source(load(path).files).sha256 != before, name
        file.write_bytes(kept)
    assert source(load(path).files).sha256 == before


def test_a_package_is_one_file(tmp_path):
    composed(tmp_path)
    assert names(load(tmp_path / "package.usdz")) == ["package.usdz"]


def test_a_change_behind_the_root_is_another_scene(tmp_path):
    """So that it is measured again."""
    part = written(tmp_path, "geom.usda", PART)
    root = written(tmp_path, "root.usda", HEAD + 'def "House" (prepend references = @./geom.usda@) {\n}\n')
    before = resolve(root).source
    part.write_text(PART.replace("(0, 1, 0)]", "(0, 3, 0)]"))
    after = resolve(root).source
    assert after.file == before.file
    assert after.sha256 != before.sha256


MISSING = {
    "reference": ('def "X" (references = @./gone.usda@) {\n}\n', "asset gone.usda for reference"),
    "payload": ('def "X" (payload = @./gone.usda@) {\n}\n', "asset gone.usda for payload"),
    "sublayer": ("", "sublayer gone.usda"),
    "prim": ('def "X" (references = @./part.usda@</Other>) {\n}\n', "part.usda</Other>"),
    "default prim": ('def "X" (references = @./plain.usda@) {\n}\n', "plain.usda<defaultPrim>"),
    "damaged": ('def "X" (references = @./damaged.usda@) {\n}\n', "asset damaged.usda for reference"),
    "cycle": ('def "X" (references = </Y>) {\n}\ndef "Y" (references = </X>) {\n}\n', "Cycle detected"),
    "instanced": (
        'class "K" {\ndef "X" (references = @./gone.usda@) {\n}\n}\n'
        'def "I" (references = </K>\n    instanceable = true) {\n}\n',
        "asset gone.usda for reference",
    ),
}


@pytest.mark.parametrize("what", MISSING)
def test_a_missing_part_is_refused_or_named(tmp_path, capfd, what):
    text, word = MISSING[what]
    written(tmp_path, "part.usda", PART)
    written(tmp_path, "plain.usda", HEAD + mesh("M"))
    written(tmp_path, "damaged.usda", "#usda 1.0\ndef Mesh x\n")
    head = HEAD.replace(")\n", "    subLayers = [@./gone.usda@]\n)\n") if what == "sublayer" else HEAD
    path = written(tmp_path, "a.usda", head + text + mesh("There"))
    line = refused(path, word, "--allow-missing")
    assert "0x" not in line.removeprefix(str(path))
    loaded = load(path, Wanted(allow_missing=True))
    assert len(loaded.faces) == 1
    assert any(note.startswith("left out: ") and word in note for note in loaded.notes)
    assert str(tmp_path) not in " ".join(loaded.notes)
    assert "".join(capfd.readouterr()) == ""


def test_a_missing_part_behind_a_link_is_named_without_its_folder(tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "there")
    written(tmp_path / "there", "a.usda", HEAD + MISSING["reference"][0] + mesh("M"))
    with pytest.raises(
        UserError, match=r"a\.usda: Could not open asset gone\.usda for reference introduced by a\.usda"
    ):
        load(tmp_path / "link" / "a.usda")


def test_a_missing_clip_is_refused_or_its_times_are_empty(tmp_path, capfd):
    path = composed(tmp_path)
    (tmp_path / "clip2.usda").unlink()
    with pytest.raises(UserError, match=r"clip \./clip2\.usda of </C>; .*--allow-missing"):
        load(path)
    loaded = load(path, Wanted(allow_missing=True))
    assert (bounds(loaded, 0)[1][2], bounds(loaded, 1)[1][2]) == (1, 0)
    assert "not in all frames: /C" in loaded.notes
    assert "".join(capfd.readouterr()) == ""


def test_what_the_library_warns_of_is_noted_and_not_printed(tmp_path, capfd):
    path = written(tmp_path, "a.usda", HEAD + mesh("M", '    uniform token[] xformOpOrder = ["nonsense"]\n'))
    loaded = load(path)
    assert "".join(capfd.readouterr()) == ""
    assert any(note.startswith("USD warns: ") for note in loaded.notes)


@pytest.mark.parametrize("content", [b"", b"#usda 1.0\ndef", b"PXR-USDC" + b"\0" * 100, b"PK\3\4", b"\0" * 4096])
@pytest.mark.parametrize("suffix", ["usd", "usda", "usdc", "usdz"])
def test_files_that_are_no_stage_are_one_line_and_silent(tmp_path, capfd, content, suffix):
    path = written(tmp_path, f"a.{suffix}", content)
    assert "pxrInternal" not in refused(path)
    assert "".join(capfd.readouterr()) == ""
