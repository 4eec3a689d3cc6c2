"""The XML parts of a 3MF package: relationships, and models of objects with triangles or components, and what is built."""

from array import array
from dataclasses import dataclass, field
from typing import IO, Any
from xml.etree import ElementTree

import numpy as np

from ...arrays import F64, I64

_SCHEMAS = "http://schemas.microsoft.com/3dmanufacturing/"
_CORE = (_SCHEMAS + "core/2015/02", _SCHEMAS + "core/2013/01", "")
_PRODUCTION = _SCHEMAS + "production/2015/06"
_PATH = f"{{{_PRODUCTION}}}path"
_LATTICE = f"{{{_SCHEMAS}beamlattice/2017/02}}beamlattice"
_UNDERSTOOD = (_PRODUCTION, _SCHEMAS + "material/2015/02", _SCHEMAS + "trianglesets/2021/07")
"""Extensions that a file may require: parts in several files, colours, and names of groups of triangles."""

_COORDINATES, _CORNERS = ("x", "y", "z"), ("v1", "v2", "v3")

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


def model_of(stream: IO[bytes], part: str) -> "Model":
    """A model part by its name. Raises :class:`WrongError`, and ParseError for what is no XML."""
    parser: Any = ElementTree.XMLParser(target=Model(part))
    while block := stream.read(_READ):
        parser.feed(block)
    return parser.close()


def relationships(stream: IO[bytes]) -> list[tuple[str, str]]:
    """Type and target of each relationship of a part of the package. Raises ParseError for what is no XML."""
    found = (element for element in ElementTree.parse(stream).iter() if element.tag.endswith("Relationship"))
    return [(element.get("Type", ""), element.get("Target", "")) for element in found]


class Model:
    """A model part: its objects by id, in the order of the file; what is built; and what it holds that is not read.

    unit  of lengths, where the file says it; else it is the millimetre

    It takes the elements of the part in turn, as an XML parser calls ``start`` and ``end``.
    """

    def __init__(self, part: str) -> None:
        self.solids: dict[str, Solid] = {}
        self.build: list[Use] = []
        self.left_out: set[str] = set()
        self.unit = ""
        self._part = part
        self._prefixes: dict[str, str] = {}
        self._solid: Solid | None = None
        self._numbers: array[Any] = array("d")

    def start_ns(self, prefix: str, uri: str) -> None:
        self._prefixes[prefix] = uri

    def doctype(self, *_: Any) -> None:
        raise WrongError("a part declares a document type, which 3MF forbids")

    def close(self) -> "Model":
        return self

    def start(self, name: str, attributes: dict[str, str]) -> None:
        solid = self._solid or Solid("")
        match _core(name):
            case "model":
                self._header(attributes)
            case "basematerials":
                self.left_out.add("materials")
            case "object":
                identity = attributes.get("id", "")
                if identity in self.solids or self._solid:
                    raise WrongError(f"object {identity} is there twice or within another")
                self._solid = Solid(identity)
            case "mesh" | "components":
                solid.shaped = True
            case "vertices":
                self._numbers = array("d")
            case "triangles":
                self._numbers = array("q")
            case "vertex":
                self._add(attributes, "vertex", _COORDINATES, float, "a coordinate")
            case "triangle":
                self._add(attributes, "triangle", _CORNERS, int, "a vertex index")
            case "component":
                solid.components.append(_use(attributes, self._part))
            case "item":
                self.build.append(_use(attributes, self._part))
            case _:
                if name == _LATTICE:
                    self.left_out.add("beam lattices")

    def _add(self, attributes: dict[str, str], element: str, names: tuple[str, ...], kind: type, number: str) -> None:
        """Take the numbers of a vertex or a triangle."""
        try:
            texts = [attributes[name] for name in names]
            if "_" in "".join(texts):  # which Python allows
                raise ValueError
            self._numbers.extend(map(kind, texts))
        except KeyError as error:
            raise WrongError(f"a {element} has no {error}") from None
        except (ValueError, OverflowError, TypeError):
            raise WrongError(f"{number} is not a number") from None

    def end(self, name: str) -> None:
        match _core(name), self._solid:
            case "vertices", Solid() as solid:
                solid.points = np.array(self._numbers).reshape(-1, 3)
            case "triangles", Solid() as solid:
                solid.faces = np.array(self._numbers).reshape(-1, 3)
            case "object", Solid() as solid:
                self._end(solid)
                self._solid = None

    def _header(self, attributes: dict[str, str]) -> None:
        self.unit = attributes.get("unit", "")
        for prefix in attributes.get("requiredextensions", "").split():
            uri = self._prefixes.get(prefix, prefix)
            if uri not in _UNDERSTOOD:
                raise WrongError(f"needs the extension {uri}")

    def _end(self, solid: Solid) -> None:
        if not solid.shaped:
            raise WrongError(f"object {solid.identity} has another shape than triangles")
        if len(solid.faces) and not 0 <= solid.faces.min() <= solid.faces.max() < len(solid.points):
            bad = solid.faces.max() if solid.faces.min() >= 0 else solid.faces.min()
            raise WrongError(f"object {solid.identity} names vertex {bad}, but there are {len(solid.points)}")
        self.solids[solid.identity] = solid


def _core(name: str) -> str:
    """The tag of an element of the core; "" for others."""
    space, _, tag = name.lstrip("{").rpartition("}")
    return tag if space in _CORE else ""


def _use(attributes: dict[str, str], part: str) -> Use:
    """What a component or an item of the build says, in a part."""
    matrix = np.eye(4, 3)
    if "transform" in attributes:
        try:
            matrix = np.array(attributes["transform"].split(), dtype=np.float64).reshape(4, 3)
        except ValueError:
            matrix = np.full((4, 3), np.nan)
        if not np.isfinite(matrix).all():
            raise WrongError(f"a transform is not 12 numbers: {attributes['transform'][:60]!r}")
    return Use(attributes.get(_PATH, part).lstrip("/"), attributes.get("objectid", ""), matrix)
