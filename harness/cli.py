"""The command line: ``shadowbench COMMAND``. It only reads arguments; the work is in :mod:`.commands`.

Exit codes: 0 done, 1 the answer is no (a check failed, a point failed), 2 the call was wrong. An error is one line
on standard error; ``--debug`` adds the traceback. Imports of the work are made when a command runs, so that help
is quick.
"""

from __future__ import annotations

import functools
import inspect
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from .commands.check import check
from .commands.keep import keep
from .commands.options import CameraPlace, Device, Fov, Json, Lights, SceneDir, Settings
from .commands.plan import plan
from .commands.verify import explain, score, verify
from .errors import UserError
from .runner.machine_lock import MACHINE

DEBUG = "SHADOWBENCH_DEBUG"
INTERRUPTED = 130

app = typer.Typer(
    name="shadowbench",
    help="Measures acceleration structures for ray tracing scenes that change every frame, and checks every answer.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
def everywhere(
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback with an error.")] = False,
    no_wait: Annotated[
        bool, typer.Option("--no-wait", help="Refuse to start while another run on this machine measures.")
    ] = False,
) -> None:
    if debug:
        os.environ[DEBUG] = "1"
    MACHINE.wait = not no_wait


EVERYWHERE = ("--debug", "--no-wait")
"""Options of the program itself: taken before the command and after it."""


def command(name: str, example: str) -> Callable[[Callable[..., int | None]], Callable[..., int | None]]:
    """Register a command: its exit code is what it returns; its help ends with an example."""

    def register(work: Callable[..., int | None]) -> Callable[..., int | None]:
        @functools.wraps(work)
        def checked(*args: Any, **kwargs: Any) -> None:
            try:
                code = work(*args, **kwargs)
            except KeyboardInterrupt:  # caught here: typer would end without a word
                way_on = "; the same command goes on where this one stopped" if name == "run" else ""
                print(f"shadowbench: interrupted{way_on}", file=sys.stderr)
                raise SystemExit(INTERRUPTED) from None
            finally:
                MACHINE.release()
            raise typer.Exit(code or 0)

        text = inspect.cleandoc(work.__doc__ or "")
        always = (
            "With every command: --debug shows a traceback with an error; --no-wait refuses to start while "
            "another run on this machine measures."
        )
        app.command(name, help=f"{text}\n\n{always}\n\n\b\nExample:\n  {example}")(checked)
        return work

    return register


@command("run", "shadowbench run table1 --preset quick --scene cloth --method bvh --method embree")
def run_(
    experiment: Annotated[
        str, typer.Argument(help="Name of an experiment; see shadowbench list experiments.")
    ],
    preset: Annotated[
        str | None, typer.Option("--preset", help="quick or paper. Default: by device.")
    ] = None,
    device: Device = None,
    scene: Annotated[
        list[str] | None, typer.Option("--scene", help="A scene's name or a file; again for more.")
    ] = None,
    method: Annotated[
        list[str] | None, typer.Option("--method", help="A method's name; again for more.")
    ] = None,
    setting: Settings = None,
    scene_dir: SceneDir = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Results folder, made where there is none. A second run goes on in it."),
    ] = None,
    size: Annotated[str | None, typer.Option("--size", help="Image size, such as 256x256.")] = None,
    frames: Annotated[
        int | None, typer.Option("--frames", help="Frames of an animated scene; 1: its middle one.")
    ] = None,
    samples: Annotated[
        int | None, typer.Option("--samples", help="Samples a frame and round, at least.")
    ] = None,
    rounds: Annotated[
        int | None, typer.Option("--rounds", help="How often each point is measured anew.")
    ] = None,
    budget: Annotated[
        float | None, typer.Option("--budget", help="Seconds of samples a point may take.")
    ] = None,
    timeout: Annotated[
        float | None, typer.Option("--timeout", help="Seconds before a silent method is given up.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", help="Seed of the order of rounds.")] = 0,
    memory_limit: Annotated[
        int | None,
        typer.Option(
            "--memory-limit",
            help="Bytes that a method may hold, on the device and, within 256 MiB, in the process. Default: 8 GiB.",
        ),
    ] = None,
    save_answers: Annotated[bool, typer.Option("--save-answers", help="Keep every raw answer.")] = False,
    score: Annotated[bool, typer.Option("--score/--no-score", help="Compare the answers with truth.")] = True,
    retry: Annotated[bool, typer.Option("--retry", help="Measure failed points again.")] = False,
    as_json: Json = False,
) -> int:
    """Measure an experiment: every method on every scene, checked against truth, drawn at the end."""
    from .commands.run import plan_run, run

    options = plan_run(
        experiment,
        preset,
        device,
        scene or (),
        method or (),
        setting or (),
        scene_dir,
        out,
        size,
        {"frames": frames, "samples": samples, "rounds": rounds, "budget_s": budget, "timeout_s": timeout},
        seed=seed,
        save_answers=save_answers,
        score=score,
        retry=retry,
        memory_limit=memory_limit,
    )
    return run(options, as_json)


@command("show", "shadowbench show table1 results/local/table1-quick")
def show_(
    experiment: Annotated[str, typer.Argument(help="Name of an experiment.")],
    folder: Annotated[
        Path | None, typer.Argument(help="A results folder. Default: the newest local one.")
    ] = None,
    as_json: Json = False,
) -> int:
    """Draw again from records, without timing."""
    from .commands.run import newest
    from .commands.show import show

    files = show(experiment, folder or newest(experiment), quiet=as_json)
    if as_json:
        print(json.dumps({"files": [str(file) for file in files]}))
    else:
        for file in files:
            print(f"written: {file}", file=sys.stderr)
    return 0


@command("list", "shadowbench list methods --json")
def list_(
    kind: Annotated[str, typer.Argument(help="methods, scenes or experiments.")],
    as_json: Json = False,
) -> int:
    """Say what there is to name: methods, scenes or experiments."""
    from .commands.listing import as_text, listing

    rows = listing(kind)
    print(json.dumps(rows, indent=1) if as_json else as_text(rows))
    return 0


@command("render", "shadowbench render cloth --method bvh --out cloth.png --size 512x512")
def render_(
    scene: Annotated[str, typer.Argument(help="A scene's name or a file.")],
    method: Annotated[str, typer.Option("--method", help="The method whose answers are shown.")],
    out: Annotated[
        Path,
        typer.Option("--out", help="The picture to write, .png; its folder is made where there is none."),
    ],
    size: Annotated[str, typer.Option("--size", help="Image size.")] = "512x512",
    frame: Annotated[int, typer.Option("--frame", help="Frame of an animated scene, from 0.")] = 0,
    camera: CameraPlace = None,
    fov: Fov = None,
    light: Lights = None,
    setting: Settings = None,
    device: Device = None,
    scene_dir: SceneDir = None,
) -> int:
    """Draw a scene from a method's answers, with the shadows that it found.

    A stand-in's picture says so in a caption below it.
    """
    from .commands.render import render
    from .runner.experiment import Entry
    from .runner.points import parse_settings

    (entry,) = parse_settings(setting or [], (Entry(method),))
    settings = dict(entry.settings)
    picture = render(scene, method, out, size, frame, device, scene_dir, settings, camera, fov, light)
    print(f"written: {picture}", file=sys.stderr)
    return 0


# These carry their own annotations: they are registered as they are.
command("check", "shadowbench check perspective_spherical --device cpu")(check)
command("plan", "shadowbench plan cloth --method uniform_grid")(plan)
command("verify", "shadowbench verify cloth bunny.ply --method bvh --json")(verify)
command("explain", "shadowbench explain cloth --pixel 120,80")(explain)
command("score", "shadowbench score results/local/table1-quick")(score)
command("keep", "shadowbench keep results/local/table1-quick --out results/my-machine/table1")(keep)


SEVERAL = ("--scene", "--method", "--set")
"""Options that take several values after one flag, once the command's own argument has been read."""


def spread_values(arguments: list[str]) -> list[str]:
    """``--scene a b`` as ``--scene a --scene b``, which is all that typer reads.

    Only after the command and one argument (``run table1 --scene a b``): before them a word may be the argument.
    """
    result: list[str] = []
    plain, flag, taken = 0, "", False
    for word in arguments:
        if word.startswith("-"):
            flag, taken = word, False
        elif flag in SEVERAL and taken and plain >= 2:
            result.append(flag)
        elif flag:
            # One value each; what follows a value (or a flag without one) is an argument again.
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
    try:
        app(sorted(words, key=lambda word: word not in EVERYWHERE), standalone_mode=True)
    except UserError as error:
        if os.environ.get(DEBUG):
            raise
        print(f"shadowbench: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    except MemoryError as error:
        if os.environ.get(DEBUG):
            raise
        reason = " ".join(str(error).split()) or "no more to be had"
        print(f"shadowbench: not enough memory ({reason}); choose a smaller --size", file=sys.stderr)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        print("shadowbench: interrupted", file=sys.stderr)
        raise SystemExit(INTERRUPTED) from None
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        raise SystemExit(INTERRUPTED) from None


if __name__ == "__main__":
    main()
