"""``shadowbench report``: one HTML file of a results folder, or of a folder of them, to explore in a browser."""

from __future__ import annotations

import importlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import UserError, say
from ..files import write_text
from ..results.folder import require_plain
from ..results.schema import folders_with_records
from ..runner.planning.experiment import PACKAGE
from .options import command

if TYPE_CHECKING:
    from pandas import DataFrame

    from ..report.document import Source

DEFAULT = "report.html"

DOCS = Path("build/site")  # where `make docs` writes the documentation


@command(
    f"""
    Write results as one HTML page to explore.
    shadowbench report results/nvidia-h200 --out report.html

    folder      A results folder, or a folder of results folders, however deep.
    --out PATH  The file to write. Default: {DEFAULT} in the folder.
    --site DIR  Write a site instead, for any static host: the page, a page for each experiment, docs.
    --docs DIR  Write no page, but the claims, the drawn parts of Markdown files and the notebooks of a checkout anew.
    """
)
def report(
    folder: Path, out: Path | None = None, site: Path | None = None, docs: Path | None = None, as_json: bool = False
) -> int:
    """Write one HTML file to explore results with: tables, curves, pictures, claims and records. It works offline.

    Nothing is measured. The page loads nothing from a network.
    """
    if docs is not None:
        return fill_documents(folder, docs, as_json)
    path = site / "index.html" if site else out or folder / DEFAULT
    if path.is_dir():
        raise UserError(f"--out {path}: is a folder; name a file, such as {path / DEFAULT}")
    if site and site.is_dir() and any(site.iterdir()) and not path.is_file():
        raise UserError(f"--site {site}: has other files; name a new folder")
    if site and DOCS.resolve() in (site.resolve(), *site.resolve().parents):
        raise UserError(
            f"--site {site}: make docs writes the documentation there, which is copied into a site; name another folder"
        )
    from ..report import document
    from ..report.page import build

    for place in (*folders_with_records(folder), folder):  # before anything in them is read
        require_plain(place)
    sources = document.sources(folder)
    data = collected(folder, sources)
    manual = DOCS if (DOCS / "index.html").is_file() else None
    try:
        if site:
            written = build.write_site(site, data, {one.name: one.path for one in sources}, manual)
        else:
            write_text(path, build.page(data))
            written = [path]
    except OSError as error:
        raise UserError(
            f"{error.filename or path}: cannot write ({error.strerror or error}); free space, correct the permissions or "
            "choose another place"
        ) from error
    size = sum(one.stat().st_size for one in written)
    if as_json:
        print(json.dumps({"file": str(path), "files": list(map(str, written)), "bytes": size}))
        return 0
    for one in data["folders"]:
        for line in one["notices"]:
            if "versions of" in line or "older record" in line:
                say(f"{one['name']}: {line}")
    if site and not manual:
        say(f"without the documentation: {DOCS} is not there; make docs writes it")
    say(f"written: {path} ({size / 1e6:.1f} MB{f' in {len(written)} pages' if site else ''})")
    return 0


def fill_documents(folder: Path, root: Path, as_json: bool) -> int:
    """Draw the claims of each machine and the parts of Markdown files made from records anew; name what changed."""
    from ..report import claims, documents

    declared, results = importlib.import_module(f"{PACKAGE}._documents"), documents.Results(folder)
    kept = {path: path.read_bytes() for path in sorted(folder.glob("*/claims.*"))}
    for machine in sorted({path.parent for path in kept}):
        claims.write(machine, declared.judged(results, machine.name), results.data(machine.name))
    changed = [path for path, before in kept.items() if path.read_bytes() != before]
    changed += documents.fill(results, root, declared.PARTS)
    if as_json:
        print(json.dumps({"changed": list(map(str, changed))}))
    else:
        say(f"written: {', '.join(map(str, changed))}" if changed else "every number is that of the records")
    return 0


def collected(folder: Path, sources: Sequence[Source]) -> dict[str, Any]:
    """Everything that the page shows of a folder."""
    from ..report.page import gather, pictures

    title = folder.resolve().name
    data = gather.gather(title, sources, importlib.import_module(PACKAGE).INTEREST)
    album = pictures.Album()
    data["gallery"] = pictures.gallery(sources, album)
    data["maps"] = pictures.maps(sources, album)
    data["figures"] = pictures.figures({title: folder} | {one.name: one.path for one in sources}, album)
    data["legend"] = pictures.legend()
    data["left_out"] = album.left_out
    data["claims"] = claims_of([one.frames for one in sources])
    return data


def claims_of(tables: Sequence[DataFrame]) -> list[dict[str, Any]]:
    """The claims, judged from the records; none where nothing there was measured."""
    from ..report import claims

    declared: Sequence[claims.Claim] = importlib.import_module(f"{PACKAGE}.claims").CLAIMS
    found = claims.together(tables)
    if found.frames.empty:
        return []
    made = claims.judge_all(declared, found)
    return [{**row, "number": int(row["number"])} for row in made.to_dict("records")]
