"""Compressed data of glTF: meshes by Draco (package DracoPy) and buffer views by meshoptimizer (package meshopt)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....errors import install
from .document import Document, Entry

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")

_MODES = ("ATTRIBUTES", "TRIANGLES", "INDICES")
_GROWTH, _FLOOR = 1100, 1 << 14
"""A compressed view unpacks to at most this many times its bytes, and a small one to this many bytes.

Its best case is 1024: of 256 equal rows each four columns take a byte.
"""


def unpacked(document: Document, name: str, packed: Entry, source: memoryview) -> memoryview:
    """The bytes of a buffer view that meshoptimizer compressed.

    name    of the view, for messages
    packed  what the extension says of it
    """
    try:
        import meshopt
    except ImportError:
        raise document.error(
            f"{name} is compressed by meshoptimizer, which needs the package meshopt", install("meshopt")
        ) from None
    count, stride = (document.whole(packed, key, name) for key in ("count", "byteStride"))
    mode, how = packed.get("mode"), packed.get("filter", "NONE")
    if mode not in _MODES:
        raise document.error(f"{name}: its compression has the mode {mode!r}")
    if count * stride > max(_FLOOR, _GROWTH * len(source)):
        problem = f"{name} unpacks {len(source)} bytes to {count * stride}"
        raise document.error(problem, "the file is damaged")
    if not count:
        return memoryview(b"")
    try:
        found = meshopt.decode_gltf_buffer(bytes(source), count, stride, mode, how)
    except (TypeError, ValueError) as error:
        raise document.error(f"{name} cannot be decompressed ({error})") from error
    return np.ascontiguousarray(found).data.cast("B")


class Draco:
    """A mesh that Draco compressed: ``faces`` uint32 [triangle_count, 3] and attributes [count, width].

    key  equal for the same data
    """

    def __init__(self, document: Document, name: str, said: Entry, source: memoryview) -> None:
        try:
            import DracoPy
        except ImportError:
            raise document.error(
                f"{name} is compressed by Draco, which needs the package DracoPy", install("DracoPy")
            ) from None
        self._document, self._name = document, name
        self._ids = document.object(said, "attributes", name)
        self.key = (str(said.get("bufferView")), str(self._ids))
        try:
            self._decoded = DracoPy.decode(bytes(source))
            faces = getattr(self._decoded, "faces", None)
        except Exception as error:
            raise document.error(f"{name} cannot be decompressed ({error})") from error
        if faces is None:
            raise document.error(f"{name}: its compressed data hold no triangles")
        self.faces: NDArray[np.uint32] = np.asarray(faces, dtype=np.uint32).reshape(-1, 3)

    def has(self, attribute: str) -> bool:
        """Whether this attribute is among the compressed ones."""
        return attribute in self._ids

    def attribute(self, attribute: str, count: int, width: int) -> NDArray[Any]:
        """An attribute by its name in glTF, of the count and width that its accessor says."""
        number = self._ids[attribute]
        found = self._decoded.get_attribute_by_unique_id(number) if type(number) is int else None
        values = None if found is None else np.asarray(found["data"])
        if values is None or values.shape != (count, width):
            shape = "nothing" if values is None else f"{values.shape}"
            raise self._document.error(
                f"{self._name}: {attribute} has the shape {(count, width)}, its compressed data {shape}"
            )
        return values
