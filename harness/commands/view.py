"""``shadowbench view``: a page on this machine to look at a scene through a method: drag the light and the camera."""

import shlex
import sys
import webbrowser
from pathlib import Path

from ..errors import UserError
from ..frame.devices import find_device
from ..frame.registry import about, method_names
from ..runner.machine.lock import MACHINE
from ..runner.planning.experiment import parse_size
from ..scene.chosen_view import ChosenView
from ..scene.prepared import prepare
from .answering import default_method, require_frame, settings_by_method
from .options import ONE_METHOD, command
from .viewer.frames import LARGEST, Frames, Wish
from .viewer.server import Server, listen

DEFAULT_SCENE = "cloth"


@command(
    f"""
    Show a scene on an interactive page on this machine.
    shadowbench view cloth --size 256x256

    scene          Name of a scene, or a mesh file.
    --method NAME  {ONE_METHOD}
    --frame N      Frame to begin with, from 0. Default: the middle.
    --port PORT    Port on 127.0.0.1. Default: a free one.
    --open         Open the page in the browser.
    """
)
def view(
    scene: str = DEFAULT_SCENE, method: str | None = None, setting: list[str] | None = None, size: str = "256x256",
    frame: int | None = None, device: str | None = None, scene_dir: Path | None = None, port: int = 0,
    browser: bool = False, *, view: ChosenView,
) -> int:  # fmt: skip
    """Show a scene on a page on this machine: drag the light and the camera, walk, play the animation, compare two methods.

    The page shows what the method answers, the time of its passes, and on request its wrong pixels. Only this machine
    reaches it, with the token in the address. The command ends when the page is closed.
    """
    width, height = parse_size(size)
    if width * height > LARGEST:
        raise UserError(f"--size {size}: more than {LARGEST:,} pixels; choose fewer for a page")
    place, settings = find_device(device), settings_by_method(setting)
    with listen(port) as listening:
        described = view.resolved(scene, scene_dir)
        chosen = method or default_method(described, place)
        MACHINE.share_beside(place)
        prepared = prepare(described)
        start = prepared.frame_count // 2 if frame is None else frame
        require_frame(prepared, start, scene)
        shown = Frames(prepared, place, settings)
        shown.session(Wish(chosen, (width, height)))
        MACHINE.release()
        facts = {
            "title": described.title, "stand_in": described.stand_in, "left_out": described.source.left_out,
            "state": {"method": chosen, "frame": start, "size": [width, height]}, "largest": LARGEST,
            "frames": prepared.frame_count, "box": shown.box(), "scene": shlex.quote(scene),
            "fov": "" if view.fov is None else f" --fov {view.fov:g}",
            "methods": [{"name": name, "title": about(name), "reason": ""} for name in method_names()],
        }  # fmt: skip
        server = Server(shown, facts, listening)
        print(server.address, flush=True)
        print("open this address in a browser; closing the page ends the command", file=sys.stderr, flush=True)
        if browser:
            webbrowser.open(server.address)
        server.run()
    return 0
