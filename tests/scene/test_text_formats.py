"""OBJ, PLY and STL as programs write them: line ends, comments, encodings, strips, solids; and their mistakes by line."""

import struct

import numpy as np
import pytest
import trimesh
from helpers import mesh_files as files
from helpers.mesh_files import refused, written
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.readers.checks import MAX_LINE
from shadowbench.harness.scene.readers.load import SUFFIXES, load
from shadowbench.harness.scene.readers.text import first_wrong, numbers

CORNER = "v 0 0 0\nv 4 0 0\nv 0 1 0\nv 4 1 0\nv 0 8 0\n"
FACES = "f 1 2 3\nf 2 4 3\nf 3 4 5\n"
READ = [[0, 1, 2], [1, 3, 2], [2, 3, 4]]

OBJ = {
    "plain": CORNER + FACES,
    "a comment that ends in a backslash": CORNER + "# saved from D:\\meshes\\\n" + FACES,
    "a first line that ends in one": "# saved from D:\\meshes\\\n" + CORNER + FACES,
    "a comment after a face": CORNER + FACES.replace("\n", " # front\n").replace("v 4 1 0", "v 4 1 0#here"),
    "a comment with a backslash after a face": CORNER + FACES.replace("2 3\n", "2 3 # c:\\\n"),
    "CR": (CORNER + FACES).replace("\n", "\r"),
    "LF, then CR": CORNER + "f 1 2 3\n" + FACES[8:].replace("\n", "\r"),
    "CR LF, then LF": CORNER.replace("\n", "\r\n") + FACES,
    "LF, then CR LF, then CR": CORNER + "f 1 2 3\r\n" + FACES[8:].replace("\n", "\r"),
    "continued lines": CORNER + "f 1 \\\n2 \\\n3\nf \\\n2 4 3\nf 3 4 \\ \n 5\n",
    "continued with CR LF": CORNER.replace("\n", "\r\n") + "f 1 \\\r\n2 3\r\nf 2 4 3\r\nf 3 4 5",
    "blanks before and after": "  " + CORNER.replace("\n", " \t\n \t") + "\n\n" + FACES.replace("\n", "   \n"),
    "tabs": (CORNER + FACES).replace(" ", "\t"),
    "form feeds": CORNER.replace("\n", "\n\f") + FACES.replace("f 2", "\f\nf\v2"),
    "no last line end": (CORNER + FACES)[:-1],
    "texture and normal indices": CORNER + "f 1/1 2/2 3/3\nf 2//1 4//1 3//1\nf 3/1/1 4/2/2 5/3/3\n",
    "indices relative to their line": CORNER[:24] + "f -3 -2 -1\n" + CORNER[24:] + "f 2 -2 3\nf -3 4 -1\n",
    "materials in turn": CORNER + "usemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 2//1 4//1 3//1\nusemtl a\ns off\n" + FACES[16:],
    "mixed indices": CORNER + "f 1/7 2 3//9\nf -4 -2/1 -3/1/1\nf 3/ 4// 5/-1\n",
    "words after a position": CORNER.replace("v 4 1 0", "v 4 1 0 red") + FACES,
    "colours of some": CORNER.replace("v 4 1 0", "v 4 1 0 1 0 0") + FACES,
    "an object named with a hash": "o part#1\\\n\n" + CORNER + FACES,
    "outlines of old programs": CORNER + FACES.replace("f 2", "fo 2").replace("f 3", " fo\t3"),
}  # fmt: skip


@pytest.mark.parametrize("kind", OBJ)
def test_an_obj_is_read_whatever_its_lines(tmp_path, kind):
    loaded = load(written(tmp_path, "a.obj", OBJ[kind]))
    assert loaded.faces.tolist() == READ
    assert loaded.frames[0].tolist() == [[0, 0, 0], [4, 0, 0], [0, 1, 0], [4, 1, 0], [0, 8, 0]]


ENCODINGS = ("utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-32-be")


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("suffix", ["obj", "ply", "stl"])
def test_a_text_in_another_encoding_is_read_by_its_mark(tmp_path, encoding, suffix):
    plain = {"obj": OBJ["LF, then CR"].encode(), "ply": files.ply_ascii(), "stl": files.stl_ascii()}[suffix]
    mark = "\ufeff" if encoding.endswith("e") else ""
    coded = written(tmp_path, f"a.{suffix}", (mark + plain.decode()).encode(encoding))
    assert coded.read_bytes() != plain
    right = load(written(tmp_path, f"b.{suffix}", plain))
    assert np.array_equal(load(coded).faces, right.faces)
    assert np.array_equal(load(coded).frames[0], right.frames[0])


@pytest.mark.parametrize("suffix", [*SUFFIXES, ".toml"])
def test_a_git_lfs_pointer_is_called_what_it_is(tmp_path, suffix):
    path = written(tmp_path, f"a{suffix}", "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n")
    with pytest.raises(UserError, match=rf"a{suffix}: is a Git LFS pointer.*git lfs pull"):
        resolve(path)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (CORNER + FACES + "f 1 2 x\n", "line 9: a value is not a number"),
        (CORNER + "f 1 \\\n 2 3\nf 1 \\\n\\\n2\nf 1 2 3\n", "line 8: a face has 2 vertices, it needs at least 3"),
        ("# a\\\n" + CORNER + "f 1 2 3 \\\n 4\nf 0 1 2\n", "line 9: a face names vertex 0"),
        (CORNER + "f 1 2 3\nf 1 2 -6\n", "line 7: a face names vertex -6, but only 5 vertices came before it"),
        ("v 0 0 0\nf -2 -1 -1\n" + CORNER, "line 2: a face names vertex -2, but only 1 vertices"),
        ("v 0 0 0\nv 1 0\r\nv 1 1 1\r" + FACES, "line 2: a vertex has 2 coordinates instead of 3"),
        ("v 0 0 0\nv 1-2 0 0\n" + FACES, "line 2: a value is not a number"),
        ("v 0 0 0\nv 1_0 0 0\n" + FACES, "line 2: a value is not a number"),
        (CORNER + "f /1 2 3\n", "line 6: a value is not a number"),
        (CORNER + "f 1 2 6\n", "vertex 5 (from 0), but there are 5"),
        (CORNER + "f 1 2 1.5\n", "line 6: a value is not a number"),
        (CORNER + "f 1 2 99999999999999999999\n", "line 6"),
        (CORNER, "no triangles"),
        ("", "no triangles"),
        ("v " + "0 " * MAX_LINE, "line 1 is longer than"),
        (CORNER + "f 1 2 4294967299\n", "line 6: a face names vertex 4294967299, which exceeds int32"),
        (CORNER + "v\n" + FACES, "line 6: a vertex has 0 coordinates"),
        (CORNER + FACES * 30_000 + "f 1 2 3.5\n" + FACES, "line 90006: a value is not a number"),
    ],
)  # fmt: skip
def test_a_mistake_in_an_obj_is_named_by_its_line(tmp_path, text, line):
    refused(written(tmp_path, "a.obj", text), line)


def test_many_continued_lines_are_read(tmp_path):
    """Each line joined to those before it would take hours."""
    refused(written(tmp_path, "a.obj", CORNER + "f 1 2 3" + " \\\n" * 600_000 + "\n"), "is longer than")
    inner = "f 1 2 3 \\\n 4 \\\n 5\n" * 50_000
    assert len(load(written(tmp_path, "b.obj", CORNER + inner)).faces) == 150_000


LEFT_OUT = {
    "l 1 2": "lines left out",
    "p\t1": "points left out",
    "call other.obj": "files that it calls left out",
    "curv 0 1 1 2": "free-form curves left out",
    "surf 0 1 0 1 1 2 3": "free-form surfaces left out",
    "usemtl red": "materials left out",
    "bzp 1 2 3": "free-form surfaces left out",
    "F 1 2 3": "unknown statements left out: F",
    "\0\0f 1 2 3": "unknown statements left out: \0\0f",
    "q\nr 1\nq 2\nu\nt": "unknown statements left out: q, r, t and 1 more",
}


@pytest.mark.parametrize("line", LEFT_OUT)
def test_what_an_obj_leaves_out_is_noted(tmp_path, line):
    plain = f"mtllib a.mtl\no b\ng c d\ns 1\nvt 0 0\nvn 0 0 1\nvp 1\n{CORNER}{FACES}"
    for text in (f"{line}\n{plain}", f"{plain}  {line}\n"):
        assert load(written(tmp_path, "a.obj", text)).notes == (LEFT_OUT[line],)
    assert load(written(tmp_path, "a.obj", plain)).notes == ()


def test_all_that_an_obj_leaves_out_is_noted_once(tmp_path):
    every = load(written(tmp_path, "a.obj", CORNER + "\n".join([*LEFT_OUT, *LEFT_OUT]) + "\n" + FACES)).notes
    assert every == (*list(LEFT_OUT.values())[:6], "unknown statements left out: \0\0f, F, q and 3 more")


ARROW = [(0, 0, 0), (4, -3, 0), (1, 0, 0), (4, 3, 0)]
U = [(0, 3, 0), (0, 0, 0), (4, 0, 0), (4, 3, 0), (3, 3, 0), (3, 1, 0), (1, 1, 0), (1, 3, 0)]
CONCAVE = [(4, 1, 0), (1, 1, 0), (1, 4, 0), (0, 4, 0), (0, 0, 0), (4, 0, 0)]


def area(loaded) -> float:
    a, b, c = (loaded.frames[0][loaded.faces[:, i]].astype(float) for i in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize(("points", "right"), [(ARROW, 3.0), (CONCAVE, 7.0), (U, 8.0)], ids=["arrow", "corner", "U"])
def test_concave_polygons_have_their_area(tmp_path, points, right):
    for turn in range(len(points)):
        own = np.roll(np.array(points, float), turn, axis=0)
        polygon = [tuple(range(len(own)))]
        for name, make in (("a.obj", files.obj), ("a.ply", files.ply_ascii), ("b.ply", files.ply_binary)):
            loaded = load(written(tmp_path, name, make(own, polygon)))
            assert len(loaded.faces) == len(own) - 2
            assert area(loaded) == pytest.approx(right)


# --- PLY ---

PLAIN = files.ply_ascii().decode()


def with_line(line: str) -> bytes:
    """An ASCII PLY with one more line in its header."""
    return PLAIN.replace("element vertex", f"{line}\nelement vertex").encode("latin-1")


HEADERS = {
    "a comment with end_header": with_line("comment the data follow end_header"),
    "a comment of end_header": with_line("comment\nobj_info end_header"),
    "byte 0x85 in a comment": with_line("comment made by \xc5\x85sa \x85 end"),
    "a form feed in a comment": with_line("comment a\x0cb \x1c \x1d \x0b c"),
    "an unknown line": with_line("made by a small exporter"),
    "an empty line": with_line(""),
    "blanks after words": PLAIN.replace("\n", " \t\n").encode(),
    "blanks after end_header": PLAIN.replace("end_header\n", "end_header  \n\n \n").encode(),
    "CR LF": PLAIN.replace("\n", "\r\n").encode(),
    "CR": PLAIN.replace("\n", "\r").encode(),
    "CR LF in the header alone": PLAIN.replace("end_header\n", "end_header").replace("\n", "\r\n", 9).replace(
        "end_header", "end_header\n").encode(),
    "binary, blanks after end_header": files.ply_binary().replace(b"end_header\n", b"end_header \t\n"),
    "binary, CR LF": files.ply_binary().replace(b"\n", b"\r\n", 9),
    "binary, CR": files.ply_binary().replace(b"\n", b"\r", 9),
    "binary, a comment with end_header": files.ply_binary().replace(b"by hand", b"end_header"),
}  # fmt: skip


@pytest.mark.parametrize("kind", HEADERS)
def test_a_ply_header_is_read_by_lines(tmp_path, kind):
    loaded = load(written(tmp_path, "a.ply", HEADERS[kind]))
    assert loaded.faces.tolist() == [list(face) for face in files.FACES]
    assert np.array_equal(loaded.frames[0], files.QUAD)


def test_the_first_byte_of_the_data_may_be_a_line_end(tmp_path):
    """10.0 in big-endian float32 begins with no line end; 1.3e-36 in little-endian with 0x0a does."""
    points = files.QUAD.copy()
    points[0, 0] = struct.unpack("<f", b"\n\0\0\0")[0]
    for end in (b"\n", b"\r\n", b"\r"):
        blob = files.ply_binary(points).replace(b"\n", end, 9)
        assert np.array_equal(load(written(tmp_path, "a.ply", blob)).frames[0], points)


STRIP = """ply
format ascii 1.0
element vertex 6
property float x
property float y
property float z
element tristrips {rows}
property list int int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
1 1 0
0 2 0.5
1 2 0.5
"""


@pytest.mark.parametrize(
    ("strips", "faces"),
    [
        (["8 0 1 2 3 -1 2 3 4"], [[0, 1, 2], [2, 1, 3], [2, 3, 4]]),
        (["4 0 1 2 3", "3 2 3 4"], [[0, 1, 2], [2, 1, 3], [2, 3, 4]]),
        (["6 0 1 2 3 4 5"], [[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]]),
        (["12 -1 0 1 -1 -1 0 1 2 -1 5 4 3"], [[0, 1, 2], [5, 4, 3]]),
        (["0", "2 0 1", "3 0 1 2"], [[0, 1, 2]]),
    ],
)
def test_triangle_strips_with_restarts(tmp_path, strips, faces):
    text = STRIP.format(rows=len(strips)) + "\n".join(strips)
    assert load(written(tmp_path, "a.ply", text)).faces.tolist() == faces
    head, _, body = text.replace("ascii", "binary_little_endian").partition("end_header\n")
    rows = body.splitlines()
    binary = (head + "end_header\n").encode()
    binary += np.array([row.split() for row in rows[:6]], "<f4").tobytes()
    binary += b"".join(np.array(row.split(), "<i4").tobytes() for row in rows[6:])
    assert load(written(tmp_path, "b.ply", binary)).faces.tolist() == faces


def test_faces_come_before_strips_and_a_strip_is_checked(tmp_path):
    face = "element face 1\nproperty list uchar int vertex_indices\nend_header"
    text = STRIP.format(rows=1).replace("end_header", face) + "4 0 1 2 3\n3 5 4 3\n"
    assert load(written(tmp_path, "a.ply", text)).faces.tolist() == [[5, 4, 3], [0, 1, 2], [2, 1, 3]]
    refused(written(tmp_path, "b.ply", STRIP.format(rows=1) + "3 0 1 6"), "vertex 6 (from 0), but there are 6")
    refused(written(tmp_path, "c.ply", STRIP.format(rows=1) + "2 0 1"), "holds no triangles")


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("3 0 2 3\n", "3 0 2 3 255 0 0\n", "row 1 (from 0) of 'face', 7, is not the declared one"),
        ("1 1 0\n", "1 1 0 9\n", "row 2 (from 0) of 'vertex', 4, is not the declared one"),
        ("1 1 0\n", "1 1\n", "row 2 (from 0) of 'vertex', 2, is not the declared one"),
        ("1 1 0\n", "1 1\n0\n", "row 2 (from 0) of 'vertex', 2, is not the declared one"),
        ("3 0 2 3\n", "4 0 2 3\n", "row 1 (from 0) of 'face', 4, is not the declared one"),
        ("3 0 2 3\n", "-3 0 2 3\n", "row 1 (from 0) of 'face', 4, is not the declared one"),
        ("3 0 2 3\n", "3.5 0 2 3\n", "row 1 (from 0) of 'face', 4, is not the declared one"),
        ("3 0 2 3\n", "nan 0 2 3\n", "row 1 (from 0) of 'face', 4, is not the declared one"),
        ("3 0 2 3\n", "1e300 0 2 3\n", "row 1 (from 0) of 'face', 4, is not the declared one"),
        ("1 1 0\n", "1 1 zero\n", "line 12: a value is not a number"),
        ("3 0 2 3\n", "2 0 2\n", "face 1 has 2 vertices"),
    ],
)
def test_a_wrong_row_of_a_ply_is_named(tmp_path, old, new, word):
    refused(written(tmp_path, "a.ply", PLAIN.replace(old, new, 1)), word)


def test_other_elements_are_noted(tmp_path):
    element = "element polygons 1\nproperty list uchar int vertex_indices\nelement edge 0\nend_header"
    loaded = load(written(tmp_path, "a.ply", PLAIN.replace("end_header", element) + "3 0 1 2\n"))
    assert loaded.notes == ("elements left out: polygons",)


def test_a_header_of_many_elements_takes_no_time(tmp_path):
    elements = "".join(f"element e{i} 0\n" for i in range(20_000))
    assert len(load(written(tmp_path, "a.ply", with_line(elements))).faces) == 4


# --- STL ---

SOLID = files.stl_ascii().decode()
ONE_LINE = " ".join(SOLID.replace("solid hand\n", "", 1).replace("end", " end").split())
NESTED = SOLID.replace("solid hand", "solid two words", 1)

STL = {
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
}


@pytest.mark.parametrize("kind", STL)
def test_an_stl_text_is_read_whatever_its_lines(tmp_path, kind):
    loaded = load(written(tmp_path, "a.stl", STL[kind]))
    expected = files.QUAD[np.array(files.FACES)]
    if kind == "several solids":
        expected = np.concatenate([expected, expected])
    assert np.array_equal(loaded.frames[0][loaded.faces], expected)
    noted = ("no endsolid at its end, so it may have been cut short",)
    assert loaded.notes == (noted if kind == "no endsolid" else ())


@pytest.mark.parametrize("extra", [b"\0", b"end of file\n", bytes(49)])
def test_bytes_after_a_binary_stl_are_noted(tmp_path, extra):
    loaded = load(written(tmp_path, "a.stl", files.stl_binary() + extra))
    assert np.array_equal(loaded.frames[0][loaded.faces], files.QUAD[np.array(files.FACES)])
    assert loaded.notes == (f"{len(extra)} bytes after the last triangle left out",)
    refused(written(tmp_path, "b.stl", files.stl_binary() + bytes(50)), "claims 4 triangles")


@pytest.mark.parametrize("extra", [b"", b"tail"])
@pytest.mark.parametrize("head", [b"solid", b"solid facet normal vertex", b"SOLID made by a program".ljust(80)])
def test_a_binary_stl_may_begin_with_solid(tmp_path, head, extra):
    blob = head.ljust(80, b"\0") + files.stl_binary()[80:] + extra
    loaded = load(written(tmp_path, "a.stl", blob))
    assert np.array_equal(loaded.frames[0][loaded.faces], files.QUAD[np.array(files.FACES)])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (SOLID.replace(" endloop\nendfacet\nendsolid hand\n", ""), ("its last facet has no endfacet",)),
        (SOLID.replace("facet normal 0 0 0\n", "", 1).replace("outer loop", "loop", 1), ("facet 0 has not three",)),
        (SOLID.replace("  vertex 1 0 0\n", "  vertex 1 0 0\n" * 2, 1), ("facet 0 has not three vertices",)),
        (SOLID.replace("  vertex 1 1 0\n", "  vertex 1 1\n"), ("facet 0: a vertex has 2 coordinates instead of 3",)),
        (SOLID * 9_000 + SOLID.replace("vertex 1 0 0", "vertex 1 O 0"), ("facet 36000: a value is not a number",)),
        ("solid a\nendfacet\nendsolid a\n", ("holds no triangles",)),
        ("solid a\nendsolid a\n", ("holds no triangles",)),
    ],
)  # fmt: skip
def test_a_mistake_in_an_stl_text_is_named_by_its_facet(tmp_path, text, words):
    refused(written(tmp_path, "a.stl", text), *words)


# --- all ---


@pytest.mark.parametrize("kind", ["obj", "ply", "ascii.ply", "stl", "ascii.stl", "off", "glb"])
def test_generated_meshes_are_what_trimesh_reads(tmp_path, kind):
    """Bounds, numbers of triangles, and for what both keep in order the very corners."""
    made = [
        trimesh.creation.icosphere(2),
        trimesh.creation.box((1, 2, 3)),
        trimesh.creation.torus(2.0, 0.5),
        trimesh.creation.annulus(1.0, 2.0, 0.5),
        trimesh.creation.capsule(1.0, 0.4),
    ]
    for k, mesh in enumerate(made):
        path = tmp_path / f"{k}.{kind}"
        text = {"ascii.ply": {"encoding": "ascii"}, "ascii.stl": {"file_type": "stl_ascii"}}.get(kind, {})
        mesh.export(path, **text)
        theirs, ours = trimesh.load_mesh(path, process=False), load(path)
        assert len(ours.faces) == len(theirs.faces)
        corners = ours.frames[0].astype(np.float32 if "ply" in kind else np.float64)[ours.faces]
        assert np.array_equal(corners, theirs.triangles)
        assert np.array_equal(corners.reshape(-1, 3).min(axis=0), theirs.bounds[0])
        assert np.array_equal(corners.reshape(-1, 3).max(axis=0), theirs.bounds[1])


def test_numbers_of_lines():
    values, each = numbers([b"1 2.5 ", b"", b" -3e2\t4 nan", b"5"])
    assert np.array_equal(values, [1, 2.5, -300, 4, np.nan, 5], equal_nan=True)
    assert each.tolist() == [2, 0, 3, 1]
    assert numbers([])[1].tolist() == []
    assert numbers([b""])[1].tolist() == [0]
    lines = [b"1 2"] * 100
    for wrong in (0, 37, 99):
        damaged = [*lines[:wrong], b"1 x", *lines[wrong + 1 :]]
        assert first_wrong(damaged, numbers)[0] == wrong
