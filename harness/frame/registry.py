"""Finding methods by name: folders of the methods package, and entry points of other packages.

The harness never names a method; a built-in one is a subpackage of ``shadowbench.methods`` that has a ``METHOD``.
A package of someone else's declares ``[project.entry-points."shadowbench.methods"]  name = "package:Class"``.
"""

from __future__ import annotations

import dataclasses
import importlib
import importlib.metadata
import pkgutil
import typing
from typing import Any

from ..errors import UserError, did_you_mean
from .method import Method

GROUP = "shadowbench.methods"
PACKAGE = __name__.rsplit(".", 3)[0] + ".methods"


def method_names() -> list[str]:
    """Every method that can be asked for, built in first."""
    return [*_built_in(), *(name for name in sorted(_entry_points()) if name not in _built_in())]


def _built_in() -> list[str]:
    package = importlib.import_module(PACKAGE)
    return sorted(m.name for m in pkgutil.iter_modules(package.__path__) if m.ispkg and m.name != "common")


def _entry_points() -> dict[str, Any]:
    return {point.name: point for point in importlib.metadata.entry_points(group=GROUP)}


def method_class(name: str) -> type[Method]:
    """The class of a method. Raises :class:`UserError` for an unknown name."""
    if name in _built_in():
        return importlib.import_module(f"{PACKAGE}.{name}").METHOD
    points = _entry_points()
    if name in points:
        try:
            return points[name].load()
        except (ImportError, AttributeError) as error:
            place = points[name].value
            raise UserError(
                f"method {name!r}: {place} cannot be imported ({error}); mend that package"
            ) from error
    raise UserError(f"no method {name!r}{did_you_mean(name, method_names())}")


def make_method(name: str, settings: dict[str, str] | None = None) -> Method:
    """A method with some of its parameters set from text, as ``--set method.param=value`` gives them."""
    cls = method_class(name)
    build, trace = cls.Build(), cls.Trace()
    for key, text in (settings or {}).items():
        for part in ("build", "trace"):
            block = build if part == "build" else trace
            if key in {f.name for f in dataclasses.fields(block)}:
                changed = _replaced(name, block, key, text)
                build, trace = (changed, trace) if part == "build" else (build, changed)
                break
        else:
            known = [f.name for p in (build, trace) for f in dataclasses.fields(p)]
            raise UserError(f"{name} has no parameter {key!r}" + (did_you_mean(key, known) if known else ""))
    return cls(build, trace)


def _replaced(method: str, block: Any, key: str, text: str) -> Any:
    kind = typing.get_type_hints(type(block))[key]
    try:
        if kind is bool:
            value: Any = {"true": True, "1": True, "false": False, "0": False}[str(text).lower()]
        else:
            value = kind(text)
        return dataclasses.replace(block, **{key: value})
    except (KeyError, ValueError, TypeError) as error:
        detail = f": {error}" if isinstance(error, ValueError) and str(error) else ""
        raise UserError(
            f"{method}.{key}={text!r}: not a valid {getattr(kind, '__name__', kind)}{detail}"
        ) from error
