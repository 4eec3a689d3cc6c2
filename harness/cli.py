"""The command line: ``shadowbench COMMAND``. It knows which commands there are, and imports those that are asked for.
Exit codes: 0: success; 1: a check or a point failed; 2: the command line was wrong. An error is one line on standard
error; ``--debug`` adds the traceback.
"""

import functools
import importlib
import inspect
import os
import sys
from typing import Annotated, Any

import typer

from .errors import UserError, one_line, say
from .runner.machine.lock import MACHINE

DEBUG = "SHADOWBENCH_DEBUG"
INTERRUPTED = 130

COMMANDS = {  # the module of `commands` and the function of each command (`commands.options.command`)
    "run": "run.run_", "show": "show.show_", "list": "listing.list_", "render": "render.render",
    "advise": "advise.advise", "check": "check.check", "plan": "plan.plan", "verify": "verify.verify",
    "explain": "explain.explain", "score": "verify.score", "report": "report.report", "compare": "compare.compare",
    "view": "view.view", "scenes": "scenes.scenes", "new-method": "new_method.new_method", "cache": "cache.cache",
    "keep": "keep.keep",
}  # fmt: skip

EVERYWHERE = ("--debug", "--no-wait")  # options of the program itself: accepted before and after the command

SEVERAL = ("--scene", "--method", "--set")
"""Options that take several values after one flag, if they come after the command's own argument."""

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


@functools.cache
def register(name: str) -> None:
    """Import a command and make it part of the program. Its help text ends with its example."""
    module, function = COMMANDS[name].split(".")
    work = getattr(importlib.import_module(f"{__package__}.commands.{module}"), function)

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

    always = (
        "Every command also takes --debug (print the traceback of an error) and --no-wait (stop with an error "
        "if another run on this machine is measuring)."
    )
    text = f"{inspect.cleandoc(work.__doc__ or '')}\n\n{always}\n\n\b\nExample:\n  {work.example}"
    app.command(name, short_help=work.short, help=text)(checked)


def wanted(words: list[str]) -> list[str]:
    """The commands that a command line needs: the one it names; all, as for help, completion and misspelt names."""
    first = next((word for word in words if not word.startswith("-")), "")
    if first in COMMANDS:
        return [first]
    return [] if "--version" in words else [*COMMANDS]


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


def line_of(error: Exception) -> str:
    """What is said of an error that ends the program."""
    if isinstance(error, UserError):
        return str(error)
    if isinstance(error, MemoryError):
        return f"not enough memory ({one_line(error)}); choose a smaller --size or scene"
    assert isinstance(error, OSError)  # a full disk, a folder that may not be written, too many open files
    where = f"{error.filename}: " if error.filename else ""
    return f"{where}{error.strerror or one_line(error)}; --debug shows where it comes from"


def main() -> None:
    """The ``shadowbench`` command."""
    # A name that is not UTF-8 is shown with its bytes as numbers, as on standard error.
    sys.stdout.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    try:
        for name in wanted(sys.argv[1:]):
            register(name)
        app(sorted(spread_values(sys.argv[1:]), key=lambda word: word not in EVERYWHERE), standalone_mode=True)
    except KeyboardInterrupt:
        print("shadowbench: interrupted", file=sys.stderr)
        raise SystemExit(INTERRUPTED) from None
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        raise SystemExit(INTERRUPTED) from None
    except (UserError, MemoryError, OSError) as error:
        if os.environ.get(DEBUG):
            raise
        say(f"shadowbench: {line_of(error)}")
        raise SystemExit(2) from None


if __name__ == "__main__":
    main()
