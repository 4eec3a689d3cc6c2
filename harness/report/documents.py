"""Parts of Markdown files that are drawn from records, between two comments that name them:

    <!-- drawn: NAME -->
    ...
    <!-- end -->

An experiment's package says what each part holds. What stands outside them is left as it is. A page with a notebook of its
name beside it is written as that, too.
"""

import json
import re
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from ..errors import UserError
from ..files import write_text
from ..results.schema import folders_with_records, place_name
from . import claims, compare, document, ranking
from .dataframe import DataFrame

PART = re.compile(r"(?m)^(<!-- drawn: (?P<name>[^>]+?) -->\n)(?P<text>.*?)^(<!-- end -->)$", re.DOTALL)
SKIPPED = ("build", "node_modules", "local")  # folders without documents of the project


class Results:
    """The kept results of a folder, read when a part asks for them."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.frames: Callable[[str], DataFrame] = cache(lambda name: document.frames(folder / name))
        self.points: Callable[[str], DataFrame] = cache(lambda name: document.named(self.slim(name)))
        self.part: Callable[..., list[str]] = cache(lambda make, *words: make(self, *words))
        self.data: Callable[[str], claims.Data] = cache(self._data)
        self.ranked: Callable[[str], DataFrame] = cache(lambda name: ranking.ranked(self.slim(name)))

    def slim(self, name: str) -> DataFrame:
        """The frames of a folder with the columns that parts are drawn from."""
        return compare.slim(self.frames(name), ("round.", "pass."))

    def _data(self, machine: str) -> claims.Data:
        """What claims are judged from: the frames of all folders of a machine."""
        names = self.names(machine)
        return claims.together([self.frames(name).assign(folder=name.removeprefix(f"{machine}/")) for name in names])

    def names(self, below: str = "") -> list[str]:
        """The results folders, as :func:`.results.schema.place_name` calls them."""
        return [place_name(place, self.folder) for place in folders_with_records(self.folder / below)]


Parts = Mapping[str, Callable[..., list[str]]]
"""The lines of each part, by its name: a function of the results and of the words after the name."""


def documents(root: Path) -> Iterator[Path]:
    """The Markdown files of a checkout."""
    for path in sorted(root.rglob("*.md")):
        inside = path.relative_to(root).parts
        if not any(part.startswith(".") or part in SKIPPED for part in inside[:-1]):
            yield path


def drawn(text: str, results: Results, parts: Parts, path: Path) -> str:
    """The text with its parts as the records have them."""

    def part(found: re.Match[str]) -> str:
        name, *words = found["name"].split()
        if name not in parts:
            raise UserError(f"{path}: no part {name!r} is drawn; there are {', '.join(sorted(parts))}")
        lines = results.part(parts[name], *words)
        return found[1] + "\n".join(["", *lines, ""]) + "\n" + found[4]

    return PART.sub(part, text)


def fill(results: Results, root: Path, parts: Parts) -> list[Path]:
    """Draw the parts of every document of a checkout anew, and notebooks of pages; the files that changed."""
    changed = []
    for path in documents(root):
        text = path.read_text(encoding="utf-8")
        made = {path: drawn(text, results, parts, path)}
        if (notebook := path.with_suffix(".ipynb")).is_file():
            made[notebook] = notebook_of(made[path])
        for place, content in made.items():
            if content != place.read_text(encoding="utf-8"):
                write_text(place, content)
                changed.append(place)
    return changed


def notebook_of(text: str) -> str:
    """A page as a Jupyter notebook without outputs: text as cells of Markdown, blocks of Python as cells of code."""
    cells = []
    for place, part in enumerate(re.split(r"```python\n(.*?)\n```\n", text, flags=re.DOTALL)):
        if part.strip():
            cell: dict[str, Any] = {
                "id": f"cell-{place}",
                "metadata": {},
                "source": part.strip().splitlines(keepends=True),
            }
            own: dict[str, Any] = {"execution_count": None, "outputs": []} if place % 2 else {}
            cells.append({"cell_type": "code" if place % 2 else "markdown", **cell, **own})
    about = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    return json.dumps({"cells": cells, "metadata": about, "nbformat": 4, "nbformat_minor": 5}, indent=1) + "\n"
