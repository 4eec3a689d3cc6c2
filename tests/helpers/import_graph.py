"""The imports of the project, read from its source: which module imports which, without running any of it."""

import ast
import functools
from collections.abc import Iterator
from pathlib import Path

import networkx

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("harness", "methods", "experiments")


def modules(root: Path = ROOT) -> dict[str, Path]:
    """The file of every module, by its dotted name from the project's root, such as ``harness.frame.session``."""
    found = {}
    for package in PACKAGES:
        for file in sorted((root / package).rglob("*.py")):
            parts = file.relative_to(root).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


def imports(root: Path = ROOT) -> dict[str, set[str]]:
    """For each module the modules of the project that it imports, also inside functions, whether or not they exist."""
    files = modules(root)
    return {name: set(_imported(name, file, files)) - {name} for name, file in files.items()}


def _imported(name: str, file: Path, files: dict[str, Path]) -> Iterator[str]:
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    for level, module, names in _statements(file.read_text(encoding="utf-8")):
        parents = package.split(".")
        base = parents[: len(parents) - level + 1] if level else []
        base += module.split(".") if module else []
        if base[:1] == ["shadowbench"]:
            base = base[1:]
        elif not level:
            continue
        for imported in names:
            inner = ".".join([*base, imported])
            yield inner if inner in files else ".".join(base)


@functools.cache
def _statements(text: str) -> tuple[tuple[int, str | None, tuple[str, ...]], ...]:
    """Level, module and names of every ``from ... import`` in a source text: a text is parsed once for all tests."""
    return tuple(
        (node.level, node.module, tuple(alias.name for alias in node.names))
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.ImportFrom)
    )


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """The groups of modules that import each other in a circle."""
    made = networkx.DiGraph([(name, other) for name, others in graph.items() for other in others])
    return sorted(sorted(one) for one in networkx.strongly_connected_components(made) if len(one) > 1)
