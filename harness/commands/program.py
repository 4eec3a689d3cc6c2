"""The program that the commands belong to: its own options, how a command is registered, exit codes and errors in one line.

Exit codes: 0: success; 1: a check or a point failed; 2: the command line was wrong. An error is one line on standard
error; ``--debug`` adds the traceback. :mod:`.cli` registers the commands.
"""

import functools
import inspect
import os
import sys
from collections.abc import Callable
from typing import Annotated, Any

import typer

from ..errors import UserError, one_line, say
from ..runner.machine.lock import MACHINE

DEBUG = "SHADOWBENCH_DEBUG"
INTERRUPTED = 130

app = typer.Typer(
    name="shadowbench",
    help="Measures acceleration structures for ray tracing scenes that change every frame, and checks every answer.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def show_version(wanted: bool) -> None:
    if wanted:
        import shadowbench

        print(f"shadowbench {shadowbench.__version__}")
        raise typer.Exit


@app.callback()
def everywhere(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=show_version, is_eager=True)
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Print the traceback of an error.")] = False,
    no_wait: Annotated[
        bool, typer.Option("--no-wait", help="Stop with an error if another run on this machine is measuring.")
    ] = False,
) -> None:
    if debug:
        os.environ[DEBUG] = "1"
    MACHINE.wait = not no_wait


EVERYWHERE = ("--debug", "--no-wait")
"""Options of the program itself: accepted before and after the command."""


SHORT = {
    "advise": "Say which structure is the fastest for a scene, here.",
    "run": "Measure an experiment: every method on every scene.",
    "show": "Draw tables and figures of an experiment from its records.",
    "list": "List methods, scenes or experiments.",
    "render": "Render a picture or an animation of a scene.",
    "check": "Test one method on small scenes that are hard to trace.",
    "plan": "List the passes of each method for a scene, with reasons.",
    "verify": "Compare every answer of every method with the reference.",
    "explain": "Show every answer at one pixel, and the exact one.",
    "score": "Score answers that a run saved without a score.",
    "report": "Write results as one HTML page to explore.",
    "compare": "Compare two runs: faster, slower or the same.",
    "view": "Show a scene on an interactive page on this machine.",
    "scenes": "Fetch the originals of scenes.",
    "new-method": "Create a Python package for a new method.",
    "cache": "Show or clear the compiled kernels on the disk.",
    "keep": "Pack results into a folder to publish.",
}
"""One line per command in ``shadowbench --help``, short enough for 80 columns."""


def command(name: str, example: str) -> Callable[[Callable[..., int | None]], Callable[..., int | None]]:
    """Register a command. The function returns its exit code; the help text ends with the example."""

    def register(work: Callable[..., int | None]) -> Callable[..., int | None]:
        @functools.wraps(work)
        def checked(*args: Any, **kwargs: Any) -> None:
            try:
                code = work(*args, **kwargs)
            except KeyboardInterrupt:  # typer would exit without a message
                way_on = "; run the same command again to continue" if name == "run" else ""
                print(f"shadowbench: interrupted{way_on}", file=sys.stderr)
                raise SystemExit(INTERRUPTED) from None
            finally:
                MACHINE.release()
            raise typer.Exit(code or 0)

        text = inspect.cleandoc(work.__doc__ or "")
        always = (
            "Every command also takes --debug (print the traceback of an error) and --no-wait (stop with an error "
            "if another run on this machine is measuring)."
        )
        app.command(name, short_help=SHORT[name], help=f"{text}\n\n{always}\n\n\b\nExample:\n  {example}")(checked)
        return work

    return register


SEVERAL = ("--scene", "--method", "--set")
"""Options that take several values after one flag, if they come after the command's own argument."""


def spread_values(arguments: list[str]) -> list[str]:
    """Rewrite ``--scene a b`` as ``--scene a --scene b``, the form that typer reads.

    This applies only after the command and its argument (``run table1 --scene a b``): before them, ``b`` could be the
    argument.
    """
    result: list[str] = []
    plain, flag, taken = 0, "", False
    for word in arguments:
        if word.startswith("-"):
            flag, taken = word, False
        elif flag in SEVERAL and taken and plain >= 2:
            result.append(flag)
        elif flag:
            # An option takes one value; the next word is an argument.
            taken = True
            if flag not in SEVERAL:
                flag = ""
        else:
            plain += 1
        result.append(word)
    return result


def main() -> None:
    """The ``shadowbench`` command."""
    words = spread_values(sys.argv[1:])
    # A name that is not UTF-8 is shown with its bytes as numbers, as on standard error.
    sys.stdout.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    try:
        app(sorted(words, key=lambda word: word not in EVERYWHERE), standalone_mode=True)
    except UserError as error:
        if os.environ.get(DEBUG):
            raise
        say(f"shadowbench: {error}")
        raise SystemExit(2) from None
    except MemoryError as error:
        if os.environ.get(DEBUG):
            raise
        reason = one_line(error)
        say(f"shadowbench: not enough memory ({reason}); choose a smaller --size")
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        print("shadowbench: interrupted", file=sys.stderr)
        raise SystemExit(INTERRUPTED) from None
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        raise SystemExit(INTERRUPTED) from None
    except OSError as error:  # a full disk, a folder that may not be written, too many open files
        if os.environ.get(DEBUG):
            raise
        where = f"{error.filename}: " if error.filename else ""
        say(f"shadowbench: {where}{error.strerror or one_line(error)}; --debug shows where it comes from")
        raise SystemExit(2) from None
