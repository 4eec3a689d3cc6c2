"""Jupyter notebooks as JSON, made of a page of documentation.

``python tests/helpers/notebooks.py docs/api.md docs/api.ipynb`` writes the notebook anew.
"""

import json
import re
import sys
from pathlib import Path


def code_of_page(text: str) -> list[str]:
    """The blocks of Python of a page, without their last newline."""
    return re.findall(r"```python\n(.*?)\n```", text, re.DOTALL)


def code_of_notebook(text: str) -> list[str]:
    """The sources of the code cells."""
    return ["".join(cell["source"]) for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]


def notebook_of(text: str) -> str:
    """The page as a notebook without outputs: text as cells of Markdown, blocks of Python as cells of code."""
    cells = []
    for place, part in enumerate(re.split(r"```python\n(.*?)\n```\n", text, flags=re.DOTALL)):
        if not part.strip():
            continue
        cell = {"id": f"cell-{place}", "metadata": {}, "source": part.strip().splitlines(keepends=True)}
        own = {"execution_count": None, "outputs": []} if place % 2 else {}
        cells.append({"cell_type": "code" if place % 2 else "markdown", **cell, **own})
    about = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    return json.dumps({"cells": cells, "metadata": about, "nbformat": 4, "nbformat_minor": 5}, indent=1) + "\n"


if __name__ == "__main__":
    page, notebook = (Path(name) for name in sys.argv[1:])
    notebook.write_text(notebook_of(page.read_text(encoding="utf-8")), encoding="utf-8")
