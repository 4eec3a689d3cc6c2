"""OFF, the text format of Geomview and of mesh collections: positions and faces, in the order of the file. trimesh 5.2
is not used because it sorts faces by their number of corners, fans concave ones, and reads as many lines as there are
where the header claims more.
"""

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from ...arrays import F64, I32, I64, Bools
from ...errors import UserError
from .checks import ALL, Loaded, Wanted, broken, checked, read_bytes
from .polygons import polygon_sizes, triangulate
from .text import blocks, decoded, first_three, numbers, parsed, plain_lines, without_comments

_HEADER = re.compile(rb"\s*(ST)?(C)?(N)?(4?n?)OFF[ \t]*(BINARY)?")
"""The first word: whether texture coordinates, colours and normals follow each position, and how many dimensions it has."""

_INDEX_LIMIT = 1 << 31


def read_off(path: Path, wanted: Wanted = ALL) -> Loaded:
    """Positions float64 and triangulated faces. A vertex and a face have a line each; what follows in it is left out.
    Raises :class:`UserError` for binary files and other than three dimensions, and if the header's counts are not those
    of the lines.
    """
    text = without_comments(plain_lines(decoded(read_bytes(path))))
    header = _HEADER.match(text)
    if header is None:
        raise broken(path, "does not begin with OFF", "this is not an OFF file")
    textured, colored, normals, dimensions, binary = header.groups()
    if binary or dimensions:
        problem = "holds binary data" if binary else "has positions of other than three dimensions"
        raise broken(path, problem, "export it as plain OFF")
    lines = [line for line in text[header.end() :].split(b"\n") if line.strip()]
    vertex_count = _vertex_count(path, lines)

    def wrong(what: str) -> Callable[[int, str], UserError]:
        return lambda index, problem: broken(path, f"{what} {index}: {problem}", "correct that line")

    points, longer = parsed(blocks(lines[1 : 1 + vertex_count]), _positions, wrong("vertex"))
    counts, corners, colors = parsed(blocks(lines[1 + vertex_count :]), _corners, wrong("face"))
    polygon_sizes(path, counts)
    colored = colored or colors.any() or (longer.any() and not (normals or textured))
    names = (("colours", colored), ("normals", normals), ("texture coordinates", textured))
    left = " and ".join(name for name, there in names if there)
    faces = triangulate(points, counts, corners)
    return checked(path, points, faces, notes=(f"{left} left out",) if left else ())


def _vertex_count(path: Path, lines: Sequence[bytes]) -> int:
    """The number of vertices that the header claims. Each of them has a line, and each face."""
    try:
        values, _ = numbers(lines[:1])
    except ValueError:
        values = np.zeros(0)
    if len(values) < 2 or not _whole(values).all():
        raise broken(path, "has no numbers of vertices and faces after OFF")
    vertex_count, face_count = (int(min(value, 1 << 53)) for value in values[:2])
    if vertex_count + face_count != len(lines) - 1:
        problem = f"the header claims {vertex_count} vertices and {face_count} faces, but {len(lines) - 1} lines"
        raise broken(path, f"{problem} follow", "the file is truncated or its header wrong")
    return vertex_count


def _positions(lines: Sequence[bytes]) -> tuple[F64, Bools]:
    """The first three numbers of each line, [len(lines), 3], and whether it has more."""
    values, each = numbers(lines)
    return first_three(values, each, "it"), each > 3


def _corners(lines: Sequence[bytes]) -> tuple[I64, I32, Bools]:
    """The number of corners of each face, their vertex indices, and which faces have a colour."""
    values, each = numbers(lines)
    starts = np.cumsum(each) - each
    claimed = values[starts]
    wrong = ~(_whole(claimed) & (claimed < each))
    if wrong.any():
        at = int(wrong.argmax())
        raise ValueError(f"it has {each[at] - 1} numbers after its number of corners, {claimed[at]:g}")
    counts = claimed.astype(np.int64)
    places = np.repeat(starts + 1 - (np.cumsum(counts) - counts), counts) + np.arange(counts.sum())
    corners = values[places]
    bad = corners[~(_whole(corners) & (corners < _INDEX_LIMIT))]
    if len(bad):
        raise ValueError(f"it names vertex {bad[0]:g}")
    return counts, corners.astype(np.int32), each > counts + 1


def _whole(values: F64) -> Bools:
    return (values >= 0) & (values < np.inf) & (values == np.floor(values))
