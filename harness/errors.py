"""Errors that are shown to the user, warnings, and suggestions for misspelt names."""

import contextlib
import difflib
import functools
import shlex
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from .texts import visible


class UserError(Exception):
    """A wrong command line or a bad file (exit code 2). The message is one line: what is wrong, then what to do."""


class CapacityRejected(Exception):
    """A method exceeds its memory limit or a capacity. The record gets the status ``rejected`` with this reason."""


def say(text: str) -> None:
    """Print a line on standard error. It may hold names and texts of files, methods and records."""
    print(visible(text), file=sys.stderr)


@functools.cache
def warn(text: str) -> None:
    """Print a warning on standard error, each text once per process."""
    say(f"shadowbench: warning: {text}")


LONGEST = 500  # characters of another program's error that are worth reading: it may repeat the contents of a file


def one_line(error: BaseException) -> str:
    """The text of an error on one line of at most :data:`LONGEST` characters; the name of its class where it has none."""
    try:
        text = " ".join(str(error).split())
    except Exception:  # the class of a method's error may fail, too
        text = ""
    text = text if len(text) <= LONGEST else f"{text[:LONGEST]}..."
    return text.encode(errors="replace").decode() or type(error).__name__


@contextlib.contextmanager
def writing(place: Path | str, remedy: str) -> Iterator[None]:
    """Turn a failure to write into one line: where, why, and what to do."""
    try:
        yield
    except OSError as error:
        raise UserError(f"{place}: cannot write ({error.strerror or one_line(error)}); {remedy}") from error


@functools.cache
def note(text: str) -> None:
    """Print what is worth knowing and no mistake on standard error, each text once per process."""
    say(f"shadowbench: note: {text}")


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """``'; did you mean X?'`` with the most similar known word; if none is similar, the list of known words."""
    names = sorted(known)
    near = difflib.get_close_matches(word, names, n=1, cutoff=0.7)
    if near:
        return f"; did you mean {near[0]}?"
    return "; known: " + ", ".join(names)


def install(package: str, editable: bool = False) -> str:
    """The command that installs a package for the Python that runs this program, from the current folder."""
    python = Path(sys.executable)
    if python.is_relative_to(Path.cwd()):
        python = python.relative_to(Path.cwd())
    return f"{shlex.quote(str(python))} -m pip install {'-e ' if editable else ''}{shlex.quote(package)}"
