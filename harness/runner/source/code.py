"""The code of a Python file without its comments, docstrings and layout, so that its hash does not change if only these
do.

The code is the syntax tree. A statement that is only a string does not count (the docstring of a module, class or
function, the text below an attribute): it does nothing. Changes of a docstring that a program reads as data
(``__doc__``) are not seen.
"""

import ast
from collections.abc import Iterator
from typing import Any

UNREADABLE = (SyntaxError, ValueError, RecursionError, MemoryError)


def code_of(source: bytes) -> bytes:
    """The code of a Python file, the same for every version of Python that can parse it; the whole file if it cannot be
    parsed."""
    try:
        return "".join(_written(ast.parse(source))).encode("utf-8", "surrogatepass")
    except UNREADABLE:
        return b"whole\0" + source


def _written(value: Any) -> Iterator[str]:
    """A part of a syntax tree as text. Fields that are empty are left out: later versions of Python have more of them."""
    if isinstance(value, ast.JoinedStr):  # Python 3.12 has empty parts in some
        value.values = [part for part in value.values if getattr(part, "value", None) != ""]
    if isinstance(value, ast.AST):
        yield f"{type(value).__name__}("
        for name, field in ast.iter_fields(value):
            if field is not None and field != []:
                yield f"{name}="
                yield from _written(field)
        yield ")"
    elif isinstance(value, list):
        yield "["
        for one in value:
            alone = one.value if isinstance(one, ast.Expr) else None
            if not (isinstance(alone, ast.Constant) and isinstance(alone.value, str)):  # not only a string
                yield from _written(one)
                yield ","
        yield "]"
    else:
        yield repr(value)
