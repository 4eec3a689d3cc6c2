"""3MF, the format of 3D printing: the objects that a package builds, in the order of its items and their components.
trimesh 5.2 is not used because it takes all meshes of another part of the package for each object in it, and unpacks
without a limit; it also reads files that require what it cannot read.
"""

from __future__ import annotations

import io
import zipfile
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, TypeVar
from xml.etree import ElementTree

import numpy as np

from ...arrays import F64, I64
from .checks import ALL, Loaded, Wanted, broken, checked, guarded, read_bytes

_SCHEMAS = "http://schemas.microsoft.com/3dmanufacturing/"
_CORE = (_SCHEMAS + "core/2015/02", _SCHEMAS + "core/2013/01", "")
_PRODUCTION = _SCHEMAS + "production/2015/06"
_PATH = f"{{{_PRODUCTION}}}path"
_LATTICE = f"{{{_SCHEMAS}beamlattice/2017/02}}beamlattice"
_UNDERSTOOD = (_PRODUCTION, _SCHEMAS + "material/2015/02", _SCHEMAS + "trianglesets/2021/07")
"""Extensions that a file may require: parts in several files, colours, and names of groups of triangles."""

_COORDINATES, _CORNERS = ("x", "y", "z"), ("v1", "v2", "v3")

_READ = 1 << 16

AffineRows = F64  # a transform of row vectors [4, 3]: p becomes p @ m[:3] + m[3]
_GROWTH, _FLOOR = 100, 1 << 26  # times its size, or bytes, that a package may unpack to: stops zip bombs

_DRAWN, _PLACED = 1 << 25, 1 << 20
"""Largest number of triangles and of placed objects: through components a small file could have any number."""

_UP = (0.0, 0.0, 1.0)

T = TypeVar("T")


def read_3mf(path: Path, wanted: Wanted = ALL) -> Loaded:
    """All triangles of the build, float64, in the unit of the file. Each placed object has vertices of its own. Raises
    :class:`UserError` for extensions that the file requires and cannot be read, for objects of other shapes than
    triangles, and for a package that unpacks to far more than its size.
    """
    blob = read_bytes(path)
    with guarded(path, "3MF"), zipfile.ZipFile(io.BytesIO(blob)) as archive:
        package = _Package(path, archive, max(_FLOOR, _GROWTH * len(blob)))
        placed = list(package.placed())
        notes = package.notes()
    points = np.empty((sum(len(solid.points) for solid, _ in placed), 3))
    faces = np.empty((sum(len(solid.faces) for solid, _ in placed), 3), dtype=np.int32)
    vertex = triangle = 0
    for solid, matrix in placed:
        count, more = len(solid.points), len(solid.faces)
        with np.errstate(over="ignore", invalid="ignore"):
            points[vertex : vertex + count] = solid.points @ matrix[:3] + matrix[3]
            mirrored = np.cross(matrix[0], matrix[1]) @ matrix[2] < 0.0
        faces[triangle : triangle + more] = (solid.faces[:, [0, 2, 1]] if mirrored else solid.faces) + vertex
        vertex, triangle = vertex + count, triangle + more
    return checked(path, points, faces, _UP, notes)


class _Package:
    """The parts of a 3MF file, each read once."""

    def __init__(self, path: Path, archive: zipfile.ZipFile, limit: int) -> None:
        self._path, self._archive, self._left = path, archive, limit
        self._models: dict[str, Model] = {}
        self._sizes: dict[tuple[str, str], tuple[int, int]] = {}
        self._built: set[tuple[str, str]] = set()

    def placed(self) -> Iterator[tuple[Solid, AffineRows]]:
        """The objects with triangles that are built, and their transforms."""
        build = self._model(self._root()).build
        sizes = [self._size(use, "the build") for use in build]
        triangles, places = (sum(column) for column in zip((0, 0), *sizes, strict=True))
        if triangles > _DRAWN or places > _PLACED:
            problem = f"builds {places} objects of {triangles} triangles, more than {_PLACED} or {_DRAWN}"
            raise broken(self._path, problem, "export a part of it")
        waiting = [(use, use.matrix) for use in reversed(build)]
        while waiting:
            use, matrix = waiting.pop()
            self._built.add((use.part.lower(), use.identity))
            solid = self._models[use.part].solids[use.identity]
            if len(solid.faces):
                yield solid, matrix
            for component in reversed(solid.components):
                with np.errstate(over="ignore", invalid="ignore"):
                    below = component.matrix @ matrix[:3]
                    below[3] += matrix[3]
                waiting.append((component, below))

    def notes(self) -> tuple[str, ...]:
        """What the parts hold that is not read, and their unit."""
        models = self._models.values()
        left_out = sorted(set[str]().union(*(model.left_out for model in models)))
        idle = {(part.lower(), identity) for part, identity in self._sizes} - self._built
        left_out += [f"objects that are not built ({len(idle)})"] if idle else []
        units = sorted({model.unit for model in models} - {"", "millimeter"})
        return (*(f"{what} left out" for what in left_out), *(f"unit of length: {unit}" for unit in units))

    def _size(self, use: Use, where: str) -> tuple[int, int]:
        """Triangles and objects that an object stands for, with its components."""
        self._model(use.part)
        if (use.part, use.identity) not in self._sizes:
            raise broken(self._path, f"{where} names object {use.identity!r}, which does not come before it")
        return self._sizes[use.part, use.identity]

    def _model(self, name: str) -> Model:
        """A part and the sizes of its objects, each of which uses those before it."""
        if name not in self._models:
            self._models[name] = self._parsed(name, lambda stream: model_of(stream, name))
            for solid in self._models[name].solids.values():
                sizes = [self._size(use, f"object {solid.identity}") for use in solid.components]
                triangles, places = map(sum, zip((len(solid.faces), 1), *sizes, strict=True))
                self._sizes[name, solid.identity] = triangles, places
        return self._models[name]

    def _root(self) -> str:
        """The name of the part that the package begins with."""
        targets = [target for kind, target in self._parsed("_rels/.rels", relationships) if kind.endswith("/3dmodel")]
        if not targets:
            raise broken(self._path, "its package names no 3D model")
        return targets[0].lstrip("/")

    def _parsed(self, name: str, parse: Callable[[IO[bytes]], T]) -> T:
        """What a part of the package holds, by its name in any case of letters."""
        names = {entry.filename.lower(): entry for entry in self._archive.infolist()}
        entry = names.get(name.lower())
        if entry is None:
            raise broken(self._path, f"its package has no part {name[:100]!r}")
        self._left -= entry.file_size
        if self._left < 0:
            raise broken(self._path, f"{name} unpacks to far more than its size", "the file is damaged")
        try:
            with self._archive.open(entry) as stream:
                return parse(stream)
        except WrongError as error:
            raise broken(self._path, f"{name}: {error}") from error
        except ElementTree.ParseError as error:
            raise broken(self._path, f"{name} is not XML ({error})", "the file is damaged") from error


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


def model_of(stream: IO[bytes], part: str) -> Model:
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

    def close(self) -> Model:
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
            words = attributes["transform"].replace("_", "?").split()
            matrix = np.array(words, dtype=np.float64).reshape(4, 3)
        except ValueError:
            matrix = np.full((4, 3), np.nan)
        if not np.isfinite(matrix).all():
            raise WrongError(f"a transform is not 12 numbers: {attributes['transform'][:60]!r}")
    return Use(attributes.get(_PATH, part).lstrip("/"), attributes.get("objectid", ""), matrix)
