"""Arrays of a glTF file: accessors, of which each is checked against the bytes that there are before it is read."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....arrays import Floats
from .compressed import unpacked
from .container import File
from .entries import MESHOPT, Entry

_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


@dataclass(frozen=True)
class Layout:
    """What an accessor says of itself: ``count`` elements of ``width`` numbers; integers may stand for -1..1 or 0..1."""

    count: int
    width: int
    dtype: np.dtype[Any]
    normalized: bool = False


class Accessors:
    """The arrays that entries name by a key. Nothing is copied unless it is sparse, compressed or converted."""

    def __init__(self, file: File) -> None:
        self.file = file
        self._read: dict[int, NDArray] = {}
        self._unpacked: dict[int, memoryview] = {}

    def layout(self, entry: Entry, key: str) -> Layout:
        """The layout of an accessor."""
        own = self.file.named(entry, entry.get(key), "accessors")
        kind, component = own.get("type"), own.get("componentType")
        if kind not in _WIDTHS or component not in _TYPES:
            raise own.error(f"has the type {kind!r} of components {component!r}")
        dtype = np.dtype(_TYPES[component])
        normalized = bool(own.get("normalized", False)) and dtype.kind != "f"
        return Layout(own.whole("count"), _WIDTHS[kind], dtype, normalized)

    def floats(self, entry: Entry, key: str, width: int) -> Floats:
        """Numbers of an accessor [count, width]: float32 where that is exact, float64 for normalised integers."""
        layout, values = self.layout(entry, key), self.raw(entry, key)
        if layout.width != width or layout.dtype == np.dtype("<u4"):
            kinds = f"{layout.width} of type {layout.dtype}"
            raise entry.error(f": accessor {entry.get(key)} holds {kinds}, not {width} floats")
        return normal(values) if layout.normalized else values.astype(np.float32, copy=False)

    def indices(self, entry: Entry, key: str, width: int = 1) -> NDArray[np.unsignedinteger]:
        """Unsigned integers [count, width] of an accessor."""
        layout = self.layout(entry, key)
        if layout.dtype.kind != "u" or layout.width != width:
            raise entry.error(f": accessor {entry.get(key)} does not hold unsigned integers")
        return self.raw(entry, key)

    def raw(self, entry: Entry, key: str) -> NDArray:
        """The numbers of an accessor as stored, [count, width]; each accessor is read once."""
        layout, index = self.layout(entry, key), entry.get(key)
        if index not in self._read:
            self._read[index] = self._array(self.file.entry("accessors", index), layout)
        return self._read[index]

    def _array(self, own: Entry, layout: Layout) -> NDArray:
        own.refuse_unknown()
        exceptions = self._exceptions(own, layout) if "sparse" in own else None
        if "bufferView" in own:
            values = self._strided(own, layout)
        elif layout.count > self.file.size:
            raise own.error(f"has {layout.count} elements, but no data")
        else:
            values = np.zeros((layout.count, layout.width), layout.dtype)
        if exceptions is not None:
            values = values.copy()
            values[exceptions[0]] = exceptions[1]
        return values

    def _exceptions(self, own: Entry, layout: Layout) -> tuple[NDArray, NDArray]:
        """The places [n] and values [n, width] that a sparse accessor has in place of its others."""
        sparse = own.object("sparse", f"{own.name} (sparse)")
        count, kind = sparse.whole("count"), sparse.object("indices").get("componentType")
        others = sparse.object("values")
        if kind not in (5121, 5123, 5125):
            raise sparse.error(": its indices are not unsigned integers")
        places = self._strided(sparse.object("indices"), Layout(count, 1, np.dtype(_TYPES[kind])))[:, 0]
        if count and places.max() >= layout.count:
            raise sparse.error(f"names element {places.max()}, but there are {layout.count}")
        return places, self._strided(others, Layout(count, layout.width, layout.dtype))

    def _strided(self, entry: Entry, layout: Layout) -> NDArray:
        """Elements of a buffer view, in place. They must lie within the view and within the bytes of its buffer."""
        view = self.file.named(entry, entry.get("bufferView"), "bufferViews")
        item = layout.dtype.itemsize * layout.width
        data, stride = self.view(entry), view.whole("byteStride", item)
        if stride < item:
            raise view.error(f"has a stride of {stride} for items of {item} bytes")
        start = entry.whole("byteOffset", 0)
        need = start + (layout.count - 1) * stride + item if layout.count else 0
        if need > len(data):
            raise entry.error(f"needs {need} bytes, its view has {len(data)}")
        step = (stride, layout.dtype.itemsize)
        return np.ndarray((layout.count, layout.width), layout.dtype, data, start if need else 0, step)

    def view(self, entry: Entry) -> memoryview:
        """The bytes of the buffer view that an entry names, decompressed."""
        view, index = self.file.named(entry, entry.get("bufferView"), "bufferViews"), entry.get("bufferView")
        view.refuse_unknown()
        packed = next((found for key in MESHOPT if (found := view.extension(key))), None)
        data = self.file.buffer(view)
        if data is not None or packed is None:
            return _slice(view, data)
        if index not in self._unpacked:
            self._unpacked[index] = unpacked(packed, _slice(packed, self.file.buffer(packed)))
        return self._unpacked[index]


def _slice(view: Entry, data: memoryview | None) -> memoryview:
    """The part of a buffer that a view names. It may lack its last bytes: what is read is checked."""
    if data is None:
        raise view.error(f"is of buffer {view.get('buffer')!r}, which has no data")
    start, length = view.whole("byteOffset", 0), view.whole("byteLength")
    if start > len(data):
        raise view.error(f"reaches beyond the {len(data)} bytes of its buffer")
    return data[start : start + length]


def normal(values: NDArray) -> Floats:
    """The numbers -1..1 or 0..1 that integers stand for."""
    return np.maximum(values / np.float64(np.iinfo(values.dtype).max), -1.0)
