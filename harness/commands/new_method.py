"""``shadowbench new-method``: a package with a method of one's own, from a template that passes ``check`` as it is."""

import importlib.metadata
import keyword
import os
import re
import shutil
import sys
import tempfile
from importlib import resources
from pathlib import Path

from ..errors import UserError, install, say, writing
from .options import command

TEMPLATE = "template"  # the folder beside this file with the package's files; names and texts have marks of `filled`
ENDING = ".txt"  # suffix of the template's files: they are no modules; `--` in their names stands for a folder

LONGEST = 64


@command(
    """
    Create a Python package for a new method.
    shadowbench new-method my_method

    name        Name of the new method, a Python identifier in lower case.
    --out PATH  The folder to create. Default: shadowbench-NAME in the current folder.
    """
)
def new_method(name: str, out: Path | None = None) -> int:
    """Create a Python package with a working method to start from, its test, and its entry point.

    As created it tests every triangle for every ray, without a structure, and passes `shadowbench check`.
    """
    check_name(name)
    # A folder of the package's own name would hide the installed package from Python where it runs beside it.
    folder = out if out is not None else Path(f"shadowbench-{name}")
    create(name, folder)
    say(f"written: {folder}/")
    print(f"next: {install(str(folder), editable=True)}", file=sys.stderr)
    print(f"then: shadowbench check {name} --device cpu", file=sys.stderr)
    return 0


def check_name(name: str) -> None:
    """Raise :class:`UserError` unless the name can be that of a new package and method."""
    from ..frame.registry import method_names

    if keyword.iskeyword(name):
        raise UserError(f"new-method {name}: this is a keyword of Python; choose another")
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or len(name) > LONGEST:
        raise UserError(
            f"new-method {name!r}: the name must be of lower-case letters, digits and _, a letter first, "
            f"at most {LONGEST} long"
        )
    if name in method_names():
        raise UserError(f"new-method {name}: there is a method of this name; choose another")
    if name in sys.stdlib_module_names or name in importlib.metadata.packages_distributions():
        raise UserError(
            f"new-method {name}: there is a Python package of this name, which it would hide; choose another"
        )


def create(name: str, folder: Path) -> Path:
    """Write the package into a folder that does not exist yet. The folder appears only when it is complete."""
    if os.path.lexists(folder):
        raise UserError(f"{folder}: exists; nothing is overwritten, choose another --out")
    with writing(folder, "choose another --out"):
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}.") as place:
            made = Path(place) / "package"
            for path, text in contents(name).items():
                file = made / path
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(text, encoding="utf-8")
            shutil.move(made, folder)
    return folder


def contents(name: str) -> dict[str, str]:
    """The files of a package: {path inside its folder: text}."""
    source = resources.files(__package__) / TEMPLATE
    return {
        filled(entry.name.removesuffix(ENDING).replace("--", "/"), name): filled(
            entry.read_text(encoding="utf-8"), name
        )
        for entry in source.iterdir()
        if entry.name.endswith(ENDING)
    }


def filled(text: str, name: str) -> str:
    """The text with @NAME@, @CLASS@ and @TITLE@ replaced by the method's name, the name of its class and its title."""
    words = [word for word in name.split("_") if word]
    marks = {"NAME": name, "CLASS": "".join(map(str.capitalize, words)), "TITLE": " ".join(words).capitalize()}
    for mark, value in marks.items():
        text = text.replace(f"@{mark}@", value)
    return text
