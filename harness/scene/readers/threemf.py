"""3MF, the format of 3D printing: the objects that a package builds, in the order of its items and their components.

trimesh 5.2 is not used because it takes all meshes of another part of the package for each object in it, and unpacks without
a limit; it also reads files that require what it cannot read.
"""

import io
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, TypeVar
from xml.etree.ElementTree import ParseError

import numpy as np

from .checks import ALL, Loaded, Wanted, broken, checked, guarded, read_bytes
from .threemf_model import AffineRows, Model, Solid, Use, WrongError, model_of, relationships

_GROWTH, _FLOOR = 100, 1 << 26
"""A package may unpack to this many times its size, or to this many bytes, whichever is more; this stops zip bombs."""

_DRAWN, _PLACED = 1 << 25, 1 << 20
"""Largest number of triangles and of placed objects: through components a small file could have any number."""

_UP = (0.0, 0.0, 1.0)

T = TypeVar("T")


def read_3mf(path: Path, wanted: Wanted = ALL) -> Loaded:
    """All triangles of the build, float64, in the unit of the file. Each placed object has vertices of its own.

    Raises :class:`UserError` for extensions that the file requires and cannot be read, for objects of other shapes than
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
        except ParseError as error:
            raise broken(self._path, f"{name} is not XML ({error})", "the file is damaged") from error
