"""Wavefront OBJ: positions and faces, in the order of the file.

trimesh 5.2 is not used because it changes valid files: it groups faces by material, splits vertices by texture and
normal indices, counts relative (negative) indices from the end of the file instead of from their line, and reads index
0 as vertex 1. The order of faces must stay, because answers identify triangles by it. The tests compare simple files
with what trimesh reads.
"""

from __future__ import annotations

import io
from array import array
from pathlib import Path

import numpy as np

from ...errors import UserError
from .checks import ALL, MAX_LINE, Mesh, Wanted, broken, checked, read_bytes

_INDEX_LIMIT = 1 << 31


def read_obj(path: Path, wanted: Wanted = ALL) -> Mesh:
    """Positions float64 (``v``; weights and colours are ignored) and the triangulated faces (``f``).

    Unused vertices are retained. Texture, normal, group, material, line and curve records are skipped. Needs memory of
    about
    6 times the file's size. Raises :class:`UserError` for an index that is 0, out of range or not a number, for a face
    of
    fewer than 3 vertices and for a file without faces.
    """
    blob = read_bytes(path)
    if b"\r" in blob and b"\n" not in blob:
        blob = blob.replace(b"\r", b"\n")
    points, corners = array("d"), array("i")
    line, number = b"", 0
    stream = io.BytesIO(blob.removeprefix(b"\xef\xbb\xbf"))
    while True:
        more = stream.readline(MAX_LINE)
        number += 1
        if len(more) == MAX_LINE or len(line) + len(more) > MAX_LINE:
            raise broken(path, f"line {number} is longer than {MAX_LINE} bytes", "this is not an OBJ mesh")
        line += more
        if more.rstrip(b"\r\n").endswith(b"\\"):
            line = line.rstrip(b"\r\n")[:-1] + b" "
            continue
        try:
            _record(line, points, corners)
        except (ValueError, OverflowError, UserError) as error:
            raise broken(
                path, f"line {number}: {error}", "correct that line or export the file again"
            ) from error
        line = b""
        if not more:
            break
    positions = np.frombuffer(points, dtype=np.float64).reshape(-1, 3) if points else np.zeros((0, 3))
    faces = (
        np.frombuffer(corners, dtype=np.int32).reshape(-1, 3) if corners else np.zeros((0, 3), dtype=np.int32)
    )
    return checked(path, positions, faces)


def _record(line: bytes, points: array, corners: array) -> None:
    """Append the contents of one line. Raises ValueError with the reason if the line is invalid."""
    words = line.split()
    if not words:
        return
    if words[0] == b"v":
        if len(words) < 4:
            raise ValueError(f"a vertex has {len(words) - 1} coordinates instead of 3")
        points.extend((float(words[1]), float(words[2]), float(words[3])))
    elif words[0] == b"f":
        if len(words) < 4:
            raise ValueError(f"a face has {len(words) - 1} vertices, it needs at least 3")
        count = len(points) // 3
        first = _index(words[1], count)
        last = _index(words[2], count)
        for word in words[3:]:
            here = _index(word, count)
            corners.extend((first, last, here))
            last = here


def _index(word: bytes, count: int) -> int:
    """Vertex index, counted from 0, of a corner ``v``, ``v/vt``, ``v//vn`` or ``v/vt/vn``.

    A negative index counts back from the last vertex read, of ``count`` so far.
    """
    index = int(word.split(b"/", 1)[0])
    if index == 0:
        raise ValueError("a face names vertex 0, but OBJ counts from 1")
    if index < 0:
        if -index > count:
            raise ValueError(f"a face names vertex {index}, but only {count} vertices came before it")
        return count + index
    if index >= _INDEX_LIMIT:
        raise ValueError(f"a face names vertex {index}, which exceeds int32")
    return index - 1
