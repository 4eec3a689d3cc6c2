"""Options that several commands share."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import UserError

if TYPE_CHECKING:  # every command needs this module, and few need what makes scenes
    from ..scene.chosen_view import ChosenView
    from ..scene.scene import Vector

FASTEST = 1e6
"""Largest rate of an animation, frames a second."""


def option(flag: str, value: str, help: str, **more: Any) -> Any:
    """An option of a command. ``value``: what stands for its value in the help."""
    return typer.Option(flag, metavar=value, help=help, **more)


def _starting(incomplete: str, names: Iterable[str]) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]


def complete_experiment(incomplete: str) -> list[str]:
    """For the completion of a shell: the names of experiments that start so."""
    from ..runner.planning.experiment import experiment_names

    return _starting(incomplete, experiment_names())


def complete_method(incomplete: str) -> list[str]:
    """The names of methods that start so."""
    from ..frame.registry import method_names

    return _starting(incomplete, method_names())


def complete_scene(incomplete: str) -> list[str]:
    """The names of scenes that start so; a shell completes files itself."""
    from ..scene.names import NAMES

    return _starting(incomplete, NAMES)


def method_option(default: str) -> Any:
    """``--method``, for the methods that a command works on. ``default``: which those are without it."""
    return option(
        "--method", "NAME", f"Name of a method. Repeatable. Default: {default}.", autocompletion=complete_method
    )


Methods = Annotated[list[str] | None, method_option("all methods")]
OneMethod = Annotated[
    str | None,
    option(
        "--method",
        "NAME",
        "The method that traces it. Default: ray_grids, or where it cannot trace the scene the first that can.",
        autocompletion=complete_method,
    ),
]
Settings = Annotated[list[str] | None, option("--set", "METHOD.PARAM=VALUE", "Parameter of a method. Repeatable.")]
Device = Annotated[str | None, option("--device", "DEVICE", "cpu or cuda:0. Default: cuda:0 if present, else cpu.")]
Size = Annotated[str, option("--size", "WxH", "Image size, such as 512x512.")]
Frame = Annotated[int, option("--frame", "N", "Frame of an animated scene, from 0.")]
SceneDir = Annotated[
    Path | None,
    option("--scene-dir", "FOLDER", "Folder of original scenes. Default: the environment variable SHADOWBENCH_SCENES."),
]
MemoryLimit = Annotated[
    int | None,
    option(
        "--memory-limit",
        "BYTES",
        "Memory that a method may use, bytes: its Warp arrays on any device, and the growth of its process on the "
        "host (plus 256 MiB for compilers). A method that needs more is rejected. What exceeds it by gigabytes on the host, "
        "or at all on a GPU, is not taken in the first place. Default: 8 GiB.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
CameraPlace = Annotated[
    tuple[str, str] | None,
    option(
        "--camera", "EYE TARGET", "Position of the camera and the point it looks at, each X,Y,Z. Default: the scene's."
    ),
]
Fov = Annotated[float | None, option("--fov", "DEGREES", "Vertical field of view, degrees. Default: the scene's.")]
Lights = Annotated[
    list[str] | None,
    option("--light", "X,Y,Z", "Position of a point light that replaces the scene's lights. Repeatable."),
]


LightSize = Annotated[
    float | None,
    option("--light-size", "SIZE", "Give every light an area of this size, in the scene's units: shadows become soft."),
]
LightSamples = Annotated[
    int | None,
    option(
        "--light-samples",
        "N",
        "Points of each light's area that shadow rays are traced to. Default: the scene's, or 16.",
    ),
]
LightShape = Annotated[
    str | None,
    option("--light-shape", "SHAPE", "Shape of that area: sphere, disc or rectangle. Default: the scene's, or sphere."),
]
CameraOf = Annotated[
    str | None,
    option(
        "--camera-of", "NAME", "Name of a camera that the scene's file has; shadowbench list scenes FILE names them."
    ),
]
LightsOf = Annotated[
    list[str] | None,
    option(
        "--light-of", "NAME", "Name of a light that the scene's file has, in place of the scene's lights. Repeatable."
    ),
]
FileFrames = Annotated[
    str | None,
    option(
        "--frames",
        "A:B:STEP",
        "Frames of an animated file: the first, the last and the step, counted from 0. Default: all.",
    ),
]
FrameRate = Annotated[
    float | None,
    option("--rate", "FPS", "Frames a second at which the animation of a file is sampled. Default: as the file says."),
]
AllowMissing = Annotated[
    bool,
    typer.Option(
        "--allow-missing", help="Leave out what a missing file would have held, instead of refusing the scene."
    ),
]


VIEW = {
    "camera": CameraPlace, "fov": Fov, "light": Lights, "camera_of": CameraOf, "light_of": LightsOf, "frames": FileFrames,
    "rate": FrameRate, "allow_missing": AllowMissing, "light_size": LightSize, "light_samples": LightSamples,
    "light_shape": LightShape,
}  # fmt: skip
"""The options that choose what is seen of a scene: the parameters of :func:`view_of`."""

Command = Callable[..., int]


def takes_view(but: Iterable[str] = ()) -> Callable[[Command], Command]:
    """Give a command the options :data:`VIEW`, ``but`` some; its parameter ``view`` is what they ask of a scene."""

    def with_options(work: Command) -> Command:
        names = [name for name in VIEW if name not in but]

        @functools.wraps(work)
        def called(*arguments: Any, **given: Any) -> int:
            view = view_of(**{name: given.pop(name) for name in names if name in given})
            return work(*arguments, **given, view=view)

        own = [
            one.replace(annotation=eval(str(one.annotation), work.__globals__))  # as typer evaluates them
            for one in inspect.signature(work).parameters.values()
            if one.name != "view"
        ]
        kind = inspect.Parameter.KEYWORD_ONLY
        more = [
            inspect.Parameter(name, kind, annotation=VIEW[name], default=False if name == "allow_missing" else None)
            for name in names
        ]
        called.__signature__ = inspect.Signature([*own, *more], return_annotation=int)  # type: ignore[attr-defined]
        called.__annotations__ = {one.name: one.annotation for one in (*own, *more)}
        return called

    return with_options


def view_of(
    camera: tuple[str, str] | None = None,
    fov: float | None = None,
    light: list[str] | None = None,
    frames: str | None = None,
    rate: float | None = None,
    allow_missing: bool = False,
    camera_of: str | None = None,
    light_of: list[str] | None = None,
    light_size: float | None = None,
    light_samples: int | None = None,
    light_shape: str | None = None,
) -> ChosenView:
    """What the options :data:`VIEW` ask of a scene. Raises :class:`UserError` for a malformed value."""
    from ..scene.chosen_view import ChosenView
    from ..scene.readers.checks import Wanted, frames_of
    from ..scene.scene import Light
    from ..scene.targets import SHAPE, with_area

    if camera is not None and camera_of is not None:
        raise UserError("--camera and --camera-of: give one of them")
    ends = None if camera is None else (_place("--camera", camera[0]), _place("--camera", camera[1]))
    if rate is not None and not 0.0 < rate <= FASTEST:
        raise UserError(f"--rate {rate:g}: must lie between 0 and {FASTEST:g} frames a second")
    wanted = Wanted(frames_of(frames), allow_missing, rate)
    places = tuple(_place("--light", text) for text in light or ())
    area = light_size, light_samples, light_shape
    any_light = Light((0.0, 0.0, 0.0), shape=SHAPE)
    with_area(any_light, light_shape, light_size, light_samples)  # refuses wrong values before a scene is made
    return ChosenView(ends, fov, places, wanted, camera_of, tuple(light_of or ()), *area)


def number_or_frames(text: str | None, view: ChosenView) -> tuple[int | None, ChosenView]:
    """The value of a ``--frames`` that takes either a number of frames, or the frames A:B:STEP of a file: the number, and
    the view of these frames."""
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
