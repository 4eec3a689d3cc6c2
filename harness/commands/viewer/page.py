"""The page as one HTML text: its style, its script and its facts inside."""

import re
from importlib.resources import files
from typing import Any

from ...report.page.build import filled, head, inert, script_source


def page(facts: dict[str, Any]) -> str:
    """The HTML of the page; ``facts`` are what its script begins with."""
    texts = {"FACTS": inert(facts), "PROGRAM": resource("view.js")}
    return head(facts["title"], resource("view.css")) + filled(resource("view.html"), texts)


def policy(text: str, sockets: str) -> str:
    """A content security policy: only the page's own script runs, and it connects to this server only."""
    (program,) = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    return (
        f"default-src 'none'; script-src {script_source(program)}; style-src 'unsafe-inline'; img-src data: blob:; "
        f"connect-src {sockets}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )


def resource(name: str) -> str:
    """A file of ``web/``, from the checkout or from an installed wheel."""
    return files(__package__).joinpath("web", name).read_text(encoding="utf-8")
