"""The command line: ``shadowbench COMMAND``. It only reads arguments; :mod:`.commands` does the work.

Each command imports what it needs when it runs; those that declare their own options are modules that are imported when they
are asked for. What all commands share, such as exit codes, is in :mod:`.commands.program`.
"""

from __future__ import annotations

import functools
import importlib
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .commands import program
from .commands.options import (
    AllowMissing,
    Device,
    Frame,
    FrameRate,
    Json,
    MemoryLimit,
    OneMethod,
    SceneDir,
    Settings,
    Size,
    complete_experiment,
    complete_scene,
    method_option,
    number_or_frames,
    option,
    takes_view,
    view_of,
)
from .commands.program import app as app
from .commands.program import command
from .errors import UserError, say

if TYPE_CHECKING:
    from .runner.planning.run_options import Options
    from .scene.chosen_view import ChosenView


@command("run", "shadowbench run table1 --scene cloth --method warp_bvh --method embree")
@takes_view(but=["frames"])
def run_(
    experiment: Annotated[
        str,
        typer.Argument(
            help="Name of an experiment; see shadowbench list experiments.", autocompletion=complete_experiment
        ),
    ],
    preset: Annotated[
        str | None,
        option("--preset", "NAME", "Name of a preset, such as quick or paper. Default: depends on the device."),
    ] = None,
    device: Device = None,
    scene: Annotated[
        list[str] | None,
        option(
            "--scene",
            "SCENE",
            "Name of a scene, or a mesh file. Repeatable. Default: those of the preset.",
            autocompletion=complete_scene,
        ),
    ] = None,
    method: Annotated[list[str] | None, method_option("those of the preset")] = None,
    setting: Settings = None,
    scene_dir: SceneDir = None,
    out: Annotated[
        Path | None,
        option(
            "--out",
            "PATH",
            "Results folder; created if missing. A second run measures only missing points. "
            "Default: results/local/EXPERIMENT-PRESET.",
        ),
    ] = None,
    size: Annotated[
        str | None, option("--size", "WxH", "Image size, such as 256x256. Default: that of the preset.")
    ] = None,
    frames: Annotated[
        str | None,
        option(
            "--frames",
            "N or A:B:STEP",
            "Number of frames of an animated scene that are measured; 1: the middle frame. Default: the preset's. "
            "With colons: of an animated file the first frame, the last and the step, counted from 0.",
        ),
    ] = None,
    samples: Annotated[
        int | None,
        option("--samples", "N", "Minimum number of timing samples per frame and round. Default: the preset's."),
    ] = None,
    rounds: Annotated[
        int | None,
        option(
            "--rounds", "N", "Number of times that each point is measured, in interleaved order. Default: the preset's."
        ),
    ] = None,
    budget: Annotated[
        float | None,
        option("--budget", "SECONDS", "Time limit for the timing samples of a point. Default: the preset's."),
    ] = None,
    timeout: Annotated[
        float | None,
        option(
            "--timeout",
            "SECONDS",
            "Time without a reply after which a point has the status timeout. Default: the preset's.",
        ),
    ] = None,
    seed: Annotated[int, option("--seed", "N", "Seed of the random order of the points in each round.")] = 0,
    memory_limit: MemoryLimit = None,
    save_answers: Annotated[
        bool, typer.Option("--save-answers", help="Save the answers of every pixel as arrays.")
    ] = False,
    score: Annotated[
        bool, typer.Option("--score/--no-score", help="Compare the answers with the exact reference.")
    ] = True,
    retry: Annotated[bool, typer.Option("--retry", help="Measure points again that failed or timed out.")] = False,
    extra: Annotated[
        list[str] | None,
        option(
            "--with",
            "NAME",
            "Untimed work that is not about the scene, such as hard-cases of the experiment accuracy. Repeatable.",
        ),
    ] = None,
    cluster: Annotated[
        str | None,
        option(
            "--cluster",
            "local|ADDRESS",
            "Measure on several GPUs: those of this machine, or the workers of a Dask scheduler. Needs the extra "
            "cluster; see docs/cluster.md.",
        ),
    ] = None,
    dry_run: Annotated[
        bool,
        typer.Option(
            "--dry-run",
            help="Measure nothing: list the points to be measured and those already measured, with the expected time.",
        ),
    ] = False,
    as_json: Json = False,
    *,
    view: ChosenView,
) -> int:
    """Measure an experiment: every method on every scene. Compare the answers with the exact reference, then draw tables
    and figures.

    Points that have a record in the results folder are not measured again, so an interrupted run continues where it
    stopped. Exit code 1 if a point failed, or could not be scored.
    """
    from .commands.run import dry, plan_run, run, run_on_cluster

    count, seen = number_or_frames(frames, view)

    def planned(elsewhere: str | None = None) -> Options:
        return plan_run(
            experiment,
            preset,
            device,
            scene or (),
            method or (),
            setting or (),
            scene_dir,
            out,
            size,
            {"frames": count, "samples": samples, "rounds": rounds, "budget_s": budget, "timeout_s": timeout},
            seen,
            elsewhere,
            seed=seed,
            save_answers=save_answers,
            score=score,
            retry=retry,
            memory_limit=memory_limit,
            extras=tuple(dict.fromkeys(extra or ())),
        )

    if cluster is not None:
        if dry_run:
            raise UserError("--dry-run --cluster: the points are known to the workers alone; leave out one of the two")
        return run_on_cluster(cluster, experiment, device, planned, as_json)
    options = planned()
    return dry(options, as_json) if dry_run else run(options, as_json)


@command("show", "shadowbench show table1 results/local/table1-quick")
def show_(
    experiment: Annotated[str, typer.Argument(help="Name of an experiment.", autocompletion=complete_experiment)],
    folder: Annotated[
        Path | None,
        typer.Argument(help="A results folder. Default: the newest folder of this experiment in results/local."),
    ] = None,
    out: Annotated[
        Path | None, option("--out", "PATH", "Folder to write to. Default: the results folder itself.")
    ] = None,
    as_json: Json = False,
) -> int:
    """Draw the tables and figures of an experiment from its records. Nothing is measured."""
    from .commands.run import newest
    from .commands.show import show

    files = show(experiment, folder or newest(experiment), quiet=as_json, out=out)
    if as_json:
        print(json.dumps({"files": [str(file) for file in files]}))
    else:
        for file in files:
            say(f"written: {file}")
    return 0


@command("list", "shadowbench list methods bvh2")
def list_(
    kind: Annotated[str, typer.Argument(help="What to list: methods, scenes or experiments.")],
    files: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAME",
            help="Methods: their parameters. Experiments: their presets. Scenes or mesh files: what they hold, their "
            "cameras and lights.",
        ),
    ] = None,
    rate: FrameRate = None,
    allow_missing: AllowMissing = False,
    scene_dir: SceneDir = None,
    as_json: Json = False,
) -> int:
    """List the methods, scenes or experiments; of a method its parameters; of an experiment its presets; of a file its
    triangles and frames, its cameras and its lights."""
    from .commands.listing import rows_of, show

    rows = rows_of(kind, files or [], lambda: view_of(rate=rate, allow_missing=allow_missing), scene_dir, not as_json)
    if as_json:
        print(json.dumps(rows, indent=1))
    else:
        show(rows)
    return 0


@command("render", "shadowbench render cloth --out cloth.png --size 512x512")
@takes_view(but=["frames"])
def render_(
    scene: Annotated[
        list[str],
        typer.Argument(help="Name of a scene, or a mesh file. With --animate there may be several, side by side."),
    ],
    method: OneMethod = None,
    out: Annotated[Path | None, option("--out", "PATH", "PNG file to write; its folder is created if missing.")] = None,
    animation: Annotated[
        Path | None,
        option(
            "--animate", "FILE", "WebP file to write instead: every frame, or of a still scene a turn of its lights."
        ),
    ] = None,
    size: Size = "512x512",
    frame: Frame = 0,
    frames: Annotated[
        str | None,
        option(
            "--frames",
            "N or A:B:STEP",
            "Number of frames of the animation. Default: all. With colons: of an animated file the first frame, the "
            "last and the step, counted from 0.",
        ),
    ] = None,
    seconds: Annotated[
        float | None, option("--seconds", "SECONDS", "Length of the animation. Default: as the file says, else 4.")
    ] = None,
    setting: Settings = None,
    device: Device = None,
    scene_dir: SceneDir = None,
    *,
    view: ChosenView,
) -> int:
    """Render a scene from the hits and shadow bits that a method finds.

    The picture of a stand-in scene has a caption that says so.
    """
    from .commands.default_method import settings_by_method
    from .commands.render import animate, render

    settings = settings_by_method(setting or [])
    count, seen = number_or_frames(frames, view)
    if (out is None) == (animation is None):
        raise UserError("render: give --out FILE.png for a picture, or --animate FILE.webp for an animation")
    if animation is not None:
        picture = animate(scene, method, animation, size, count, seconds, device, scene_dir, settings, seen)
    else:
        assert out is not None
        if len(scene) > 1:
            raise UserError(f"render {' '.join(scene)}: --out shows one scene; --animate shows several")
        picture = render(scene[0], method, out, size, frame, device, scene_dir, settings, seen)
    say(f"written: {picture}")
    return 0


ELSEWHERE = {
    "advise": ("advise", "shadowbench advise mesh.ply --lights 4"),
    "check": ("check", "shadowbench check perspective_spherical --device cpu"),
    "plan": ("plan", "shadowbench plan cloth --method uniform_grid"),
    "verify": ("verify", "shadowbench verify cloth bunny.ply --method warp_bvh --json"),
    "explain": ("verify", "shadowbench explain cloth --pixel 120,80"),
    "score": ("verify", "shadowbench score results/local/table1-quick"),
    "report": ("report", "shadowbench report results/nvidia-h200 --out report.html"),
    "compare": ("compare", "shadowbench compare results/local/old results/local/new --fail-on slower"),
    "view": ("view", "shadowbench view cloth --size 256x256"),
    "scenes": ("scenes", "shadowbench scenes fetch sibenik buddha --scene-dir scenes"),
    "new-method": ("new_method", "shadowbench new-method my_method"),
    "cache": ("cache", "shadowbench cache clear"),
    "keep": ("keep", "shadowbench keep results/local/table1-quick --out results/my-machine/table1"),
}
"""Commands whose functions declare their own options: the module of :mod:`.commands` and an example. The function is called
as the command."""


@functools.cache
def register(name: str) -> None:
    """Import a command of :data:`ELSEWHERE` and make it part of the program."""
    module, example = ELSEWHERE[name]
    found = importlib.import_module(f"{__package__}.commands.{module}")
    command(name, example)(getattr(found, name.replace("-", "_")))


def wanted(words: list[str]) -> list[str]:
    """Which commands of :data:`ELSEWHERE` a command line needs: the one that it names; all, where it names none and is not
    answered before, as for help, completion and misspelt names."""
    first = next((word for word in words if not word.startswith("-")), "")
    if first in ELSEWHERE:
        return [first]
    here = {info.name for info in app.registered_commands} - set(ELSEWHERE)
    return [] if first in here or "--version" in words else [*ELSEWHERE]


def main() -> None:
    """The ``shadowbench`` command."""
    for name in wanted(sys.argv[1:]):
        register(name)
    program.main()


if __name__ == "__main__":
    main()
