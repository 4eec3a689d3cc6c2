"""Tables in a terminal: whole words, nothing wider than the line, and no column lost."""

import io

import pandas as pd
import pytest
from rich.console import Console
from shadowbench.harness.report.terminal import make_console, print_table


def printed(body: pd.DataFrame, width: int) -> str:
    console = Console(width=width, file=io.StringIO(), force_terminal=False, highlight=False, markup=False)
    print_table(body, "Heading", console)
    return console.file.getvalue()


def wide_table() -> pd.DataFrame:
    columns = {
        "scene": ["Fairy (stand-in)"] * 2 + ["Cloth (stand-in)"] * 2, "method": ["warp_bvh", "perspective + spherical"] * 2
    }  # fmt: skip
    columns |= {f"milliseconds at number {i}": [f"{i}.{j}00" for j in range(4)] for i in range(12)}
    return pd.DataFrame(columns)


@pytest.mark.parametrize("width", [70, 80, 220])
def test_columns_without_room_follow_below_with_the_names_of_the_rows(width):
    body = wide_table()
    text = printed(body, width)
    lines = text.splitlines()
    assert max(map(len, lines)) <= width
    for word in " ".join(body.columns).split():
        assert word in text.split(), "no word of a heading is broken"
    for row in body.to_numpy().tolist():
        of_row = [line for line in lines if line.startswith(row[0]) and row[1] in line]
        assert of_row, "every group names both the scene and the method"
        assert {cell for line in of_row for cell in line.split()} >= set(row[2:])
    assert (len([line for line in lines if "warp_bvh" in line]) > 2) == (width < 220)


def test_sentences_give_way_and_are_broken_between_words():
    sentence = "one of the longest reasons that a method ever gave for not being measured at all on any scene"
    body = pd.DataFrame({"method": ["warp_bvh", "embree"], "ms": ["1.0", "2.0"], "why": [sentence, "-"]})
    lines = printed(body, 60).splitlines()
    assert max(map(len, lines)) <= 60
    assert " ".join(line[13:].strip() for line in lines if line[13:].strip()).count(sentence) == 1


def test_emphasis_of_a_cell_is_a_style_and_no_text():
    assert "**" not in printed(pd.DataFrame({"a": ["**1.0 ✓**", "*2.0*", "3 * 4"]}), 40)
    assert "3 * 4" in printed(pd.DataFrame({"a": ["3 * 4"]}), 40)


def test_a_pipe_has_the_width_of_columns_or_room_to_scroll(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "72")
    assert make_console().width == 72
    monkeypatch.delenv("COLUMNS")
    assert make_console().width == 160
