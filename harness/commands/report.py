"""``shadowbench report``: one HTML file of a results folder, or of a folder of them, to explore in a browser."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import UserError, say
from ..files import write_text
from ..results.folder import require_plain
from ..results.schema import folders_with_records
from ..runner.planning.experiment import PACKAGE
from .options import Json

if TYPE_CHECKING:
    from pandas import DataFrame

DEFAULT = "report.html"

Folder = Annotated[Path, typer.Argument(help="A results folder, or a folder of results folders.")]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="PATH", help=f"The file to write. Default: {DEFAULT} in the folder."),
]


def report(folder: Folder, out: Out = None, as_json: Json = False) -> int:
    """Write one HTML file to explore results with: tables, curves, pictures, claims and records. It works offline.

    Nothing is measured. The page loads nothing from a network.
    """
    path = out or folder / DEFAULT
    if path.is_dir():
        raise UserError(f"--out {path}: is a folder; name a file, such as {path / DEFAULT}")
    data = collected(folder)
    from ..report.page.build import page

    html = page(data)
    try:
        write_text(path, html)
    except OSError as error:
        raise UserError(
            f"{path}: cannot write ({error.strerror or error}); free space, correct the permissions or choose another --out"
        ) from error
    if as_json:
        import json

        print(json.dumps({"file": str(path), "bytes": len(html.encode())}))
    else:
        for one in data["folders"]:
            for line in one["notices"]:
                if "versions of" in line or "older records" in line:
                    say(f"{one['name']}: {line}")
        say(f"written: {path} ({len(html.encode()) / 1e6:.1f} MB)")
    return 0


def collected(folder: Path) -> dict[str, Any]:
    """Everything that the page shows of a folder."""
    from ..report import document
    from ..report.page import gather, pictures

    places = folders_with_records(folder)
    for place in {folder, *places}:
        require_plain(place)
    tables = [document.frames(place) for place in places]
    points = [document.named(table) for table in tables]
    data = gather.gather(folder.resolve().name, places, tables, points)
    album = pictures.Album()
    data["gallery"] = pictures.gallery(places, points, album)
    data["maps"] = pictures.maps(places, points, album)
    data["figures"] = pictures.figures([*places, *([folder] if folder not in places else [])], album)
    data["legend"] = pictures.legend()
    data["left_out"] = album.left_out
    data["claims"] = claims_of(tables)
    return data


def claims_of(tables: Sequence[DataFrame]) -> list[dict[str, Any]]:
    """The claims, judged from the records; none where nothing there was measured."""
    from ..report import claims
    from ..report.claims import together

    declared: Sequence[claims.Claim] = importlib.import_module(f"{PACKAGE}.claims").CLAIMS
    found = together(tables)
    if found.frames.empty:
        return []
    made = claims.judge_all(declared, found)
    return [{**row, "number": int(row["number"])} for row in made.to_dict("records")]
