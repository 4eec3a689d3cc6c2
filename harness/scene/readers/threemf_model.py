"""The XML parts of a 3MF package: relationships, and models of objects with triangles or components, and what is built."""

from dataclasses import dataclass, field
from operator import itemgetter
from typing import IO, Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ...arrays import F64, I64
from .text import numbers

_SCHEMAS = "http://schemas.microsoft.com/3dmanufacturing/"
_CORE = (_SCHEMAS + "core/2015/02", _SCHEMAS + "core/2013/01", "")
_PRODUCTION = _SCHEMAS + "production/2015/06"
_PATH = f"{{{_PRODUCTION}}}path"
_LATTICE = f"{{{_SCHEMAS}beamlattice/2017/02}}beamlattice"
_UNDERSTOOD = (_PRODUCTION, _SCHEMAS + "material/2015/02", _SCHEMAS + "trianglesets/2021/07")
"""Extensions that a file may require: parts in several files, colours, and names of groups of triangles."""

_COORDINATES, _CORNERS = ("x", "y", "z"), ("v1", "v2", "v3")

_BLOCK = 3 << 14
"""Numbers that are converted at a time."""

_READ = 1 << 16

AffineRows = F64
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
    points: F64 = field(default_factory=lambda: np.zeros((0, 3)))
    faces: I64 = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))
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
    """A model part by its name. Raises :class:`WrongError`, and ParseError for what is no XML."""
    parser: Any = ElementTree.XMLParser(target=_Reader(part))
    while block := stream.read(_READ):
        parser.feed(block)
    return parser.close()


def relationships(stream: IO[bytes]) -> list[tuple[str, str]]:
    """Type and target of each relationship of a part of the package. Raises ParseError for what is no XML."""
    found = (element for element in ElementTree.parse(stream).iter() if element.tag.endswith("Relationship"))
    return [(element.get("Type", ""), element.get("Target", "")) for element in found]


class _Triples:
    """Three numbers of each element of a kind, [n, 3]; gathered as texts and converted in blocks."""

    def __init__(self, element: str, number: str, names: tuple[str, str, str], dtype: type) -> None:
        self._element, self._number, self._dtype = element, number, dtype
        self._three = itemgetter(*names)
        self._texts: list[str] = []
        self._blocks: list[NDArray[Any]] = []

    def add(self, attributes: dict[str, str]) -> None:
        try:
            self._texts += self._three(attributes)
        except KeyError as error:
            raise WrongError(f"a {self._element} has no {error}") from None
        if len(self._texts) >= _BLOCK:
            self._convert()

    def all(self) -> NDArray[Any]:
        self._convert()
        return np.concatenate(self._blocks).reshape(-1, 3)

    def _convert(self) -> None:
        self._blocks.append(_numbers(" ".join(self._texts), "?", self._dtype))
        if len(self._blocks[-1]) != len(self._texts):
            raise WrongError(f"{self._number} is not a number")
        self._texts = []


def _numbers(text: str, end_of_line: str, dtype: type = np.float64) -> NDArray[Any]:
    """The numbers of a text, in which ends of lines are written so; none if a word is no number."""
    try:
        return numbers([text.replace("\n", end_of_line).encode("ascii", "replace")], dtype)[0]
    except ValueError:
        return np.zeros(0, dtype)


class _Reader:
    """Takes the elements of a model part in turn: what an XML parser calls. ``close`` gives the model."""

    def __init__(self, part: str) -> None:
        self._model = ModelPart()
        self._part = part
        self._prefixes: dict[str, str] = {}
        self._solid = Solid("")
        self._within = False
        self._triples = _Triples("", "", _COORDINATES, np.float64)

    def start_ns(self, prefix: str, uri: str) -> None:
        self._prefixes[prefix] = uri

    def doctype(self, *_: Any) -> None:
        raise WrongError("a part declares a document type, which 3MF forbids")

    def close(self) -> ModelPart:
        return self._model

    def start(self, name: str, attributes: dict[str, str]) -> None:
        match _core(name):
            case "model":
                self._header(attributes)
            case "basematerials":
                self._model.left_out.add("materials")
            case "object":
                identity = attributes.get("id", "")
                if identity in self._model.solids or self._within:
                    raise WrongError(f"object {identity} is there twice or within another")
                self._solid, self._within = Solid(identity), True
            case "mesh" | "components":
                self._solid.shaped = True
            case "vertices":
                self._triples = _Triples("vertex", "a coordinate", _COORDINATES, np.float64)
            case "triangles":
                self._triples = _Triples("triangle", "a vertex index", _CORNERS, np.int64)
            case "vertex" | "triangle":
                self._triples.add(attributes)
            case "component":
                self._solid.components.append(_use(attributes, self._part))
            case "item":
                self._model.build.append(_use(attributes, self._part))
            case _:
                if name == _LATTICE:
                    self._model.left_out.add("beam lattices")

    def end(self, name: str) -> None:
        match _core(name):
            case "vertices":
                self._solid.points = self._triples.all()
            case "triangles":
                self._solid.faces = self._triples.all()
            case "object":
                self._end_object()

    def _header(self, attributes: dict[str, str]) -> None:
        self._model.unit = attributes.get("unit", "")
        for prefix in attributes.get("requiredextensions", "").split():
            uri = self._prefixes.get(prefix, prefix)
            if uri not in _UNDERSTOOD:
                raise WrongError(f"needs the extension {uri}")

    def _end_object(self) -> None:
        solid, self._solid, self._within = self._solid, Solid(""), False
        if not solid.shaped:
            raise WrongError(f"object {solid.identity} has another shape than triangles")
        if len(solid.faces) and not 0 <= solid.faces.min() <= solid.faces.max() < len(solid.points):
            bad = solid.faces.max() if solid.faces.min() >= 0 else solid.faces.min()
            problem = f"object {solid.identity} names vertex {bad}, but there are {len(solid.points)}"
            raise WrongError(problem)
        self._model.solids[solid.identity] = solid


def _core(name: str) -> str:
    """The tag of an element of the core; "" for others."""
    space, _, tag = name.lstrip("{").rpartition("}")
    return tag if space in _CORE else ""


def _use(attributes: dict[str, str], part: str) -> Use:
    """What a component or an item of the build says, in a part."""
    matrix = np.concatenate([np.eye(3), np.zeros((1, 3))])
    if "transform" in attributes:
        values = _numbers(attributes["transform"], " ")
        if len(values) != 12 or not np.isfinite(values).all():
            raise WrongError(f"a transform is not 12 numbers: {attributes['transform'][:60]!r}")
        matrix = values.reshape(4, 3)
    return Use(attributes.get(_PATH, part).lstrip("/"), attributes.get("objectid", ""), matrix)
