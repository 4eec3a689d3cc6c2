"""The page as one file: the template of ``web/`` with its style, its scripts and its data inside. And a site of it: a
folder for any static host, with an address for each experiment that stays, drawings and the documentation.
"""

import base64
import hashlib
import html
import json
import re
import shutil
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlencode

from ...files import write_text

SCRIPTS = (  # in the order in which they run: each uses only what stands before it
    "base.js", "data.js", "filters.js", "grid.js", "export.js", "details.js", "chart.js", "marks.js", "slider.js",
    "view_overview.js", "view_table.js", "view_scatter.js", "view_points.js", "view_curves.js", "view_machines.js",
    "view_pictures.js", "view_maps.js", "view_claims.js", "main.js",
)  # fmt: skip

DRAWINGS = ("*.svg", "*.png")
LIBRARY = ("uplot/uPlot.iife.min.js", "uplot/uPlot.min.css", "uplot/LICENSE")


def page(data: dict[str, Any]) -> str:
    """The HTML of the page. ``data``: what :mod:`.report.page.gather` and :mod:`.report.page.pictures` made."""
    library, library_style, licence = (resource(name) for name in LIBRARY)
    script = "\n".join(f"// {name}\n{resource(name)}" for name in SCRIPTS)
    program = f'"use strict";\n(() => {{\n{script}\n}})();\n'
    library = f"/*\n{licence.strip()}\n*/\n{library}"
    style = resource("page.css") + "\n" + library_style
    texts = {"DATA": inert(data), "LIBRARY": library, "PROGRAM": program}
    return head(data["title"], style, policy(library, program)) + filled(resource("page.html"), texts)


def head(title: str, style: str, policy: str = "") -> str:
    """The beginning of every page of the project, up to its body; ``policy``: of its content, if it has one of its own."""
    meta = f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n' if policy else ""
    style = resource("theme.css") + style
    return filled(resource("head.html"), {"TITLE": html.escape(title, quote=False), "POLICY": meta, "STYLE": style})


def filled(template: str, texts: dict[str, str]) -> str:
    """A template with a text for each ``{{NAME}}`` in it."""
    return re.sub(r"\{\{([A-Z]+)\}\}", lambda found: texts[found[1]], template)


def policy(*scripts: str) -> str:
    """A content security policy: nothing is fetched, and only these scripts run."""
    hashes = " ".join(map(script_source, scripts))
    return (
        f"default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; script-src {hashes}; base-uri 'none'; "
        "form-action 'none'"
    )


def inert(data: dict[str, Any]) -> str:
    """JSON that cannot end the element that it stands in."""
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def script_source(script: str) -> str:
    """What a content security policy calls a script that may run: its hash."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"


def resource(name: str, package: str = __package__) -> str:
    """A file of a package's ``web/``, from the checkout or from an installed wheel."""
    return files(package).joinpath("web", *name.split("/")).read_text(encoding="utf-8")


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
