"""A folder for any static host: the page, an address for each experiment that stays, drawings, the documentation."""

import html
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlencode

from ...files import write_text
from .build import filled, head, page, resource

DRAWINGS = ("*.svg", "*.png")


def write_site(out: Path, data: dict[str, Any], places: Mapping[str, Path], docs: Path | None) -> list[Path]:
    """Write the site and return its pages.

    out     a new or an empty folder, or one that such a site was written to
    data    of the page; ``places``: the results folders in it by name; ``docs``: the documentation as HTML, if there is one
    """
    out.mkdir(parents=True, exist_ok=True)
    links = [["docs/index.html", "Documentation"]] if docs else []
    if docs:
        shutil.copytree(docs, out / "docs", dirs_exist_ok=True)
    pages = [out / "index.html", *(out / name / "index.html" for name in places)]
    write_text(pages[0], page({**data, "links": links, "addresses": True}))
    about = {one["name"]: one for one in data["folders"]}
    for (name, place), path in zip(places.items(), pages[1:], strict=True):
        path.parent.mkdir(parents=True, exist_ok=True)
        drawings = sorted(file for pattern in DRAWINGS for file in place.glob(pattern))
        for file in drawings:
            shutil.copyfile(file, path.parent / file.name)
        write_text(path, experiment_page(about[name], [file.name for file in drawings]))
    return pages


def experiment_page(about: Mapping[str, Any], drawings: list[str]) -> str:
    """The page of one experiment, which needs no script: what was found, its drawings, and the way to its tables."""
    up = "../" * (about["name"].count("/") + 1)
    # Lines follow the theme; a picture or a map of colours stays as it is.
    images = [
        f'<p class="drawing{" lines" * name.endswith(".svg")}"><a href="{quote(name)}"><img src="{quote(name)}" '
        f'alt="{html.escape(name)}"></a></p>'
        for name in drawings
    ]
    texts = {
        "TITLE": html.escape(about["title"]),
        "FINDING": html.escape(about["finding"]),
        "NOTES": "\n".join(
            f"<p class=note>{html.escape(text)}</p>" for text in (about["where"] + ".", *about["valid"])
        ),
        "TABLE": html.escape(f"{up}index.html#{urlencode({'view': 'table', 't': about['name']})}"),
        "HOME": f"{up}index.html",
        "DRAWINGS": "\n".join(images),
    }
    return head(about["title"], resource("page.css")) + filled(resource("experiment.html"), texts)
