"""The pages that are notebooks, too: the same code, and it runs."""

import json
import re
from pathlib import Path

import matplotlib
import pandas as pd
import pytest
from PIL import Image
from shadowbench.harness import api
from shadowbench.harness.report.documents import notebook_of

DOCS = Path(__file__).resolve().parent.parent / "docs"


def code_of_notebook(text):
    """The sources of the code cells."""
    return ["".join(cell["source"]) for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]


def ran(name):
    """The names that the cells of a notebook leave."""
    names: dict = {}
    for number, source in enumerate(code_of_notebook((DOCS / f"{name}.ipynb").read_text(encoding="utf-8")), 1):
        exec(compile(source, f"{name}.ipynb, cell {number}", "exec"), names)
    return names


@pytest.mark.parametrize("name", ["api", "soft-shadows"])
def test_the_notebook_is_the_page(name):
    """Else write it anew: shadowbench report results --docs ."""
    page = (DOCS / f"{name}.md").read_text(encoding="utf-8")
    notebook = (DOCS / f"{name}.ipynb").read_text(encoding="utf-8")
    assert notebook_of(page) == notebook
    assert code_of_notebook(notebook) == re.findall(r"```python\n(.*?)\n```", page, re.DOTALL)
    assert len(code_of_notebook(notebook)) > 3


def test_a_soft_shadow_and_its_error(tmp_path, monkeypatch):
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    errors = list(ran("soft-shadows")["errors"].values())
    assert errors[1:] == sorted(errors[1:], reverse=True)
    assert errors[-1] < errors[0] / 8, "better than random points"
    for picture in ("soft-1.png", "soft-16.png", "soft-error.png"):
        with Image.open(tmp_path / picture) as drawn:
            assert len(drawn.convert("RGB").getcolors(1 << 24)) > 50


@pytest.mark.slow
def test_the_notebook_runs(tmp_path, monkeypatch, capsys):
    pytest.importorskip("embreex", reason="a frame is judged against Embree")
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    names = ran("api")
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
