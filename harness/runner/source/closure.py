"""Which source files a measurement depends on: the closure of a method's imports, and one hash of it.

A record is current as long as the code that it measured is. That code is every module that the method's own module
imports, directly or not, as far as it belongs to this project or to the method's distribution; the further files that
the method names (``sources``); and, for every method, the modules that load a frame and take samples
(:data:`MEASURING`). Import statements are read from the source, also those inside functions; nothing is run. Modules
found by name at run time (the registry's methods, the catalogue's stand-ins) are not imported by a statement, and so one
method's key does not depend on another method.

Of a file the syntax tree counts, without statements that are only a string (docstrings, the text below an attribute):
so comments and layout do not count, nor changes of a docstring that a program reads as data (``__doc__``).
"""

import ast
import functools
import hashlib
import importlib.metadata
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

HARNESS = __name__.rsplit(".", 3)[0]
PROJECT = HARNESS.rpartition(".")[0]
ROOT = Path(__file__).parents[3]

SAMPLING = f"{HARNESS}.runner.measuring.timing"
MEASURING = (f"{HARNESS}.runner.measuring.measured_point",)  # load frames, take samples, count memory

UNREADABLE = (SyntaxError, ValueError, RecursionError, MemoryError)


def source_hash(cls: type, root: Path = ROOT) -> str:
    """The hash of all source that a method's records depend on. ``root``: the folder of this project's packages."""
    files = source_files(cls, root)
    known, further = hash_of(files), sorted(further_sources(cls, files).items())
    lines = (f"{name} {hashlib.sha256(file.read_bytes()).hexdigest()}\n" for name, file in further)
    return hashlib.sha256("".join([known, *lines]).encode()).hexdigest() if further else known


def further_sources(cls: type, files: Mapping[str, Path]) -> dict[str, Path]:
    """The files that a method and its base classes name as ``sources``, beside the module of each in ``files``. Raises
    FileNotFoundError for a name that no file has: the records would not depend on it.
    """
    found: dict[str, Path] = {}
    for base in cls.__mro__:
        for pattern in vars(base).get("sources", ()):
            folder = files[base.__module__].parent
            named = [path for path in folder.glob(pattern) if path.is_file()]
            if not named:
                raise FileNotFoundError(f"{base.__name__}.sources: no file {pattern!r} beside {base.__module__}")
            found |= {f"{base.__module__}/{path.relative_to(folder).as_posix()}": path for path in named}
    return found


def source_files(cls: type, root: Path = ROOT) -> dict[str, Path]:
    """The files that a method's records depend on; base classes count, wherever they were imported from."""
    places = project(root)
    roots = list(MEASURING)
    for base in cls.__mro__:
        name = base.__module__
        if name.partition(".")[0] in sys.stdlib_module_names:
            continue
        roots.append(name)
        file = str(getattr(sys.modules[name], "__file__", None))
        if file.endswith(".py") and not name.startswith(f"{PROJECT}."):
            places |= distribution(name, Path(file).resolve())
    return closure(roots, places)


def closure_hash(roots: Iterable[str], places: Mapping[str, Path] | None = None) -> str:
    """The hash of :func:`closure`, by default in this project."""
    return hash_of(closure(roots, places or project()))


def hash_of(files: Mapping[str, Path]) -> str:
    """Sha256 of the names and the code of modules; the same wherever their folders lie, and for every Python."""
    lines = (f"{name} {_code_hash(file.read_bytes())}\n" for name, file in sorted(files.items()))
    return hashlib.sha256("".join(lines).encode()).hexdigest()


@functools.lru_cache(maxsize=4096)
def _code_hash(source: bytes) -> str:
    return hashlib.sha256(code_of(source)).hexdigest()


def closure(roots: Iterable[str], places: Mapping[str, Path]) -> dict[str, Path]:
    """The file of every module that ``roots`` import, directly or not, and of the packages around them. ``places``: the
    folder of each package, or the file of each lone module, whose modules are followed; an import of anything else is
    left out.
    """
    found: dict[str, Path | None] = {"": None}
    todo = list(roots)
    while todo:
        name = todo.pop()
        if name not in found:
            found[name] = file = _file(name, places)
            todo += imported(name, file) if file is not None else ()
            todo.append(name.rpartition(".")[0])  # importing a module runs the packages around it
    return {name: file for name, file in found.items() if file is not None}


def imported(name: str, file: Path) -> Iterator[str]:
    """The dotted names that a module's import statements may mean: modules, and what may be a name in one."""
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    for level, module, names in _statements(file.read_bytes()):
        parents = package.split(".")
        stem = ".".join([*(parents[: len(parents) - level + 1] if level else ()), *([module] if module else ())])
        yield stem
        yield from (f"{stem}.{one}" for one in names)


@functools.lru_cache(maxsize=4096)
def _statements(source: bytes) -> tuple[tuple[int, str, tuple[str, ...]], ...]:
    """The import statements of a file: dots before the module, the module, the names taken from it."""
    found: list[tuple[int, str, tuple[str, ...]]] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom):
            found.append((node.level, node.module or "", tuple(alias.name for alias in node.names)))
        elif isinstance(node, ast.Import):
            found += [(0, alias.name, ()) for alias in node.names]
    return tuple(found)


def _file(name: str, places: Mapping[str, Path]) -> Path | None:
    """The file of a module; None where it is in none of the places, or is a name inside a module."""
    package = name
    rest: list[str] = []
    while package not in places:
        package, _, last = package.rpartition(".")
        if not last:
            return None
        rest.insert(0, last)
    place = places[package].joinpath(*rest)
    candidates = (place / "__init__.py", place.with_name(f"{place.name}.py") if rest else place)
    return next((file for file in candidates if file.is_file()), None)


def project(root: Path = ROOT) -> dict[str, Path]:
    return {f"{PROJECT}.{room}": root / room for room in ("harness", "methods", "experiments")}


def distribution(name: str, file: Path) -> dict[str, Path]:
    """The places of the packages and modules of the same distribution as a given module from elsewhere. These are its
    top-level package and the others that were installed with it. If it was not installed (a script, an editable
    install), they are those beside it.
    """
    top = name.partition(".")[0]
    up = name.count(".") + (file.name == "__init__.py")
    folder = file.parents[up]
    installed = folder in {Path(sysconfig.get_path(kind)).resolve() for kind in ("purelib", "platlib")}
    beside = {path.stem: path for path in folder.glob("*.py")}
    beside |= {path.parent.name: path.parent for path in folder.glob("*/__init__.py")}
    if installed:
        owners = importlib.metadata.packages_distributions()
        same = {one for one, names in owners.items() if set(names) & set(owners.get(top, ()))}
        beside = {one: place for one, place in beside.items() if one in same or one == top}
    places = {top: folder / top, **beside}
    if _file(name, places) != file:  # the names of its folders differ from those of its packages
        package, _, module = name.rpartition(".")
        places |= (
            {name: file.parent} if file.name == "__init__.py" else {package or module: file.parent if package else file}
        )
    return places


def code_of(source: bytes) -> bytes:
    """The code of a Python file, the same for every Python that can parse it; else the whole file."""
    try:
        return "".join(_written(ast.parse(source))).encode("utf-8", "surrogatepass")
    except UNREADABLE:
        return b"whole\0" + source


def _written(value: Any) -> Iterator[str]:
    """A part of a syntax tree as text. Fields that are empty are left out: later versions of Python have more of them."""
    if isinstance(value, ast.JoinedStr):  # Python 3.12 has empty parts in some
        value.values = [part for part in value.values if getattr(part, "value", None) != ""]
    if isinstance(value, ast.AST):
        yield f"{type(value).__name__}("
        for name, field in ast.iter_fields(value):
            if field is not None and field != []:
                yield f"{name}="
                yield from _written(field)
        yield ")"
    elif isinstance(value, list):
        yield "["
        for one in value:
            alone = one.value if isinstance(one, ast.Expr) else None
            if not (isinstance(alone, ast.Constant) and isinstance(alone.value, str)):  # not only a string
                yield from _written(one)
                yield ","
        yield "]"
    else:
        yield repr(value)
