"""Opening a glTF file: its JSON part, and the bytes of its buffers within the file, in it as text, or beside it."""

import base64
import json
import re
import struct
from pathlib import Path, PurePosixPath
from typing import Any, NoReturn
from urllib.parse import unquote, unquote_to_bytes

from ....errors import UserError
from ..checks import is_file, read_bytes
from .document import Document

_JSON, _BIN = 0x4E4F534A, 0x004E4942
_JSON_LIMIT = 1 << 25
"""Largest JSON part without embedded data, bytes. Parsed into Python objects it takes up to twenty times as much memory."""

_EMBEDDED = re.compile(rb'"data:(?:[^"\\]|\\.)*+"')
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")


class MissingError(UserError):
    """A buffer beside the file that is not there."""


class Container:
    """A glTF file and its buffers, each read once, when it is first asked for.

    document  its JSON part
    files     the files beside it that were read
    """

    def __init__(self, path: Path) -> None:
        blob = read_bytes(path)
        self._chunk: memoryview | None = None
        self._embedded: list[bytes] = []
        self._buffers: dict[int, memoryview | None] = {}
        self.files: list[Path] = []
        self.document = Document(path, {})
        text = self._chunks(blob) if blob[:4] == b"glTF" else memoryview(blob)
        self.document.head = self._parsed(text)
        self._require_version()
        self._size = len(blob)

    @property
    def size(self) -> int:
        """Bytes that were read so far, in the file and beside it."""
        return self._size + sum(len(data) for data in self._buffers.values() if data is not None)

    def _chunks(self, blob: bytes) -> memoryview:
        """The JSON chunk of a binary file; keeps the binary chunk. Chunks of other kinds and later bytes are ignored."""
        if len(blob) < 20:
            raise self.document.error("ends within its header", "the file is truncated")
        version, length = struct.unpack_from("<II", blob, 4)
        if version != 2:
            raise self.document.error(f"glTF version {version}", "export as glTF 2.0")
        if length > len(blob):
            problem = f"the header claims {length} bytes, but the file has {len(blob)}"
            raise self.document.error(problem, "the file is truncated or its header wrong")
        text, at = None, 12
        while at + 8 <= length and self._chunk is None:
            size, kind = struct.unpack_from("<II", blob, at)
            if at + 8 + size > length:
                raise self.document.error("a chunk ends beyond the file", "the file is truncated")
            part = memoryview(blob)[at + 8 : at + 8 + size]
            if text is None and kind != _JSON:
                raise self.document.error("the first chunk is not JSON")
            if text is None:
                text = part
            elif kind == _BIN:
                self._chunk = part
            at += 8 + size
        if text is None:
            raise self.document.error("has no JSON chunk", "the file is truncated or its header wrong")
        return text

    def _parsed(self, text: memoryview) -> dict[str, Any]:
        """The JSON part as objects. Embedded data are taken out first, so that none of it is parsed or copied twice."""
        kept: list[bytes | memoryview] = []
        at = 0
        for match in _EMBEDDED.finditer(text):
            kept += [text[at : match.start()], b'"data:%d"' % len(self._embedded)]
            self._embedded.append(match[0])
            at = match.end()
        kept.append(text[at:])
        size = sum(map(len, kept))
        if size > _JSON_LIMIT:
            problem = f"its JSON part has {size} bytes, more than {_JSON_LIMIT}"
            raise self.document.error(problem, "export a part of it")
        try:
            head = json.loads(b"".join(kept), parse_constant=_no_number)
        except (ValueError, RecursionError) as error:
            problem = f"its JSON part cannot be read ({error})"
            raise self.document.error(problem, "the file is damaged or not a glTF file") from error
        if not isinstance(head, dict):
            raise self.document.error("its JSON part is not an object")
        return head

    def _require_version(self) -> None:
        asset = self.document.object(self.document.head, "asset", "the file")
        least, version = asset.get("minVersion", "2.0"), str(asset.get("version", "2.0"))
        if least != "2.0" or version.split(".")[0] != "2":
            raise self.document.error(f"glTF version {version}", "export as glTF 2.0")

    def buffer(self, index: Any, where: str) -> memoryview | None:
        """The bytes of a buffer; None where it has none, since an extension holds them."""
        entry = self.document.get("buffers", index, where)
        if index not in self._buffers:
            self._buffers[index] = self._opened(index, entry.get("uri"))
        return self._buffers[index]

    def _opened(self, index: int, uri: Any) -> memoryview | None:
        if uri is None:
            return self._chunk if index == 0 else None
        if not isinstance(uri, str):
            raise self.document.error(f"buffer {index}: its URI is not a text")
        if uri.startswith("data:"):
            return memoryview(self._decoded(index, uri))
        return memoryview(self._beside(index, uri))

    def _decoded(self, index: int, uri: str) -> bytes:
        """The data embedded in a URI of which :meth:`_parsed` kept the place."""
        place = uri.removeprefix("data:")
        whole = json.loads(self._embedded[int(place)]) if place.isdigit() else uri
        kind, comma, data = whole.partition(",")
        if not comma:
            raise self.document.error(f"buffer {index}: its embedded data have no comma before them")
        if not kind.endswith(";base64"):
            return unquote_to_bytes(data)
        try:
            return base64.b64decode(data, validate=True)
        except ValueError as error:
            raise self.document.error(f"buffer {index}: its embedded data are not base64 ({error})") from error

    def _beside(self, index: int, uri: str) -> bytes:
        """The contents of a file in the folder of this one or below it."""
        shown = repr(uri if len(uri) <= 100 else uri[:97] + "...")
        name = unquote(uri).replace("\\", "/")
        if _SCHEME.match(uri) or name.startswith("/") or ".." in PurePosixPath(name).parts:
            problem = f"buffer {index} is at {shown}, outside the file's folder"
            raise self.document.error(problem, "put it beside the file, or export one self-contained .glb")
        path = self.document.path.parent / name
        if not is_file(path):
            way_out = "put it beside the file, or export one self-contained .glb"
            raise MissingError(str(self.document.error(f"its buffer {shown} is missing", way_out)))
        if path not in self.files:
            self.files.append(path)
        return read_bytes(path)


def _no_number(word: str) -> NoReturn:
    raise ValueError(f"{word} is not JSON")
