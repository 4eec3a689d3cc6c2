"""Commands made of plain functions: their parameters become arguments and options, each described by a row of text.

A command's text is a line for the list of commands, an example, and a row for each parameter: what a user types, two
spaces, and what it means. Further lines of a row are indented. A name in capitals is shown so in the help. Types and
defaults are those of the parameters::

    Compare every answer of every method with the reference.
    shadowbench verify cloth bunny.ply --method warp_bvh --json

    scene            Names of scenes, or mesh files.
    --size WxH       Image size, such as 512x512.
"""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable, Collection
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from ..errors import UserError
from ..runner.machine.lock import MACHINE

if TYPE_CHECKING:  # every command needs this module, and few need what makes scenes
    from ..scene.chosen_view import ChosenView
    from ..scene.scene import Vector

FASTEST = 1e6  # largest rate of an animation, frames a second

SHARED = """
--method NAME               Name of a method. Repeatable. Default: all methods.
--set METHOD.PARAM=VALUE    Parameter of a method. Repeatable.
--device DEVICE             cpu or cuda:0. Default: cuda:0 if present, else cpu.
--size WxH                  Image size, such as 512x512.
--frame N                   Frame of an animated scene, from 0.
--scene-dir FOLDER          Folder of original scenes. Default: the environment variable SHADOWBENCH_SCENES.
--memory-limit BYTES        Memory that a method may use, bytes: its Warp arrays on any device, and the growth of its process
                            on the host (plus 256 MiB for compilers). A method that needs more is rejected. What exceeds it
                            by gigabytes on the host, or at all on a GPU, is not taken in the first place. Default: 8 GiB.
--json                      Print the result as JSON.
--camera EYE TARGET         Position of the camera and the point it looks at, each X,Y,Z. Default: the scene's.
--fov DEGREES               Vertical field of view, degrees. Default: the scene's.
--light X,Y,Z               Position of a point light that replaces the scene's lights. Repeatable.
--camera-of NAME            Name of a camera that the scene's file has; shadowbench list scenes FILE names them.
--light-of NAME             Name of a light that the scene's file has, in place of the scene's lights. Repeatable.
--frames A:B:STEP           Frames of an animated file: the first, the last and the step, counted from 0. Default: all.
--rate FPS                  Frames a second at which the animation of a file is sampled. Default: as the file says.
--allow-missing             Leave out what a missing file would have held, instead of refusing the scene.
--light-size SIZE           Give every light an area of this size, in the scene's units: shadows become soft.
--light-samples N           Points of each light's area that shadow rays are traced to. Default: the scene's, or 16.
--light-shape SHAPE         Shape of that area: sphere, disc or rectangle. Default: the scene's, or sphere.
"""
"""Options that mean the same in several commands."""

ONE_METHOD = "The method that traces it. Default: ray_grids, or where it cannot trace the scene the first that can."
"""What ``--method`` means to a command that shows a scene."""

PARAMETERS = {  # parameters that are not called as their options, most of which Python has a use for
    "set": "setting", "json": "as_json", "with": "extras", "open": "browser", "all": "everything",
    "every_pixel": "everything", "animate": "animation",
}  # fmt: skip

ROW = re.compile(r"(?P<head>\S+)(?: (?P<value>\S+(?: \S+)*))?  +(?P<text>.+)")

Work = Callable[..., int]


def described(texts: str) -> dict[str, Any]:
    """What typer is to know of each parameter that rows of text describe, by the parameter's name."""
    found = {}
    for row in re.split(r"\n+(?=\S)", texts.strip()):
        parts = ROW.fullmatch(re.sub(r"\n +", " ", row))
        assert parts, row
        head, value, text = parts.group("head", "value", "text")
        name = head.removeprefix("--").partition("/")[0].replace("-", "_").lower()
        name = PARAMETERS.get(name, name)
        more: dict[str, Any] = {"help": text, "autocompletion": completion(name) if name in COMPLETED else None}
        if head.startswith("--"):
            found[name] = typer.Option(head, metavar=value, **more)
        else:
            found[name] = typer.Argument(metavar=head if head.isupper() else None, **more)
    return found


COMPLETED = ("experiment", "method", "scene")  # Parameters whose names a shell can complete. It completes files itself.


def completion(kind: str) -> Callable[[str], list[str]]:
    """For a shell: the names of a kind that begin as what is typed."""

    def names(incomplete: str) -> list[str]:
        from ..frame.registry import method_names
        from ..runner.planning.experiment import experiment_names
        from ..scene.names import NAMES

        known = {"experiment": experiment_names, "method": method_names, "scene": lambda: NAMES}[kind]()
        return [name for name in known if name.startswith(incomplete)]

    return names


def command(text: str, without: Collection[str] = ()) -> Callable[[Work], Work]:
    """Make a function that returns its exit code a command. What its ``text`` leaves out is described by :data:`SHARED`. One
    that has a parameter ``view`` gets those of :func:`view_of`, ``without`` some, in its place.

    What the command takes of the lock on the machine, it gives back.
    """
    short, example, *rows = inspect.cleandoc(text).split("\n", 2)
    known = described("\n".join([SHARED, *rows]))

    def made(work: Work) -> Work:
        own = dict(inspect.signature(work).parameters)
        hints = get_type_hints(work, localns={"ChosenView": object})
        seen: dict[str, inspect.Parameter] = {}
        if own.pop("view", None):
            taken = {*own, *without}
            seen = {name: one for name, one in inspect.signature(view_of).parameters.items() if name not in taken}
            hints |= get_type_hints(view_of, localns={"ChosenView": object})

        @functools.wraps(work)
        def called(*arguments: Any, **given: Any) -> int:
            if seen:
                given["view"] = view_of(**{name: given.pop(name) for name in seen if name in given})
            with MACHINE.restored():
                return work(*arguments, **given)

        parameters = [one.replace(annotation=Annotated[hints[name], known[name]]) for name, one in (own | seen).items()]
        called.__annotations__ = {one.name: one.annotation for one in parameters}
        vars(called).update(short=short, example=example, __signature__=inspect.Signature(parameters))
        return called

    return made


def view_of(
    camera: tuple[str, str] | None = None, fov: float | None = None, light: list[str] | None = None,
    camera_of: str | None = None, light_of: list[str] | None = None, frames: str | None = None,
    rate: float | None = None, allow_missing: bool = False, light_size: float | None = None,
    light_samples: int | None = None, light_shape: str | None = None,
) -> ChosenView:  # fmt: skip
    """What the options of these names ask of a scene. Raises :class:`UserError` for a malformed value."""
    from ..scene.chosen_view import ChosenView
    from ..scene.readers.checks import Wanted, frames_of
    from ..scene.scene import Light
    from ..scene.targets import SHAPE, with_area

    if camera is not None and camera_of is not None:
        raise UserError("--camera and --camera-of: give one of them")
    ends = None if camera is None else (_place("--camera", camera[0]), _place("--camera", camera[1]))
    if rate is not None and not 0.0 < rate <= FASTEST:
        raise UserError(f"--rate {rate:g}: must be more than 0 and at most {FASTEST:g} frames a second")
    wanted = Wanted(frames_of(frames), allow_missing, rate)
    places = tuple(_place("--light", text) for text in light or ())
    area = light_size, light_samples, light_shape
    any_light = Light((0.0, 0.0, 0.0), shape=SHAPE)
    with_area(any_light, light_shape, light_size, light_samples)  # refuses wrong values before a scene is made
    return ChosenView(ends, fov, places, wanted, camera_of, tuple(light_of or ()), *area)


def number_or_frames(text: str | None, view: ChosenView) -> tuple[int | None, ChosenView]:
    """The value of a ``--frames`` that takes a number of frames, or A:B:STEP of a file: the number, and the view."""
    from ..scene.readers.checks import frames_of

    if text is None or ":" in text:
        return None, replace(view, wanted=replace(view.wanted, frames=frames_of(text)))
    if not re.fullmatch(r"-?\d+", text):
        raise UserError(f"--frames {text!r}: give a number of frames, or those of a file as A:B:STEP")
    return int(text), view


def _place(option: str, text: str) -> Vector:
    from ..scene.scene import FARTHEST

    try:
        x, y, z = (float(number) for number in text.split(","))
    except ValueError:
        raise UserError(f"{option} {text!r}: give three numbers, as in {option} 0,1.7,4") from None
    if any(number != number for number in (x, y, z)):
        raise UserError(f"{option} {text!r}: nan is not a number; give three numbers, as in {option} 0,1.7,4")
    if not all(abs(number) <= FARTHEST for number in (x, y, z)):
        raise UserError(f"{option} {text!r}: a number is outside the range of float32, -3.4e38 to 3.4e38")
    return x, y, z


def checked_limit(memory: int | None) -> int | None:
    """The value of ``--memory-limit``. Raises :class:`UserError` unless it is more than 0."""
    if memory is not None and memory <= 0:
        raise UserError(f"--memory-limit {memory}: must be more than 0 bytes")
    return memory
