"""Find methods by name: subpackages of ``shadowbench.methods``, and entry points of other packages.

A built-in method is a subpackage of ``shadowbench.methods`` that sets ``METHOD``; those that do not are libraries. The
harness itself names no method. Another package declares
``[project.entry-points."shadowbench.methods"]  name = "package:Class"``.
"""

from __future__ import annotations

import ast
import contextlib
import dataclasses
import functools
import importlib
import importlib.metadata
import inspect
import math
import re
import sys
import typing
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import UserError, did_you_mean, one_line

if TYPE_CHECKING:  # names are listed without importing Warp
    from .method import Method

GROUP = "shadowbench.methods"
PACKAGE = __name__.rsplit(".", 3)[0] + ".methods"
NAME = re.compile(r"[\w-]{1,100}")


def method_names() -> list[str]:
    """The names of all methods, built-in ones first."""
    built_in = built_in_names()
    return [*built_in, *sorted(set(_entry_points()).difference(built_in))]


def built_in_names() -> list[str]:
    return [*_built_in()]


@functools.cache
def _built_in() -> dict[str, str]:
    """The source of the package of each built-in method, by name: a method is imported when it is asked for."""
    folders = importlib.import_module(PACKAGE).__path__
    files = sorted(file for folder in folders for file in Path(folder).glob("*/__init__.py"))
    sources = ((file.parent.name, file.read_text(encoding="utf-8")) for file in files)
    return {name: text for name, text in sources if "\nMETHOD = " in text}


def about(name: str) -> str:
    """What a method is: the first sentence of the docstring of its package, or its title where there is none. Built-in
    methods are not imported for it. Raises :class:`UserError` for an unknown name.
    """
    if name in _built_in():
        return first_sentence(ast.get_docstring(ast.parse(_built_in()[name])) or name)
    cls = method_class(name)
    return first_sentence(inspect.getdoc(sys.modules[cls.__module__]) or cls.title)


def first_sentence(text: str) -> str:
    """The first sentence of a text, on one line."""
    paragraph = " ".join(text.split("\n\n")[0].split())
    return re.split(r"(?<=\.) (?=[A-Z])", paragraph)[0]


def _entry_points() -> dict[str, Any]:
    return _installed(tuple(sys.path))


@functools.cache
def _installed(path: tuple[str, ...]) -> dict[str, Any]:
    """The entry points of the packages that are found with this ``sys.path``; reading them takes milliseconds."""
    return {point.name: point for point in importlib.metadata.entry_points(group=GROUP)}


def method_class(name: str) -> type[Method]:
    """The class of a method. Raises :class:`UserError` for an unknown name."""
    if name in built_in_names():
        return importlib.import_module(f"{PACKAGE}.{name}").METHOD
    points = _entry_points()
    if name in points:
        if not NAME.fullmatch(name):  # files are called by it
            raise UserError(f"method {name!r}: a name has letters, digits, - and _ alone; correct its package")
        try:
            with contextlib.chdir("."):  # a package that goes elsewhere does not take this process with it
                return points[name].load()
        except (Exception, SystemExit) as error:  # a package may raise anything, or end the program
            kind, said = type(error).__name__, one_line(error)
            what = kind if said == kind else f"{kind}: {said}"
            raise UserError(
                f"method {name!r}: {points[name].value} cannot be imported ({what}); correct that package"
            ) from error
    present = current_name(name)
    if present != name:
        raise UserError(f"method {name!r} is now called {present}; use that name")
    raise UserError(f"no method {name!r}{did_you_mean(name, method_names())}")


def label_of(method: Mapping[str, Any]) -> str:
    """What tables call the method of a record with its settings: the present name of a former label, which is kept
    there. A title is a name of the method without settings only.
    """
    label: str = method.get("label") or method.get("title") or method["name"]
    if label == method.get("title") and method.get("settings"):
        return label
    return str(importlib.import_module(PACKAGE).FORMER_LABELS.get(label, label))


@functools.cache
def current_name(name: str) -> str:
    """The name of the method that declares ``name`` as a former one (``formerly``); ``name`` itself where none does.
    Records keep the name that a method had when they were measured; on reading they get the present one.
    """
    if name in built_in_names():
        return name
    for other in method_names():
        try:
            if name in getattr(method_class(other), "formerly", ()):
                return other
        except (UserError, ImportError, TypeError):  # it cannot run here, or declares no names
            continue
    return name


def present_settings(name: str, settings: dict[str, str]) -> dict[str, str]:
    """A record's settings as its method names them now (``present_settings``); as they are where it cannot say."""
    if not settings or name not in method_names():
        return settings
    try:
        return getattr(method_class(name), "present_settings", dict)(settings)
    except (UserError, ImportError, TypeError):
        return settings


@dataclass(frozen=True)
class Parameter:
    """A parameter of a method. ``meaning``: from the docstring of its dataclass; ``allowed``: the allowed values."""

    name: str
    default: Any
    kind: str
    meaning: str
    allowed: str


def parameters(cls: type[Method]) -> list[Parameter]:
    """The parameters of a method, build parameters first."""
    found = []
    for block in (cls.Build(), cls.Trace()):
        kinds, meanings = typing.get_type_hints(type(block)), _meanings(type(block))
        for name in (entry.name for entry in dataclasses.fields(block)):
            kind = kinds[name]
            called, meaning = getattr(kind, "__name__", str(kind)), meanings.get(name, "")
            found.append(Parameter(name, getattr(block, name), called, meaning, _allowed(block, name, kind)))
    return found


def _meanings(block: type) -> dict[str, str]:
    """The description of each field in a docstring: lines ``name  meaning``, continued by indented lines."""
    names = {entry.name for entry in dataclasses.fields(block)}
    found: dict[str, list[str]] = {}
    words: list[str] = []
    for line in (inspect.getdoc(block) or "").splitlines():
        first, _, rest = line.partition(" ")
        if first in names:
            words = found.setdefault(first, [rest.strip()])
        elif line.startswith(" "):
            words.append(line.strip())
        else:
            words = []
    return {name: " ".join(parts) for name, parts in found.items()}


def _allowed(block: Any, name: str, kind: type) -> str:
    """The allowed values of a parameter, from the error of its dataclass for an invalid value."""
    if kind is bool:
        return "must be true or false"
    for value in {int: (-(2**63),), float: (math.nan, -math.inf), str: ("", "?")}.get(kind, ()):
        try:
            dataclasses.replace(block, **{name: value})
        except ValueError as error:
            return str(error)[max(0, str(error).find("must ")) :]  # without the name of the parameter
        except Exception:  # a class may raise any error for such a value
            break
    return ""


def make_method(name: str, settings: dict[str, str] | None = None) -> Method:
    """A method with parameters given as text, as in ``--set method.param=value``."""
    cls = method_class(name)
    blocks = {"trace": cls.Trace(), "build": cls.Build()}
    place = {entry.name: part for part, block in blocks.items() for entry in dataclasses.fields(block)}
    given: dict[str, dict[str, str]] = {part: {} for part in blocks}
    for key, text in (settings or {}).items():
        if key not in place:
            raise UserError(f"{name} has no parameter {key!r}" + (did_you_mean(key, place) if place else ""))
        given[place[key]][key] = text
    build, trace = (_replaced(name, blocks[part], given[part]) for part in ("build", "trace"))
    with contextlib.chdir("."):
        return cls(build, trace)


def _replaced(method: str, block: Any, texts: dict[str, str]) -> Any:
    """The block with all parameters set at once: whether a value is valid may depend on the others."""
    kinds = typing.get_type_hints(type(block))
    values = {key: _value(method, key, kinds[key], text) for key, text in texts.items()}
    try:
        return dataclasses.replace(block, **values)
    except (ValueError, TypeError) as error:
        for key in texts:
            try:
                dataclasses.replace(block, **{key: values[key]})
            except (ValueError, TypeError) as own:
                if str(own) == str(error):
                    raise UserError(f"{method}.{key}={texts[key]!r}: {own}") from own
        said = ", ".join(f"{method}.{key}={text!r}" for key, text in texts.items())
        raise UserError(f"{said}: {error}") from error


def _value(method: str, key: str, kind: Any, text: str) -> Any:
    try:
        if kind is bool:
            return {"true": True, "1": True, "false": False, "0": False}[str(text).lower()]
        return kind(text)
    except (KeyError, ValueError, TypeError) as error:
        wanted = WANTED.get(kind, f"a valid {getattr(kind, '__name__', kind)}")
        raise UserError(f"{method}.{key}={text!r}: not {wanted}") from error


WANTED = {int: "a whole number", float: "a number", bool: "true or false"}
"""What a text must be for a parameter of a type."""
