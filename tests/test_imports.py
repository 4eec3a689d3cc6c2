"""The order of the packages: each imports only those before it, nothing imports in a circle, no harness names a method. And
that a test of each file of kernels is found by its name.
"""

import ast
import functools
import re
from collections.abc import Mapping
from pathlib import PurePosixPath

import pytest
from helpers.import_graph import ROOT, circles, imports, modules
from shadowbench.harness.frame.registry import built_in_names

ORDER = (
    "harness.arrays", "harness.texts", "harness.errors", "harness.files", "harness.typed_json", "harness.scene",
    "harness.frame", "harness.judge", "harness.results", "harness.report", "harness.runner", "harness.hardcases",
    "harness.commands", "harness.api", "harness.cli", "harness.shadowbench", "methods", "experiments",
)  # fmt: skip
"""Each imports only from those before it. Methods may import only the harness's scene and frame."""

FOR_METHODS = ("harness.arrays", "harness.errors", "harness.files", "harness.scene", "harness.frame", "methods")
NAMES = built_in_names()


def place(module: str) -> int:
    """Where a module's package stands in :data:`ORDER`; the packages' own faces, such as ``harness``, stand first."""
    found = [i for i, name in enumerate(ORDER) if module == name or module.startswith(name + ".")]
    return found[0] if found else -1


def against_the_order(graph: dict[str, set[str]]) -> list[str]:
    return sorted(
        f"{module} -> {other}" for module, others in graph.items() for other in others if place(other) > place(module)
    )


def test_every_module_has_a_place():
    assert [module for module in modules() if place(module) < 0] == ["harness"]


def test_every_import_leads_to_a_module():
    graph = imports()
    missing = [f"{module} -> {other}" for module, others in graph.items() for other in others - graph.keys()]
    assert missing == []


def test_packages_import_only_those_before_them():
    assert against_the_order(imports()) == []


def test_nothing_imports_in_a_circle():
    assert circles(imports()) == []


def test_methods_import_only_what_describes_a_frame():
    graph = imports()
    outside = [
        f"{module} -> {other}"
        for module, others in graph.items()
        if module.startswith("methods")
        for other in others
        if not other.startswith(FOR_METHODS)
    ]
    assert outside == []


def methods_in_methods(graph: dict[str, set[str]]) -> list[str]:
    """Imports of a method by another one, or by what methods share. ``hybrid`` consists of others."""
    return sorted(
        f"{module} -> {other}"
        for module, others in graph.items()
        if module.startswith("methods.")
        for user in [module.split(".")[1]]
        for other in others
        for used in other.split(".")[1:2]
        if used in NAMES and used != user and user != "hybrid" and other.startswith("methods.")
    )


def test_no_method_imports_another():
    assert methods_in_methods(imports()) == []
    found = methods_in_methods(
        {
            "methods.kdtree.nodes": {"methods.kdtree.clip", "methods.bvh2"},
            "methods.streams.queues": {"methods.ray_grids", "methods.gpu.warps"},
            "methods.hybrid.choice": {"methods.bvh2"},
        }
    )
    assert found == ["methods.kdtree.nodes -> methods.bvh2", "methods.streams.queues -> methods.ray_grids"]


def test_a_folder_of_methods_holds_at_most_twelve_files():
    folders = [folder for folder in (ROOT / "methods").rglob("*") if folder.is_dir()]
    held = {str(folder.relative_to(ROOT)): len(list(folder.glob("*.py"))) for folder in folders}
    assert {name: number for name, number in held.items() if number > 12} == {}
    assert held["methods/common"] > 2


def test_the_harness_names_no_method():
    named = []
    for module, file in modules().items():
        if not module.startswith("harness"):
            continue
        tree = ast.parse(file.read_text(encoding="utf-8"))
        words = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
        words |= {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
        named += [f"{module}: {name}" for name in NAMES if name in words and name not in NEUTRAL]
    assert named == []


NEUTRAL = {"embree", "driver"}
"""Embree is a method and the library that the reference is made with; a GPU's driver is one, and a fact of a machine."""


@pytest.mark.parametrize(
    ("file", "line", "found"),
    [
        ("harness/scene/scene.py", "from ..judge import score\n", "harness.scene.scene -> harness.judge.score"),
        ("harness/judge/score.py", "from ..cli import app\n", "harness.judge.score -> harness.cli"),
    ],
)
def test_an_import_against_the_order_is_found(tmp_path, file, line, found):
    for path, text in (("harness/judge/score.py", ""), (file, line)):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    assert against_the_order(imports(tmp_path)) == [found]


def test_a_circle_is_found():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == [["a", "b", "c"]]


def words_of(path: PurePosixPath) -> str:
    return "_" + re.sub(r"\W", "_", str(path)) + "_"


def without_a_test(kernels: list[PurePosixPath], tests: Mapping[PurePosixPath, str]) -> list[PurePosixPath]:
    """Files of kernels that no test is found by. ``tests``: the first paragraph of each, by its path.

    A test's path holds the file's package and stem, and its folder where others of the package have that stem; or its first
    paragraph names the file. Of an ``__init__`` the package's own name stands for the stem.
    """
    units = {file: file.parent if file.stem == "__init__" else file.with_suffix("") for file in kernels}
    named = {mention for paragraph in tests.values() for mention in re.findall(r"[\w/]+\.py", paragraph)}
    lacking = []
    for file, unit in units.items():
        package = unit.parts[:2]
        alike = [other for other in units.values() if other.parts[:2] == package and other.name == unit.name]
        asked = [package[1], unit.name] + [unit.parent.name] * (len(alike) > 1)
        found = any(all(f"_{word}_" in words_of(test) for word in asked) for test in tests)
        if not found and not any(file.match(mention) for mention in named):
            lacking.append(file)
    return lacking


@functools.cache
def first_paragraphs() -> dict[PurePosixPath, str]:
    files = (ROOT / "tests").rglob("test_*.py")
    docstrings = {file: ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "" for file in files}
    return {PurePosixPath(file.relative_to(ROOT)): text.partition("\n\n")[0] for file, text in docstrings.items()}


def test_a_test_of_each_file_of_kernels_is_found_by_name():
    kernels = [
        PurePosixPath(file.relative_to(ROOT))
        for module, file in modules().items()
        if not module.startswith("experiments") and re.search(r"@wp\.(kernel|func)", file.read_text(encoding="utf-8"))
    ]
    assert len(kernels) > 100
    assert without_a_test(kernels, first_paragraphs()) == []


def test_a_file_that_a_test_names_is_one_file():
    """With its folder, where another file has the same name."""
    files = [
        PurePosixPath(file.relative_to(ROOT))
        for top in ("harness", "methods", "tests")
        for file in (ROOT / top).rglob("*.py")
    ]
    unclear = {
        f"{test}: {mention}": found
        for test, paragraph in first_paragraphs().items()
        for mention in re.findall(r"[\w/]+\.py", paragraph)
        for found in [[str(file) for file in files if file.match(mention)]]
        if len(found) != 1
    }
    assert unclear == {}


@pytest.mark.parametrize(
    ("test", "paragraph", "found"),
    [
        ("tests/methods/grids/test_far_walk.py", "", ["kdtree/walk", "grids/near/walk"]),
        ("tests/methods/test_kdtree_walk.py", "", ["grids/near/walk", "grids/far/walk"]),
        ("tests/methods/test_kdtree_walks.py", "", ["kdtree/walk", "grids/near/walk", "grids/far/walk"]),
        ("tests/test_steps.py", "Steps (``far/walk.py``).", ["kdtree/walk", "grids/near/walk"]),
        (
            "tests/methods/grids/test_grids_walk.py",
            "In r/walk.py.",
            ["kdtree/walk", "grids/near/walk", "grids/far/walk"],
        ),
    ],
)
def test_a_file_of_kernels_without_a_test_is_found(test, paragraph, found):
    kernels = [PurePosixPath(f"methods/{name}.py") for name in ("kdtree/walk", "grids/near/walk", "grids/far/walk")]
    lacking = without_a_test(kernels, {PurePosixPath(test): paragraph})
    assert [str(file.relative_to("methods").with_suffix("")) for file in lacking] == found
