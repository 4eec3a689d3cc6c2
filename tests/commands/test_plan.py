"""The tables of ``plan``: as wide as the terminal, and lines that break between words only."""

import io
import json

import pytest
from rich.console import Console
from shadowbench.harness.report.terminal import GAP, table_blocks

NAMES = ["pass", "first frame", "camera", *(f"light {i}" for i in range(5)), "geometry", "nothing"]
ROWS = [
    ["light 0: clear counts", 'read by "light 0: shadow rays"', *["(shadow counts/0)"] * 6, "points", "."],
    ["mirrors: triangles", "output shadowed/0/1", *["light rectangle/0"] * 6, "light triangles/0", "."],
]


def printed(width: int) -> list[list[str]]:
    """The lines of each block, at a width."""
    blocks = []
    for table in table_blocks(NAMES, ROWS, width):
        console = Console(file=io.StringIO(), width=width, markup=False, highlight=False)
        console.print(table)
        blocks.append(console.file.getvalue().splitlines())
    return blocks


@pytest.mark.parametrize("width", [60, 80, 120, 160, 400])
def test_words_stay_whole_and_every_column_is_there_once(width):
    words = {word for row in [NAMES, *ROWS] for cell in row for word in cell.split()}
    blocks = printed(width)
    shown = [line for lines in blocks for line in lines]
    assert all(len(line) <= width for line in shown)
    assert {word for line in shown for word in line.split()} == words
    headings = [line for lines in blocks for line in lines[:1]]
    assert [heading.split()[0] for heading in headings] == ["pass"] * len(blocks)
    later = " ".join(" ".join(heading.split()[1:]) for heading in headings)
    assert later == " ".join(NAMES[1:])


def test_what_fits_is_one_table_without_broken_lines():
    (lines,) = printed(400)
    assert len(lines) == 1 + len(ROWS)
    assert len(printed(80)) > 1


def test_a_column_that_is_wider_than_the_terminal_is_a_table_of_its_own():
    (table,) = table_blocks(["pass", "first"], [["a", "x" * 50]], 20)
    assert [column.width for column in table.columns] == [4, 50]
    assert 4 + 50 + 2 * GAP > 20


def test_plan_breaks_no_word_at_80_columns(call, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    command = ("plan", "fairy", "--method", "perspective_spherical", "--size", "16x16", "--device", "cpu")
    code, out, _ = call(*command)
    assert code == 0
    assert "declared closed: no" in out
    words = out.split()
    for word in ("rectangle/0", "shadowed/0", "triangles", "geometry", "nothing", "camera"):
        assert word in words
    assert max(map(len, out.splitlines())) <= 80


def test_camera_lights_and_frame_are_taken(call, refused_call, scene):
    asked = ("plan", scene, "--method", "uniform_grid", "--size", "8x8", "--device", "cpu", "--json")
    code, out, _ = call(*asked, "--camera", "1,2,3", "0,0.5,0", "--light", "4,5,6", "--light", "7,8,9", "--frame", "0")
    assert code == 0
    found = json.loads(out)
    assert found["declared"]["camera"] == "fixed, from 1,2,3 to 0,0.5,0"
    assert [one.split(", ")[-1] for one in found["declared"]["lights"]] == ["at 4,5,6", "at 7,8,9"]
    assert set(found["changes"]) == {"camera", "light 0", "light 1", "geometry", "nothing"}
    assert found["frame"] == 0
    assert f"--frame 3: {scene} has frames 0 to 0" in refused_call(*asked, "--frame", "3")
