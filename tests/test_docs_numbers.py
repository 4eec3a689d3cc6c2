"""One quantity has one value: every measured number of a document is drawn from records (helpers/page_numbers.py)."""

import re

import pytest
from helpers import page_numbers as rule
from shadowbench.harness.report.documents import PART, documents
from shadowbench.harness.runner.planning.experiment import experiment_names

NAMES = [str(path.relative_to(rule.ROOT)) for path in rule.pages()]
NOTEBOOK = sorted((rule.ROOT / "results").glob("notebook*.md"))


def text_of(name):
    return (rule.ROOT / name).read_text(encoding="utf-8")


@pytest.mark.parametrize("name", NAMES)
def test_a_measured_number_is_drawn(name):
    """What is found here is drawn from records, told in words with its numbers in the notebook, or, where nothing measured
    it, listed with a reason in tests/data/definitions.toml.
    """
    assert rule.undrawn(name, text_of(name)) == []


def test_what_is_listed_stands_on_its_page():
    assert set(rule.listed()) <= set(NAMES)
    assert {name: lost for name in rule.listed() if (lost := rule.unused(name, text_of(name)))} == {}


PLANTED = [
    ("README.md", "Sibenik takes 0.2.", "0.2"),
    ("README.md", "It takes 3 times as long.", "3 times"),
    ("README.md", "It takes three times as long.", "three times"),
    ("README.md", "It is twice as fast.", "twice as fast"),
    ("README.md", "Four GPUs, 17 scenes", "17 scenes"),
    ("docs/findings.md", "A tree has 517 wrong answers.", "517 wrong"),
    ("docs/findings.md", "On Buddha it is 0.228 of that.", "0.228 of"),
    ("docs/findings.md", "Of 1e7 rays 1e3 wrong ones are left.", "1e3 wrong"),
    ("docs/experiments.md", "| fairy | 214 |", "214"),
    ("docs/performance.md", "| wide loads | 0.31 |", "0.31"),
    ("docs/performance.md", "It needs 64 registers.", "64 registers"),
    ("docs/methods/bvh2.md", "Sibenik takes 0.363 ms.", "0.363 ms"),
    ("docs/methods/bvh2.md", "The walk takes 38 % fewer steps.", "38 %"),
    ("docs/methods/kdtree.md", "`small` (63): triangles at which the heuristic takes over.", "63"),
    ("docs/methods/warp_bvh.md", "A frame takes `0.5` of it.", "`0.5`"),
    ("docs/accuracy.md", "Of 12,288 rays some are lost.", "12,288 rays"),
    ("CHANGELOG.md", "## 0.2.0 (2026-11-27)\nIt takes 27 ms.", "27 ms"),
    ("docs/cluster.md", "```\nshadowbench run table1  # 28 s on two cards\n```", "28 s"),
    ("docs/paper-method.md", "| § 3, tiles | `tile` | side in pixels, **9** |", "9"),
    ("results/nvidia-h200/README.md", "Memory: 219.1 MB", "219.1 MB"),
]


@pytest.mark.parametrize(("name", "planted", "found"), PLANTED)
def test_a_planted_number_is_found(name, planted, found):
    """A whole number, a ratio, a share, a number in words; on a page of results, of a method, of a command."""
    text = text_of(name)
    assert sorted(rule.undrawn(name, f"{text}\n{planted}\n")) == sorted([*rule.undrawn(name, text), found])


@pytest.mark.parametrize(
    "text",
    ["within 2^-30 of it", "1e7 radii away", "9 u of its size", "at 1024x1024 pixels", "Wald et al. 2007", "Table 1",
     "`--set r=32`", "a 64-bit word", "1. first", "`small` (64)", "<!-- drawn: kinds a -->\n0.3 ms\n<!-- end -->"],
)  # fmt: skip
def test_a_definition_is_told_apart(text):
    assert list(rule.numbers(text)) == []


def test_the_defaults_of_a_table_are_those_of_the_code():
    found = rule.bold_defaults(text_of("docs/paper-method.md"))
    assert len(found) > 15
    assert [pair for pair in found if pair[1] not in rule.defaults().get(pair[0], ())] == []


def test_every_document_is_a_page_a_report_or_the_notebook():
    """A report is drawn as a whole from the records of its folder, claims from those of its machine (tests/results)."""
    others = [path for path in documents(rule.ROOT) if path not in [*rule.pages(), *NOTEBOOK]]
    others = [path for path in others if path.relative_to(rule.ROOT).parts[0] not in (".github", "tests")]
    reports = [path for path in others if path.stem in experiment_names() and (path.parent / "records").is_dir()]
    assert [path for path in others if path not in reports and path.stem != "claims"] == []
    assert len(reports) > 15


@pytest.mark.parametrize("path", NOTEBOOK, ids=lambda path: path.name)
def test_the_notebook_is_in_the_site_and_says_when(path):
    text = path.read_text(encoding="utf-8")
    assert f"- results/{path.name}\n" in text_of("mkdocs.yml")
    assert not PART.search(text), "the notebook is of its day"
    assert re.search(r"\b20\d\d\b|\bcommit [0-9a-f]{7}\b", text)
