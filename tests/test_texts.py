"""Texts made safe to show."""

import io
import json

import pandas as pd
import pytest
from shadowbench.harness import errors
from shadowbench.harness.report.document import markdown
from shadowbench.harness.report.terminal import plain_console, print_table
from shadowbench.harness.texts import FILE_NAME, all_visible, for_markdown, may_hide, numbered, visible, visible_lines

ODD = "a\x1b[31m\x9b\u202e\ud800\ufeff\x00z"
SEEN = r"a\x1b[31m\x9b\u202e\ud800\ufeff\x00z"


def test_what_cannot_be_seen_is_shown_as_its_number():
    assert visible(ODD) == SEEN
    assert visible("one\r\n\ttwo\u2028three é ✓ \U0001f600") == "one   two three é ✓ \U0001f600"
    assert visible_lines(f"{ODD}\n{ODD}") == f"{SEEN}\n{SEEN}"
    visible("".join(map(chr, range(0x11000)))).encode("utf-8")
    assert all_visible({ODD: [ODD, 1, None, {"b": (ODD,)}]})[SEEN][:3] == [SEEN, 1, None]


@pytest.mark.parametrize("sign", ["\x1b", "\x9b", "\u202e", "\ud800", "\ufeff", "\0", "\n", "\t"])
def test_json_that_may_hide_something_is_noticed(sign):
    assert may_hide(json.dumps({"a": sign}))
    if sign != "\ud800":  # no file of UTF-8 has it
        assert may_hide(json.dumps({"a": sign}, ensure_ascii=False))
    assert not may_hide('{\n\t"a": "✓ é"\n}')


def test_markdown_holds_no_html_and_no_link():
    assert for_markdown("**a** <b> & [x](y)") == r"**a** &lt;b> &amp; [x]\(y)"

    assert markdown(pd.DataFrame({"a": ["<i>|"]}))[-1] == r"| &lt;i>\| |"


def test_a_number_of_things_has_its_plural():
    assert [numbered(n, "round") for n in (0, 1, 2, 12200)] == ["0 rounds", "1 round", "2 rounds", "12,200 rounds"]


def test_names_of_files_lead_nowhere_else():
    for name in ("a", "a.b", "é", "-x"):
        assert FILE_NAME.fullmatch(name)
    for name in ("", ".", "..", ".a", "a/b", "../a", "a\\b", "a\0", "a" * 256):
        assert not FILE_NAME.fullmatch(name)


def test_terminals_get_no_codes(capsys):
    stream = io.StringIO()
    console = plain_console(file=stream, width=200, force_terminal=True, color_system=None)
    console.print(ODD)
    odd = ODD.replace("\ud800", "")  # which no table can hold
    print_table(pd.DataFrame({odd: [odd, f"**{odd}**"]}), ODD, console)
    assert stream.getvalue().replace("\x1b[3m", "").replace("\x1b[0m", "").count("\x1b[31m") == 0
    assert stream.getvalue().count(r"a\x1b[31m\x9b\u202e") >= 4
    errors.warn(ODD)
    assert capsys.readouterr().err == f"shadowbench: warning: {SEEN}\n"
