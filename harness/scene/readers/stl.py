"""STL, binary and ASCII. Every triangle has three vertices of its own, in file order. trimesh 5.2 is not used because
it refuses an ASCII file without ``endsolid`` and a binary one with bytes after its last triangle, and takes three times
as long.
"""

import contextlib
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...arrays import F32, F64, Floats
from ...errors import UserError
from .checks import ALL, Loaded, Wanted, broken, checked, read_bytes
from .text import decoded, numbers, parsed, plain_lines

_HEADER = 84
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_UP = (0.0, 0.0, 1.0)  # programs that write STL (printing, machining) take z as up; the format does not define it
_LINES = {b"facet", b"facet ", b"facet\t", b"vertex"}  # how the lines begin that are read of a text, in six letters

_KEYWORD = re.compile(rb"(?<=\S)[ \t]+(?=(?:facet|outer|vertex|endloop|endfacet)\b)")
_END = b"endfacet"

_BLOCK = 1 << 18  # bytes of a text that are parsed at a time


def read_stl(path: Path, wanted: Wanted = ALL) -> Loaded:
    """The triangles of all solids; float32 of a binary file, float64 of an ASCII file. A binary file may begin with
    "solid", too: a text holds no zero byte. Raises :class:`UserError` if the count of a binary file is not that of its
    triangles, and for a facet of a text that has not three vertices.
    """
    blob = read_bytes(path)
    text = plain_lines(decoded(blob))
    points: Floats
    if b"\0" not in text and (text.lstrip()[:5].lower() == b"solid" or b"facet" in text[:_BLOCK].lower()):
        points, notes = _from_text(path, text)
    elif len(blob) < _HEADER:
        raise broken(path, "is neither binary nor ASCII STL", "the file is truncated or of another kind")
    else:
        points, notes = _from_records(path, blob)
    return checked(path, points, np.arange(len(points)).reshape(-1, 3), _UP, notes)


def _from_records(path: Path, blob: bytes) -> tuple[F32, tuple[str, ...]]:
    """The corners of a binary file, [3 triangles, 3]."""
    claimed = int.from_bytes(blob[80:_HEADER], "little")
    left = len(blob) - _HEADER - claimed * _TRIANGLE.itemsize
    if left < 0 or left >= _TRIANGLE.itemsize:
        size = f"{_HEADER + _TRIANGLE.itemsize * claimed} bytes, but the file has {len(blob)}"
        problem = f"the header claims {claimed} triangles, {size}"
        raise broken(path, problem, "the file is truncated or its header wrong")
    records = np.frombuffer(blob, dtype=_TRIANGLE, count=claimed, offset=_HEADER)
    return records["corners"].reshape(-1, 3), (f"{left} bytes after the last triangle left out",) * bool(left)


def _from_text(path: Path, text: bytes) -> tuple[F64, tuple[str, ...]]:
    """The corners of a text, [3 triangles, 3]."""
    text = text.lower()
    parts, at, last = [np.zeros((0, 3))], 0, text.rfind(_END)
    while 0 <= at < last:
        end = text.find(_END, min(at + _BLOCK, last)) + len(_END)
        parts.append(_corners(path, text[at:end], sum(map(len, parts)) // 3))
        at = end
    if _lines(text[at:]):
        raise broken(path, "its last facet has no endfacet", "the file is truncated")
    ended = re.search(rb"(?m)^\s*endsolid", text[at:])
    return np.concatenate(parts), () if ended else ("no endsolid at its end, so it may have been cut short",)


def _lines(text: bytes) -> list[bytes]:
    """The lines of facets and vertices, without blanks about them."""
    return [line for line in map(bytes.strip, text.split(b"\n")) if line[:6] in _LINES]


def _corners(path: Path, text: bytes, before: int) -> F64:
    """The corners of the facets of a text in lower case, [3 facets, 3]. ``before``: facets of the file before them."""
    lines = _lines(text)
    if _in_threes(lines) and len(lines) == 4 * text.count(_END):
        with contextlib.suppress(ValueError):
            return _positions(_vertices(lines))[0]
    lines = _lines(_KEYWORD.sub(b"\n", text))  # several keywords may share a line
    way_out = "correct it or export the file again"
    if not _in_threes(lines):
        wrong = next(i for i, line in enumerate([*lines, b""]) if line[:1] != b"fvvv"[i % 4 : i % 4 + 1])
        raise broken(path, f"facet {before + max(0, wrong - 1) // 4} has not three vertices", way_out)

    def at(vertex: int, problem: str) -> UserError:
        return broken(path, f"facet {before + vertex // 3}: {problem}", way_out)

    return parsed([_vertices(lines)], _positions, at)[0]


def _vertices(lines: list[bytes]) -> list[bytes]:
    return [line[6:] for line in lines if line[:1] == b"v"]


def _in_threes(lines: list[bytes]) -> bool:
    """Whether each facet is followed by three vertices."""
    return b"".join([line[:1] for line in lines]) == b"fvvv" * (len(lines) // 4)


def _positions(lines: Sequence[bytes]) -> tuple[F64]:
    """The three numbers of each line, [len(lines), 3]."""
    values, each = numbers(lines)
    if (each != 3).any():
        raise ValueError(f"a vertex has {each[each != 3][0]} coordinates instead of 3")
    return (values.reshape(-1, 3),)
