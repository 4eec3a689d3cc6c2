"""A package made by ``new-method``: clean, found by its entry point, passing its own test and ``check``."""

import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest
from shadowbench.harness.commands.check import check
from shadowbench.harness.commands.new_method import contents, create, new_method
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame import registry

GUIDE = Path(__file__).parents[2] / "docs" / "adding-a-method.md"


@pytest.fixture
def package(tmp_path, monkeypatch):
    """The package as an installed one: importable, with its entry point."""
    folder = create("scanned_rows", tmp_path / "scanned_rows")
    about = folder / "scanned_rows-0.1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: scanned-rows\nVersion: 0.1.0\n")
    points = re.search(r"\[project\.entry-points\.\"(.*)\"\]\n(.*)\n", (folder / "pyproject.toml").read_text())
    value = points[2].replace('"', "")
    (about / "entry_points.txt").write_text(f"[{points[1]}]\n{value}\n")
    monkeypatch.syspath_prepend(str(folder))
    yield folder
    sys.modules.pop("scanned_rows", None)


def test_the_package_passes_check_and_its_own_test(package, capsys):
    assert "scanned_rows" in registry.method_names()
    assert check("scanned_rows", "cpu", case=["P12", "P02", "S01", "M04"]) == 0
    assert "0 with true errors" in capsys.readouterr().out
    (name,) = [path.stem for path in (package / "tests").glob("test_*.py")]
    sys.path.insert(0, str(package / "tests"))
    try:
        own = importlib.import_module(name)
        for case in own.CASES:
            own.test_no_answer_is_wrong(case)
    finally:
        sys.path.remove(str(package / "tests"))
        sys.modules.pop(name, None)


def test_the_package_is_clean(package):
    if importlib.util.find_spec("ruff") is None and not Path(sys.executable).with_name("ruff").exists():
        pytest.skip("ruff is not installed (pip install -e .[lint])")
    ruff = str(Path(sys.executable).with_name("ruff"))
    for words in (["check"], ["format", "--check"]):
        done = subprocess.run([ruff, *words, "--no-cache", "."], cwd=package, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    assert [path for path in package.rglob("*") if path.is_file() and "@" in path.name] == []
    assert re.search(r"@[A-Z]+@", "".join(contents("scanned_rows").values())) is None


def test_the_guide_shows_the_template():
    (code,) = re.findall(r"```python\n(.*?)```", GUIDE.read_text(), re.DOTALL)
    made = contents("every_triangle")["every_triangle/__init__.py"]
    assert made.split("\n\n", 1)[1] == code


@pytest.mark.parametrize("name", ["Grid", "2d", "a-b", "class", "../x", "", "a" * 65, "embree", "json", "numpy"])
def test_names_that_cannot_be_are_refused(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError):
        new_method(name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("name", "said"), [
    ("class", "this is a keyword of Python"), ("Class", "of lower-case letters"), ("7up", "a letter first"),
    ("a" * 65, "at most 64 long"),
])  # fmt: skip
def test_a_name_that_cannot_be_one_says_why(name, said, tmp_path):
    with pytest.raises(UserError, match=said):
        new_method(name, tmp_path / "mine")


def test_nothing_is_overwritten(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    for taken in ("mine", "link"):
        with pytest.raises(UserError, match="nothing is overwritten"):
            new_method("scanned_rows", tmp_path / taken)
    with pytest.raises(UserError, match="cannot write"):
        new_method("scanned_rows", Path("/proc/scanned_rows"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link", "mine"]
