"""OFF files: as they are, in the forms that collections have, and broken ones in one line."""

import numpy as np
import pytest
from helpers import mesh_files as files
from helpers.mesh_files import off, refused, written
from shadowbench.harness.scene.readers.load import load

POLYGONS = [(0, 1, 2, 3), (0, 1, 4), (4, 1, 2)]


@pytest.mark.parametrize(
    ("content", "notes"),
    [
        (off(), ()),
        (off(first="OFF "), ()),
        (off(first="OFF"), ()),
        (off(first="# a comment\n\nOFF # of the kind\n\n"), ()),
        (off(first="OFF BINARY\n").replace(b" BINARY", b""), ()),
        (off().replace(b"\n", b"\r\n"), ()),
        (off().replace(b"\n", b"\r"), ()),
        (off().decode().encode("utf-16"), ()),
        (off(counts=f"{len(files.QUAD)} {len(files.FACES)}"), ()),
        (off(first="COFF\n", vertex=" 255 0 0 255"), ("colours left out",)),
        (
            off(first="STCNOFF\n", vertex=" 0 0 1 0.5 0.5 0.5 1 0 0"),
            ("colours and normals and texture coordinates left out",),
        ),
        (off(face=" 0.5 0.5 0.5"), ("colours left out",)),
        (off(vertex="  # a corner", face=" 7"), ("colours left out",)),
    ],
)
def test_forms(tmp_path, content, notes):
    loaded = load(written(tmp_path, "a.off", content))
    assert np.array_equal(loaded.frames[0], files.QUAD)
    assert loaded.faces.tolist() == [list(face) for face in files.FACES]
    assert loaded.notes == notes


def test_polygons_are_cut_in_the_order_of_the_file(tmp_path):
    loaded = load(written(tmp_path, "a.off", off(polygons=POLYGONS)))
    assert loaded.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 4], [4, 1, 2]]


def test_concave_polygons_keep_their_area(tmp_path):
    points = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [2, 1, 0], [0, 4, 0]])
    loaded = load(written(tmp_path, "a.off", off(points, [(1, 2, 3, 4, 0)])))
    a, b, c = loaded.frames[0][loaded.faces].transpose(1, 0, 2)
    assert len(loaded.faces) == 3
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(10)


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"", "does not begin with OFF"),
        (b"3 1 0\n", "does not begin with OFF"),
        (b"OFF\n", "no numbers of vertices and faces"),
        (b"OFF\nmany 1 0\n", "no numbers of vertices and faces"),
        (b"OFF\n-1 1 0\n", "no numbers of vertices and faces"),
        (b"OFF\n0 0 0\n", "no triangles"),
        (off(first="OFF BINARY\n"), "binary"),
        (off(first="4OFF\n"), "dimensions"),
        (off(first="nOFF\n3\n"), "dimensions"),
        (off(counts="5 5 0"), "claims 5 vertices and 5 faces, but 9 lines follow"),
        (off(counts="5 3 0"), "but 9 lines follow"),
        (off(counts="2000000000 4 0"), "but 9 lines follow"),
        (off(counts="1e300 4 0"), "but 9 lines follow"),
        (off(counts="4 5 0"), "face 0"),
        (off(polygons=[(0, 1)]), "face 0 has 2 vertices"),
        (off(polygons=[(0, 1, 9)]), "vertex 9"),
        (off(polygons=[(0, 1, 2), (0, 1, -1)]), "face 1: it names vertex -1"),
        (off(polygons=[(0, 1, 2.5)]), "face 0: it names vertex 2.5"),
        (off(polygons=[(0, 1, 1 << 40)]), "face 0: it names vertex 1.09951e+12"),
        (off().replace(b"\n3 0 1 2\n", b"\n4 0 1 2\n"), "face 0: it has 3 numbers after its number of corners, 4"),
        (off().replace(b"0.5 0.5 1", b"0.5 half 1"), "vertex 4: a value is not a number"),
        (off().replace(b"0.5 0.5 1", b"0.5 0.5"), "vertex 4: it has 2 coordinates"),
        (off()[:-9], "lines follow"),
    ],
)
def test_broken_files(tmp_path, content, word):
    refused(written(tmp_path, "a.off", content), word)
