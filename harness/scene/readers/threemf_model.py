"""The XML parts of a 3MF package: relationships, and models of objects with triangles or components, and what is built."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from operator import itemgetter
from typing import IO, Any
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from .text import numbers

_SCHEMAS = "http://schemas.microsoft.com/3dmanufacturing/"
_CORE = (_SCHEMAS + "core/2015/02", _SCHEMAS + "core/2013/01", "")
_PRODUCTION = _SCHEMAS + "production/2015/06"
_PATH = _PRODUCTION + " path"
_LATTICE = _SCHEMAS + "beamlattice/2017/02 beamlattice"
_UNDERSTOOD = (_PRODUCTION, _SCHEMAS + "material/2015/02", _SCHEMAS + "trianglesets/2021/07")
"""Extensions that a file may require: parts in several files, colours, and names of groups of triangles."""

_COORDINATES, _CORNERS = itemgetter("x", "y", "z"), itemgetter("v1", "v2", "v3")

_BLOCK = 3 << 14
"""Numbers that are converted at a time."""

_READ = 1 << 16

AffineRows = NDArray[np.float64]
"""A transform of row vectors [4, 3]: p becomes p @ m[:3] + m[3]."""


class WrongError(ValueError):
    """What is wrong with a part, for the message."""


@dataclass(frozen=True)
class Use:
    """An object in a place: the part of the package that it is in, its id, its transform."""

    part: str
    identity: str
    matrix: AffineRows


@dataclass
class Solid:
    """An object: points [n, 3] and faces [m, 3], or components."""

    identity: str
    points: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    faces: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))
    components: list[Use] = field(default_factory=list)
    shaped: bool = False


@dataclass
class ModelPart:
    """A model: its objects by id, in the order of the file; what is built; and what it holds that is not read.

    unit  of lengths, where the file says it; else it is the millimetre
    """

    solids: dict[str, Solid] = field(default_factory=dict)
    build: list[Use] = field(default_factory=list)
    left_out: set[str] = field(default_factory=set)
    unit: str = ""


def model_of(stream: IO[bytes], part: str) -> ModelPart:
    """A model part by its name. Raises :class:`WrongError`, and expat's error for what is no XML."""
    reader = _Reader(part)
    _parse(stream, reader.start, reader.end, reader.prefixes)
    return reader.model


def relationships(stream: IO[bytes]) -> list[tuple[str, str]]:
    """Type and target of each relationship of a part of the package."""
    found: list[tuple[str, str]] = []

    def start(name: str, attributes: dict[str, str]) -> None:
        if name.endswith("Relationship"):
            found.append((attributes.get("Type", ""), attributes.get("Target", "")))

    _parse(stream, start, lambda name: None, {})
    return found


def _parse(
    stream: IO[bytes],
    start: Callable[[str, dict[str, str]], None],
    end: Callable[[str], None],
    prefixes: dict[str, str],
) -> None:
    """Read XML; tags and attributes are named "namespace name". Keeps the namespaces by their prefixes."""
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartNamespaceDeclHandler = lambda prefix, uri: prefixes.__setitem__(prefix or "", uri or "")
    parser.StartDoctypeDeclHandler = _no_doctype
    while block := stream.read(_READ):
        parser.Parse(block, False)
    parser.Parse(b"", True)


def _no_doctype(*_: Any) -> None:
    raise WrongError("a part declares a document type, which 3MF forbids")


class _Reader:
    """Handles the elements of a model part in turn. Numbers are gathered as texts and converted in blocks."""

    def __init__(self, part: str) -> None:
        self.model = ModelPart()
        self._part = part
        self.prefixes: dict[str, str] = {}
        self._solid: Solid | None = None
        self._texts: list[str] = []
        self._blocks: list[NDArray[Any]] = []
        self._starts = {
            "model": self._model,
            "basematerials": self._material,
            "object": self._object,
            "mesh": self._shape,
            "components": self._shape,
            "component": self._component,
            "vertices": self._begin,
            "vertex": self._vertex,
            "triangles": self._begin,
            "triangle": self._triangle,
            "item": self._item,
        }
        self._ends = {"vertices": self._end_vertices, "triangles": self._end_triangles, "object": self._end_object}

    def start(self, name: str, attributes: dict[str, str]) -> None:
        space, _, tag = name.rpartition(" ")
        if space in _CORE and tag in self._starts:
            self._starts[tag](attributes)
        elif name == _LATTICE:
            self.model.left_out.add("beam lattices")

    def end(self, name: str) -> None:
        space, _, tag = name.rpartition(" ")
        if space in _CORE and tag in self._ends:
            self._ends[tag]()

    def _model(self, attributes: dict[str, str]) -> None:
        self.model.unit = attributes.get("unit", "")
        for prefix in attributes.get("requiredextensions", "").split():
            uri = self.prefixes.get(prefix, prefix)
            if uri not in _UNDERSTOOD:
                raise WrongError(f"needs the extension {uri}")

    def _material(self, attributes: dict[str, str]) -> None:
        self.model.left_out.add("materials")

    def _object(self, attributes: dict[str, str]) -> None:
        identity = attributes.get("id", "")
        if identity in self.model.solids or self._solid is not None:
            raise WrongError(f"object {identity} is there twice or within another")
        self._solid = Solid(identity)

    def _shape(self, attributes: dict[str, str]) -> None:
        if self._solid is not None:
            self._solid.shaped = True

    def _end_object(self) -> None:
        solid, self._solid = self._solid, None
        if solid is None:
            return
        if not solid.shaped:
            raise WrongError(f"object {solid.identity} has another shape than triangles")
        if len(solid.faces) and not 0 <= solid.faces.min() <= solid.faces.max() < len(solid.points):
            bad = solid.faces.max() if solid.faces.min() >= 0 else solid.faces.min()
            problem = f"object {solid.identity} names vertex {bad}, but there are {len(solid.points)}"
            raise WrongError(problem)
        self.model.solids[solid.identity] = solid

    def _begin(self, attributes: dict[str, str]) -> None:
        self._texts, self._blocks = [], []

    def _vertex(self, attributes: dict[str, str]) -> None:
        self._gather(_COORDINATES, attributes, np.float64)

    def _triangle(self, attributes: dict[str, str]) -> None:
        self._gather(_CORNERS, attributes, np.int64)

    def _gather(self, three: itemgetter[tuple[str, str, str]], attributes: dict[str, str], dtype: type) -> None:
        try:
            self._texts += three(attributes)
        except KeyError as error:
            what = "vertex" if dtype is np.float64 else "triangle"
            raise WrongError(f"a {what} has no {error}") from None
        if len(self._texts) >= _BLOCK:
            self._convert(dtype)

    def _convert(self, dtype: type) -> None:
        """Convert the gathered texts."""
        text = " ".join(self._texts).encode("ascii", "replace").replace(b"\n", b"?")
        try:
            values, _ = numbers([text], dtype)
        except ValueError:
            values = np.zeros(0)
        if len(values) != len(self._texts):
            what = "a coordinate" if dtype is np.float64 else "a vertex index"
            raise WrongError(f"{what} is not a number")
        self._blocks.append(values)
        self._texts = []

    def _taken(self, dtype: type) -> NDArray[Any]:
        self._convert(dtype)
        found = np.concatenate(self._blocks).reshape(-1, 3)
        self._blocks = []
        return found

    def _end_vertices(self) -> None:
        if self._solid is not None:
            self._solid.points = self._taken(np.float64)

    def _end_triangles(self) -> None:
        if self._solid is not None:
            self._solid.faces = self._taken(np.int64)

    def _component(self, attributes: dict[str, str]) -> None:
        if self._solid is not None:
            self._solid.components.append(_use(attributes, self._part))

    def _item(self, attributes: dict[str, str]) -> None:
        self.model.build.append(_use(attributes, self._part))


def _use(attributes: dict[str, str], part: str) -> Use:
    """What a component or an item of the build says, in a part."""
    matrix = np.concatenate([np.eye(3), np.zeros((1, 3))])
    if "transform" in attributes:
        try:
            values, _ = numbers([attributes["transform"].encode("ascii", "replace").replace(b"\n", b" ")])
        except ValueError:
            values = np.zeros(0)
        if len(values) != 12 or not np.isfinite(values).all():
            raise WrongError(f"a transform is not 12 numbers: {attributes['transform'][:60]!r}")
        matrix = values.reshape(4, 3)
    return Use(attributes.get(_PATH, part).lstrip("/"), attributes.get("objectid", ""), matrix)
