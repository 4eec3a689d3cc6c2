"""What is installed: every import is declared, every package has its hashes, a source distribution is whole."""

import ast
import importlib.metadata
import itertools
import json
import re
import shutil
import subprocess
import sys
import tarfile
import time
import tomllib

import pytest
from helpers.import_graph import ROOT, modules

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
TOOLS = ("test", "lint", "docs")
LISTS = {"requirements.txt": PROJECT["dependencies"]} | {
    f".ci/requirements-{extra}.txt": EXTRAS[extra] for extra in TOOLS
}


def plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def name_of(requirement: str) -> str:
    return plain(re.match(r"[\w.-]+", requirement)[0])


def pinned(path: str) -> dict[str, str]:
    """The packages of a list, and the lines of each."""
    text = (ROOT / path).read_text(encoding="utf-8").replace(" \\\n   ", "")
    return {name_of(line): line for line in text.splitlines() if line and line[0] != "#"}


def test_the_files_of_the_smoke_test_exist():
    smoke = re.search(r'^SMOKE="(.*?)"', (ROOT / ".ci" / "run").read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    files = smoke[1].split()
    assert len(files) > 5
    assert [file for file in files if not (ROOT / file).is_file()] == []


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="no checkout")
def test_no_link_is_tracked():
    """It would lead to a place of one machine."""
    kept = subprocess.run(["git", "ls-files", "-s"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    assert [line for line in kept.splitlines() if line.startswith("120000")] == []


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_each_commit_has_another_turn_of_the_tests_also_in_a_clone_of_the_last_alone(tmp_path):
    """A server that builds clones the last commit alone, and so would have the same part of the tests for ever."""
    whole, last = tmp_path / "whole", tmp_path / "last"
    git = ["git", "-c", "user.name=name", "-c", "user.email=name@host", "-C", whole]
    subprocess.run(["git", "init", "-q", whole], check=True)
    for _ in range(3):
        subprocess.run([*git, "commit", "-q", "--allow-empty", "-m", "one"], check=True)
    subprocess.run(["git", "clone", "-q", "--depth", "1", whole.as_uri(), last], check=True)

    def turn(folder):
        return int(subprocess.run([ROOT / ".ci" / "turn"], cwd=folder, check=True, capture_output=True).stdout)

    assert turn(whole) == 3
    before = time.localtime().tm_yday
    assert turn(last) in (before, time.localtime().tm_yday)


def test_a_release_has_one_number():
    import shadowbench

    cited, kept, told = (
        (ROOT / name).read_text(encoding="utf-8") for name in ("CITATION.cff", ".zenodo.json", "CHANGELOG.md")
    )
    version, released = re.search(r"^version: (\S+)\ndate-released: (\S+)$", cited, re.MULTILINE).groups()
    newest = re.search(r"^## (\d\S+) \((\S+)\)$", told, re.MULTILINE).groups()
    assert {version, json.loads(kept)["version"]} == {shadowbench.__version__}
    assert newest == (version, released)


def test_every_import_is_of_a_declared_package():
    """What is only there because another package needs it may go with the next version of that one."""
    declared = {
        name_of(one)
        for one in [*PROJECT["dependencies"], *itertools.chain(*(EXTRAS[name] for name in EXTRAS if name not in TOOLS))]
    }
    # What tests do without, under its distribution's name.
    owners = {"pynvml": ["nvidia-ml-py"]} | dict(importlib.metadata.packages_distributions())
    undeclared = []
    for module, file in modules().items():
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module]
            for top in {name.partition(".")[0] for name in names} - {*sys.stdlib_module_names, "shadowbench"}:
                if not declared & {plain(owner) for owner in owners.get(top, [top])}:
                    undeclared.append(f"{module}: {top}")
    assert undeclared == []


@pytest.mark.parametrize("path", LISTS)
def test_every_package_of_a_list_has_its_hashes_and_its_pinned_version(path):
    """If this fails after a change of pyproject.toml or constraints.txt: make lock."""
    found = pinned(path)
    for line in found.values():
        assert re.match(r"[\w.-]+==[\w.]+ (; .*)?--hash=sha256:[0-9a-f]{64}( |$)", line), line[:80]
    pins = dict(line.split("==") for line in (ROOT / "constraints.txt").read_text().splitlines() if "==" in line)
    for name, version in pins.items():
        if plain(name) in found:
            assert re.search(r"==([\w.]+)", found[plain(name)])[1] == version, name
    everything = set(found) | set(pinned("requirements.txt"))
    wanted = {name_of(one) for one in LISTS[path]} - {PROJECT["name"]}
    assert wanted <= everything
    assert "://" not in (ROOT / path).read_text(encoding="utf-8")


def test_lower_bounds_are_those_declared():
    said = subprocess.run([sys.executable, ROOT / ".ci" / "lower_bounds.py"], capture_output=True, text=True)
    assert said.stdout.split() == [one.replace(">=", "==") for one in PROJECT["dependencies"]]


def test_a_source_distribution_holds_what_the_readme_calls_for(tmp_path):
    pytest.importorskip("setuptools", "77")
    build = "import sys; from setuptools import build_meta; print(build_meta.build_sdist(sys.argv[1]))"
    copy = tmp_path / "source"
    tracked = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True)
    if tracked.returncode:
        pytest.skip("not a checkout of git")
    for name in filter(None, tracked.stdout.split("\0")):
        if (ROOT / name).is_file():  # not one that is being removed
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            (copy / name).hardlink_to(ROOT / name)
    made = subprocess.run([sys.executable, "-c", build, tmp_path], cwd=copy, capture_output=True, text=True)
    assert made.returncode == 0, made.stderr
    (archive,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as tape:
        held = {name.partition("/")[2] for name in tape.getnames()}
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    linked = {link for link in re.findall(r"\]\(([^)#:]+)\)", readme)}
    needed = {"Makefile", "requirements.txt", "constraints.txt", ".ci/run", ".ci/turn", *LISTS, *linked}
    assert {one for one in needed if one not in held} == set()
    ours = {
        name
        for name in tracked.stdout.split("\0")
        if name.startswith(("harness/", "methods/", "experiments/", "tests/"))
    }
    assert ours - held == set()
