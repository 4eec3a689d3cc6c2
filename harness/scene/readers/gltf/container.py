"""Opening a glTF file: its JSON part, and the bytes of its buffers within the file, in it as text, or beside it.

An entry of the JSON part has values of the type that it must have, or is named by a line. An extension that is not
understood may move, add or hide triangles: it is refused where the file requires it, and where it stands at something
that is read. One of a material, a texture or an image only changes how a surface looks.
"""

from __future__ import annotations

import base64
import json
import re
import struct
from collections.abc import Sequence
from os.path import isfile
from pathlib import Path, PurePosixPath
from typing import Any, NoReturn
from urllib.parse import unquote, unquote_to_bytes

from ....errors import UserError
from ..checks import broken, read_bytes

_LARGEST = 1 << 40  # whole numbers are smaller: they count and index bytes of a file

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")

_UNDERSTOOD = {DRACO, *MESHOPT} | set(
    """
    EXT_mesh_gpu_instancing KHR_animation_pointer KHR_lights_punctual KHR_mesh_quantization KHR_node_visibility
    """.split()
)
_LOOKS = re.compile(r"[A-Z0-9]+_(materials|texture|textures|lights|image)_.+")
"""Extensions of how surfaces look and are lit."""

_NOT_DRAWN = set(
    """
    AGI_articulations AGI_stk_metadata CESIUM_primitive_outline EXT_feature_metadata EXT_instance_features EXT_mesh_features
    EXT_mesh_manifold EXT_structural_metadata FB_geometry_metadata FB_ngon_encoding GODOT_single_root KHR_audio
    KHR_audio_emitter KHR_collision_shapes KHR_implicit_shapes KHR_interactivity KHR_node_hoverability
    KHR_node_selectability KHR_physics_rigid_bodies KHR_xmp KHR_xmp_json_ld MOZ_hubs_components MSFT_audio_emitter MSFT_lod
    MSFT_packing_normalRoughnessMetallic MSFT_packing_occlusionRoughnessMetallic OMI_collider OMI_physics_body
    OMI_physics_joint OMI_physics_shape VRM VRMC_node_constraint VRMC_springBone VRMC_vrm VRMC_vrm_animation
    """.split()
)
"""Extensions that describe a file, or what may happen after it is first drawn. Of MSFT_lod the finest meshes are drawn."""

_JSON, _BIN = 0x4E4F534A, 0x004E4942
_JSON_LIMIT = 1 << 25  # bytes of JSON without embedded data; Python's objects take up to twenty times as much

_EMBEDDED = re.compile(rb'"data:(?:[^"\\]|\\.)*+"')
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")
_TRUNCATED = "the file is truncated or its header wrong"
_BESIDE = "put it beside the file, or export one self-contained .glb"

_ONE = {"bufferViews": "buffer view", "meshes": "mesh"}
"""What one entry of a list is called in messages, where that is not the name of the list without its s."""


class Entry:
    """An object of the JSON part. Every wrong value is a :class:`UserError` that names the file and the entry.

    name    what it is called in messages: "node 3"
    values  as they stand in the file
    """

    __slots__ = ("name", "path", "values")

    def __init__(self, path: Path, name: str, values: dict[str, Any]) -> None:
        self.path, self.name, self.values = path, name, values

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def get(self, key: str, default: Any = None) -> Any:
        return self.values.get(key, default)

    def error(self, problem: str, way_out: str = "export the file again") -> UserError:
        """The error for what is wrong with it: "has ...", ": its ..."."""
        return broken(self.path, f"{self.name}{'' if problem[0] == ':' else ' '}{problem}", way_out)

    def whole(self, key: str, default: int | None = None) -> int:
        """A whole number that is not negative."""
        value = self.get(key, default)
        if type(value) is not int or not 0 <= value < _LARGEST:
            raise self.error(f": {key} is {value!r}, not a whole number")
        return value

    def items(self, key: str) -> list[Any]:
        """A list; empty where it is absent."""
        value = self.get(key, [])
        if not isinstance(value, list):
            raise self.error(f": {key} is not a list")
        return value

    def entries(self, key: str, one: str) -> list[Entry]:
        """A list of objects, which are called as this one is. ``one``: what is said of one that is none."""
        for value in self.items(key):
            if not isinstance(value, dict):
                raise self.error(f": {one} is not an object")
        return [Entry(self.path, self.name, value) for value in self.items(key)]

    def object(self, key: str, name: str = "") -> Entry:
        """An object within it; empty where it is absent. ``name``: what it is called, else as this one."""
        value = self.get(key, {})
        if not isinstance(value, dict):
            raise Entry(self.path, name or self.name, {}).error(f": {key} is not an object")
        return Entry(self.path, name or self.name, value)

    def numbers(self, key: str, default: Sequence[float]) -> list[float]:
        """As many finite numbers as the default has."""
        value = self.get(key)
        if value is None:
            return list(default)
        good = isinstance(value, list) and len(value) == len(default)
        if not good or not all(type(x) in (int, float) and abs(x) < 1e300 for x in value):
            raise self.error(f": {key} is not {len(default)} finite numbers")
        return [float(x) for x in value]

    def number(self, key: str, default: float) -> float:
        """A finite number."""
        return Entry(self.path, self.name, {key: [self.get(key, default)]}).numbers(key, (default,))[0]

    def extension(self, name: str) -> Entry | None:
        """What an extension says about it; None where it says nothing."""
        said = self.object("extensions") if "extensions" in self else None
        return said.object(name) if said and name in said else None

    def refuse_unknown(self) -> None:
        """Raise :class:`UserError` if an extension of it may change what is drawn: for what is read."""
        for name in filter(_unknown, self.object("extensions").values if "extensions" in self else ()):
            problem = f"has the extension {name}, which may change its triangles and cannot be read"
            raise self.error(problem, "export it without")

    def named(self, what: str, index: Any, items: Sequence[Any]) -> Entry:
        """The object among ``items`` that it names by an index."""
        if type(index) is not int or not 0 <= index < len(items) or not isinstance(items[index], dict):
            raise self.error(f"names {what} {index!r}, but there are {len(items)}")
        return Entry(self.path, f"{what} {index}", items[index])

    def title(self) -> str:
        """What it is and its own name, on one line; its index where it has none."""
        name = self.get("name")
        name = " ".join(name.split())[:60] if isinstance(name, str) else ""
        return f"{self.name.rpartition(' ')[0]} {name!r}" if name else self.name


def counted(count: int, one: str, many: str | None = None) -> str:
    """A number of things: "1 skin", "2 skins"."""
    return f"{count} {one if count == 1 else many or one + 's'}"


def _unknown(name: object) -> bool:
    """Whether an extension may change the triangles and is not understood."""
    return not isinstance(name, str) or not (name in _UNDERSTOOD | _NOT_DRAWN or _LOOKS.fullmatch(name))


def refuse_required(head: Entry) -> None:
    """Raise :class:`UserError` if the file requires an extension that is not understood, or one of its root is not."""
    for name in filter(_unknown, head.items("extensionsRequired")):
        raise broken(head.path, f"needs the extension {name}", "export it without")
    head.refuse_unknown()


class MissingError(UserError):
    """A buffer beside the file that is not there."""


class File:
    """A glTF file and its buffers, each read once, when it is first asked for.

    head      its JSON part
    files     the files beside it that were read
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.files: list[Path] = []
        self._chunk: memoryview | None = None
        self._embedded: list[bytes] = []
        self._buffers: dict[int, memoryview | None] = {}
        self._lists: dict[str, list[dict[str, Any]]] = {}
        blob = read_bytes(path)
        self._size = len(blob)
        self.head = Entry(path, "the file", self._parsed(self._text(blob) if blob[:4] == b"glTF" else memoryview(blob)))
        asset = self.head.object("asset")
        least, version = asset.get("minVersion", "2.0"), str(asset.get("version", "2.0"))
        if least != "2.0" or version.split(".")[0] != "2":
            raise self.error(f"glTF version {version}", "export as glTF 2.0")

    def error(self, problem: str, way_out: str = "export the file again") -> UserError:
        return broken(self.path, problem, way_out)

    @property
    def size(self) -> int:
        """Bytes that were read so far, in the file and beside it."""
        return self._size + sum(len(data) for data in self._buffers.values() if data is not None)

    def all(self, name: str) -> list[dict[str, Any]]:
        """The objects of one of the lists of the JSON part; empty where it is absent."""
        if name not in self._lists:
            self._lists[name] = self.head.items(name)
            for i, values in enumerate(self._lists[name]):
                if not isinstance(values, dict):
                    raise self.error(f"{_one(name)} {i} is not an object")
        return self._lists[name]

    def entry(self, name: str, index: int) -> Entry:
        """An entry of a list, whose index is known to be right."""
        return Entry(self.path, f"{_one(name)} {index}", self.all(name)[index])

    def named(self, entry: Entry, index: Any, name: str) -> Entry:
        """The entry of a list that another one names by its index."""
        return entry.named(_one(name), index, self.all(name))

    def _text(self, blob: bytes) -> memoryview:
        """The JSON chunk of a binary file; keeps the binary chunk. Chunks of other kinds and later bytes are ignored."""
        if len(blob) < 20:
            raise self.error("ends within its header", "the file is truncated")
        version, length = struct.unpack_from("<II", blob, 4)
        if version != 2:
            raise self.error(f"glTF version {version}", "export as glTF 2.0")
        if length > len(blob):
            raise self.error(f"the header claims {length} bytes, but the file has {len(blob)}", _TRUNCATED)
        text, at = None, 12
        while at + 8 <= length and self._chunk is None:
            size, kind = struct.unpack_from("<II", blob, at)
            if at + 8 + size > length:
                raise self.error("a chunk ends beyond the file", "the file is truncated")
            part = memoryview(blob)[at + 8 : at + 8 + size]
            if text is None and kind != _JSON:
                raise self.error("the first chunk is not JSON")
            if text is None:
                text = part
            elif kind == _BIN:
                self._chunk = part
            at += 8 + size
        if text is None:
            raise self.error("has no JSON chunk", _TRUNCATED)
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
            raise self.error(f"its JSON part has {size} bytes, more than {_JSON_LIMIT}", "export a part of it")
        try:
            head = json.loads(b"".join(kept), parse_constant=_no_number)
        except (ValueError, RecursionError) as error:
            way_out = "the file is damaged or not a glTF file"
            raise self.error(f"its JSON part cannot be read ({error})", way_out) from error
        if not isinstance(head, dict):
            raise self.error("its JSON part is not an object")
        return head

    def buffer(self, entry: Entry) -> memoryview | None:
        """The bytes of the buffer that a view names; None where it has none, since an extension holds them."""
        index = entry.get("buffer")
        own = self.named(entry, index, "buffers")
        if index not in self._buffers:
            uri = own.get("uri")
            if uri is not None and not isinstance(uri, str):
                raise own.error(": its URI is not a text")
            if uri is None:
                self._buffers[index] = self._chunk if index == 0 else None
            else:
                read = self._decoded if uri.startswith("data:") else self._beside
                self._buffers[index] = memoryview(read(own, uri))
        return self._buffers[index]

    def _decoded(self, buffer: Entry, uri: str) -> bytes:
        """The data embedded in a URI of which :meth:`_parsed` kept the place."""
        place = uri.removeprefix("data:")
        whole = json.loads(self._embedded[int(place)]) if place.isdigit() else uri
        kind, comma, data = whole.partition(",")
        if not comma:
            raise buffer.error(": its embedded data have no comma before them")
        if not kind.endswith(";base64"):
            return unquote_to_bytes(data)
        try:
            return base64.b64decode(data, validate=True)
        except ValueError as error:
            raise buffer.error(f": its embedded data are not base64 ({error})") from error

    def _beside(self, buffer: Entry, uri: str) -> bytes:
        """The contents of a file in the folder of this one or below it."""
        shown = repr(uri if len(uri) <= 100 else uri[:97] + "...")
        name = unquote(uri).replace("\\", "/")
        if _SCHEME.match(uri) or name.startswith("/") or ".." in PurePosixPath(name).parts:
            raise buffer.error(f"is at {shown}, outside the file's folder", _BESIDE)
        path = self.path.parent / name
        if not isfile(path):
            raise MissingError(str(self.error(f"its buffer {shown} is missing", _BESIDE)))
        if path not in self.files:
            self.files.append(path)
        return read_bytes(path)


def _no_number(word: str) -> NoReturn:
    raise ValueError(f"{word} is not JSON")


def _one(name: str) -> str:
    return _ONE.get(name, name[:-1])
