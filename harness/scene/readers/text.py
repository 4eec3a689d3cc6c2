"""What the text formats share: encodings and line ends, numbers in lines, and the line of a mistake."""

import codecs
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import F64, I64
from ...errors import UserError

_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32"),  # before UTF-16, whose mark begins it
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)

_BLOCK = 1 << 16  # bytes of a block of lines, about
_LINES = 1 << 15  # lines that are parsed at a time

_BLANK = np.zeros(256, dtype=bool)
_BLANK[list(b" \t\n\v\f\r")] = True

JOINED = b"\f"  # stands for a backslash and the line end after it, so that the lines of a file can still be counted


def decoded(blob: bytes) -> bytes:
    """A text that begins with the mark of an encoding, as UTF-8 without its mark; other bytes as they are."""
    for mark, encoding in _MARKS:
        if blob.startswith(mark):
            return blob[len(mark) :] if encoding == "utf-8" else blob.decode(encoding, "replace").encode()
    return blob


def plain_lines(blob: bytes) -> bytes:
    """The bytes with each line ended by ``\\n`` alone, whatever mixture of ends they had."""
    return blob.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in blob else blob


def blocks_of_lines(text: bytes) -> Iterator[list[bytes]]:
    """The lines of a text, block by block, so that they need little memory; at least one block."""
    at = 0
    while at <= len(text):
        end = text.find(b"\n", at + _BLOCK)
        end = len(text) if end < 0 else end
        yield text[at:end].split(b"\n")
        at = end + 1


def blocks(lines: Sequence[bytes]) -> Iterator[Sequence[bytes]]:
    """The lines, block by block; at least one block."""
    return (lines[first : first + _LINES] for first in range(0, max(1, len(lines)), _LINES))


def without_comments(text: bytes) -> bytes:
    """The text without what follows a ``#``, and with each line that ends in a backslash joined to the next."""
    text = text.replace(JOINED, b" ")
    if b"#" in text:
        text = re.sub(rb"#[^\n]*", b"", text)
    if b"\\" in text:
        text = re.sub(rb"\\[ \t]*\n", JOINED, text)
    return text


def number_of(lines: Sequence[bytes], index: int) -> int:
    """The number in the file, from 1, of a line of :func:`without_comments`."""
    return index + 1 + sum(line.count(JOINED) for line in lines[:index])


def numbers(lines: Sequence[bytes], dtype: type = np.float64) -> tuple[NDArray[Any], I64]:
    """The numbers of lines, and how many each has, [len(lines)]. Raises ValueError for a word that is no number."""
    if not lines:
        return np.zeros(0, dtype), np.zeros(0, np.int64)
    text = b"\n" + b"\n".join(lines)
    letters = np.frombuffer(text, dtype=np.uint8)
    blank = _BLANK[letters]
    begins = np.zeros(len(blank), dtype=bool)
    np.logical_and(blank[:-1], ~blank[1:], out=begins[1:])
    each = np.add.reduceat(begins, np.flatnonzero(letters == ord("\n")), dtype=np.int64)
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            values: NDArray[Any] = np.zeros(0, dtype)
            if each.any():
                values = np.fromstring(text, dtype=dtype, sep=" ")
        except (ValueError, DeprecationWarning):
            raise ValueError("a value is not a number") from None
    # 1-2 is one word, but read as two numbers; a sign alone, at the end, as 0.
    if each.sum() != len(values) or text.rstrip().endswith((b"-", b"+")):
        raise ValueError("a value is not a number")
    return values, each


def first_three(values: F64, each: I64, what: str) -> F64:
    """The first three :func:`numbers` of each line, [line_count, 3]. Raises ValueError for a line with fewer."""
    if each.min(initial=3) < 3:
        raise ValueError(f"{what} has {each.min()} coordinates instead of 3")
    return values[(np.cumsum(each) - each)[:, None] + np.arange(3)]


def parsed(
    some: Iterable[Sequence[bytes]],
    parse: Callable[[Sequence[bytes]], tuple[NDArray[Any], ...]],
    wrong: Callable[[int, str], UserError],
) -> list[NDArray[Any]]:
    """The arrays that ``parse`` makes of the lines of blocks, each joined over all blocks, of which there is one.
    Raises what ``wrong`` makes of the index of the first line that is refused, and of the problem.
    """
    made, first = [], 0
    for lines in some:
        try:
            made.append(parse(lines))
        except ValueError:
            index, error = first_wrong(lines, parse)
            raise wrong(first + index, str(error)) from None
        first += len(lines)
    return [np.concatenate(parts) for parts in zip(*made, strict=True)]


def first_wrong(lines: Sequence[bytes], parse: Callable[[Sequence[bytes]], Any]) -> tuple[int, ValueError]:
    """The first of the lines that ``parse`` refuses, and why; it refuses some."""
    low, high = 0, len(lines)
    while high - low > 1:
        middle = (low + high) // 2
        try:
            parse(lines[low:middle])
            low = middle
        except ValueError:
            high = middle
    try:
        parse(lines[low:high])
    except ValueError as error:
        return low, error
    raise AssertionError("every line alone is right")
