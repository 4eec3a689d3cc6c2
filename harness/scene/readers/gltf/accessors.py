"""Arrays of a glTF file: accessors, of which each is checked against the bytes that there are before it is read. Meshes
may be compressed by Draco (package DracoPy), and buffer views by meshoptimizer (package meshopt).
"""

import importlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....arrays import Floats
from ....errors import install
from .container import MESHOPT, Entry, File

_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}

_MODES = ("ATTRIBUTES", "TRIANGLES", "INDICES")
_GROWTH, _FLOOR = 1100, 1 << 14
"""A compressed view unpacks to at most this many times its bytes, and a small one to this many bytes.

Its best case is 1024: of 256 equal rows each four columns take a byte.
"""


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
        own = self.file.named(entry, entry.get(key), "accessors")
        kind, component = own.get("type"), own.get("componentType")
        if kind not in _WIDTHS or component not in _TYPES:
            raise own.error(f"has the type {kind!r} of components {component!r}")
        dtype = np.dtype(_TYPES[component])
        normalized = bool(own.get("normalized", False)) and dtype.kind != "f"
        return Layout(own.whole("count"), _WIDTHS[kind], dtype, normalized)

    def floats(self, entry: Entry, key: str, width: int) -> Floats:
        """Numbers of an accessor [count, width]: float32 where that is exact, float64 for normalised integers."""
        layout = self.layout(entry, key)
        values = self._values(entry.get(key), layout)
        if layout.width != width or layout.dtype == np.dtype("<u4"):
            kinds = f"{layout.width} of type {layout.dtype}"
            raise entry.error(f": accessor {entry.get(key)} holds {kinds}, not {width} floats")
        return normal(values) if layout.normalized else values.astype(np.float32, copy=False)

    def indices(self, entry: Entry, key: str, width: int = 1) -> NDArray[np.unsignedinteger]:
        """Unsigned integers [count, width] of an accessor."""
        layout = self.layout(entry, key)
        if layout.dtype.kind != "u" or layout.width != width:
            raise entry.error(f": accessor {entry.get(key)} does not hold unsigned integers")
        return self._values(entry.get(key), layout)

    def raw(self, entry: Entry, key: str) -> NDArray:
        """The numbers of an accessor as stored, [count, width]."""
        return self._values(entry.get(key), self.layout(entry, key))

    def _values(self, index: int, layout: Layout) -> NDArray:
        """The numbers of an accessor, which is read once."""
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
        data, stride = self._bytes(view, entry.get("bufferView")), view.whole("byteStride", item)
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
        index = entry.get("bufferView")
        return self._bytes(self.file.named(entry, index, "bufferViews"), index)

    def _bytes(self, view: Entry, index: int) -> memoryview:
        view.refuse_unknown()
        packed = next((found for key in MESHOPT if (found := view.extension(key))), None)
        data = self.file.buffer(view)
        if data is not None or packed is None:
            return _slice(view, data)
        if index not in self._unpacked:
            self._unpacked[index] = _unpacked(packed, _slice(packed, self.file.buffer(packed)))
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


def _decoder(entry: Entry, package: str, by: str) -> Any:
    """The package that decodes an entry. Raises :class:`UserError` where it is not installed."""
    try:
        return importlib.import_module(package)
    except ImportError:
        raise entry.error(f"is compressed by {by}, which needs the package {package}", install(package)) from None


def _unpacked(packed: Entry, source: memoryview) -> memoryview:
    """The bytes of a buffer view that meshoptimizer compressed. ``packed``: what the extension says of it."""
    meshopt = _decoder(packed, "meshopt", "meshoptimizer")
    count, stride = packed.whole("count"), packed.whole("byteStride")
    mode, how = packed.get("mode"), packed.get("filter", "NONE")
    if mode not in _MODES:
        raise packed.error(f": its compression has the mode {mode!r}")
    if count * stride > max(_FLOOR, _GROWTH * len(source)):
        raise packed.error(f"unpacks {len(source)} bytes to {count * stride}", "the file is damaged")
    if not count:
        return memoryview(b"")
    try:
        found = meshopt.decode_gltf_buffer(bytes(source), count, stride, mode, how)
    except (TypeError, ValueError) as error:
        raise packed.error(f"cannot be decompressed ({error})") from error
    return np.ascontiguousarray(found).data.cast("B")


class Draco:
    """A mesh that Draco compressed: ``faces`` uint32 [triangle_count, 3] and attributes [count, width].

    key  equal for the same data
    """

    def __init__(self, said: Entry, source: memoryview) -> None:
        decoder = _decoder(said, "DracoPy", "Draco")
        self._ids = said.object("attributes")
        self.key = (str(said.get("bufferView")), str(self._ids.values))
        try:
            self._decoded = decoder.decode(bytes(source))
            faces = getattr(self._decoded, "faces", None)
        except Exception as error:
            raise said.error(f"cannot be decompressed ({error})") from error
        if faces is None:
            raise said.error(": its compressed data hold no triangles")
        self.faces: NDArray[np.uint32] = np.asarray(faces, dtype=np.uint32).reshape(-1, 3)

    def has(self, attribute: str) -> bool:
        """Whether this attribute is among the compressed ones."""
        return attribute in self._ids

    def attribute(self, attribute: str, count: int, width: int) -> NDArray[Any]:
        """An attribute by its name in glTF, of the count and width that its accessor says."""
        number = self._ids.get(attribute)
        found = self._decoded.get_attribute_by_unique_id(number) if type(number) is int else None
        values = None if found is None else np.asarray(found["data"])
        if values is None or values.shape != (count, width):
            shape = "nothing" if values is None else f"{values.shape}"
            raise self._ids.error(f": {attribute} has the shape {(count, width)}, its compressed data {shape}")
        return values
