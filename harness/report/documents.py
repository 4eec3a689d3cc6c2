"""Parts of Markdown files that are drawn from records, between two comments that name them:

    <!-- drawn: NAME -->
    ...
    <!-- end -->

An experiment's package says what each part holds. What stands outside them is left as it is.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import UserError
from ..files import write_text
from ..results.schema import folders_with_records, place_name
from . import claims, document, ranking

if TYPE_CHECKING:
    from pandas import DataFrame

PART = re.compile(r"(?m)^(<!-- drawn: (?P<name>[^>]+?) -->\n)(?P<text>.*?)^(<!-- end -->)$", re.DOTALL)
SKIPPED = ("build", "node_modules", "local")
"""Folders without documents of the project."""


class Results:
    """The kept results of a folder, read when a part asks for them."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.frames: Callable[[str], DataFrame] = cache(lambda name: document.frames(folder / name))
        self.points: Callable[[str], DataFrame] = cache(lambda name: document.named(self.frames(name)))
        self.part: Callable[..., list[str]] = cache(lambda make, *words: make(self, *words))
        self.data: Callable[[str], claims.Data] = cache(self._data)
        self.ranked: Callable[[str], DataFrame] = cache(lambda name: ranking.ranked(self.frames(name)))

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
    """Draw the parts of every document of a checkout anew; the files that changed."""
    changed = []
    for path in documents(root):
        text = path.read_text(encoding="utf-8")
        if PART.search(text) and (new := drawn(text, results, parts, path)) != text:
            write_text(path, new)
            changed.append(path)
    return changed
