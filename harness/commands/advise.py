"""``shadowbench advise``: which structure is the fastest for a scene on this machine, and whether its answers are right."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import UserError, did_you_mean
from ..scene.overrides import Lighting
from ..texts import numbered
from .options import command

if TYPE_CHECKING:
    from ..scene.chosen_view import ChosenView

EXPERIMENT = "advise"
MOVES = {  # words of `--moves`, names of `scene.overrides.MOVED` that leave something to do, and what tables say
    "camera": "the camera moves",
    "light": "a light moves",
    "part": "part of the geometry moves",
    "all": "everything moves",
}
MOST_LIGHTS = 1024


@command(
    f"""
    Say which structure is the fastest for a scene, here.
    shadowbench advise mesh.ply --lights 4

    scene         Name of a scene, or a mesh file.
    --lights N    Number of lights: copies of the scene's first one, spread around it.
    --moves WHAT  What has moved since the last frame: {", ".join(MOVES)}. Only what depends on it is rebuilt. Default: all.
    --size WxH    Image size. Default: 256x256 on a CPU, 1024x1024 on a GPU.
    --out PATH    Results folder. Default: one in results/local.
    """,
    without=["frames"],
)
def advise(
    scene: str, lights: int | None = None, moves: str | None = None, size: str | None = None,
    device: str | None = None, scene_dir: Path | None = None, memory_limit: int | None = None,
    out: Path | None = None, as_json: bool = False, *, view: ChosenView,
) -> int:  # fmt: skip
    """Measure a shortlist of structures on a scene and say which is the fastest: of the exact ones, and of all.

    It takes about two minutes on a CPU and half a minute on a GPU, besides compiling kernels for the first time. The
    table is sorted by time, with wrong answers, memory and what is rebuilt in each frame; below it stands what would
    change the answer. A second call measures only what is not yet in the results folder. Exit code 1 if a point failed.
    """
    from .run import RESULTS, plan_run, run

    if lights is not None and (view.lights or view.lights_of):
        raise UserError("--lights and --light: give the number of lights or their places, not both")
    lighting = lighting_of(lights, moves)
    options = plan_run(
        EXPERIMENT, device=device, scenes=[scene], scene_dir=scene_dir, out=out, size=size, view=view,
        memory_limit=memory_limit,
    )  # fmt: skip
    preset = dataclasses.replace(options.preset, lightings=(lighting,))
    place = f"{options.device.replace(':', '')}-{preset.width}x{preset.height}"
    words = [EXPERIMENT, Path(scene).stem, place, *lighting.label.replace(",", "").split()]
    options = dataclasses.replace(options, preset=preset, out=out or RESULTS / "-".join(words))
    return run(options, as_json)


def lighting_of(lights: int | None, moves: str | None) -> Lighting:
    """What ``--lights`` and ``--moves`` change. Raises :class:`UserError` for a number or a word that is not known."""
    if lights is not None and not 1 <= lights <= MOST_LIGHTS:
        raise UserError(f"--lights {lights}: must be 1 to {MOST_LIGHTS}")
    if moves is not None and moves not in MOVES:
        raise UserError(f"--moves {moves!r}: unknown{did_you_mean(moves, MOVES)}")
    words = [] if lights is None else [numbered(lights, "light")]
    words += [] if moves is None else [MOVES[moves]]
    return Lighting(", ".join(words), count=lights or 0, moved=moves)
