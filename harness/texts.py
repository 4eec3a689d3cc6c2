"""Texts of files, records and methods made safe to show, in one place: in a terminal, in Markdown, in a file's name.
Such a text may hold codes that move a terminal's cursor, reverse the direction of reading or end a line, halves of
characters that no file can be written with, and HTML. What is read from a record is :func:`visible` from then on.
"""

import re
from typing import Any

_DIRECTIONS = "\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"
_ENDS_AND_MARKS = "\u2028\u2029\ufeff\ufff9-\ufffb\ufffe\uffff"
_HALVES = "\ud800-\udfff"  # halves of characters: bytes of a name that are not UTF-8, or wrong JSON

_UNSEEN = re.compile(f"[\x00-\x1f\x7f-\x9f{_DIRECTIONS}{_ENDS_AND_MARKS}{_HALVES}]")
_UNSEEN_IN_JSON = re.compile(rf"[\x7f-\x9f{_DIRECTIONS}{_ENDS_AND_MARKS}\\]")
"""JSON has no control character in a text, but may have an escape for it."""

FILE_NAME = re.compile(r"[^/\\.\x00][^/\\\x00]{0,254}")
"""A text that can be the name of a file in a folder, and of no other place. Such a file is not hidden."""


def visible(text: str) -> str:
    r"""The text in one line, with every control character as its number: ESC is ``\x1b``; ends of lines are spaces."""
    return _UNSEEN.sub(_shown, text)


def visible_lines(text: str) -> str:
    """The text with every control character as its number, and its lines as they are."""
    return "\n".join(map(visible, text.split("\n")))


def _shown(found: re.Match[str]) -> str:
    sign = found[0]
    if sign in "\n\r\t\u2028\u2029":
        return " "
    return f"\\x{ord(sign):02x}" if ord(sign) < 256 else f"\\u{ord(sign):04x}"


def may_hide(json_text: str) -> bool:
    """Whether a text of JSON may hold a text that :func:`visible` would change."""
    return _UNSEEN_IN_JSON.search(json_text) is not None


def all_visible(value: Any) -> Any:
    """A value of JSON with every text in it :func:`visible`, names of fields included."""
    if isinstance(value, str):
        return visible(value)
    if isinstance(value, list):
        return [all_visible(one) for one in value]
    if isinstance(value, dict):
        return {visible(key): all_visible(one) for key, one in value.items()}
    return value


def for_markdown(text: str) -> str:
    """The text without HTML and without links; emphasis stays, since tables use it."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace("](", "]\\(")


def numbered(count: int, noun: str) -> str:
    """A number of things: "1 scene", "12,200 triangles"."""
    return f"{count:,} {noun}" + "s" * (count != 1)


def scalar(value: Any) -> Any:
    """A value that a column of a table can hold: lists and objects as text."""
    return value if value is None or isinstance(value, str | int | float) else str(value)
