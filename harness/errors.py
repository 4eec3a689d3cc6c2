"""The one kind of error a user may see: a line that names the thing and the way out."""

from __future__ import annotations

import difflib
import functools
import sys
from collections.abc import Iterable


class UserError(Exception):
    """The call was wrong (exit code 2). The message is one line: what is wrong, then what to do."""


class CapacityRejected(Exception):
    """A frame needs more than a method may take. Becomes the status ``rejected`` with this text as reason."""


@functools.cache
def warn(text: str) -> None:
    """Say on standard error, once a process, what a person should know and nothing stops at."""
    print(f"shadowbench: warning: {text}", file=sys.stderr)


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return ``'; did you mean X?'`` for the nearest known word, or what there is to choose from."""
    names = sorted(known)
    near = difflib.get_close_matches(word, names, n=1, cutoff=0.5)
    if near:
        return f"; did you mean {near[0]}?"
    return "; known: " + ", ".join(names)
