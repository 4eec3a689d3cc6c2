"""Options that several commands share."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from ..errors import UserError
from ..scene.declaration import FARTHEST
from ..scene.moment import ray_tables
from ..scene.scene import Light, Scene, Vector

Methods = Annotated[
    list[str] | None, typer.Option("--method", help="Name of a method. Repeatable. Default: all methods.")
]
Settings = Annotated[
    list[str] | None, typer.Option("--set", help="Parameter of a method, as method.param=value. Repeatable.")
]
Device = Annotated[
    str | None, typer.Option("--device", help="cpu or cuda:0. Default: cuda:0 if present, else cpu.")
]
Size = Annotated[str, typer.Option("--size", help="Image size, such as 512x512.")]
Frame = Annotated[int, typer.Option("--frame", help="Frame of an animated scene, from 0.")]
SceneDir = Annotated[
    Path | None,
    typer.Option(
        "--scene-dir", help="Folder of original scenes. Default: the environment variable SHADOWBENCH_SCENES."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
CameraPlace = Annotated[
    tuple[str, str] | None,
    typer.Option(
        "--camera", metavar="EYE TARGET", help="Position of the camera and the point it looks at, each X,Y,Z."
    ),
]
Fov = Annotated[float | None, typer.Option("--fov", help="Vertical field of view, degrees.")]
Lights = Annotated[
    list[str] | None,
    typer.Option(
        "--light",
        metavar="X,Y,Z",
        help="Position of a point light that replaces the scene's lights. Repeatable.",
    ),
]


def seen_as(
    scene: Scene, camera: tuple[str, str] | None, fov: float | None, lights: list[str] | None
) -> Scene:
    """The scene with the camera and the point lights of ``--camera``, ``--fov`` and ``--light``, where given.

    Positions are in scene coordinates. These lights do not move. Raises :class:`UserError` for a malformed position
    and for a degenerate camera.
    """
    if lights:
        placed = tuple(Light(_place("--light", text)) for text in lights)
        scene = replace(scene, lights=placed, light_path=None)
    if camera is None and fov is None:
        return scene
    seen = scene.camera if fov is None else replace(scene.camera, fov=fov)
    if camera is not None:
        eye, target = (_place("--camera", text) for text in camera)
        seen = replace(seen, eye=eye, target=target, up=_upright(np.subtract(target, eye), seen.up))
    ray_tables(seen, 1, 1, np.zeros(3))
    return replace(scene, camera=seen)


def _place(option: str, text: str) -> Vector:
    try:
        x, y, z = (float(number) for number in text.split(","))
    except ValueError:
        raise UserError(f"{option} {text!r}: give three numbers, as in {option} 0,1.7,4") from None
    if not all(abs(number) <= FARTHEST for number in (x, y, z)):
        raise UserError(f"{option} {text!r}: is outside the range of float32")
    return x, y, z


def _upright(view: NDArray[np.float64], up: Vector) -> Vector:
    """``up``; if it is parallel to the view direction, the coordinate axis most perpendicular to the view."""
    size = float(np.abs(view).max())
    if size and np.linalg.norm(np.cross(np.divide(view, size), up)) > 1e-6 * np.linalg.norm(up):
        return up
    x, y, z = np.eye(3)[np.abs(view).argmin()].tolist()
    return x, y, z
