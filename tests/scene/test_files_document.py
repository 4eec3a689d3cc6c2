"""docs/files.md: its endings, limits and examples, and its table of what is not read, are those of the code."""

import re
from pathlib import Path

import numpy as np
import pytest
from helpers import mesh_files as files
from shadowbench.harness.commands.options import view_of
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.readers import checks
from shadowbench.harness.scene.readers.load import DECLARATION, READERS, SUFFIXES, UNREAD, load

TEXT = (Path(__file__).resolve().parents[2] / "docs" / "files.md").read_text(encoding="utf-8")
EXAMPLE = re.compile(r"```(\w+)\n((?:(?!```).)*)```\n\nRead as (.*?)\.\n", re.DOTALL)


def test_every_ending_that_is_read_stands_in_the_first_table():
    first = TEXT.split("## The same for all")[0]
    assert set(re.findall(r"`(\.\w+)`", first)) == {*SUFFIXES, DECLARATION}
    for suffix in READERS:
        assert re.search(rf"^## .*`{re.escape(suffix)}`", TEXT, re.MULTILINE), f"{suffix} has no section"


def test_the_table_of_what_is_not_read_is_that_of_the_messages():
    last = TEXT.split("## Not read")[1]
    found = {}
    for row in re.findall(r"^\| `.*\|$", last, re.MULTILINE):
        endings, what, way_out = (cell.strip() for cell in row.strip("|").split("|"))
        found |= dict.fromkeys(re.findall(r"`(\.\w+)`", endings), (what, way_out))
    assert found == UNREAD
    assert not set(found) & set(SUFFIXES)


def test_its_links_within_lead_to_a_heading():
    slug = lambda heading: re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")  # noqa: E731
    headings = {slug(heading) for heading in re.findall(r"^#+ (.*)$", TEXT, re.MULTILINE)}
    links = re.findall(r"\]\(#([\w-]+)\)", TEXT)
    assert len(links) > 5
    assert set(links) <= headings


def test_its_limits_are_those_of_the_code():
    assert "not exceed 1e37" in TEXT
    assert "at least\n  1e-38" in TEXT
    assert (checks.LARGEST, checks.SMALLEST) == (1e37, 1e-38)
    assert "may have 2^27 triangles" in TEXT
    assert checks.MAX_TRIANGLES == 1 << 27
    assert "a line of more than 2^20 bytes" in TEXT
    assert checks.MAX_LINE == 1 << 20


@pytest.mark.parametrize(("suffix", "content", "told"), EXAMPLE.findall(TEXT), ids=lambda text: text[:4])
def test_its_examples_are_read_as_it_says(tmp_path, suffix, content, told):
    loaded = load(files.written(tmp_path, f"a.{suffix}", content.encode()))
    count, low, high, noted = re.fullmatch(
        r"(\d+) triangles? from \((.*?)\) to \((.*?)\)(?:; noted: (.*))?", told.replace("\n", " ")
    ).groups()
    points = loaded.frames[0][np.unique(loaded.faces)]
    assert len(loaded.faces) == int(count)
    assert points.min(axis=0).tolist() == [float(x) for x in low.split(",")]
    assert points.max(axis=0).tolist() == [float(x) for x in high.split(",")]
    assert loaded.notes == ((noted,) if noted else ())


def test_it_has_an_example_of_every_text_format():
    assert {suffix for suffix, _, _ in EXAMPLE.findall(TEXT)} == {"obj", "ply", "stl"}


@pytest.fixture
def folder(tmp_path):
    """The files that the declarations of the document name."""
    files.written(tmp_path, "room.obj", files.obj())
    (tmp_path / "dancer").mkdir()
    for number in range(91):
        files.written(tmp_path / "dancer", f"{number:04}.ply", files.ply_binary(files.QUAD + number))
    return tmp_path


def test_its_declarations_are_read(folder):
    several, views = re.findall(r"```toml\n(.*?)```", TEXT, re.DOTALL)
    scene = resolve(files.written(folder, "several.toml", several.encode()))
    assert scene.geometry().frame_count == 10
    assert len(scene.geometry().faces) == 12
    assert np.allclose(scene.geometry().positions(9)[5], (0.9, -0.9, 2.9))
    assert scene.geometry().positions(9)[10].tolist() == [3, 0, 0]
    scene = resolve(files.written(folder, "views.toml", views.encode()))
    assert (scene.camera.eye, scene.camera.fov) == ((0, 1.7, 4), 50)
    assert view_of(None, None, None, camera_of="door", light_of=["lamp"]).applied(scene).camera.fov != 50


def test_its_patterns_are_read(folder, monkeypatch):
    monkeypatch.chdir(folder)
    (folder / "frames").mkdir()
    for number in (1, 2, 10):
        files.written(folder / "frames", f"{number:04}.ply", files.ply_binary())
        files.written(folder / "frames", f"wave_{number}.obj", files.obj())
        files.written(folder / "frames", f"{number}.stl", files.stl_binary())
    for pattern in re.findall(r"^\| `(frames/\S+)`", TEXT, re.MULTILINE):
        assert resolve(pattern).geometry().frame_count == 3
    assert len(re.findall(r"^\| `frames/", TEXT, re.MULTILINE)) == 3
