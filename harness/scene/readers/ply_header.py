"""The header of a PLY file: its elements, and where its data begin."""

import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple

from .checks import broken

CORNERS = ("vertex_indices", "vertex_index")
"""Names of the list of a face's, or a strip's, vertices."""

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LIMIT = 1 << 20
"""Longest header, bytes."""

_LAST = re.compile(rb"(end_header)()\Z")
_LINE = re.compile(rb"([^\r\n]*)(\r\n|\r|\n)")


class Property(NamedTuple):
    """``kind``: numpy's name of the type, without byte order. ``count_kind``: of a list's length; "" for a scalar."""

    name: str
    kind: str
    count_kind: str = ""


class Element(NamedTuple):
    """``length`` rows, each with a value or a list of each property."""

    name: str
    length: int
    properties: list[Property]


class Header(NamedTuple):
    """``order``: byte order as numpy writes it, "" for ASCII. ``start``: where the data begin, bytes."""

    order: str
    elements: list[Element]
    start: int


def read_header(path: Path, blob: bytes) -> Header:
    """The header, read line by line. Comments and lines with unknown words are skipped.

    A line ends with LF, CR LF or CR. Where the first line ends with CR alone, so does the last, since a byte 10 after it may
    be data.
    """
    if not re.match(rb"ply[ \t]*(?:[\r\n]|\Z)", blob[:80], re.IGNORECASE):
        raise broken(path, "does not begin with a line 'ply'", "this is not a PLY file")
    order: str | None = None
    elements: list[Element] = []
    at, first_end, words = 0, b"", [""]
    while words != ["end_header"]:
        match = _LINE.match(blob, at, _LIMIT) or _LAST.match(blob, at, _LIMIT)
        if not match:
            raise broken(path, "the header has no end_header", "the file is truncated")
        line, end = match.groups()
        at, first_end, words = match.end(), first_end or end, line.decode("latin-1").split(None)
        try:
            if words[:1] == ["format"]:
                order = _ORDERS[words[1]]
            elif words[:1] == ["element"]:
                elements.append(Element(words[1], int(words[2]), []))
            elif words[:2] == ["property", "list"]:
                elements[-1].properties.append(Property(words[4], _TYPES[words[3]], _TYPES[words[2]]))
            elif words[:1] == ["property"]:
                elements[-1].properties.append(Property(words[2], _TYPES[words[1]]))
        except (KeyError, IndexError, ValueError):
            raise broken(path, f"header line {line.decode('latin-1').strip()[:60]!r} is not PLY") from None
    if order is None:
        raise broken(path, "the header names no format")
    _check(path, elements)
    return Header(order, elements, at - (first_end == b"\r" and end == b"\r\n"))


def _check(path: Path, elements: list[Element]) -> None:
    names = Counter(element.name for element in elements)
    for name, length, properties in elements:
        lists = {p.name: p for p in properties if p.count_kind}
        known = {p.name for p in properties}
        if length < 0 or names[name] > 1 or len(known) < len(properties):
            raise broken(path, f"header: element {name!r} has a negative count or a name twice")
        if any(p.count_kind[0] == "f" for p in lists.values()):
            problem = f"header: a list of element {name!r} has a length that is not of an integer type"
            raise broken(path, problem)
        if name == "vertex" and not {"x", "y", "z"} <= known - lists.keys():
            raise broken(path, "header: element 'vertex' lacks x, y or z")
        if name in ("face", "tristrips") and length and lists.keys().isdisjoint(CORNERS):
            raise broken(path, f"header: element {name!r} has no list 'vertex_indices'", "export it as polygons")
