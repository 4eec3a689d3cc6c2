"""Stanford PLY: ASCII and binary of either byte order, any element order, polygons of any size.

trimesh 5.2 is not used because it refuses binary files that mix triangles and larger polygons, and files whose elements
or lists have an unusual order; it moves the second halves of quads behind all other faces; it reads a truncated ASCII
file as a smaller mesh, and an index of 1.5 as 1. tests/scene/test_load.py has a file for each case, and compares files
of triangles with what trimesh reads.
"""

from __future__ import annotations

import struct
import warnings
from array import array
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import UserError
from .checks import ALL, Mesh, Wanted, broken, checked, read_bytes
from .polygons import polygon_sizes, triangulate

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
    "i8": "q",
    "u8": "Q",
    "f4": "f",
    "f8": "d",
}
_CORNERS = ("vertex_indices", "vertex_index")
_HEADER_LIMIT = 1 << 20
_WRONG = "the file is truncated or its header wrong"


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

    @property
    def lists(self) -> list[_Property]:
        return [p for p in self.properties if p.count_kind]


def read_ply(path: Path, wanted: Wanted = ALL) -> Mesh:
    """Positions (float32 if a binary file stores float32, else float64) and triangulated faces, in file order.

    Needs memory of up to about ten times the file's size. Raises :class:`UserError` if header and contents disagree, an
    index is out of range, a face has fewer than 3 vertices, or there are no faces.
    """
    data = _Data(path, *_header(path, read_bytes(path)))
    points, counts, corners = None, np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int32)
    for element in data.elements:
        if element.name == "vertex":
            points = data.positions(element)
        else:
            sizes, indices = data.corners(element)
            if element.name == "face":
                polygon_sizes(path, sizes)
                counts, corners = sizes, _indices(path, indices)
    data.finish()
    if points is None:
        raise broken(path, "has no element 'vertex'")
    return checked(path, points, triangulate(points, counts, corners))


def _indices(path: Path, corners: NDArray) -> NDArray[np.int32]:
    """The vertex indices, after checking that they are integers in the range of int32."""
    limit = 1 << 31
    whole = not len(corners) or (corners.min() >= -limit and corners.max() < limit)
    if whole and corners.dtype.kind == "f":
        whole = not (corners % 1 != 0).any()
    if not whole:
        raise broken(path, "a face has a vertex index that is not a whole number below 2^31")
    return corners.astype(np.int32, copy=False)


def _header(path: Path, blob: bytes) -> tuple[str, list[_Element], memoryview]:
    """Byte order ('' for ASCII), elements, and the bytes after the header."""
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
    return order, elements, memoryview(blob)[start:]


def _check_element(path: Path, element: _Element, all_names: list[str]) -> None:
    names = [p.name for p in element.properties]
    scalars = [p.name for p in element.properties if not p.count_kind]
    if element.length < 0 or all_names.count(element.name) > 1 or len(set(names)) < len(names):
        raise broken(path, f"header: element {element.name!r} has a negative count or a name twice")
    if any(p.count_kind[0] == "f" for p in element.lists):
        raise broken(
            path, f"header: a list of element {element.name!r} has a length that is not of an integer type"
        )
    if element.name == "vertex" and not {"x", "y", "z"} <= set(scalars):
        raise broken(path, "header: element 'vertex' lacks x, y or z")
    if element.name == "face" and not {p.name for p in element.lists} & set(_CORNERS):
        raise broken(path, "header: element 'face' has no list 'vertex_indices'", "export it as polygons")
    if element.name == "tristrips":
        raise broken(path, "holds triangle strips", "export it as triangles")


class _Data:
    """The data after the header, read element by element.

    The numbers of an ASCII file are first converted to float64, and then read like a binary file of float64.
    """

    def __init__(self, path: Path, order: str, elements: list[_Element], data: memoryview):
        self.path, self.order, self.elements, self.at = path, order or "=", elements, 0
        self.data = data
        self.unit, self.unit_name = 1, "bytes"
        if not order:
            self.data = _numbers(path, bytes(data)).view(np.uint8).data
            self.unit, self.unit_name = 8, "numbers"
            for element in elements:
                element.properties = [
                    _Property(p.name, "f8", "f8" if p.count_kind else "") for p in element.properties
                ]
        for element in elements:  # checked before memory is allocated by these counts; lists may be empty
            least = element.length * sum(int((p.count_kind or p.kind)[1]) for p in element.properties)
            if least > len(self.data):
                claim = (
                    f"the header claims {element.length} of {element.name!r}, at least {least // self.unit}"
                )
                follow = f"{len(self.data) // self.unit} follow it"
                raise broken(path, f"{claim} {self.unit_name}, but {follow}", _WRONG)

    def positions(self, element: _Element) -> NDArray:
        """x, y, z [length, 3]; other properties of the vertices are skipped."""
        if element.lists:
            raise broken(
                self.path, "vertices with list properties are not supported", "export positions only"
            )
        rows = self._rows(element, [])
        if rows is None:
            raise self._short(element)
        kinds = {p.kind for p in element.properties if p.name in "xyz"}
        kind = np.float32 if kinds <= {"f4", "i1", "u1", "i2", "u2"} else np.float64
        points = np.empty((element.length, 3), dtype=kind)
        for i, axis in enumerate("xyz"):
            points[:, i] = rows[axis]
        return points

    def corners(self, element: _Element) -> tuple[NDArray, NDArray]:
        """Lengths and contents of the lists of vertex indices; both empty for an element without such a list."""
        nothing = np.zeros(0, dtype=np.int64), np.zeros(0)
        if not element.length or not element.properties:
            return nothing
        begin = self.at
        sizes = self._walk(element, 1)[2]
        self.at = begin
        rows = self._rows(element, sizes)
        if rows is None and not element.lists:
            raise self._short(element)
        if rows is not None:
            wanted = [(p.name, n) for p, n in zip(element.lists, sizes, strict=True) if p.name in _CORNERS]
            if not wanted:
                return nothing
            name, count = wanted[0]
            return np.full(element.length, count), rows[name].reshape(-1)
        counts, corners, _ = self._walk(element, element.length)
        return np.array(counts, dtype=np.int64), np.frombuffer(corners) if corners else np.zeros(0)

    def _rows(self, element: _Element, sizes: list[int]) -> NDArray | None:
        """The element as a structured array if the lists of every row have these sizes, else None."""
        fields: list[tuple] = []
        left = iter(sizes)
        for p in element.properties:
            if p.count_kind:
                fields.append((f"{p.name}:count", self.order + p.count_kind))
                fields.append((p.name, self.order + p.kind, (next(left),)))
            else:
                fields.append((p.name, self.order + p.kind))
        dtype = np.dtype(fields)
        need = dtype.itemsize * element.length
        if need > len(self.data) - self.at:
            return None
        rows = np.frombuffer(self.data[self.at : self.at + need], dtype=dtype) if need else np.zeros(0, dtype)
        if any((rows[f"{p.name}:count"] != n).any() for p, n in zip(element.lists, sizes, strict=True)):
            return None
        self.at += need
        return rows

    def _walk(self, element: _Element, length: int) -> tuple[array, array, list[int]]:
        """Read row by row: lengths and contents of the index lists, and the list lengths of the last row."""
        counts, corners = array("q"), array("d")
        sizes: list[int] = []
        kinds = [(p.name in _CORNERS, p.count_kind, p.kind) for p in element.properties]
        at, end, order = self.at, len(self.data), self.order
        for _ in range(length):
            sizes = []
            for wanted, count_kind, kind in kinds:
                number, size = 1, int(kind[1])
                if count_kind:
                    if at + int(count_kind[1]) > end:
                        raise self._short(element)
                    (number,) = struct.unpack_from(order + _STRUCT[count_kind], self.data, at)
                    at += int(count_kind[1])
                    if not (number >= 0 and number % 1 == 0):
                        raise broken(self.path, f"a list of {element.name!r} has the length {number:g}")
                    number = int(number)
                    sizes.append(number)
                if at + number * size > end:
                    raise self._short(element)
                if wanted and count_kind:
                    counts.append(number)
                    corners.extend(struct.unpack_from(f"{order}{number}{_STRUCT[kind]}", self.data, at))
                at += number * size
        self.at = at
        return counts, corners, sizes

    def _short(self, element: _Element) -> UserError:
        problem = f"the data end inside the {element.length} of {element.name!r} that the header claims"
        return broken(self.path, problem, _WRONG)

    def finish(self) -> None:
        """Raise :class:`UserError` if anything but white space is left."""
        left = len(self.data) - self.at
        if left and (self.unit > 1 or bytes(self.data[self.at :]).strip()):
            problem = f"{left // self.unit} {self.unit_name} remain after the elements that the header claims"
            raise broken(self.path, problem, "its header is wrong")


def _numbers(path: Path, text: bytes) -> NDArray[np.float64]:
    """The numbers in a text, float64."""
    if not text.strip():
        return np.zeros(0)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)
            return np.fromstring(text.decode("ascii"), sep=" ")
    except (ValueError, DeprecationWarning):
        raise broken(
            path, "a value after the header is not a number", "correct the file or export it again"
        ) from None
