"""The page as one file: the template of ``web/`` with its style, its scripts and its data inside."""

import base64
import hashlib
import html
import json
import re
from importlib.resources import files
from typing import Any

SCRIPTS = (
    "base.js", "data.js", "filters.js", "grid.js", "export.js", "details.js", "chart.js", "marks.js", "slider.js",
    "view_overview.js", "view_table.js", "view_scatter.js", "view_points.js", "view_curves.js", "view_machines.js",
    "view_pictures.js", "view_maps.js", "view_claims.js", "main.js",
)  # fmt: skip
"""In the order in which they run: each uses only what stands before it."""

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


def resource(name: str) -> str:
    """A file of ``web/``, from the checkout or from an installed wheel."""
    return files(__package__).joinpath("web", *name.split("/")).read_text(encoding="utf-8")
