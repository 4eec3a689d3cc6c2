"""Options that several commands take, each worded once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Methods = Annotated[
    list[str] | None, typer.Option("--method", help="A method's name; again for more. Default: all.")
]
Settings = Annotated[list[str] | None, typer.Option("--set", help="method.param=value; again for more.")]
Device = Annotated[
    str | None, typer.Option("--device", help="cpu or cuda:0. Default: cuda:0 where there is one.")
]
Size = Annotated[str, typer.Option("--size", help="Image size.")]
Frame = Annotated[int, typer.Option("--frame", help="Frame of an animated scene, from 0.")]
SceneDir = Annotated[
    Path | None,
    typer.Option("--scene-dir", help="Folder of original scenes. Default: the variable SHADOWBENCH_SCENES."),
]
Json = Annotated[bool, typer.Option("--json", help="Print nothing but JSON.")]
