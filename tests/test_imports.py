"""The order of the packages: each imports only those before it, nothing imports in a circle, no harness names a method."""

import ast

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
