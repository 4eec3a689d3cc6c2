"""A drawing in half of its bytes has the same elements, texts and looks."""

import re
from pathlib import Path
from xml.etree import ElementTree

from shadowbench.harness.report import panels
from shadowbench.harness.report.panels import short

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
