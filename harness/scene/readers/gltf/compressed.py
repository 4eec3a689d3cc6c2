"""Compressed data of glTF: meshes by Draco (package DracoPy) and buffer views by meshoptimizer (package meshopt)."""

import importlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....errors import install
from .entries import Entry

_MODES = ("ATTRIBUTES", "TRIANGLES", "INDICES")
_GROWTH, _FLOOR = 1100, 1 << 14
"""A compressed view unpacks to at most this many times its bytes, and a small one to this many bytes.

Its best case is 1024: of 256 equal rows each four columns take a byte.
"""


def _decoder(entry: Entry, package: str, by: str) -> Any:
    """The package that decodes an entry. Raises :class:`UserError` where it is not installed."""
    try:
        return importlib.import_module(package)
    except ImportError:
        raise entry.error(f"is compressed by {by}, which needs the package {package}", install(package)) from None


def unpacked(packed: Entry, source: memoryview) -> memoryview:
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
