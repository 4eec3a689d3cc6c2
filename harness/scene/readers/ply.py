"""Stanford PLY: ASCII and binary of either byte order, any element order, polygons of any size.

Read here and not through trimesh, whose 5.2 returns a truncated file as an empty mesh, takes indices beyond
the vertices, refuses binary files that mix triangles and quads, and moves the second halves of quads behind
all other faces. What it does not do is checked here: the header's counts against the file's size before
anything is allocated, and against what was read. Plain files are compared with trimesh in the tests.
"""

from __future__ import annotations

import struct
import warnings
from array import array
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .checks import Mesh, broken, checked, fan, polygon_sizes, read_bytes

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
_STRUCT = {
    "i1": "b",
    "u1": "B",
    "i2": "h",
    "u2": "H",
    "i4": "i",
    "u4": "I",
    "f4": "f",
    "f8": "d",
    "i8": "q",
    "u8": "Q",
}
_CORNERS = ("vertex_indices", "vertex_index")
_HEADER_LIMIT = 1 << 20


@dataclass(frozen=True)
class _Property:
    name: str
    kind: str
    count_kind: str = ""
    """Type of a list's length; empty for a scalar."""


@dataclass
class _Element:
    name: str
    length: int
    properties: list[_Property] = field(default_factory=list)

    def least(self, binary: bool) -> int:
        """Bytes that the element takes at least: its lists may be empty, an ASCII value takes two
        characters.
        """
        sizes = (int((p.count_kind or p.kind)[1]) if binary else 2 for p in self.properties)
        return self.length * sum(sizes)

    @property
    def lists(self) -> list[_Property]:
        return [p for p in self.properties if p.count_kind]


def read_ply(path: Path) -> Mesh:
    """Positions (float32 where the file stores float32, else float64) and fans of the faces, in the file's
    order.

    Needs about 8 times the file's size. Raises :class:`UserError` where header and contents disagree, an
    index is out of range, a face has fewer than 3 vertices, or there are no faces.
    """
    blob = read_bytes(path)
    order, elements, start = _header(path, blob)
    size = len(blob) - start
    for element in elements:
        least = element.least(bool(order))
        if least > size + 1:
            claim = f"the header claims {element.length} of {element.name!r}, at least {least} bytes"
            raise broken(path, f"{claim}, but {size} follow it", "the file is truncated or its header wrong")
    source = _Binary(path, blob, start, order) if order else _Ascii(path, blob, start)
    points, faces = None, None
    for element in elements:
        if element.name == "vertex":
            points = source.vertices(element)
        elif element.name == "face":
            counts, corners = source.polygons(element)
            polygon_sizes(path, counts)
            faces = _indices(path, counts, corners)
        else:
            source.polygons(element)
    source.finish()
    if points is None:
        raise broken(path, "has no element 'vertex'")
    return checked(path, points, np.zeros((0, 3), dtype=np.int32) if faces is None else faces)


def _indices(path: Path, counts: NDArray, corners: NDArray) -> NDArray[np.int32]:
    """Fans, after a check that the corners are whole numbers that int32 can hold."""
    limit = 1 << 31
    whole = not len(corners) or (corners.min() >= -limit and corners.max() < limit)
    if whole and corners.dtype.kind == "f":
        whole = not (corners % 1 != 0).any()
    if not whole:
        raise broken(path, "a face names a vertex that is no whole number below 2^31")
    return fan(counts, corners)


def _header(path: Path, blob: bytes) -> tuple[str, list[_Element], int]:
    """Byte order ('' for ASCII), elements, and where the data start."""
    if blob[:3].lower() != b"ply":
        raise broken(path, "does not begin with 'ply'", "this is not a PLY file")
    end = blob.find(b"end_header", 0, _HEADER_LIMIT)
    if end < 0:
        raise broken(path, "the header has no end_header", "the file is truncated")
    start = end + len(b"end_header")
    start += 2 if blob[start : start + 2] == b"\r\n" else 1
    order: str | None = None
    elements: list[_Element] = []
    for line in blob[3:end].decode("latin-1").splitlines():
        words = line.split()
        try:
            if not words or words[0] in ("comment", "obj_info"):
                continue
            if words[0] == "format":
                order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[words[1]]
            elif words[0] == "element":
                elements.append(_Element(words[1], int(words[2])))
            elif words[0] == "property" and words[1] == "list":
                elements[-1].properties.append(_Property(words[4], _TYPES[words[3]], _TYPES[words[2]]))
            elif words[0] == "property":
                elements[-1].properties.append(_Property(words[2], _TYPES[words[1]]))
            else:
                raise ValueError(words[0])
        except (KeyError, IndexError, ValueError):
            raise broken(path, f"header line {line.strip()[:60]!r} is not PLY") from None
    if order is None:
        raise broken(path, "the header names no format")
    for element in elements:
        _check_element(path, element, [e.name for e in elements])
    return order, elements, start


def _check_element(path: Path, element: _Element, all_names: list[str]) -> None:
    names = [p.name for p in element.properties]
    scalars = [p.name for p in element.properties if not p.count_kind]
    if element.length < 0 or all_names.count(element.name) > 1 or len(set(names)) < len(names):
        raise broken(path, f"header: element {element.name!r} has a negative count or a name twice")
    if any(p.count_kind[0] == "f" for p in element.lists):
        raise broken(path, f"header: a list of element {element.name!r} has a length that is no integer type")
    if element.name == "vertex" and not {"x", "y", "z"} <= set(scalars):
        raise broken(path, "header: element 'vertex' lacks x, y or z")
    if element.name == "face" and not {p.name for p in element.lists} & set(_CORNERS):
        raise broken(path, "header: element 'face' has no list 'vertex_indices'", "export it as polygons")
    if element.name == "tristrips":
        raise broken(path, "holds triangle strips", "export it as triangles")


class _Binary:
    """Walks the elements of a binary file, in order."""

    def __init__(self, path: Path, blob: bytes, start: int, order: str):
        self.path, self.blob, self.at, self.order = path, blob, start, order

    def vertices(self, element: _Element) -> NDArray:
        """Positions [length, 3]; other properties of the vertices are skipped."""
        if element.lists:
            raise broken(self.path, "vertices that carry lists are not supported", "export positions only")
        rows = self._rows(element, [])
        kinds = {p.kind for p in element.properties if p.name in "xyz"}
        kind = np.float32 if kinds <= {"f4", "i1", "u1", "i2", "u2"} else np.float64
        points = np.empty((element.length, 3), dtype=kind)
        for i, axis in enumerate("xyz"):
            points[:, i] = rows[axis]
        return points

    def polygons(self, element: _Element) -> tuple[NDArray, NDArray]:
        """Length and contents of the element's list of corners (empty for other elements, which are walked
        over).
        """
        nothing = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        if not element.length or not element.properties:
            return nothing
        if not element.lists:
            self._rows(element, [])
            return nothing
        begin = self.at
        sizes = self._walk(element, 1)[2]
        self.at = begin
        dtype = self._dtype(element, sizes)
        same = dtype.itemsize * element.length <= len(self.blob) - begin
        if same:
            rows = self._rows(element, sizes)
            same = all(
                (rows[f"{p.name}:count"] == n).all() for p, n in zip(element.lists, sizes, strict=True)
            )
        if same:
            found = [(p.name, n) for p, n in zip(element.lists, sizes, strict=True) if p.name in _CORNERS]
            if not found:
                return nothing
            name, count = found[0]
            return np.full(element.length, count), rows[name].reshape(-1)
        self.at = begin
        counts, corners, _ = self._walk(element, element.length)
        return _array(counts), np.frombuffer(corners, dtype=np.float64) if corners else np.zeros(0)

    def _dtype(self, element: _Element, sizes: list[int]) -> np.dtype:
        fields: list[tuple] = []
        left = iter(sizes)
        for p in element.properties:
            if p.count_kind:
                fields.append((f"{p.name}:count", self.order + p.count_kind))
                fields.append((p.name, self.order + p.kind, (next(left),)))
            else:
                fields.append((p.name, self.order + p.kind))
        return np.dtype(fields)

    def _rows(self, element: _Element, sizes: list[int]) -> NDArray:
        dtype = self._dtype(element, sizes)
        need = dtype.itemsize * element.length
        if need > len(self.blob) - self.at:
            raise self._short(element)
        rows = np.frombuffer(self.blob, dtype=dtype, count=element.length, offset=self.at)
        self.at += need
        return rows

    def _walk(self, element: _Element, length: int) -> tuple[array, array, list[int]]:
        """Row by row: lengths and contents of the corner lists, and the list lengths of the last row."""
        counts, corners = array("q"), array("d")
        sizes: list[int] = []
        plan = [
            (p.name in _CORNERS, p.count_kind, int(p.kind[1]), _STRUCT[p.kind]) for p in element.properties
        ]
        at, end, order = self.at, len(self.blob), self.order
        for _ in range(length):
            sizes = []
            for wanted, count_kind, size, code in plan:
                number = 1
                if count_kind:
                    if at + int(count_kind[1]) > end:
                        raise self._short(element)
                    (number,) = struct.unpack_from(order + _STRUCT[count_kind], self.blob, at)
                    at += int(count_kind[1])
                    sizes.append(number)
                if number < 0 or at + number * size > end:
                    raise self._short(element)
                if wanted and count_kind:
                    counts.append(number)
                    corners.extend(struct.unpack_from(f"{order}{number}{code}", self.blob, at))
                at += number * size
        self.at = at
        return counts, corners, sizes

    def _short(self, element: _Element) -> Exception:
        problem = f"the data end inside the {element.length} of {element.name!r} that the header claims"
        return broken(self.path, problem, "the file is truncated or its header wrong")

    def finish(self) -> None:
        """Nothing but white space may be left."""
        if self.blob[self.at :].strip():
            left = len(self.blob) - self.at
            raise broken(
                self.path, f"{left} bytes are left after the counts of the header", "its header is wrong"
            )


class _Ascii:
    """Walks the elements of an ASCII file, as one flat row of numbers."""

    def __init__(self, path: Path, blob: bytes, start: int):
        self.path, self.at = path, 0
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", DeprecationWarning)
                text = blob[start:].decode("ascii")
                self.values = np.fromstring(text, sep=" ") if text.strip() else np.zeros(0)
        except (ValueError, DeprecationWarning):
            raise broken(path, "something after the header is not a number", "mend or export again") from None

    def vertices(self, element: _Element) -> NDArray:
        """Positions float64 [length, 3]."""
        if element.lists:
            raise broken(self.path, "vertices that carry lists are not supported", "export positions only")
        width = len(element.properties)
        rows = self._take(element, element.length * width).reshape(-1, width)
        names = [p.name for p in element.properties]
        return np.ascontiguousarray(rows[:, [names.index(axis) for axis in "xyz"]])

    def polygons(self, element: _Element) -> tuple[NDArray, NDArray]:
        """As :meth:`_Binary.polygons`."""
        nothing = np.zeros(0, dtype=np.int64), np.zeros(0)
        width = len(element.properties)
        if not element.length or not width:
            return nothing
        if not element.lists:
            self._take(element, element.length * width)
            return nothing
        only = width == 1 and element.properties[0].name in _CORNERS
        if only and self.at < len(self.values) and 0 <= self.values[self.at] < len(self.values):
            first = int(self.values[self.at])
            need = element.length * (first + 1)
            rows = self.values[self.at : self.at + need]
            if len(rows) == need and (rows[:: first + 1] == first).all():
                self.at += need
                return np.full(element.length, first), rows.reshape(-1, first + 1)[:, 1:].reshape(-1)
        counts, starts = array("q"), array("q")
        for _ in range(element.length):
            for p in element.properties:
                number = 1.0
                if p.count_kind:
                    number = float(self._take(element, 1)[0])
                    if not (number >= 0 and number % 1 == 0):
                        raise broken(self.path, f"a list of {element.name!r} has the length {number:g}")
                if p.count_kind and p.name in _CORNERS:
                    counts.append(int(min(number, len(self.values))))
                    starts.append(self.at)
                self._take(element, number)
        if not counts:
            return nothing
        return _array(counts), _gather(self.values, _array(starts), _array(counts))

    def _take(self, element: _Element, number: float) -> NDArray:
        if number > len(self.values) - self.at:
            problem = f"the data end inside the {element.length} of {element.name!r} that the header claims"
            raise broken(self.path, problem, "the file is truncated or its header wrong")
        taken = self.values[self.at : self.at + int(number)]
        self.at += int(number)
        return taken

    def finish(self) -> None:
        """No number may be left."""
        if self.at < len(self.values):
            left = len(self.values) - self.at
            raise broken(
                self.path, f"{left} numbers are left after the counts of the header", "its header is wrong"
            )


def _array(numbers: array) -> NDArray[np.int64]:
    return np.frombuffer(numbers, dtype=np.int64) if numbers else np.zeros(0, dtype=np.int64)


def _gather(values: NDArray, starts: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray:
    """The stretches ``values[start : start + count]`` one after another."""
    keep = np.zeros(len(values) + 1, dtype=np.int8)
    np.add.at(keep, starts[counts > 0], 1)
    np.add.at(keep, (starts + counts)[counts > 0], -1)
    return values[np.cumsum(keep[:-1], dtype=np.int8).astype(bool)]
