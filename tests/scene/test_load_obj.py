"""OBJ as programs write it: line ends, comments, indices of all kinds; what is left out; and mistakes by their line."""

import pytest
from helpers.mesh_files import refused, written
from shadowbench.harness.scene.readers.checks import MAX_LINE
from shadowbench.harness.scene.readers.load import load

CORNER = "v 0 0 0\nv 4 0 0\nv 0 1 0\nv 4 1 0\nv 0 8 0\n"
FACES = "f 1 2 3\nf 2 4 3\nf 3 4 5\n"
READ = [[0, 1, 2], [1, 3, 2], [2, 3, 4]]

FORMS = {
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


@pytest.mark.parametrize("form", FORMS)
def test_forms(tmp_path, form):
    loaded = load(written(tmp_path, "a.obj", FORMS[form]))
    assert loaded.faces.tolist() == READ
    assert loaded.frames[0].tolist() == [[0, 0, 0], [4, 0, 0], [0, 1, 0], [4, 1, 0], [0, 8, 0]]


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
        (CORNER + "f 1 2 6\n", "line 6: a face names vertex 6, but there are 5"),
        (CORNER + "f 1 2 1.5\n", "line 6: a value is not a number"),
        (CORNER + "f 1 2 -\n" + FACES, "line 6: a value is not a number"),
        (CORNER + "f 1 2 +", "line 6: a value is not a number"),
        (CORNER + "f 1 2 99999999999999999999\n", "line 6"),
        (CORNER, "no triangles"),
        ("", "no triangles"),
        ("v " + "0 " * MAX_LINE, "line 1 is longer than"),
        (CORNER + "f 1 2 3" + " \\\n" * 600_000 + "\n", "is longer than"),  # each joined to those before it would take hours
        (CORNER + "f 1 2 4294967299\n", "line 6: a face names vertex 4294967299, which exceeds int32"),
        (CORNER + "v\n" + FACES, "line 6: a vertex has 0 coordinates"),
        (CORNER + FACES * 30_000 + "f 1 2 3.5\n" + FACES, "line 90006: a value is not a number"),
    ],
)  # fmt: skip
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
    plain = f"mtllib a.mtl\no b\ng c d\ns 1\nvt 0 0\nvn 0 0 1\nvp 1\n{CORNER}{FACES}"
    for text in (f"{line}\n{plain}", f"{plain}  {line}\n"):
        assert load(written(tmp_path, "a.obj", text)).notes == notes
