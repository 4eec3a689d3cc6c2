"""STL and OFF: as they are, in the forms that programs and collections have, and broken ones in one line."""

import numpy as np
import pytest
from helpers import mesh_files as files
from helpers.mesh_files import off, refused, stl_binary, written
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


@pytest.mark.parametrize(
    ("content", "word"),
    [
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
)  # fmt: skip
def test_broken_stl_files(tmp_path, content, word):
    refused(written(tmp_path, "a.stl", content), word)


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
    assert loaded.faces.tolist() == [list(face) for face in files.FACES]
    assert loaded.notes == OFF[content]


@pytest.mark.parametrize(
    ("content", "word"),
    [
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
)
def test_broken_off_files(tmp_path, content, word):
    refused(written(tmp_path, "a.off", content), word)
