"""The data of a PLY file after its header: the columns of each element, from records or from rows of text."""

import struct
from array import array
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays import I64
from ...errors import UserError
from .checks import broken
from .ply_header import CORNERS, Element, Header, Property
from .text import blocks_of_lines, first_wrong, numbers, plain_lines

_STRUCT = {
    "i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q", "f4": "f", "f8": "d",
}  # fmt: skip
_READ = ("x", "y", "z", *CORNERS)
"""The properties that are read; others are passed over."""

_WRONG = "the file is truncated or its header wrong"


class Column(NamedTuple):
    """The values of a property of all rows; of a list one list after the other, with the length of each."""

    values: NDArray
    counts: I64


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
        if not element.length or not element.properties:
            return _nothing(element)
        begin, sizes = self.at, self._walk(element, 1)[1]
        self.at = begin
        table = self._table(element, sizes)
        if table is None:
            return self._walk(element, element.length)[0]
        full = {p.name: np.full(element.length, n) for p, n in zip(element.lists, sizes, strict=True)}
        none = np.zeros(0, np.int64)
        return {
            p.name: Column(table[p.name].reshape(-1), full.get(p.name, none))
            for p in element.properties
            if p.name in _READ
        }

    def _table(self, element: Element, sizes: list[int]) -> NDArray | None:
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
        rows = np.frombuffer(self.data, dtype, element.length, self.at)
        if any((rows[f"{p.name}:count"] != n).any() for p, n in zip(element.lists, sizes, strict=True)):
            return None
        self.at += need
        return rows

    def _walk(self, element: Element, length: int) -> tuple[Columns, list[int]]:
        """Read row by row: the columns, and the lengths of the lists of the last row."""
        read = {p.name: (array("d"), array("q")) for p in element.properties if p.name in _READ}
        sizes: list[int] = []
        at, end, order = self.at, len(self.data), self.order
        for _ in range(length):
            sizes = []
            for p in element.properties:
                number, size = 1, int(p.kind[1])
                if p.count_kind:
                    number = self._length(element, p, at)
                    at += int(p.count_kind[1])
                    sizes.append(number)
                if at + number * size > end:
                    raise self._short(element)
                if p.name in read:
                    values, counts = read[p.name]
                    values.extend(struct.unpack_from(f"{order}{number}{_STRUCT[p.kind]}", self.data, at))
                    if p.count_kind:
                        counts.append(number)
                at += number * size
        self.at = at
        made = {
            name: Column(np.array(values), np.array(counts, dtype=np.int64)) for name, (values, counts) in read.items()
        }
        return made, sizes

    def _length(self, element: Element, p: Property, at: int) -> int:
        """The length of a list."""
        if at + int(p.count_kind[1]) > len(self.data):
            raise self._short(element)
        (number,) = struct.unpack_from(self.order + _STRUCT[p.count_kind], self.data, at)
        if not (number >= 0 and number % 1 == 0):
            raise broken(self.path, f"a list of {element.name!r} has the length {number:g}")
        return int(number)

    def _short(self, element: Element) -> UserError:
        problem = f"the data end inside the {element.length} of {element.name!r} that the header claims"
        return broken(self.path, problem, _WRONG)

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
        parts, counts = [np.zeros(0)], [np.zeros(0, np.int64)]
        line = blob[: header.start].count(b"\n") + 1
        for lines in blocks_of_lines(plain_lines(blob[header.start :])):
            try:
                values, each = numbers(lines)
            except ValueError:
                wrong, error = first_wrong(lines, numbers)
                way_out = "correct the file or export it again"
                raise broken(path, f"line {line + wrong}: {error}", way_out) from None
            parts.append(values)
            counts.append(each[each > 0])
            line += len(lines)
        self.values, each = np.concatenate(parts), np.concatenate(counts)
        self.ends = np.cumsum(each)
        self.starts = self.ends - each

    def columns(self, element: Element) -> Columns:
        """The columns of the next element that are read. Raises :class:`UserError` if it has not the rows it claims."""
        if not element.length or not element.properties:
            return _nothing(element)
        first, last = self.at, self.at + element.length
        if last > len(self.starts):
            left = len(self.starts) - first
            problem = f"the header claims {element.length} of {element.name!r}, but {left} rows follow"
            raise broken(self.path, problem, _WRONG)
        self.at, found = last, {}
        at, ends = self.starts[first:last], self.ends[first:last]
        right = np.ones(element.length, dtype=bool)
        for p in element.properties:
            right &= at < ends
            at = np.where(right, at, 0)  # a wrong row is refused below, wherever it is read
            counts = np.zeros(0, np.int64)
            if p.count_kind:
                given = self.values[at]
                with np.errstate(invalid="ignore"):
                    right &= (given >= 0) & (given % 1 == 0) & (at + given < ends)
                counts, at = np.where(right, given, 0).astype(np.int64), at + 1
            if p.name in _READ:
                each = counts if p.count_kind else np.ones(len(at), np.int64)
                places = np.repeat(at - (np.cumsum(each) - each), each)
                places += np.arange(len(places))
                found[p.name] = Column(self.values[places], counts)
            at = at + (counts if p.count_kind else 1)
        right &= at == ends
        if not right.all():
            row = int(np.argmin(right))
            values = (self.ends - self.starts)[first + row]
            problem = (
                f"the number of values in row {row} (from 0) of {element.name!r}, {values}, is not the declared one"
            )
            raise broken(self.path, problem, _WRONG)
        return found

    def finish(self) -> None:
        """Raise :class:`UserError` if rows are left."""
        left = len(self.starts) - self.at
        if left:
            problem = f"more rows follow than the header claims: {left}"
            raise broken(self.path, problem, "its header is wrong")


def _nothing(element: Element) -> Columns:
    """The columns of an element without rows."""
    return {p.name: Column(np.zeros(0), np.zeros(0, np.int64)) for p in element.properties}
