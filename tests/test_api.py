"""The page of the Python API and its notebook: the same code, and it runs."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import pandas as pd
import pytest
from helpers.notebooks import code_of_notebook, code_of_page, notebook_of
from PIL import Image
from shadowbench.harness import api

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGE = (DOCS / "api.md").read_text(encoding="utf-8")
NOTEBOOK = (DOCS / "api.ipynb").read_text(encoding="utf-8")


def test_the_notebook_is_the_page():
    """Else write it anew: python tests/helpers/notebooks.py docs/api.md docs/api.ipynb."""
    assert notebook_of(PAGE) == NOTEBOOK
    assert code_of_notebook(NOTEBOOK) == code_of_page(PAGE)
    assert len(code_of_page(PAGE)) > 5


def test_the_notebook_runs(tmp_path, monkeypatch, capsys):
    pytest.importorskip("embreex", reason="a frame is judged against Embree")
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    for number, source in enumerate(code_of_notebook(NOTEBOOK), 1):
        exec(compile(source, f"api.ipynb, cell {number}", "exec"), names)
    assert names["score"].check == "ok"
    assert names["failed"] == 0
    assert isinstance(names["table"], pd.DataFrame)
    assert set(names["mean"]["method"]) == {"bvh2", "ray_grids"}
    assert (names["mean"]["true_errors"] == 0).all()
    for picture in ("bunny.png", "table1-bunny.png"):
        with Image.open(tmp_path / picture) as drawn:
            assert len(drawn.convert("RGB").getcolors(1 << 24)) > 100
    assert "true errors" in capsys.readouterr().out


def test_every_name_of_the_facade_is_one_of_its_modules():
    assert sorted(api.__all__) == api.__all__
    assert all(getattr(api, name).__module__.startswith("shadowbench.harness.") for name in api.__all__)
    assert all(getattr(api, name).__module__ != api.__name__ for name in api.__all__)
