"""3MF files: objects, components and parts of a package; broken and boundless ones are one line."""

import numpy as np
import pytest
import trimesh
from helpers import mesh_files as files
from helpers.mesh_files import refused, written
from helpers.threemf_files import group, item, mesh, model, package, use
from helpers.zipped import zipped
from shadowbench.harness.scene.readers.load import load


def test_objects_are_built_in_the_order_of_the_items(tmp_path):
    """What is mirrored is turned round."""
    one = np.array([(0, 1, 2)])
    mirror = (-1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0)
    text = model([mesh(1), mesh(7, files.QUAD * 2, one)], item(7, (10, 0, 0)), item(1), item(7, mirror))
    loaded = load(written(tmp_path, "a.3mf", package(text)))
    assert loaded.faces.tolist() == [[0, 1, 2], *[[5 + i for i in face] for face in files.FACES], [10, 12, 11]]
    expected = [files.QUAD * 2 + [10, 0, 0], files.QUAD, files.QUAD * [-2, 2, 2]]
    assert np.array_equal(loaded.frames[0], np.concatenate(expected))
    assert loaded.up == (0, 0, 1)
    assert loaded.notes == ()


def test_components_are_moved_by_all_above_them(tmp_path):
    """A transform multiplies rows: 12 numbers are three rows of axes and one of the place."""
    turned = (0, 2, 0, -2, 0, 0, 0, 0, 2, 1, 2, 3)
    objects = [mesh(1), group(2, use(1, (1, 0, 0)), use(1)), group(3, use(2, turned), use(1))]
    loaded = load(written(tmp_path, "a.3mf", package(model(objects, item(3, (100, 0, 0))))))
    axes = np.array(turned[:9]).reshape(3, 3)
    expected = [
        (files.QUAD + [1, 0, 0]) @ axes + [101, 2, 3],
        files.QUAD @ axes + [101, 2, 3],
        files.QUAD + [100, 0, 0],
    ]
    assert np.allclose(loaded.frames[0], np.concatenate(expected))
    assert len(loaded.faces) == 12


def test_parts_of_a_package_have_their_own_objects(tmp_path):
    """As slicers write them; trimesh takes all meshes of the part for each of its objects."""
    other = model([mesh(1), mesh(2, files.QUAD * 3, [(0, 1, 2)])])
    parts = group(1, use(2, path="/3D/other.model"), use(1, (5, 0, 0), path="/3D/OTHER.model"))
    text = model([parts], item(1), item(2, path="/3D/other.model"), more='requiredextensions="p"')
    loaded = load(written(tmp_path, "a.3mf", package(text, other=other)))
    expected = [files.QUAD * 3, files.QUAD + [5, 0, 0], files.QUAD * 3]
    assert np.array_equal(loaded.frames[0], np.concatenate(expected))
    assert len(loaded.faces) == 6


def test_it_is_what_trimesh_reads(tmp_path):
    path = tmp_path / "a.3mf"
    scene = trimesh.Scene()
    ball = trimesh.creation.icosphere(2)
    scene.add_geometry(ball, transform=trimesh.transformations.random_rotation_matrix())
    scene.add_geometry(trimesh.creation.box(), transform=trimesh.transformations.translation_matrix([3, 0, 0]))
    path.write_bytes(scene.export(file_type="3mf"))
    theirs, ours = trimesh.load_scene(path, process=False).to_mesh(), load(path)
    assert len(ours.faces) == len(theirs.faces)
    mine, other = (
        corners[np.lexsort(corners.mean(axis=1).round(6).T)]
        for corners in (ours.frames[0][ours.faces], theirs.triangles)
    )
    assert np.allclose(mine, other)


LATTICE = "http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02"
BEAMS = mesh(1).replace("</mesh>", f'<b:beamlattice xmlns:b="{LATTICE}"/></mesh>')


@pytest.mark.parametrize(
    ("text", "notes"),
    [
        (model(['<basematerials id="9"/>', BEAMS], item(1)), ("beam lattices left out", "materials left out")),
        (
            model([mesh(1), mesh(2), group(3, use(1))], item(1)).replace("millimeter", "inch"),
            ("objects that are not built (2) left out", "unit of length: inch"),
        ),
    ],
)
def test_what_is_left_out_and_another_unit_are_noted(tmp_path, text, notes):
    loaded = load(written(tmp_path, "a.3mf", package(text)))
    assert np.array_equal(loaded.frames[0], files.QUAD)
    assert loaded.notes == notes


def test_elements_of_other_namespaces_are_not_those_of_the_core(tmp_path):
    slices = '<s:stack xmlns:s="http://other"><s:vertices><s:vertex x="1" y="2"/></s:vertices></s:stack>'
    loaded = load(written(tmp_path, "a.3mf", package(model([slices, mesh(1)], item(1)))))
    assert np.array_equal(loaded.frames[0], files.QUAD)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", ["3MF"]),
        (b"no archive", ["3MF"]),
        (package("no XML"), ["3D/model.model is not XML"]),
        (package(model([])), ["no triangles"]),
        (package(model([mesh(1)])), ["no triangles"]),
        (package(model([mesh(1)], item(2))), ["the build names object '2'"]),
        (package(model([group(2, use(1)), mesh(1)], item(2))), ["object 2 names object '1'", "before it"]),
        (package(model([group(2, use(2))], item(2))), ["object 2 names object '2'"]),
        (package(model([mesh(1), mesh(1)], item(1))), ["object 1 is there twice"]),
        (package(model([mesh(1)], item(1, path="/3D/absent.model"))), ["no part '3D/absent.model'"]),
        (package(model([mesh(1)], item(1, (1, 2)))), ["a transform is not 12 numbers"]),
        (package(model([mesh(1)], item(1, ("1_0", 2, 3)))), ["a transform is not 12 numbers"]),
        (package(model([mesh(1)], item(1, ("nan", 2, 3)))), ["a transform is not 12 numbers"]),
        (package(model([mesh(1, triangles=[(0, 1, 5)])], item(1))), ["object 1 names vertex 5, but there are 5"]),
        (package(model([mesh(1, triangles=[(0, 1, -1)])], item(1))), ["object 1 names vertex -1"]),
        (package(model([mesh(1, triangles=[(0, 1, 1.5)])], item(1))), ["a vertex index is not a number"]),
        (package(model([mesh(1).replace('x="1"', 'x="one"')], item(1))), ["a coordinate is not a number"]),
        (package(model([mesh(1).replace('x="1"', 'x="1 2"')], item(1))), ["a coordinate is not a number"]),
        (package(model([mesh(1).replace('x="1"', 'x="1_0"')], item(1))), ["a coordinate is not a number"]),
        (package(model([mesh(1).replace('x="1"', 'u="1"')], item(1))), ["a vertex has no 'x'"]),
        (package(model([mesh(1).replace('v2="1"', "")], item(1))), ["a triangle has no 'v2'"]),
        (package(model(['<object id="1"><d:dots xmlns:d="http://dots"/></object>'], item(1))), ["another shape"]),
        (
            package(model([mesh(1)], item(1), more='xmlns:x="http://secret" requiredextensions="p x"')),
            ["needs the extension http://secret"],
        ),
        (package(model([mesh(1)], item(1)).replace("?>", '?><!DOCTYPE a [<!ENTITY b "c">]>')), ["document type"]),
    ],
)
def test_broken_files(tmp_path, content, words):
    refused(written(tmp_path, "a.3mf", content), *words)


def nested(first: str) -> bytes:
    """Twice the object before it, 64 times over."""
    return package(model([first, *(group(k + 1, use(k), use(k)) for k in range(64))], item(64)))


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (zipped({"other.txt": ""}), "no part '_rels/.rels'"),
        (zipped({"_rels/.rels": "<Relationships/>"}), "names no 3D model"),
        (package(model([" " * (70 << 20), mesh(1)], item(1))), "unpacks to far more than its size"),
        (nested(mesh(0)), "builds 36893488147419103231 objects"),
        (nested(group(0)), "builds 36893488147419103231 objects"),
    ],
    ids=["no part", "no model", "bomb", "meshes", "groups"],
)
def test_packages_beyond_reason(tmp_path, content, word):
    refused(written(tmp_path, "a.3mf", content), word)
