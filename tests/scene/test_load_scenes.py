"""GLB and USD files, which hold scenes: transforms, instances and shadowed; broken ones are one line."""

import numpy as np
import pytest
import trimesh
from helpers import mesh_files as files
from helpers.mesh_files import refused, written
from shadowbench.harness.scene.readers import usd
from shadowbench.harness.scene.readers.load import load


def test_glb_applies_transforms_and_keeps_the_order(tmp_path):
    loaded = load(written(tmp_path, "a.glb", files.glb()))
    assert loaded.faces.tolist() == [
        *map(list, files.FACES),
        *[[i + 5 for i in face] for face in files.FACES],
    ]
    assert np.array_equal(loaded.frames[0], np.vstack([files.QUAD, files.QUAD + np.float32([10, 0, 0])]))
    assert loaded.up == (0, 1, 0)


@pytest.mark.parametrize("index", ["u1", "<u2"])
def test_glb_with_small_indices_in_many_places(tmp_path, index):
    def change(head):
        head["nodes"] = [{"mesh": 0} for _ in range(60)]
        head["scenes"] = [{"nodes": list(range(60))}]

    faces = load(written(tmp_path, "a.glb", files.glb(change=change, index=index))).faces
    assert np.array_equal(faces[-4:], np.array(files.FACES) + 59 * 5)


def test_glb_order_is_that_of_the_scene_not_of_names(tmp_path):
    """Nodes named so that sorting by name would turn them round."""

    def change(head):
        head["nodes"] = [{"mesh": 0, "name": f"{9 - i}", "translation": [i, 0, 0]} for i in range(10)]
        head["scenes"] = [{"nodes": [3, 0, 1, 2, *range(4, 10)]}]

    loaded = load(written(tmp_path, "a.glb", files.glb(change=change)))
    assert loaded.frames[0][::5, 0].tolist() == [3, 0, 1, 2, 4, 5, 6, 7, 8, 9]


def test_glb_transforms_are_those_of_trimesh(tmp_path):
    def change(head):
        turned = {
            "rotation": [0.5, 0.5, -0.5, 0.5],
            "scale": [2, 1, 3],
            "translation": [0, 7, 0],
            "children": [2],
        }
        matrix = [1, 2, 0, 0, 0, 1, 0, 0, 3, 0, 1, 0, 5, 6, 7, 1]
        head["nodes"] = [{"mesh": 0, "matrix": matrix}, turned, {"mesh": 0, "translation": [10, 0, 0]}]

    path = written(tmp_path, "a.glb", files.glb(change=change))
    ours = load(path)
    theirs = trimesh.load_scene(path, process=False).to_mesh()
    corners = ours.frames[0][ours.faces]
    assert np.allclose(sorted(corners.tolist()), sorted(theirs.triangles.tolist()))


def test_glb_with_several_meshes_modes_and_primitives(tmp_path):
    def change(head):
        solid, points = (
            {"attributes": {"POSITION": 0}, "indices": 1},
            {"attributes": {"POSITION": 0}, "mode": 0},
        )
        strip = {"attributes": {"POSITION": 0}, "mode": 5}
        head["meshes"] = [{"primitives": [solid]}, {"primitives": [points, strip, solid]}]
        head["nodes"] = [{"mesh": 1}]
        head["scenes"] = [{"nodes": [0]}]

    loaded = load(written(tmp_path, "a.glb", files.glb(change=change)))
    assert len(loaded.faces) == 3 + 4
    assert sorted(loaded.faces[0].tolist()) == [0, 1, 2]
    assert loaded.faces[3:].tolist() == [[i + 5 for i in face] for face in files.FACES]


def edit(*path, value):
    """A change of a GLB's JSON part: the entry at ``path`` becomes ``value``."""

    def change(head):
        for key in path[:-1]:
            head = head[key]
        head[path[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (edit("accessors", 0, "count", value=2_000_000_000), "accessor 0 needs"),
        (edit("accessors", 1, "count", value=-3), "not a whole number"),
        (edit("accessors", 1, "count", value=11), "not a multiple of 3"),
        (edit("accessors", 1, "byteOffset", value=4), "accessor 1 needs"),
        (edit("bufferViews", 1, "byteOffset", value=1 << 30), "buffer view 1"),
        (edit("bufferViews", 1, "byteOffset", value=0), "names vertex"),
        (edit("bufferViews", 0, "byteStride", value=1), "stride"),
        (edit("nodes", 2, value={"children": [1]}), "has two parents"),
        (edit("nodes", 2, "children", value=[77]), "node 77"),
        (edit("nodes", 2, value={"children": [0]}), "has two parents"),
        (edit("meshes", 0, "primitives", 0, "mode", value=6), "fans"),
        (edit("meshes", 0, "primitives", 0, "mode", value=1), "no triangles"),
        (edit("meshes", value=[]), "GLB"),
        (edit("extensionsRequired", value=["KHR_draco_mesh_compression"]), "KHR_draco"),
        (edit("accessors", 0, "sparse", value={}), "sparse"),
        (edit("buffers", 0, "uri", value="other.bin"), "self-contained"),
        (edit("nodes", value="no list"), "GLB"),
        (edit("scenes", value=[]), "no scene"),
    ],
)
def test_broken_glb_files(tmp_path, change, word):
    refused(written(tmp_path, "a.glb", files.glb(change=change)), word)


def test_truncated_glb(tmp_path):
    for length in (0, 11, 19, 40, 500, len(files.glb()) - 1):
        refused(written(tmp_path, "a.glb", files.glb()[:length]))


def test_glb_in_which_a_few_bytes_name_many_triangles(tmp_path):
    def change(head):
        head["nodes"] = [{"mesh": 0}] * 3000
        head["scenes"] = [{"nodes": list(range(3000))}]
        head["meshes"][0]["primitives"] *= 3000

    refused(written(tmp_path, "a.glb", files.glb(change=change)), "36000000 triangles with instances")


@pytest.mark.skipif(not usd.available(), reason="usd-core is not installed")
def test_usd_fans_transforms_visibility_and_up(tmp_path):
    loaded = load(written(tmp_path, "a.usda", files.USDA))
    assert loaded.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 4]]
    assert np.array_equal(loaded.frames[0], files.QUAD + np.float32([10, 0, 0]))
    assert loaded.up == (0, 0, 1)


@pytest.mark.skipif(not usd.available(), reason="usd-core is not installed")
@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("[5, 3]", "[5, 2]", "face 1 has 2 vertices"),
        ("[5, 3]", "[5, 3, 3]", "11 corners are declared"),
        ("[0, 1, 2, 3, 4, 0, 1, 4]", "[0, 1, 2, 3, 9, 0, 1, 4]", "vertex 9"),
        ("def Mesh", "def Xform", "no visible mesh"),
        ("#usda 1.0", "#usda", "USD"),
    ],
)
def test_broken_usd_files(tmp_path, old, new, word):
    refused(written(tmp_path, "a.usda", files.USDA.replace(old, new)), word)


def test_without_usd_core_the_line_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr(usd, "available", lambda: False)
    refused(written(tmp_path, "a.usda", files.USDA), "usd-core", "pip install")
