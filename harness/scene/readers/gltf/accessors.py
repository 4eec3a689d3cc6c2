"""Arrays of a glTF file: accessors, of which each is checked against the bytes that there are before it is read."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....arrays import Floats
from .compressed import MESHOPT, unpacked
from .container import Container
from .document import Entry
from .extensions import refuse_unknown

_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


@dataclass(frozen=True)
class Layout:
    """What an accessor says of itself: ``count`` elements of ``width`` numbers; integers may stand for -1..1 or 0..1."""

    count: int
    width: int
    dtype: np.dtype[Any]
    normalized: bool


class Accessors:
    """The arrays of a file by index. Nothing is copied unless it is sparse, compressed or converted."""

    def __init__(self, file: Container) -> None:
        self._file = file
        self._document = file.document
        self._read: dict[int, NDArray] = {}
        self._unpacked: dict[int, memoryview] = {}

    def layout(self, index: Any, where: str) -> Layout:
        """The layout of an accessor. ``where``: the entry that names it."""
        entry, own = self._document.get("accessors", index, where), f"accessor {index}"
        kind, component = entry.get("type"), entry.get("componentType")
        if kind not in _WIDTHS or component not in _TYPES:
            raise self._document.error(f"{own} has the type {kind!r} of components {component!r}")
        dtype = np.dtype(_TYPES[component])
        normalized = bool(entry.get("normalized", False)) and dtype.kind != "f"
        return Layout(self._document.whole(entry, "count", own), _WIDTHS[kind], dtype, normalized)

    def floats(self, index: Any, where: str, width: int) -> Floats:
        """Numbers of an accessor [count, width]: float32 where that is exact, float64 for normalised integers."""
        layout, values = self.layout(index, where), self.raw(index, where)
        if layout.width != width or layout.dtype == np.dtype("<u4"):
            kinds = f"{layout.width} of type {layout.dtype}"
            raise self._document.error(f"{where}: accessor {index} holds {kinds}, not {width} floats")
        if not layout.normalized:
            return values.astype(np.float32, copy=False)
        return np.maximum(values / np.float64(np.iinfo(layout.dtype).max), -1.0)

    def indices(self, index: Any, where: str, width: int = 1) -> NDArray[np.unsignedinteger]:
        """Unsigned integers [count, width] of an accessor."""
        layout = self.layout(index, where)
        if layout.dtype.kind != "u" or layout.width != width:
            raise self._document.error(f"{where}: accessor {index} does not hold unsigned integers")
        return self.raw(index, where)

    def raw(self, index: Any, where: str) -> NDArray:
        """The numbers of an accessor as stored, [count, width]; each accessor is read once."""
        layout = self.layout(index, where)
        if index not in self._read:
            entry = self._document.get("accessors", index, where)
            self._read[index] = self._array(index, entry, layout)
        return self._read[index]

    def _array(self, index: int, entry: Entry, layout: Layout) -> NDArray:
        own, document = f"accessor {index}", self._document
        refuse_unknown(document, entry, own)
        exceptions = self._exceptions(index, entry, layout) if "sparse" in entry else None
        if "bufferView" in entry:
            values = self._strided(own, entry, layout, entry["bufferView"])
        elif layout.count > self._file.size:
            raise document.error(f"{own} has {layout.count} elements, but no data")
        else:
            values = np.zeros((layout.count, layout.width), layout.dtype)
        if exceptions is not None:
            values = values.copy()
            values[exceptions[0]] = exceptions[1]
        return values

    def _exceptions(self, index: int, entry: Entry, layout: Layout) -> tuple[NDArray, NDArray]:
        """The places [n] and values [n, width] that a sparse accessor has in place of its others."""
        document, where = self._document, f"accessor {index} (sparse)"
        sparse = document.object(entry, "sparse", where)
        count = document.whole(sparse, "count", where)
        indices, others = (document.object(sparse, key, where) for key in ("indices", "values"))
        kind = indices.get("componentType")
        if kind not in (5121, 5123, 5125):
            raise document.error(f"{where}: its indices are not unsigned integers")
        one = Layout(count, 1, np.dtype(_TYPES[kind]), False)
        places = self._strided(where, indices, one, indices.get("bufferView"))[:, 0]
        if count and places.max() >= layout.count:
            raise document.error(f"{where} names element {places.max()}, but there are {layout.count}")
        new = Layout(count, layout.width, layout.dtype, False)
        return places, self._strided(where, others, new, others.get("bufferView"))

    def _strided(self, own: str, entry: Entry, layout: Layout, view_index: Any) -> NDArray:
        """Elements of a buffer view, in place. They must lie within the view and within the bytes of its buffer."""
        document = self._document
        view = document.get("bufferViews", view_index, own)
        name = f"buffer view {view_index}"
        item = layout.dtype.itemsize * layout.width
        data, stride = self.view(view_index, own), document.whole(view, "byteStride", name, item)
        if stride < item:
            raise document.error(f"{name} has a stride of {stride} for items of {item} bytes")
        start = document.whole(entry, "byteOffset", own, 0)
        need = start + (layout.count - 1) * stride + item if layout.count else 0
        if need > len(data):
            raise document.error(f"{own} needs {need} bytes, its view has {len(data)}")
        step = (stride, layout.dtype.itemsize)
        return np.ndarray((layout.count, layout.width), layout.dtype, data, start if need else 0, step)

    def view(self, index: Any, where: str) -> memoryview:
        """The bytes of a buffer view, decompressed."""
        document, name = self._document, f"buffer view {index}"
        view = document.get("bufferViews", index, where)
        refuse_unknown(document, view, name)
        packed = next((found for key in MESHOPT if (found := document.extension(view, key, name))), None)
        data = self._file.buffer(view.get("buffer"), name)
        if data is None and packed is not None:
            if index not in self._unpacked:
                source = self._slice(packed, self._file.buffer(packed.get("buffer"), name), name)
                self._unpacked[index] = unpacked(document, name, packed, source)
            return self._unpacked[index]
        return self._slice(view, data, name)

    def _slice(self, view: Entry, data: memoryview | None, name: str) -> memoryview:
        """The part of a buffer that a view names. It may lack its last bytes: what is read is checked."""
        document = self._document
        if data is None:
            raise document.error(f"{name} is of buffer {view.get('buffer')!r}, which has no data")
        start, length = (document.whole(view, "byteOffset", name, 0), document.whole(view, "byteLength", name))
        if start > len(data):
            raise document.error(f"{name} reaches beyond the {len(data)} bytes of its buffer")
        return data[start : start + length]
