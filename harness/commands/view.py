"""``shadowbench view``: a page on this machine to look at a scene through a method: drag the light and the camera."""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import UserError
from ..runner.machine.lock import MACHINE
from ..runner.planning.experiment import PACKAGE, parse_size
from .options import (
    AllowMissing,
    CameraOf,
    CameraPlace,
    Device,
    FileFrames,
    Fov,
    FrameRate,
    Lights,
    LightsOf,
    SceneDir,
    Size,
    view_of,
)

if TYPE_CHECKING:
    from .viewer.frames import Frames

DEFAULT_SCENE = "cloth"
LARGEST = 1 << 22
"""Pixels of a frame on the page."""


@MACHINE.restored()
def view(
    scene: Annotated[str, typer.Argument(help="Name of a scene, or a mesh file.")] = DEFAULT_SCENE,
    method: Annotated[
        str | None,
        typer.Option(
            "--method",
            metavar="NAME",
            help="The method to begin with. Default: ray_grids, or where it cannot trace the scene the first that can.",
        ),
    ] = None,
    size: Size = "256x256",
    frame: Annotated[int, typer.Option("--frame", metavar="N", help="Frame to begin with, from 0.")] = 0,
    camera: CameraPlace = None,
    fov: Fov = None,
    light: Lights = None,
    camera_of: CameraOf = None,
    light_of: LightsOf = None,
    frames: FileFrames = None,
    rate: FrameRate = None,
    allow_missing: AllowMissing = False,
    device: Device = None,
    scene_dir: SceneDir = None,
    port: Annotated[
        int, typer.Option("--port", metavar="PORT", help="Port on 127.0.0.1. Default: a free one.")
    ] = 0,
    browser: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False,
) -> int:
    """Show a scene on a page on this machine: drag the light and the camera, play the animation, switch the method.

    The page shows what the method answers, the time of its passes, and on request its wrong pixels. Only this machine
    reaches it, with the token in the address. The command ends when the page is closed.
    """
    from ..frame.devices import find_device
    from ..scene.prepared import prepare
    from .viewer.frames import Frames
    from .viewer.server import Server, listen

    width, height = parse_size(size)
    if width * height > LARGEST:
        raise UserError(f"--size {size}: more than {LARGEST:,} pixels; choose fewer for a page")
    place = find_device(device)
    listening = listen(port)
    try:
        described = view_of(camera, fov, light, frames, rate, allow_missing, camera_of, light_of).resolved(
            scene, scene_dir
        )
        MACHINE.share()
        prepared = prepare(described)
        if not 0 <= frame < prepared.frame_count:
            raise UserError(f"--frame {frame}: {scene} has frames 0 to {prepared.frame_count - 1}")
        shown = Frames(prepared, width, height, place)
        chosen = method or default_method(shown)
        shown.session(chosen)
        MACHINE.release()
        facts = {
            "title": described.title, "stand_in": described.stand_in,
            "left_out": described.source.left_out, "method": chosen, "frame": frame,
            "frames": prepared.frame_count, "methods": shown.methods(),
        }  # fmt: skip
        server = Server(shown, facts, listening)
        print(server.address, flush=True)
        print(
            "open this address in a browser; closing the page ends the command", file=sys.stderr, flush=True
        )
        if browser:
            import webbrowser

            webbrowser.open(server.address)
        server.run()
    finally:
        listening.close()
    return 0


def default_method(frames: Frames) -> str:
    """The default method of the page (see the list of rivals); if it cannot trace the scene, the first one that can."""
    proposed = importlib.import_module(f"{PACKAGE}._rivals").OURS.method
    able = [row["name"] for row in frames.methods() if not row["reason"]]
    return proposed if proposed in able or not able else able[0]
