"""Stanford PLY: ASCII and binary of either byte order, any element order, polygons of any size, triangle strips.

trimesh 5.2 is not used because it refuses binary files that mix triangles and larger polygons, and files whose elements
or lists have an unusual order; it moves the second halves of quads behind all other faces; it reads a truncated ASCII
file as a smaller mesh, and an index of 1.5 as 1. tests/scene/test_load.py has a file for each case, and compares files
of triangles with what trimesh reads.
"""

from __future__ import annotations

import re
import struct
from array import array
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays import I32, I64, Floats
from .checks import ALL, Loaded, Wanted, broken, checked, read_bytes
from .polygons import polygon_sizes, triangulate
from .text import blocks_of_lines, decoded, numbers, parsed, plain_lines

_DRAWN = ("vertex", "face", "tristrips")  # the elements that are read; others are left out with a note
_RESTART = -1  # ends a triangle strip, after which another begins
CORNERS = ("vertex_indices", "vertex_index")  # names of the list of a face's, or a strip's, vertices

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LIMIT = 1 << 20  # longest header, bytes

_LAST = re.compile(rb"(end_header)()\Z")
_LINE = re.compile(rb"([^\r\n]*)(\r\n|\r|\n)")

_STRUCT = {
    "i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q", "f4": "f", "f8": "d",
}  # fmt: skip
_READ = ("x", "y", "z", *CORNERS)  # the properties that are read; others are passed over

_WRONG = "the file is truncated or its header wrong"


def read_ply(path: Path, wanted: Wanted = ALL) -> Loaded:
    """Positions (float32 if a binary file stores float32, else float64) and triangulated faces, in file order.

    Faces come before strips where the file has both. Needs memory of up to about ten times the file's size. Raises
    :class:`UserError` if header and contents disagree, an index is out of range, a face has fewer than 3 vertices, or there
    are no faces.
    """
    blob = decoded(read_bytes(path))
    header = read_header(path, blob)
    data = (Records if header.order else Rows)(path, header, blob)
    elements = {element.name: element for element in header.elements}
    columns: dict[str, Columns] = {}
    for name, element in elements.items():
        there = element.length and element.properties
        columns[name] = data.columns(element) if there else {p.name: NOTHING for p in element.properties}
    data.finish()
    if "vertex" not in elements:
        raise broken(path, "has no element 'vertex'")
    points = _positions(elements["vertex"], columns["vertex"], bool(header.order))
    polygons = _corners(path, columns.get("face", {}))
    polygon_sizes(path, polygons.counts)
    faces = triangulate(points, polygons.counts, polygons.values)
    strips = _strips(_corners(path, columns.get("tristrips", {})))
    others = [name for name, one in elements.items() if name not in _DRAWN and one.length]
    notes = (f"elements left out: {', '.join(others)}",) if others else ()
    return checked(path, points, np.concatenate([faces, strips]) if len(strips) else faces, notes=notes)


def _positions(element: Element, columns: Columns, binary: bool) -> Floats:
    """x, y, z of the vertices, [length, 3]."""
    kinds = {p.kind for p in element.properties if p.name in ("x", "y", "z")}
    short = binary and kinds <= {"f4", "i1", "u1", "i2", "u2"}
    points = np.empty((element.length, 3), dtype=np.float32 if short else np.float64)
    for i, axis in enumerate("xyz"):
        points[:, i] = columns[axis].values
    return points


def _corners(path: Path, columns: Columns) -> Column:
    """The lists of vertex indices, after checking that these are integers in the range of int32."""
    name = next((name for name in CORNERS if name in columns), None)
    found, counts = columns[name] if name else NOTHING
    limit = 1 << 31
    if len(found) and not (-limit <= found.min() and found.max() < limit and not (found % 1).any()):
        raise broken(path, "a face has a vertex index that is not a whole number below 2^31")
    return Column(found.astype(np.int32, copy=False), counts)


def _strips(lists: Column) -> I32:
    """Triangles of strips, turned like the first of each, int32 [triangle_count, 3]; :data:`_RESTART` ends one."""
    corners = np.insert(lists.values, np.cumsum(lists.counts), _RESTART)
    places = np.arange(len(corners))
    place = places - np.maximum.accumulate(np.where(corners == _RESTART, places, -1)) - 1
    last = np.flatnonzero(place >= 2)
    odd = place[last] % 2
    return np.stack([corners[last - 2 + odd], corners[last - 1 - odd], corners[last]], axis=1)


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
    """The header, read line by line. Comments and lines with unknown words are skipped. A line ends with LF, CR LF or
    CR. Where the first line ends with CR alone, so does the last, since a byte 10 after it may be data.
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


class Column(NamedTuple):
    """The values of a property of all rows; of a list one list after the other, with the length of each."""

    values: NDArray
    counts: I64


NOTHING = Column(np.zeros(0), np.zeros(0, np.int64))

Columns = dict[str, Column]


class Records:
    """The data of a binary file, element by element."""

    def __init__(self, path: Path, header: Header, blob: bytes):
        self.path, self.order, self.at = path, header.order, header.start
        self.data = memoryview(blob)

    def columns(self, element: Element) -> Columns:
        """The columns of the next element that are read. Raises :class:`UserError` if it has not the rows it claims."""
        # Checked before memory is allocated by these counts. Lists may be empty.
        least = element.length * sum(int((p.count_kind or p.kind)[1]) for p in element.properties)
        if least > len(self.data) - self.at:
            claim = f"the header claims {element.length} of {element.name!r}, at least {least} bytes"
            raise broken(self.path, f"{claim}, but {len(self.data) - self.at} follow", _WRONG)
        begin, sizes = self.at, {name: found.counts for name, found in self._walk(element, 1).items()}
        self.at = begin
        table = self._table(element, sizes)
        if table is None:
            return self._walk(element, element.length)
        return {
            name: Column(table[name].reshape(-1), np.repeat(size, element.length))
            for name, size in sizes.items()
            if name in _READ
        }

    def _table(self, element: Element, sizes: dict[str, I64]) -> NDArray | None:
        """The element as a structured array if the lists of every row have these sizes, else None."""
        fields: list[tuple[Any, ...]] = []
        for name, kind, count_kind in element.properties:
            fields += [(f"{name}:count", self.order + count_kind)] * bool(count_kind)
            fields += [(name, self.order + kind, tuple(sizes[name]))]
        dtype = np.dtype(fields)
        need = dtype.itemsize * element.length
        if need > len(self.data) - self.at:
            return None
        rows = np.frombuffer(self.data, dtype, element.length, self.at)
        if any((rows[f"{name}:count"] != size).any() for name, size in sizes.items() if len(size)):
            return None
        self.at += need
        return rows

    def _walk(self, element: Element, length: int) -> Columns:
        """The columns of so many rows, read one by one; those that are not read have lengths of lists alone."""
        read = {p.name: (array("d"), array("q")) for p in element.properties}
        for _ in range(length):
            for name, kind, count_kind in element.properties:
                values, counts = read[name]
                number = 1
                if count_kind:
                    (number,) = self._taken(element, count_kind, 1)
                    if number < 0:
                        raise broken(self.path, f"a list of {element.name!r} has the length {number}")
                values.extend(self._taken(element, kind, number, name in _READ))
                if count_kind:
                    counts.append(number)
        return {name: Column(np.array(values), np.array(counts, np.int64)) for name, (values, counts) in read.items()}

    def _taken(self, element: Element, kind: str, number: int, wanted: bool = True) -> tuple[Any, ...]:
        """The next values; none if they are not wanted but passed over."""
        start, self.at = self.at, self.at + number * int(kind[1])
        if self.at > len(self.data):
            problem = f"the data end inside the {element.length} of {element.name!r} that the header claims"
            raise broken(self.path, problem, _WRONG)
        return struct.unpack_from(f"{self.order}{number}{_STRUCT[kind]}", self.data, start) if wanted else ()

    def finish(self) -> None:
        """Raise :class:`UserError` if anything but white space is left."""
        if bytes(self.data[self.at :]).strip():
            problem = f"{len(self.data) - self.at} bytes remain after the elements that the header claims"
            raise broken(self.path, problem, "its header is wrong")


class Rows:
    """The data of a text, element by element: a line for each row; lines without a word are passed over.

    values        float64: the numbers of all rows
    starts, ends  where those of each row begin and end among them
    """

    def __init__(self, path: Path, header: Header, blob: bytes):
        self.path, self.at = path, 0
        line = blob[: header.start].count(b"\n") + 1
        way_out = "correct the file or export it again"
        self.values, each = parsed(
            blocks_of_lines(plain_lines(blob[header.start :])),
            numbers,
            lambda index, problem: broken(path, f"line {line + index}: {problem}", way_out),
        )
        each = each[each > 0]
        self.ends = np.cumsum(each)
        self.starts = self.ends - each

    def columns(self, element: Element) -> Columns:
        """The columns of the next element that are read. Raises :class:`UserError` if it has not the rows it claims."""
        first, last = self.at, self.at + element.length
        if last > len(self.starts):
            left = len(self.starts) - first
            problem = f"the header claims {element.length} of {element.name!r}, but {left} rows follow"
            raise broken(self.path, problem, _WRONG)
        self.at, found = last, {}
        at, ends = self.starts[first:last], self.ends[first:last]
        right = np.ones(element.length, dtype=bool)
        for name, _, is_list in element.properties:
            right &= at < ends
            at = np.where(right, at, 0)  # a wrong row is refused below, wherever it is read
            each = np.ones(element.length, np.int64)
            if is_list:
                given = self.values[at]
                with np.errstate(invalid="ignore"):
                    right &= (given >= 0) & (given % 1 == 0) & (at + given < ends)
                each, at = np.where(right, given, 0).astype(np.int64), at + 1
            if name in _READ:
                places = np.repeat(at - (np.cumsum(each) - each), each)
                places += np.arange(len(places))
                found[name] = Column(self.values[places], each if is_list else NOTHING.counts)
            at = at + each
        right &= at == ends
        if not right.all():
            row = int(np.argmin(right))
            values = (self.ends - self.starts)[first + row]
            named = f"row {row} (from 0) of {element.name!r}, {values}"
            raise broken(self.path, f"the number of values in {named}, is not the declared one", _WRONG)
        return found

    def finish(self) -> None:
        """Raise :class:`UserError` if rows are left."""
        left = len(self.starts) - self.at
        if left:
            raise broken(self.path, f"more rows follow than the header claims: {left}", "its header is wrong")
