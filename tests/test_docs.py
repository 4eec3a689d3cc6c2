"""What the documents show must work: the example method runs, and its answers are exact."""

import ast
import importlib.util
import itertools
import re
import sys
import tomllib
from pathlib import Path

import pandas as pd
import pytest
from helpers.exact_answers import assert_right, exact_answers
from helpers.import_graph import modules
from helpers.small_scenes import make_scene, soup
from shadowbench.experiments._documents import FAITHFUL, KINDS, PAPER, PARTS, judged, measured
from shadowbench.harness.frame.registry import method_class, method_names
from shadowbench.harness.frame.session import Session
from shadowbench.harness.report import claims, documents, style
from shadowbench.harness.results import points, samples, table, tidy
from shadowbench.harness.runner.planning.experiment import experiment_names
from shadowbench.harness.runner.planning.planned_point import source_hash

ROOT = Path(__file__).resolve().parent.parent
GUIDE = ROOT / "docs" / "adding-a-method.md"
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), ROOT / "results" / "README.md"])
LINKED = sorted({*DOCUMENTS, *(ROOT / "docs").rglob("*.md"), *(ROOT / "results").rglob("*.md")})


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """The class of the guide's example, imported from a file as its reader would write it."""
    (code,) = re.findall(r"```python\n(.*?)```", GUIDE.read_text(), re.DOTALL)
    path = tmp_path_factory.mktemp("package") / "every_triangle.py"
    path.write_text(code)
    spec = importlib.util.spec_from_file_location("every_triangle", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules["every_triangle"] = module
    spec.loader.exec_module(module)
    yield module.EveryTriangle
    del sys.modules["every_triangle"]


def test_the_example_method_answers_exactly(example):
    prepared = make_scene(*soup(3, 60), [(1.0, 2.5, 1.5), (-3.0, 0.4, 0.2)])
    moment = prepared.moment(0, 24, 20)
    answers = Session(example(), prepared, 24, 20, "cpu").answers(moment)
    exact = exact_answers(prepared, moment)
    hits = (exact["triangle"] >= 0).sum()
    assert hits > 50
    assert all(0 < dark < hits for dark in exact["shadowed"].sum(axis=1))
    assert_right(answers, exact)


@pytest.mark.parametrize("document", LINKED, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_to_files_and_headings_lead_somewhere(document):
    lost = []
    for path, heading in re.findall(r"\]\(([^)#:\s]*)(?:#([^)\s]*))?\)", prose(document)):
        target = document.parent / path if path else document
        if not target.exists() or (heading and target.suffix == ".md" and heading not in headings(target)):
            lost.append(f"{path}#{heading}")
    assert lost == []


def prose(document):
    """A document without its blocks of code."""
    return re.sub(r"(?s)```.*?```", "", document.read_text())


def headings(document):
    """The anchors that the headings of a document have on a page."""
    texts = re.findall(r"(?m)^#+ (.*)$", prose(document))
    return {re.sub(r"[^\w\- ]", "", text.strip().lower()).replace(" ", "-") for text in texts}


def test_the_readme_names_what_exists():
    text = (ROOT / "README.md").read_text()
    makefile = (ROOT / "Makefile").read_text()
    for target in re.findall(r"^make (\w+)", text, re.MULTILINE):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def test_the_pages_of_methods_and_experiments_name_all_of_them():
    methods = (ROOT / "docs" / "methods.md").read_text()
    assert [name for name in method_names() if f"| `{name}` |" not in methods] == []
    experiments = (ROOT / "docs" / "experiments.md").read_text()
    assert [name for name in experiment_names() if f"| `{name}` |" not in experiments] == []


@pytest.fixture(scope="module")
def results():
    return documents.Results(ROOT / "results")


def test_every_drawn_number_is_that_of_the_records(results, tmp_path):
    """README and docs have the numbers that the kept records give; the claims of a machine are those of its records."""
    for path in documents.documents(ROOT):
        text = path.read_text()
        assert documents.drawn(text, results, PARTS, path) == text, f"{path}: shadowbench report results --docs ."
    places = sorted(path.parent for path in (ROOT / "results").glob("*/claims.csv"))
    assert places
    for place in places:
        for made in claims.write(tmp_path, judged(results, place.name), results.data(place.name)):
            kept = place / made.name
            assert made.read_text() == kept.read_text(), f"{kept}: shadowbench show claims {place}"


def test_what_the_first_pages_say_of_the_columns_of_their_table_is_true(results):
    """Grids of triangles, which have none, are slower than the best of each kind that has one; the tuned entry of
    the paper's grids is the faster of the two.
    """
    table = results.ranked("nvidia-h200/frame_time")
    own = table.pivot_table("total_ms", "title", "label")
    best = (
        table[table["exact"]]
        .assign(kind=table["method"].map(style.kind))
        .pivot_table("total_ms", "title", "kind", "min")
    )
    assert set(best) == {*KINDS, "grids of triangles"}
    assert (best["grids of triangles"] > best[list(KINDS)].max(axis=1)).all()
    assert (own[PAPER] < own[FAITHFUL]).all()


def test_a_number_that_was_changed_is_drawn_anew_and_a_page_that_is_a_notebook_is_written_as_both(results, tmp_path):
    page = "# A\n\n<!-- drawn: a -->\n\n0.25 ms\n\n<!-- end -->\n\n```python\nprint(1)\n```\n"
    (tmp_path / "a.md").write_text(page.replace("0.25", "0.26"))
    (tmp_path / "a.ipynb").write_text("")
    parts = {"a": lambda _: ["0.25 ms"]}
    assert documents.fill(results, tmp_path, parts) == [tmp_path / "a.md", tmp_path / "a.ipynb"]
    assert (tmp_path / "a.md").read_text() == page
    assert "0.25 ms" in (tmp_path / "a.ipynb").read_text()
    assert documents.fill(results, tmp_path, parts) == []


def test_the_version_of_a_folder_is_of_the_method_that_it_names():
    points = pd.DataFrame(
        [("paper", "a" * 64), ("tree", "b" * 64), ("paper", "c" * 64), ("tree", "d" * 64)],
        columns=["method", "method_sha256"],
    ).assign(started=[0.0, 1.0, 2.0, 3.0])
    assert measured(points)["version"] == f"paper `{'a' * 8}` and `{'c' * 8}`"
    points.loc[3, "method"] = "ray_grids"
    assert measured(points)["version"] == f"ray_grids `{'d' * 8}`"


def test_the_findings_say_whether_the_kept_figures_are_of_the_code_beside_them(results):
    points = results.points("nvidia-h200/frame_time")
    kept = dict(points.groupby("method")["method_sha256"].last())
    older = [name for name, sha in kept.items() if source_hash(method_class(name)) != sha]
    said = "all kept figures are of an earlier version of the code than this checkout"
    assert (said in (ROOT / "docs" / "findings.md").read_text()) == (len(older) == len(kept)), older


def test_the_first_pages_are_short_and_the_readme_has_one_sentence_and_a_table_of_six_columns():
    for page, screens in (("README.md", 3), ("docs/findings.md", 4)):
        assert len((ROOT / page).read_text().splitlines()) <= screens * 40
    parts = {
        part["name"].split()[0]: part["text"] for part in documents.PART.finditer((ROOT / "README.md").read_text())
    }
    assert {line.count(" | ") for line in parts["kinds"].splitlines() if line.startswith("|")} == {5}
    assert re.fullmatch(r"\*\*[^.]+(?:\.\d+[^.]*)*\.\*\*", parts["headline"].strip())


def test_every_page_is_in_the_index_and_in_the_site():
    """A page that is not in the site's list has no place beside the others; ``make docs`` fails for one that is missing."""
    index, listed = (ROOT / "docs" / "index.md").read_text(), (ROOT / "mkdocs.yml").read_text()
    assert [path for path in (ROOT / "docs").glob("*.md") if f"({path.name})" not in index] == [
        ROOT / "docs" / "index.md"
    ]
    pages = [str(path.relative_to(ROOT)) for path in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]]
    assert [page for page in pages if f"- {page}\n" not in listed] == []


def test_the_site_fetches_nothing():
    """The search of a page that is opened from the disk needs a script, which the theme would fetch; see ``make docs``."""
    site = (ROOT / "mkdocs.yml").read_text()
    assert "font: false" in site
    (script,) = re.findall(r"polyfills: \[(\S*iframe-worker\S*)\]", site)
    assert (ROOT / script).is_file()


def test_every_folder_of_code_is_a_package():
    """Only packages are distributed (setup.py)."""
    folders = {path.parent for room in ("harness", "methods", "experiments") for path in (ROOT / room).rglob("*.py")}
    assert [folder for folder in folders if not (folder / "__init__.py").exists()] == []


def test_every_dependency_is_pinned():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = [*project["dependencies"], *itertools.chain(*project["optional-dependencies"].values())]
    pins = dict(line.split("==") for line in (ROOT / "constraints.txt").read_text().splitlines() if "==" in line)
    named = {re.match(r"[\w-]+", text)[0] for text in wanted}
    named.discard(project["name"])  # one extra may hold another
    assert {name.lower().replace("_", "-") for name in named} <= {name.lower().replace("_", "-") for name in pins}


def test_roles_in_docstrings_name_what_exists():
    files = {name: file.read_text(encoding="utf-8") for name, file in modules().items()}
    defined = {name: {getattr(n, "name", getattr(n, "id", getattr(n, "attr", ""))) for n in ast.walk(ast.parse(text))}
               for name, text in files.items()}  # fmt: skip
    lost = []
    for module, text in files.items():
        for kind, target in re.findall(r":(\w+):`[.~]*([\w.]+)`", text):
            path, _, name = target.rpartition(".")
            if kind == "mod":
                found = any(f".{other}".endswith(f".{target}") for other in files)
            else:
                homes = [other for other in files if f".{other}".endswith(f".{path}")] if path else []
                found = name in set().union(*(defined[home] for home in homes or files))
            lost += [] if found else [f"{module}: {kind} {target}"]
    assert lost == []


def page_columns(function: str) -> dict[str, str]:
    """Each column that the page of the table of results lists of a function, and its type."""
    page = (ROOT / "docs" / "results-table.md").read_text()
    listed = page.partition(f"## Columns of `{function}`")[2].partition("```text\n")[2].partition("```")[0]
    kind = r"(?:text|object|category|float|int|Int64)"
    found: list[tuple[str, str]] = []
    for names, kinds in re.findall(rf"^(\S.*?) +({kind}(?:, {kind})*)  ", listed, re.MULTILINE):
        columns, several = names.split(", "), kinds.split(", ")
        found += zip(columns, several if len(several) == len(columns) else several * len(columns), strict=True)
    assert len(dict(found)) == len(found), "a column is listed twice"
    return dict(found)


def test_the_page_of_the_table_of_results_has_every_column_with_its_type():
    kinds = {"Int64": table.COUNTS, "float": table.NUMBERS, "text": table.TEXTS}
    known = {name: kind for kind, names in kinds.items() for name in names}
    assert {name: kind for name, kind in page_columns("tidy").items() if "." not in name} == known
    folder = ROOT / "results" / "nvidia-h200" / "key_bits"
    frames = tidy(folder)
    assert set(page_columns("points")) == set(points(frames)) - set(frames)
    assert list(page_columns("samples")) == list(samples(folder))
