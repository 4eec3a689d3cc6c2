"""The code of a Python file without its comments, docstrings and layout, so that its hash does not change if only these
do.

The code is the sequence of tokens. Comments, blank lines, the width of an indentation and blanks between tokens do not
count, nor does a statement that is only a string (the docstring of a module, class or function, the text below an
attribute): it does nothing. Changes of a docstring that a program reads as data (``__doc__``) are not seen.
"""

from __future__ import annotations

import ast
import io
import tokenize
from collections.abc import Iterator

LAYOUT = {tokenize.NEWLINE: "end", tokenize.INDENT: "in", tokenize.DEDENT: "out"}
"""Names for the tokens of layout that are part of a program's meaning. A token of the text has a blank before it
instead."""

WORD = (tokenize.NAME, tokenize.ERRORTOKEN)
"""The tokens of a name: before Python 3.12, ``tokenize`` splits names with some letters, such as U+2118."""

IGNORED = (tokenize.COMMENT, tokenize.NL, tokenize.ENDMARKER, tokenize.ENCODING)

OPENING = {getattr(tokenize, f"{kind}STRING_START", None) for kind in "FT"} - {None}
CLOSING = {getattr(tokenize, f"{kind}STRING_END", None) for kind in "FT"} - {None}
"""The first and the last token of a formatted string. Before Python 3.12 such a string is one token."""

UNREADABLE = (SyntaxError, ValueError, LookupError, tokenize.TokenError, RecursionError, MemoryError)

Place = tuple[int, int]
"""Line from 1, character from 0."""


def code_of(source: bytes) -> bytes:
    """The code of a Python file, the same for every version of Python that can parse it; the whole file if it cannot be
    parsed."""
    try:
        encoding, _ = tokenize.detect_encoding(io.BytesIO(source).readline)
        text = source.decode(encoding).replace("\r\n", "\n").replace("\r", "\n")
        return "\0".join(_code(text)).encode("utf-8", "surrogatepass")
    except UNREADABLE:
        return b"whole\0" + source


def _code(text: str) -> list[str]:
    """The tokens that count, in order."""
    docstrings = _docstrings(text)
    found: list[str] = []
    end: Place | None = None  # of the docstring that is being left out
    after = False  # whether the last token belonged to a docstring
    word: Place | None = None  # the end of the last token, if that is part of a name
    for kind, token, start in _tokens(text):
        if end is not None and start < end:
            continue
        end = docstrings.get(start) if kind not in LAYOUT else None
        if end is not None:
            after = True
            continue
        separator, after = after, False
        if separator and token == ";":
            continue
        if separator and found and found[-1] == " ;":
            found.pop()
        if kind == tokenize.NEWLINE and (not found or found[-1] in LAYOUT.values()):
            continue  # the line of a docstring
        if kind in WORD and start == word:
            found[-1] += token
        else:
            found.append(LAYOUT.get(kind) or f" {token}")
        word = (start[0], start[1] + len(token)) if kind in WORD else None
    return found


def _docstrings(text: str) -> dict[Place, Place]:
    """Start and end of every statement that is only a string."""
    lines = text.split("\n")

    def place(line: int, column: int) -> Place:
        return line, len(lines[line - 1].encode()[:column].decode())  # columns of a syntax tree count bytes

    return {
        place(node.lineno, node.col_offset): place(node.end_lineno, node.end_col_offset)
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
        and node.end_lineno is not None
        and node.end_col_offset is not None
    }


def _tokens(text: str) -> Iterator[tuple[int, str, Place]]:
    """Kind, text and start of every token that counts. A formatted string is one token, as it stands in the text."""
    lines = text.split("\n")
    depth, first = 0, (0, 0)
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type in OPENING:
            first = first if depth else token.start
            depth += 1
        elif token.type in CLOSING:
            depth -= 1
            if not depth:
                yield tokenize.STRING, _between(lines, first, token.end), first
        elif not depth and token.type not in IGNORED:
            yield token.type, token.string, token.start


def _between(lines: list[str], start: Place, end: Place) -> str:
    if start[0] == end[0]:
        return lines[start[0] - 1][start[1] : end[1]]
    middle = lines[start[0] : end[0] - 1]
    return "\n".join([lines[start[0] - 1][start[1] :], *middle, lines[end[0] - 1][: end[1]]])
