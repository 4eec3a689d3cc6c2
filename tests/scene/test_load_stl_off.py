"""STL, OFF and 3MF: as they are, in the forms that programs have, in parts of a package; broken ones in one line."""

import numpy as np
import pytest
import trimesh
from helpers import mesh_files as files
from helpers.mesh_files import off, refused, stl_binary, written, zipped
from helpers.threemf_files import group, item, mesh, model, package, use
from shadowbench.harness.scene.readers.load import load

SOLID = files.stl_ascii().decode()
ONE_LINE = " ".join(SOLID.replace("solid hand\n", "", 1).replace("end", " end").split())
NESTED = SOLID.replace("solid hand", "solid two words", 1)
CUT = "no endsolid at its end, so it may have been cut short"

STL = {
    "plain": SOLID,
    "no endsolid": SOLID[: SOLID.rindex("endsolid")],
    "several solids": NESTED + SOLID.replace("hand", "foot"),
    "a solid within a solid": "solid outer\n" + SOLID + "endsolid outer\n",
    "CR": SOLID.replace("\n", "\r"),
    "CR LF": SOLID.replace("\n", "\r\n"),
    "capitals": SOLID.upper(),
    "no indentation": "\n".join(line.strip() for line in SOLID.splitlines()),
    "tabs": SOLID.replace("vertex ", "vertex\t\t").replace(" outer", "\touter"),
    "blanks first": "\n  " + SOLID,
    "a name with keywords": SOLID.replace("hand", "facet vertex hand"),
    "all in one line": "solid hand\n" + ONE_LINE,
    "an empty name": SOLID.replace(" hand", ""),
    "all in the first line": "solid hand " + ONE_LINE,
    "a facet in the first line": SOLID.replace("hand\n", "hand ", 1),
    "a facet in one line": " ".join(SOLID.split("\n", 8)[:8]) + "\n" + SOLID.split("\n", 8)[8],
    "an end in the line of a vertex": SOLID.replace("\n endloop\n", " endloop\n"),
    "no solid": SOLID.partition("\n")[2],
    "binary": stl_binary(),
    **{f"{head}, {len(tail)} bytes more": head.encode().ljust(80, b"\0") + stl_binary()[80:] + tail
       for head in ("solid", "solid facet normal vertex", "SOLID made by a program")
       for tail in (b"", b"\0", b"end of file\n", bytes(49))},
}  # fmt: skip


@pytest.mark.parametrize("form", STL)
def test_forms_of_stl(tmp_path, form):
    loaded = load(written(tmp_path, "a.stl", STL[form]))
    expected = files.QUAD[np.array(files.FACES)]
    if form == "several solids":
        expected = np.concatenate([expected, expected])
    assert np.array_equal(loaded.frames[0][loaded.faces], expected)
    assert loaded.up == (0, 0, 1)
    more = form.rpartition(", ")[2]
    after = (
        (f"{more.replace(' more', '')} after the last triangle left out",) if "more" in more and more[0] != "0" else ()
    )
    assert loaded.notes == ((CUT,) if form == "no endsolid" else after)


BROKEN = {
    "stl": [
        (SOLID.replace(" endloop\nendfacet\nendsolid hand\n", ""), "its last facet has no endfacet"),
        (SOLID.replace("facet normal 0 0 0\n", "", 1).replace("outer loop", "loop", 1), "facet 0 has not three"),
        (SOLID.replace("  vertex 1 0 0\n", "  vertex 1 0 0\n" * 2, 1), "facet 0 has not three vertices"),
        (SOLID.replace("  vertex 1 1 0\n", "  vertex 1 1\n"), "facet 0: a vertex has 2 coordinates instead of 3"),
        (SOLID * 9_000 + SOLID.replace("vertex 1 0 0", "vertex 1 O 0"), "facet 36000: a value is not a number"),
        ("solid a\nendfacet\nendsolid a\n", "holds no triangles"),
        ("solid a\nendsolid a\n", "holds no triangles"),
        (stl_binary(claimed=5), "claims 5 triangles"),
        (stl_binary(claimed=3), "claims 3 triangles"),
        (stl_binary() + bytes(50), "claims 4 triangles"),
        (stl_binary()[:-7], "truncated"),
        (stl_binary(claimed=4_000_000_000), "claims 4000000000"),
        (stl_binary(triangles=np.zeros((0, 3), int)), "no triangles"),
        (b"short", "neither"),
    ],
    "off": [
        (b"", "does not begin with OFF"),
        (b"3 1 0\n", "does not begin with OFF"),
        (b"OFF\n", "no numbers of vertices and faces"),
        (b"OFF\nmany 1 0\n", "no numbers of vertices and faces"),
        (b"OFF\n-1 1 0\n", "no numbers of vertices and faces"),
        (b"OFF\ninf 1 0\n", "no numbers of vertices and faces"),
        (b"OFF\n0 0 0\n", "no triangles"),
        (off(first="OFF BINARY\n"), "binary"),
        (off(first="4OFF\n"), "dimensions"),
        (off(first="nOFF\n3\n"), "dimensions"),
        (off(counts="5 5 0"), "claims 5 vertices and 5 faces, but 9 lines follow"),
        (off(counts="5 3 0"), "but 9 lines follow"),
        (off(counts="1e300 4 0"), "but 9 lines follow"),
        (off(counts="4 5 0"), "face 0"),
        (off(polygons=[(0, 1)]), "face 0 has 2 vertices"),
        (off(polygons=[(0, 1, 9)]), "vertex 9"),
        (off(polygons=[(0, 1, 2), (0, 1, -1)]), "face 1: it names vertex -1"),
        (off(polygons=[(0, 1, 2.5)]), "face 0: it names vertex 2.5"),
        (off(polygons=[(0, 1, 1 << 40)]), "face 0: it names vertex 1.09951e+12"),
        (off(polygons=[(0, 1, "inf")]), "face 0: it names vertex inf"),
        (off().replace(b"\n3 0 1 2\n", b"\n4 0 1 2\n"), "face 0: it has 3 numbers after its number of corners, 4"),
        (off().replace(b"0.5 0.5 1", b"0.5 half 1"), "vertex 4: a value is not a number"),
        (off().replace(b"0.5 0.5 1", b"0.5 0.5"), "vertex 4: it has 2 coordinates"),
        (off()[:-9], "lines follow"),
    ],
    "3mf": [
        (b"", "3MF"),
        (b"no archive", "3MF"),
        (package("no XML"), "3D/model.model is not XML"),
        *((package(model(objects, *build)), word) for objects, build, word in (
            ([], [], "no triangles"),
            ([mesh(1)], [], "no triangles"),
            ([mesh(1)], [item(2)], "the build names object '2'"),
            ([group(2, use(1)), mesh(1)], [item(2)], "object 2 names object '1', which does not come before it"),
            ([group(2, use(2))], [item(2)], "object 2 names object '2'"),
            ([mesh(1), mesh(1)], [item(1)], "object 1 is there twice"),
            ([mesh(1)], [item(1, path="/3D/absent.model")], "no part '3D/absent.model'"),
            ([mesh(1)], [item(1, (1, 2))], "a transform is not 12 numbers"),
            ([mesh(1)], [item(1, ("1_0", 2, 3))], "a transform is not 12 numbers"),
            ([mesh(1)], [item(1, ("nan", 2, 3))], "a transform is not 12 numbers"),
            ([mesh(1, triangles=[(0, 1, 5)])], [item(1)], "object 1 names vertex 5, but there are 5"),
            ([mesh(1, triangles=[(0, 1, -1)])], [item(1)], "object 1 names vertex -1"),
            ([mesh(1, triangles=[(0, 1, 1.5)])], [item(1)], "a vertex index is not a number"),
            ([mesh(1).replace('x="1"', 'x="one"')], [item(1)], "a coordinate is not a number"),
            ([mesh(1).replace('x="1"', 'x="1 2"')], [item(1)], "a coordinate is not a number"),
            ([mesh(1).replace('x="1"', 'x="1_0"')], [item(1)], "a coordinate is not a number"),
            ([mesh(1).replace('x="1"', 'u="1"')], [item(1)], "a vertex has no 'x'"),
            ([mesh(1).replace('v2="1"', "")], [item(1)], "a triangle has no 'v2'"),
            (['<object id="1"><d:dots xmlns:d="http://dots"/></object>'], [item(1)], "another shape"),
            ([" " * (70 << 20), mesh(1)], [item(1)], "unpacks to far more than its size"),
        )),
        (package(model([mesh(1)], item(1), more='xmlns:x="http://secret" requiredextensions="p x"')),
         "needs the extension http://secret"),
        (package(model([mesh(1)], item(1)).replace("?>", '?><!DOCTYPE a [<!ENTITY b "c">]>')), "document type"),
        (zipped({"other.txt": ""}), "no part '_rels/.rels'"),
        (zipped({"_rels/.rels": "<Relationships/>"}), "names no 3D model"),
        # twice the object before it, 64 times over
        *((package(model([first, *(group(k + 1, use(k), use(k)) for k in range(64))], item(64))),
           "builds 36893488147419103231 objects") for first in (mesh(0), group(0))),
    ],
}  # fmt: skip


@pytest.mark.parametrize(("suffix", "place"), [(suffix, k) for suffix, own in BROKEN.items() for k in range(len(own))])
def test_broken_files(tmp_path, suffix, place):
    content, word = BROKEN[suffix][place]
    refused(written(tmp_path, f"a.{suffix}", content), word)


OFF = {
    off(): (),
    off(first="OFF "): (),
    off(first="OFF"): (),
    off(first="# a comment\n\nOFF # of the kind\n\n"): (),
    off().replace(b"\n", b"\r\n"): (),
    off().replace(b"\n", b"\r"): (),
    off().decode().encode("utf-16"): (),
    off(counts=f"{len(files.QUAD)} {len(files.FACES)}"): (),
    off(first="COFF\n", vertex=" 255 0 0 255"): ("colours left out",),
    off(first="STCNOFF\n", vertex=" 0 0 1 0.5 0.5 0.5 1 0 0"): (
        "colours and normals and texture coordinates left out",
    ),
    off(face=" 0.5 0.5 0.5"): ("colours left out",),
    off(vertex="  # a corner", face=" 7"): ("colours left out",),
}


@pytest.mark.parametrize("content", OFF)
def test_forms_of_off(tmp_path, content):
    loaded = load(written(tmp_path, "a.off", content))
    assert np.array_equal(loaded.frames[0], files.QUAD)
    assert (loaded.faces.tolist(), loaded.notes) == ([list(face) for face in files.FACES], OFF[content])


def test_objects_are_built_in_the_order_of_the_items(tmp_path):
    """What is mirrored is turned round."""
    one = np.array([(0, 1, 2)])
    mirror = (-1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0)
    text = model([mesh(1), mesh(7, files.QUAD * 2, one)], item(7, (10, 0, 0)), item(1), item(7, mirror))
    loaded = load(written(tmp_path, "a.3mf", package(text)))
    assert loaded.faces.tolist() == [[0, 1, 2], *[[5 + i for i in face] for face in files.FACES], [10, 12, 11]]
    expected = [files.QUAD * 2 + [10, 0, 0], files.QUAD, files.QUAD * [-2, 2, 2]]
    assert np.array_equal(loaded.frames[0], np.concatenate(expected))
    assert (loaded.up, loaded.notes) == ((0, 0, 1), ())


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


@pytest.mark.parametrize(("text", "notes"), [
    (model(['<basematerials id="9"/>', BEAMS], item(1)), ("beam lattices left out", "materials left out")),
    (
        model([mesh(1), mesh(2), group(3, use(1))], item(1)).replace("millimeter", "inch"),
        ("objects that are not built (2) left out", "unit of length: inch"),
    ),
])  # fmt: skip
def test_what_is_left_out_and_another_unit_are_noted(tmp_path, text, notes):
    loaded = load(written(tmp_path, "a.3mf", package(text)))
    assert np.array_equal(loaded.frames[0], files.QUAD)
    assert loaded.notes == notes


def test_elements_of_other_namespaces_are_not_those_of_the_core(tmp_path):
    slices = '<s:stack xmlns:s="http://other"><s:vertices><s:vertex x="1" y="2"/></s:vertices></s:stack>'
    loaded = load(written(tmp_path, "a.3mf", package(model([slices, mesh(1)], item(1)))))
    assert np.array_equal(loaded.frames[0], files.QUAD)
