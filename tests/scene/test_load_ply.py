"""OBJ and PLY in all the forms that programs write: what is read, what is left out, and broken files in one line."""

import struct

import numpy as np
import pytest
from helpers import mesh_files as files
from helpers.mesh_files import refused, traced_memory, written
from shadowbench.harness.scene.readers.checks import MAX_LINE
from shadowbench.harness.scene.readers.load import load

CORNER = "v 0 0 0\nv 4 0 0\nv 0 1 0\nv 4 1 0\nv 0 8 0\n"
OBJ_FACES = "f 1 2 3\nf 2 4 3\nf 3 4 5\n"
READ = [[0, 1, 2], [1, 3, 2], [2, 3, 4]]

OBJ_FORMS = {
    "plain": CORNER + OBJ_FACES,
    "a comment that ends in a backslash": CORNER + "# saved from D:\\meshes\\\n" + OBJ_FACES,
    "a first line that ends in one": "# saved from D:\\meshes\\\n" + CORNER + OBJ_FACES,
    "a comment after a face": CORNER + OBJ_FACES.replace("\n", " # front\n").replace("v 4 1 0", "v 4 1 0#here"),
    "a comment with a backslash after a face": CORNER + OBJ_FACES.replace("2 3\n", "2 3 # c:\\\n"),
    "CR": (CORNER + OBJ_FACES).replace("\n", "\r"),
    "LF, then CR": CORNER + "f 1 2 3\n" + OBJ_FACES[8:].replace("\n", "\r"),
    "CR LF, then LF": CORNER.replace("\n", "\r\n") + OBJ_FACES,
    "LF, then CR LF, then CR": CORNER + "f 1 2 3\r\n" + OBJ_FACES[8:].replace("\n", "\r"),
    "continued lines": CORNER + "f 1 \\\n2 \\\n3\nf \\\n2 4 3\nf 3 4 \\ \n 5\n",
    "continued with CR LF": CORNER.replace("\n", "\r\n") + "f 1 \\\r\n2 3\r\nf 2 4 3\r\nf 3 4 5",
    "blanks before and after": "  " + CORNER.replace("\n", " \t\n \t") + "\n\n" + OBJ_FACES.replace("\n", "   \n"),
    "tabs": (CORNER + OBJ_FACES).replace(" ", "\t"),
    "form feeds": CORNER.replace("\n", "\n\f") + OBJ_FACES.replace("f 2", "\f\nf\v2"),
    "no last line end": (CORNER + OBJ_FACES)[:-1],
    "texture and normal indices": CORNER + "f 1/1 2/2 3/3\nf 2//1 4//1 3//1\nf 3/1/1 4/2/2 5/3/3\n",
    "indices relative to their line": CORNER[:24] + "f -3 -2 -1\n" + CORNER[24:] + "f 2 -2 3\nf -3 4 -1\n",
    "materials in turn": CORNER + "usemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 2//1 4//1 3//1\nusemtl a\ns off\n" + OBJ_FACES[16:],
    "mixed indices": CORNER + "f 1/7 2 3//9\nf -4 -2/1 -3/1/1\nf 3/ 4// 5/-1\n",
    "words after a position": CORNER.replace("v 4 1 0", "v 4 1 0 red") + OBJ_FACES,
    "colours of some": CORNER.replace("v 4 1 0", "v 4 1 0 1 0 0") + OBJ_FACES,
    "an object named with a hash": "o part#1\\\n\n" + CORNER + OBJ_FACES,
    "outlines of old programs": CORNER + OBJ_FACES.replace("f 2", "fo 2").replace("f 3", " fo\t3"),
}  # fmt: skip


@pytest.mark.parametrize("form", OBJ_FORMS)
def test_forms_of_obj(tmp_path, form):
    loaded = load(written(tmp_path, "a.obj", OBJ_FORMS[form]))
    assert loaded.faces.tolist() == READ
    assert loaded.frames[0].tolist() == [[0, 0, 0], [4, 0, 0], [0, 1, 0], [4, 1, 0], [0, 8, 0]]


@pytest.mark.parametrize(("text", "line"), [
    (CORNER + OBJ_FACES + "f 1 2 x\n", "line 9: a value is not a number"),
    (CORNER + "f 1 \\\n 2 3\nf 1 \\\n\\\n2\nf 1 2 3\n", "line 8: a face has 2 vertices, it needs at least 3"),
    ("# a\\\n" + CORNER + "f 1 2 3 \\\n 4\nf 0 1 2\n", "line 9: a face names vertex 0"),
    (CORNER + "f 1 2 3\nf 1 2 -6\n", "line 7: a face names vertex -6, but only 5 vertices came before it"),
    ("v 0 0 0\nf -2 -1 -1\n" + CORNER, "line 2: a face names vertex -2, but only 1 vertices"),
    ("v 0 0 0\nv 1 0\r\nv 1 1 1\r" + OBJ_FACES, "line 2: a vertex has 2 coordinates instead of 3"),
    ("v 0 0 0\nv 1-2 0 0\n" + OBJ_FACES, "line 2: a value is not a number"),
    ("v 0 0 0\nv 1_0 0 0\n" + OBJ_FACES, "line 2: a value is not a number"),
    (CORNER + "f /1 2 3\n", "line 6: a value is not a number"),
    (CORNER + "f 1 2 6\n", "line 6: a face names vertex 6, but there are 5"),
    (CORNER + "f 1 2 1.5\n", "line 6: a value is not a number"),
    (CORNER + "f 1 2 -\n" + OBJ_FACES, "line 6: a value is not a number"),
    (CORNER + "f 1 2 +", "line 6: a value is not a number"),
    (CORNER + "f 1 2 99999999999999999999\n", "line 6"),
    (CORNER, "no triangles"),
    ("", "no triangles"),
    ("v " + "0 " * MAX_LINE, "line 1 is longer than"),
    (CORNER + "f 1 2 3" + " \\\n" * 600_000 + "\n", "is longer than"),  # each joined to those before it would take hours
    (CORNER + "f 1 2 4294967299\n", "line 6: a face names vertex 4294967299, which exceeds int32"),
    (CORNER + "v\n" + OBJ_FACES, "line 6: a vertex has 0 coordinates"),
    (CORNER + OBJ_FACES * 30_000 + "f 1 2 3.5\n" + OBJ_FACES, "line 90006: a value is not a number"),
])  # fmt: skip
def test_a_mistake_is_named_by_its_line(tmp_path, text, line):
    refused(written(tmp_path, "a.obj", text), line)


def test_many_continued_lines_are_read(tmp_path):
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
EVERY = (*list(LEFT_OUT.values())[:6], "unknown statements left out: \0\0f, F, q and 3 more")


@pytest.mark.parametrize(("line", "notes"), [("", ()), *((line, (note,)) for line, note in LEFT_OUT.items()),
                                             ("\n".join([*LEFT_OUT, *LEFT_OUT]), EVERY)])  # fmt: skip
def test_what_is_left_out_is_noted_once(tmp_path, line, notes):
    plain = f"mtllib a.mtl\no b\ng c d\ns 1\nvt 0 0\nvn 0 0 1\nvp 1\n{CORNER}{OBJ_FACES}"
    for text in (f"{line}\n{plain}", f"{plain}  {line}\n"):
        assert load(written(tmp_path, "a.obj", text)).notes == notes


PLAIN = files.ply_ascii().decode()


def with_line(line: str) -> bytes:
    """An ASCII PLY with one more line in its header."""
    return PLAIN.replace("element vertex", f"{line}\nelement vertex").encode("latin-1")


FORMS = {
    "big": files.ply_binary(big=True),
    "other types": files.ply_binary(count="int", index="ushort"),
    "a comment with end_header": with_line("comment the data follow end_header"),
    "a comment of end_header": with_line("comment\nobj_info end_header"),
    "byte 0x85 in a comment": with_line("comment made by \xc5\x85sa \x85 end"),
    "a form feed in a comment": with_line("comment a\x0cb \x1c \x1d \x0b c"),
    "an unknown line": with_line("made by a small exporter"),
    "an empty line": with_line(""),
    "20,000 elements": with_line("".join(f"element e{i} 0\n" for i in range(20_000))),
    "blanks after words": PLAIN.replace("\n", " \t\n").encode(),
    "blanks after end_header": PLAIN.replace("end_header\n", "end_header  \n\n \n").encode(),
    "CR LF": PLAIN.replace("\n", "\r\n").encode(),
    "CR": PLAIN.replace("\n", "\r").encode(),
    "CR LF in the header alone": PLAIN.replace("end_header\n", "end_header").replace("\n", "\r\n", 9).replace(
        "end_header", "end_header\n").encode(),
    "binary, blanks after end_header": files.ply_binary().replace(b"end_header\n", b"end_header \t\n"),
    "binary, a comment with end_header": files.ply_binary().replace(b"by hand", b"end_header"),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_forms(tmp_path, form):
    loaded = load(written(tmp_path, "a.ply", FORMS[form]))
    assert loaded.faces.tolist() == [list(face) for face in files.FACES]
    assert np.array_equal(loaded.frames[0], files.QUAD)


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"])
def test_the_first_byte_of_the_data_may_be_a_line_end(tmp_path, end):
    """10.0 in big-endian float32 begins with no line end; 1.3e-36 in little-endian with 0x0a does."""
    points = files.QUAD.copy()
    points[0, 0] = struct.unpack("<f", b"\n\0\0\0")[0]
    blob = files.ply_binary(points).replace(b"\n", end, 9)
    assert np.array_equal(load(written(tmp_path, "a.ply", blob)).frames[0], points)


def test_other_properties_elements_and_orders(tmp_path):
    text = """ply
format ascii 1.0
element camera 1
property float x
element face 2
property uchar red
property list uchar int vertex_index
property list uchar float texcoord
element vertex 4
property float x
property float nx
property float y
property double z
element edge 1
property int vertex1
property int vertex2
end_header
9
255 4 0 1 2 3 2 0.5 0.5
0 3 0 1 2 0
0 7 0 0
1 7 0 0
1 7 1 0
0 7 1 0
0 1
"""
    loaded = load(written(tmp_path, "a.ply", text))
    assert loaded.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 2]]
    assert loaded.frames[0].tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert loaded.notes == ("elements left out: camera, edge",)


def test_a_long_list_that_is_not_read_takes_no_memory(tmp_path):
    blob = files.ply_binary(polygons=[(0, 1, 2)]).replace(b"end_header", b"property list uint uchar more\nend_header")
    path = written(tmp_path, "a.ply", blob + struct.pack("<I", 1_000_000) + bytes(1_000_000))
    with traced_memory() as most:
        assert load(path).faces.tolist() == [[0, 1, 2]]
        assert most() < 4_000_000


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


@pytest.mark.parametrize(("strips", "faces"), [
    (["8 0 1 2 3 -1 2 3 4"], [[0, 1, 2], [2, 1, 3], [2, 3, 4]]),
    (["4 0 1 2 3", "3 2 3 4"], [[0, 1, 2], [2, 1, 3], [2, 3, 4]]),
    (["6 0 1 2 3 4 5"], [[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]]),
    (["12 -1 0 1 -1 -1 0 1 2 -1 5 4 3"], [[0, 1, 2], [5, 4, 3]]),
    (["0", "2 0 1", "3 0 1 2"], [[0, 1, 2]]),
])  # fmt: skip
def test_triangle_strips_with_restarts(tmp_path, strips, faces):
    text = STRIP.format(rows=len(strips)) + "\n".join(strips)
    assert load(written(tmp_path, "a.ply", text)).faces.tolist() == faces
    head, _, body = text.replace("ascii", "binary_little_endian").partition("end_header\n")
    rows = body.splitlines()
    binary = (head + "end_header\n").encode()
    binary += np.array([row.split() for row in rows[:6]], "<f4").tobytes()
    binary += b"".join(np.array(row.split(), "<i4").tobytes() for row in rows[6:])
    assert load(written(tmp_path, "b.ply", binary)).faces.tolist() == faces


def test_faces_come_before_strips(tmp_path):
    face = "element face 1\nproperty list uchar int vertex_indices\nend_header"
    text = STRIP.format(rows=1).replace("end_header", face) + "4 0 1 2 3\n3 5 4 3\n"
    assert load(written(tmp_path, "a.ply", text)).faces.tolist() == [[5, 4, 3], [0, 1, 2], [2, 1, 3]]


BINARY = files.ply_binary()


@pytest.mark.parametrize(("content", "word"), [
    (STRIP.format(rows=1) + "3 0 1 6", "vertex 6 (from 0), but there are 6"),
    (STRIP.format(rows=1) + "2 0 1", "holds no triangles"),
    (files.ply_binary(polygons=[(0, 1, 5)]), "vertex 5 (from 0), but there are 5"),
    (files.ply_binary(polygons=[(0, 1, -1)]), "vertex -1"),
    (files.ply_ascii(polygons=[(0, 1, 5)]), "vertex 5"),
    (files.ply_binary(vertices=2_000_000_000), "claims 2000000000 of 'vertex'"),
    (files.ply_binary(faces=2_000_000_000), "claims 2000000000 of 'face'"),
    (files.ply_ascii(vertices=2_000_000_000), "claims 2000000000"),
    (files.ply_binary(faces=5), "truncated"),
    (files.ply_binary(faces=3), "13 bytes remain"),
    (files.ply_binary(vertices=4), "truncated or its header wrong"),
    (files.ply_ascii(faces=3), "more rows follow than the header claims: 1"),
    (files.ply_ascii(faces=5), "claims 5 of 'face', but 4 rows follow"),
    (files.ply_binary(polygons=[], faces=1, count="uint64") + struct.pack("<Q", 1 << 63), "the data end inside the 1"),
    (BINARY[:-1], "truncated"),
    (BINARY[:100], "truncated"),
    (BINARY[:3], "no end_header"),
    (b"", "ply"),
    (b"ply\nend_header\n", "no format"),
    (files.ply_binary(faces=-1), "negative"),
    (files.ply_binary(polygons=[(0, 1)]), "face 0 has 2 vertices"),
    (files.ply_ascii(polygons=[(0, 1, 2), (0, 1)]), "face 1 has 2 vertices"),
    (files.ply_binary(polygons=[]), "no triangles"),
    (BINARY.replace(b"float z", b"float w"), "lacks x, y or z"),
    (BINARY.replace(b"vertex_indices", b"other_indices"), "vertex_indices"),
    (BINARY.replace(b"list uchar", b"list float"), "not of an integer type"),
    (BINARY.replace(b"property float x", b"property quad x"), "header line 'property quad x'"),
    *(
        (PLAIN.replace(old, new, 1), word)
        for old, new, word in [
            ("0.5 0.5 1", "0.5 half 1", "not a number"),
            ("3 0 1 2\n", "3 0 1.5 2\n", "not a whole number"),
            ("3 0 2 3\n", "3 0 2 3 255 0 0\n", "row 1 (from 0) of 'face', 7, is not the declared one"),
            ("1 1 0\n", "1 1 0 9\n", "row 2 (from 0) of 'vertex', 4, is not the declared one"),
            ("1 1 0\n", "1 1\n", "row 2 (from 0) of 'vertex', 2, is not the declared one"),
            ("1 1 0\n", "1 1\n0\n", "row 2 (from 0) of 'vertex', 2, is not the declared one"),
            ("1 1 0\n", "1 1 zero\n", "line 12: a value is not a number"),
            ("3 0 2 3\n", "2 0 2\n", "face 1 has 2 vertices"),
            *(("3 0 2 3\n", f"{count} 0 2 3\n", "row 1 (from 0) of 'face', 4, is not the declared one")
              for count in (4, -3, 3.5, "nan", 1e300)),
        ]
    ),
])  # fmt: skip
def test_broken_files(tmp_path, content, word):
    refused(written(tmp_path, "a.ply", content), word)
