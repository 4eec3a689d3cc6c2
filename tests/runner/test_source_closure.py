"""Keys of records: an edit makes those records stale whose measurement imports the edited module, and no others."""

import contextlib
import importlib
import shutil
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import networkx
import pytest
from helpers.import_graph import PACKAGES, ROOT, imports, modules
from shadowbench.harness.frame import registry
from shadowbench.harness.runner.planning import survey
from shadowbench.harness.runner.source.closure import (
    MEASURING,
    PROJECT,
    closure_hash,
    hash_of,
    source_files,
    source_hash,
)

METHODS = registry.built_in_names()


@pytest.fixture(scope="module")
def copied(tmp_path_factory) -> Path:
    """A copy of the project. Who edits it puts back what was there."""
    folder = tmp_path_factory.mktemp("copied")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def reached(graph: dict[str, set[str]], roots: list[str]) -> set[str]:
    """Modules that ``roots`` import, directly or not; importing one runs the packages around it."""
    around = {name: {name.rpartition(".")[0]} if "." in name else set() for name in graph}
    runs = networkx.DiGraph({name: others | around[name] for name, others in graph.items()})
    return {*roots}.union(*(networkx.descendants(runs, root) for root in roots))


@contextlib.contextmanager
def edited(*files: Path, text: bytes = b"\nan_edit = 1\n") -> Iterator[None]:
    """Inside, the files have a line more."""
    before = {file: file.read_bytes() for file in files}
    for file, content in before.items():
        file.write_bytes(content + text)
    yield
    for file, content in before.items():
        file.write_bytes(content)


def that_count(folder: Path, paths: Iterable[str], cls: type) -> set[str]:
    """The files whose edit changes the hash of a method."""
    before, found = source_hash(cls), set()
    for path in paths:
        with edited(folder / path):
            found |= {path} if source_hash(cls) != before else set()
    assert source_hash(cls) == before
    return found


@pytest.fixture(scope="module")
def stale() -> dict[str, set[str]]:
    """For every module of the project the methods whose hash is made of it."""
    files = {name: set(source_files(registry.method_class(name)).values()) for name in METHODS}
    return {module: {name for name in METHODS if file in files[name]} for module, file in modules().items()}


def test_a_hash_changes_with_each_of_its_files_and_with_no_other(copied) -> None:
    """On a copied tree, whose folder has no part in it: each file of a method edited by itself, and all other files of the
    project at once.
    """
    cls = registry.method_class("uniform_grid")
    files = source_files(cls, copied)
    before = source_hash(cls)
    assert hash_of(files) == before
    for file in files.values():
        with edited(file):
            assert hash_of(files) != before, file
    with edited(*files.values(), text=b'\n# a comment\n"""and a docstring"""\n'):
        assert hash_of(files) == before
    with edited(*set(modules(copied).values()) - set(files.values())):
        assert source_hash(cls, copied) == before


def test_an_edit_makes_those_methods_stale_that_import_it(stale) -> None:
    graph = imports()
    measuring = [root.removeprefix(f"{PROJECT}.") for root in MEASURING]
    classes = {name: registry.method_class(name) for name in METHODS}
    roots = {
        name: [base.__module__.removeprefix(f"{PROJECT}.") for base in cls.__mro__ if PROJECT in base.__module__]
        for name, cls in classes.items()
    }
    holds = {name: reached(graph, [*roots[name], *measuring]) for name in METHODS}
    assert stale == {module: {name for name in METHODS if module in holds[name]} for module in modules()}


MEASURES = (
    "harness.frame.alpha harness.frame.effects.mirrors harness.frame.effects.shading harness.frame.effects.receivers "
    "harness.frame.frame harness.frame.session harness.frame.schedule.passes harness.frame.schedule.needed "
    "harness.frame.effects.specialise harness.frame.vectors harness.scene.prepared harness.scene.moment "
    "harness.runner.measuring.measured_point harness.runner.measuring.timing harness.runner.measuring.memory "
    "methods.exact.hit_point"
).split()
SHARED = {
    "methods.warp_bvh": {"warp_bvh"},
    "methods.common.box_tree": {"warp_bvh", "accuracy_ladder"},
    "methods.streams.camera.pixels": {"ray_grids", "shadow_map"},
    "methods.grids.cells": {"uniform_grid", "coherent_grid"},
    "methods.grids.walk": {"uniform_grid", "two_level_grid"},
}
APART = (
    "harness.judge harness.report harness.commands harness.hardcases harness.cli harness.results harness.scene.readers "
    "harness.scene.standins harness.scene.catalogue harness.frame.registry harness.runner.run "
    "harness.runner.workers.executor experiments"
).split()


def test_what_every_measurement_runs_makes_all_methods_stale_and_what_none_runs_makes_none(stale) -> None:
    assert {module for module in MEASURES if stale[module] != set(METHODS)} == set()
    for module, methods in SHARED.items():
        assert methods <= stale[module] < set(METHODS), module
    for package in APART:
        within = [module for module in stale if f"{module}.".startswith(f"{package}.")]
        assert within
        assert {module for module in within if stale[module]} == set()


# --- methods of other distributions ---------------------------------------------------------------------------

METHOD = "from shadowbench.harness.frame.method import SimpleMethod\n"
PACKAGE = {
    "theirs/__init__.py": "from .method import Theirs\n",
    "theirs/method.py": "import numpy\nfrom .base import Base\n\nclass Theirs(Base):\n    def late(self):\n"
    "        from . import kernels\n",
    "theirs/base.py": METHOD + "import theirs.numbers\n\nclass Base(SimpleMethod): ...\n",
    "theirs/numbers.py": "",
    "theirs/kernels.py": "import beside\n",
    "theirs/unused.py": "",
    "beside.py": "",
    "unrelated.py": "",
}
LONE = {"lone.py": METHOD + "import part\n\nclass Theirs(SimpleMethod): ...\n", "part.py": "", "other.py": ""}
SPACE = {
    "space/deep/__init__.py": METHOD + "from space import near\n\nclass Theirs(SimpleMethod): ...\n",
    "space/near.py": "",
}


def installed(folder: Path, files: dict[str, str], monkeypatch, name: str) -> type:
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    monkeypatch.syspath_prepend(str(folder))
    for path in (path for path in files if path.endswith(".py")):
        parts = Path(path).with_suffix("").parts
        monkeypatch.delitem(sys.modules, ".".join(p for p in parts if p != "__init__"), raising=False)
        monkeypatch.delitem(sys.modules, parts[0], raising=False)
    return importlib.import_module(name).Theirs


@pytest.mark.parametrize(
    ("files", "name", "depends"),
    [
        (PACKAGE, "theirs", {"theirs/__init__.py", "theirs/method.py", "theirs/base.py", "theirs/numbers.py",
                             "theirs/kernels.py", "beside.py"}),
        (LONE, "lone", {"lone.py", "part.py"}),
        (SPACE, "space.deep", {"space/deep/__init__.py", "space/near.py"}),
    ],
)  # fmt: skip
def test_a_method_of_another_package(tmp_path, monkeypatch, files, name, depends) -> None:
    assert that_count(tmp_path, files, installed(tmp_path, files, monkeypatch, name)) == depends


def test_a_method_of_another_package_that_measures_as_ours_do(copied, tmp_path, monkeypatch) -> None:
    cls = installed(tmp_path / "theirs", LONE, monkeypatch, "lone")
    before = source_hash(cls, copied)
    with edited(copied / "harness/frame/session.py"):
        assert source_hash(cls, copied) != before


def test_a_base_class_from_another_distribution_counts(tmp_path, monkeypatch) -> None:
    """Also one that was found without an import statement."""
    base = installed(
        tmp_path / "a", {"their_base.py": METHOD + "class Theirs(SimpleMethod): ...\n"}, monkeypatch, "their_base"
    )
    text = "import importlib\nclass Theirs(importlib.import_module('their_' + 'base').Theirs): ...\n"
    cls = installed(tmp_path / "b", {"their_method.py": text}, monkeypatch, "their_method")
    assert base in cls.__mro__
    assert that_count(tmp_path, ["a/their_base.py"], cls)


SOURCED = {
    "sourced/__init__.py": "from .method import Theirs\n",
    "sourced/method.py": "from .base.base import Base\n\nclass Theirs(Base):\n    sources = ('*.cu', 'data/weights.bin')\n",
    "sourced/base/__init__.py": "",
    "sourced/base/base.py": METHOD + "class Base(SimpleMethod):\n    sources = ('base.cu',)\n",
    "sourced/base/base.cu": "// a comment counts, too: nothing is known of this language\n",
    "sourced/base/other.cu": "",
    "sourced/trace.cu": "",
    "sourced/sort.cu": "",
    "sourced/data/weights.bin": "",
    "sourced/data/unused.bin": "",
}


def test_further_sources_count_where_a_method_names_them(tmp_path, monkeypatch) -> None:
    cls = installed(tmp_path, SOURCED, monkeypatch, "sourced")
    assert that_count(tmp_path, SOURCED, cls) == set(SOURCED) - {"sourced/base/other.cu", "sourced/data/unused.bin"}
    before = source_hash(cls)
    (tmp_path / "sourced/new.cu").write_text("")
    assert source_hash(cls) != before
    (tmp_path / "sourced/new.cu").unlink()
    assert source_hash(cls) == before
    (tmp_path / "sourced/data/weights.bin").unlink()
    with pytest.raises(FileNotFoundError, match=r"Theirs.sources: no file 'data/weights.bin' beside sourced.method"):
        source_hash(cls)


# --- scenes ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scene", "module", "made_again"),
    [
        ("cloth", "harness.scene.standins.shapes", True),
        ("cloth", "harness.scene.standins.fairy", False),
        ("cloth", "harness.scene.prepared", True),
        ("cloth", "harness.runner.measuring.timing", False),
        ("declared.toml", "harness.scene.standins.fairy", True),
        ("declared.toml", "harness.scene.declaration", True),
    ],
)
def test_the_facts_of_a_scene_follow_from_its_maker(copied, tmp_path, monkeypatch, scene, module, made_again) -> None:
    (tmp_path / "declared.toml").write_text('mesh = "fairy"\n')
    places = {f"{PROJECT}.{package}": copied / package for package in PACKAGES}
    monkeypatch.setattr(survey, "closure_hash", lambda roots: closure_hash(roots, places))
    name = str(tmp_path / scene) if scene.endswith("toml") else scene
    load = {"scene": name, "scene_dir": None, "frames": 1, "width": 8, "height": 8, "lighting": {}}
    before = survey._scene_id(load)
    with edited(modules(copied)[module]):
        assert (survey._scene_id(load) != before) == made_again
