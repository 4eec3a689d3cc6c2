"""The header of a PLY file: its elements, and where its data begin."""

import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

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


@dataclass(frozen=True)
class Property:
    """``kind``: numpy's name of the type, without byte order. ``count_kind``: of a list's length; "" for a scalar."""

    name: str
    kind: str
    count_kind: str = ""


@dataclass(frozen=True)
class Element:
    """``length`` rows, each with a value or a list of each property."""

    name: str
    length: int
    properties: tuple[Property, ...]

    @property
    def lists(self) -> list[Property]:
        return [p for p in self.properties if p.count_kind]


@dataclass(frozen=True)
class Header:
    """``order``: byte order as numpy writes it, "" for ASCII. ``start``: where the data begin, bytes."""

    order: str
    elements: tuple[Element, ...]
    start: int


def read_header(path: Path, blob: bytes) -> Header:
    """The header, read line by line. Comments and lines with unknown words are skipped.

    A line ends with LF, CR LF or CR. Where the first line ends with CR alone, so does the last, since a byte 10 after it may
    be data.
    """
    if not re.match(rb"ply[ \t]*(?:[\r\n]|\Z)", blob[:80], re.IGNORECASE):
        raise broken(path, "does not begin with a line 'ply'", "this is not a PLY file")
    order: str | None = None
    found: list[tuple[str, int, list[Property]]] = []
    at, first_end = 0, b""
    while True:
        match = _LINE.match(blob, at, _LIMIT) or _LAST.match(blob, at, _LIMIT)
        if not match:
            raise broken(path, "the header has no end_header", "the file is truncated")
        at, first_end = match.end(), first_end or match[2]
        words = match[1].decode("latin-1").split(None)
        try:
            if words == ["end_header"]:
                at -= first_end == b"\r" and match[2] == b"\r\n"
                break
            if words[:1] == ["format"]:
                order = _ORDERS[words[1]]
            elif words[:1] == ["element"]:
                found.append((words[1], int(words[2]), []))
            elif words[:2] == ["property", "list"]:
                found[-1][2].append(Property(words[4], _TYPES[words[3]], _TYPES[words[2]]))
            elif words[:1] == ["property"]:
                found[-1][2].append(Property(words[2], _TYPES[words[1]]))
        except (KeyError, IndexError, ValueError):
            line = match[1].decode("latin-1").strip()[:60]
            raise broken(path, f"header line {line!r} is not PLY") from None
    if order is None:
        raise broken(path, "the header names no format")
    elements = tuple(Element(name, length, tuple(properties)) for name, length, properties in found)
    _check(path, elements)
    return Header(order, elements, at)


def _check(path: Path, elements: tuple[Element, ...]) -> None:
    names = Counter(element.name for element in elements)
    for element in elements:
        properties = {p.name for p in element.properties}
        twice = names[element.name] > 1 or len(properties) < len(element.properties)
        if element.length < 0 or twice:
            raise broken(path, f"header: element {element.name!r} has a negative count or a name twice")
        if any(p.count_kind[0] == "f" for p in element.lists):
            problem = f"header: a list of element {element.name!r} has a length that is not of an integer type"
            raise broken(path, problem)
        if element.name == "vertex" and not {"x", "y", "z"} <= properties - {p.name for p in element.lists}:
            raise broken(path, "header: element 'vertex' lacks x, y or z")
        if (
            element.name in ("face", "tristrips")
            and element.length
            and not {p.name for p in element.lists} & set(CORNERS)
        ):
            problem = f"header: element {element.name!r} has no list 'vertex_indices'"
            raise broken(path, problem, "export it as polygons")
