"""The JSON part of a glTF file: its entries by index, and values of the type that they must have."""

from pathlib import Path
from typing import Any

from ....errors import UserError
from ..checks import broken

Entry = dict[str, Any]

_ONE = {
    "accessors": "accessor",
    "animations": "animation",
    "buffers": "buffer",
    "bufferViews": "buffer view",
    "cameras": "camera",
    "materials": "material",
    "meshes": "mesh",
    "nodes": "node",
    "scenes": "scene",
    "skins": "skin",
}
"""The lists of the JSON part that are read, and what one of their entries is called in messages."""

_LARGEST = 1 << 40
"""Whole numbers are smaller: they count and index bytes of a file."""


class Document:
    """The JSON part. Every wrong value is a :class:`UserError` that names the file and the entry."""

    def __init__(self, path: Path, head: Entry) -> None:
        self.path = path
        self.head = head
        self._lists: dict[str, list[Entry]] = {}

    def error(self, problem: str, way_out: str = "export the file again") -> UserError:
        return broken(self.path, problem, way_out)

    def all(self, name: str) -> list[Entry]:
        """One of the lists of the JSON part; empty where it is absent."""
        if name not in self._lists:
            entries = self.items(self.head, name, "the file")
            for i, entry in enumerate(entries):
                if not isinstance(entry, dict):
                    raise self.error(f"{_ONE[name]} {i} is not an object")
            self._lists[name] = entries
        return self._lists[name]

    def get(self, name: str, index: Any, where: str) -> Entry:
        """An entry of a list. ``where``: the entry that names it, for the message."""
        entries = self.all(name)
        if type(index) is not int or not 0 <= index < len(entries):
            raise self.error(f"{where} names {_ONE[name]} {index!r}, but there are {len(entries)}")
        return entries[index]

    def whole(self, entry: Entry, key: str, where: str, default: int | None = None) -> int:
        """A whole number that is not negative."""
        value = entry.get(key, default)
        if type(value) is not int or not 0 <= value < _LARGEST:
            raise self.error(f"{where}: {key} is {value!r}, not a whole number")
        return value

    def items(self, entry: Entry, key: str, where: str) -> list[Any]:
        """A list; empty where it is absent."""
        value = entry.get(key, [])
        if not isinstance(value, list):
            raise self.error(f"{where}: {key} is not a list")
        return value

    def object(self, entry: Entry, key: str, where: str) -> Entry:
        """An object; empty where it is absent."""
        value = entry.get(key, {})
        if not isinstance(value, dict):
            raise self.error(f"{where}: {key} is not an object")
        return value

    def numbers(self, entry: Entry, key: str, where: str, default: tuple[float, ...]) -> list[float]:
        """As many finite numbers as the default has."""
        value = entry.get(key)
        if value is None:
            return list(default)
        good = isinstance(value, list) and len(value) == len(default)
        if not good or not all(type(x) in (int, float) and abs(x) < 1e300 for x in value):
            raise self.error(f"{where}: {key} is not {len(default)} finite numbers")
        return [float(x) for x in value]

    def number(self, entry: Entry, key: str, where: str, default: float) -> float:
        """A finite number."""
        return self.numbers({key: [entry.get(key, default)]}, key, where, (default,))[0]

    def extension(self, entry: Entry, name: str, where: str) -> Entry | None:
        """What an extension says about an entry; None where it says nothing."""
        said = self.object(entry, "extensions", where)
        return self.object(said, name, where) if name in said else None


def titled(entry: Entry, what: str, index: int) -> str:
    """What an entry is and its name, on one line; its index where it has none."""
    name = entry.get("name")
    name = " ".join(name.split())[:60] if isinstance(name, str) else ""
    return f"{what} {name!r}" if name else f"{what} {index}"


def counted(count: int, one: str, many: str | None = None) -> str:
    """A number of things: "1 skin", "2 skins"."""
    return f"{count} {one if count == 1 else many or one + 's'}"
