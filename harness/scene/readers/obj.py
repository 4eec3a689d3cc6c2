"""Wavefront OBJ: positions and faces, in the order of the file.

trimesh 5.2 is not used because it changes valid files: it groups faces by material, splits vertices by texture and
normal indices, counts relative (negative) indices from the end of the file instead of from their line, and reads index
0 as vertex 1. The order of faces must stay, because answers identify triangles by it. The tests compare simple files
with what trimesh reads.
"""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...arrays import F64, I32, I64
from ...errors import UserError
from .checks import ALL, MAX_LINE, Loaded, Wanted, broken, checked, read_bytes, some
from .polygons import triangulate
from .text import JOINED, blocks, decoded, first_three, number_of, numbers, parsed, plain_lines, without_comments

_VERTEX, _FACE = ({letter, *(letter + blank for blank in (b" ", b"\t", b"\v", JOINED))} for letter in (b"v", b"f"))
"""How the lines of vertices and of faces begin."""

_OUTLINE = re.compile(rb"(?m)^([ \t]*)fo(?=[ \t])")  # a face as old programs write it

_INDEX_LIMIT = 1 << 31

_LEFT_OUT = {  # statements that are left out with a note
    b"l": "lines", b"p": "points", b"call": "files that it calls",
    **dict.fromkeys((b"curv", b"cdc", b"cdp"), "free-form curves"),
    **dict.fromkeys((b"surf", b"bsp", b"bzp"), "free-form surfaces"), b"usemtl": "materials",
}  # fmt: skip

_PASSED_OVER = set(  # Statements without triangles. Others are not known, and noted by name.
    b"""
    vp g o s mg mtllib deg bmat cstype step parm trim hole scrv sp end con curv2 res bevel c_interp d_interp lod maplib
    usemap shadow_obj trace_obj ctech stech csh
    """.split()
)

_NO_STATEMENT = _VERTEX | _FACE | {b"vt", b"vn"}


def read_obj(path: Path, wanted: Wanted = ALL) -> Loaded:
    """Positions float64 (``v``; weights and colours are ignored) and the triangulated faces (``f``).

    Unused vertices are retained. Texture, normal, group, material, line and curve records are skipped. Needs memory of
    about 6 times the file's size. Raises :class:`UserError` for an index that is 0, out of range or not a number, for a
    face of fewer than 3 vertices and for a file without faces.
    """
    text = without_comments(plain_lines(decoded(read_bytes(path))))
    if b"fo" in text:
        text = _OUTLINE.sub(rb"\1f", text)
    lines = text.split(b"\n")
    longest = max(range(len(lines)), key=lambda i: len(lines[i]))
    if len(lines[longest]) > MAX_LINE:
        problem = f"line {number_of(lines, longest)} is longer than {MAX_LINE} bytes"
        raise broken(path, problem, "this is not an OBJ mesh")
    if any(line[:1].isspace() for line in lines):
        lines = [line.lstrip() for line in lines]
    (points,) = _parsed(path, lines, _VERTEX, _positions)
    counts, corners = _faces(path, lines, len(points))
    return checked(path, points, triangulate(points, counts, corners), notes=_notes(lines))


def _notes(lines: Sequence[bytes]) -> tuple[str, ...]:
    """What the statements of a file hold beside vertices and faces."""
    others = (line.split(None, 1)[:1] for line in lines if line[:2] not in _NO_STATEMENT)
    found = {words[0] for words in others if words} - _PASSED_OVER
    notes = [f"{what} left out" for what in dict.fromkeys(_LEFT_OUT[word] for word in _LEFT_OUT if word in found)]
    unknown = sorted(word[:20].decode("latin-1") for word in found - _LEFT_OUT.keys())
    return (*notes, f"unknown statements left out: {some(unknown)}") if unknown else tuple(notes)


def _parsed(path: Path, lines: Sequence[bytes], kind: set[bytes], parse: Callable[[Sequence[bytes]], Any]) -> list[Any]:
    """The arrays that ``parse`` makes of the lines of a kind. Raises :class:`UserError` with the wrong line."""
    own = [line for line in lines if line[:2] in kind]
    return parsed(blocks(own), parse, lambda index, problem: _wrong(path, lines, kind, index, problem))


def _wrong(path: Path, lines: Sequence[bytes], kind: set[bytes], index: int, problem: str) -> UserError:
    place = [i for i, line in enumerate(lines) if line[:2] in kind][index]
    way_out = "correct that line or export the file again"
    return broken(path, f"line {number_of(lines, place)}: {problem}", way_out)


def _positions(lines: Sequence[bytes]) -> tuple[F64]:
    """The first three numbers of each line, [len(lines), 3]."""
    try:
        values, each = numbers([line[1:] for line in lines])
    except ValueError:  # of words after the position, which need not be numbers
        values, each = numbers([b" ".join(line.split()[1:4]) for line in lines])
    return (first_three(values, each, "a vertex"),)


def _faces(path: Path, lines: Sequence[bytes], vertex_count: int) -> tuple[I64, I32]:
    """The number of corners of each face, and the vertex indices of all corners, counted from 0."""
    corners, counts = _parsed(path, lines, _FACE, _corners)

    def wrong(corner: int, problem: str) -> UserError:
        line = int(np.searchsorted(np.cumsum(counts), corner, side="right"))
        return _wrong(path, lines, _FACE, line, f"a face names {problem}")

    if corners.max(initial=0) > vertex_count:
        at = int(np.argmax(corners > vertex_count))
        raise wrong(at, f"vertex {corners[at]}, but there are {vertex_count}")
    if corners.min(initial=1) > 0:
        return counts, corners - np.int32(1)
    if not corners.all():
        raise wrong(int(np.argmin(corners != 0)), "vertex 0, but OBJ counts from 1")
    # A negative index counts back from the last vertex before its line.
    vertices = np.cumsum(np.fromiter((line[:2] in _VERTEX for line in lines), bool, len(lines)))
    is_face = np.fromiter((line[:2] in _FACE for line in lines), bool, len(lines))
    before = np.repeat(vertices[is_face], counts)
    found = np.where(corners < 0, before + corners, corners - np.int64(1))
    if found.min() < 0:
        at = int(np.argmax(found < 0))
        raise wrong(at, f"vertex {corners[at]}, but only {before[at]} vertices came before it")
    return counts, found.astype(np.int32)


def _corners(lines: Sequence[bytes]) -> tuple[I32, I64]:
    """The vertex indices of the lines, and how many each has. A corner is ``v``, ``v/vt``, ``v//vn`` or ``v/vt/vn``."""
    values, each = numbers([line[1:] for line in _before_slashes(lines)], np.int64)
    if each.min(initial=3) < 3:
        raise ValueError(f"a face has {each.min()} vertices, it needs at least 3")
    large = values[(values <= -_INDEX_LIMIT) | (values >= _INDEX_LIMIT)]
    if len(large):
        raise ValueError(f"a face names vertex {large[0]}, which exceeds int32")
    return values.astype(np.int32), each


def _before_slashes(lines: Sequence[bytes]) -> Sequence[bytes]:
    """The lines with blanks in place of each slash that follows a number, and of what follows it up to the next blank."""
    text = b"\n".join(lines)
    if b"/" not in text:
        return lines
    letters = np.frombuffer(text, dtype=np.uint8)
    places = np.arange(len(letters), dtype=np.int32)
    blank = np.maximum.accumulate(np.where(letters <= ord(" "), places, -1))
    slash = np.maximum.accumulate(np.where(letters == ord("/"), places, -1))
    return np.where(slash > blank + 1, np.uint8(ord(" ")), letters).tobytes().split(b"\n")
