"""The results that are kept: drawing them again changes nothing, and they name no machine of anybody's.

Numbers and texts are compared. Pictures are not: their bytes depend on the versions of matplotlib and of its fonts. They are
put together, and not painted, which takes a third of the time.
"""

import json
import lzma
import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest
from shadowbench.harness.commands.show import show
from shadowbench.harness.results.schema import ARCHIVE
from shadowbench.harness.runner.machine import environment as environment

RESULTS = Path(__file__).resolve().parents[2] / "results"
FOLDERS = sorted(path.parent for path in RESULTS.glob("*/*/records") if path.relative_to(RESULTS).parts[0] != "local")
"""Folders of committed results. ``local`` holds a user's own runs."""

TEXTS = (".csv", ".md")


def copied(folder: Path, place: Path) -> Path:
    """A copy of a folder of results, written to without harm."""
    return Path(shutil.copytree(folder, place / folder.name))


def texts(folder: Path) -> dict[str, str]:
    """What stands in a folder's own tables and reports, by name."""
    return {path.name: path.read_text(encoding="utf-8") for path in sorted(folder.iterdir()) if path.suffix in TEXTS}


def experiment_of(folder: Path) -> str:
    """What its first record says, without checking the others: drawing them does."""
    packed = folder / "records" / ARCHIVE
    if not packed.is_file():  # the records of a run, one file each
        return json.loads(next((folder / "records").glob("*.json")).read_text(encoding="utf-8"))["experiment"]
    with lzma.open(packed, "rt", encoding="utf-8") as file:
        return json.loads(file.readline())["experiment"]


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: path.name)
@pytest.mark.usefixtures("unpainted")
@pytest.mark.slow
def test_drawing_kept_records_again_changes_no_table(folder, tmp_path):
    again = copied(folder, tmp_path)
    before = texts(again)
    files = show(experiment_of(folder), again, quiet=True)
    assert texts(again) == before
    # Every drawing is kept too: a new one must be added, one that is drawn no more be removed.
    kept = {path.name for path in folder.iterdir() if path.is_file()}
    assert {file.name for file in files} <= kept


def test_folders_of_results_beside_the_machines_are_named():
    text = (RESULTS / "README.md").read_text(encoding="utf-8")
    places = [path.parent.relative_to(RESULTS / "versions") for path in (RESULTS / "versions").rglob("records")]
    assert [place for place in places if f"`{place.as_posix()}/`" not in text] == []
    assert places


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: path.name)
def test_reports_show_only_pictures_that_are_there(folder):
    for name, text in texts(folder).items():
        for shown in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text):
            assert (folder / shown).is_file(), f"{name} shows {shown}"


@pytest.mark.parametrize(
    "path",
    sorted(path for folder in FOLDERS for path in folder.glob("environments/*.json")),
    ids=lambda path: path.stem,
)
def test_environments_name_no_card_and_no_image(path):
    facts = json.loads(path.read_text(encoding="utf-8"))
    assert "uuid" not in path.read_text(encoding="utf-8")
    assert re.fullmatch(r"[A-Za-z]+-[\d.]+-\w+", facts["os"]), facts["os"]


def test_a_card_is_paired_by_its_number_and_the_number_is_not_kept(monkeypatch):
    cards = [SimpleNamespace(alias=f"cuda:{i}", name="Card", uuid=f"GPU-{i}", arch=90, sm_count=1) for i in (0, 1)]
    told = "".join(f"GPU-{i}, Card, {i}.0, 1, 2, 3, 4\n" for i in (1, 0))
    monkeypatch.setattr(environment.wp, "get_cuda_devices", lambda: cards)
    monkeypatch.setattr(environment.shutil, "which", lambda name: name)
    monkeypatch.setattr(environment.subprocess, "run", lambda *_, **__: SimpleNamespace(stdout=told))
    found = environment.gpus()
    assert [card["smi"]["driver_version"] for card in found] == ["0.0", "1.0"]
    assert [card["ray_tracing_units"] for card in found] == [False, False]
    assert "GPU-" not in json.dumps(found)


@pytest.mark.parametrize(
    ("release", "kept"), [("6.18.44-somebodys-build", "6.18.44"), ("24.1.0", "24.1.0"), ("x", "unknown")]
)
def test_of_a_kernel_its_number_is_kept(monkeypatch, release, kept):
    monkeypatch.setattr(environment.platform, "release", lambda: release)
    assert environment.system().split("-")[1] == kept
