"""Tables in a terminal, with whole words and no column lost; a drawing in half of its bytes, with the same looks."""

import io
import re
from pathlib import Path
from xml.etree import ElementTree

import pandas as pd
import pytest
from rich.console import Console
from shadowbench.harness.report import panels
from shadowbench.harness.report.panels import short
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


DECIMAL = re.compile(r"-?\d+\.\d+")


def drawn(path: Path) -> str:
    with panels.sheet(path, (3.0, 2.0), 2, 2, below='a < b & c > d, "e", 0.123456', left="ms") as (_, grid):
        for k, axes in enumerate(grid.flat):
            axes.plot([0.123456, 1.0, 2.7], [k, 3.3333333, 1e-3], "o-", label=f"line {k}, 1.987654 < 2", color="C0")
            axes.bar([0, 1], [1, 2], hatch="//", alpha=0.123)
    return path.read_text()


def test_elements_texts_and_looks_stay(tmp_path, monkeypatch):
    now = drawn(tmp_path / "short.svg")
    monkeypatch.setattr(panels, "short", lambda drawing: drawing)
    whole = drawn(tmp_path / "whole.svg")
    assert len(now) < 0.75 * len(whole)
    assert short(whole) == now
    before, after = (list(ElementTree.fromstring(text).iter()) for text in (whole, now))
    rules = dict(re.findall(r"\.(s\d+)\{([^}]*)\}", now))
    assert len(rules) > 5
    assert [one.tag for one in before] == [one.tag for one in after]
    for old, new in zip(before, after, strict=True):
        if not old.tag.endswith("style"):
            assert (old.text or "").strip() == (new.text or "").strip()
        found = dict(new.attrib)
        if "class" in found:
            found["style"] = rules[found.pop("class")]
        assert set(old.attrib) == set(found)
        for name, value in old.attrib.items():
            written = [value, found[name]]
            if name != "style":
                numbers = [[float(number) for number in DECIMAL.findall(text)] for text in written]
                assert len(numbers[0]) == len(numbers[1])
                assert all(abs(a - b) <= 0.00501 for a, b in zip(*numbers, strict=True))
                written = [DECIMAL.sub("#", text) for text in written]
            assert written[0].split() == written[1].split()


def test_what_is_short_stays_and_a_drawing_without_rules_keeps_its_styles():
    plain = '<svg>\n <path d="M 1.23456 2\nL 3 4" style="fill: none"/>\n <path d="M 0 0" style="fill: none"/>\n</svg>'
    brief = '<svg>\n<path d="M 1.23 2 L 3 4" style="fill: none"/>\n<path d="M 0 0" style="fill: none"/>\n</svg>'
    assert short(plain) == brief == short(brief)
