"""Drawings that are put together and not painted, which takes a third of the time: what tests look at are the tables."""

from pathlib import Path

import pytest
from matplotlib.figure import Figure
from PIL import Image


@pytest.fixture
def unpainted(monkeypatch):
    """Pictures are files of nothing."""

    def save(figure: Figure, path: Path, **_: object) -> None:
        if path.suffix == ".png":
            Image.new("RGB", (1, 1)).save(path)
        else:
            path.write_text("<svg/>")

    monkeypatch.setattr(Figure, "savefig", save)
