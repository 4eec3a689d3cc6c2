"""Write the packages of each purpose with their versions and hashes, as `make lock` does.

The versions are those of constraints.txt, which is kept by hand. requirements.txt has what the program needs, and what
builds it; .ci/requirements-EXTRA.txt what tests, linters and documentation need in addition. Hashes are of every file of a
version, so that the lists are for every platform.
"""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
EXTRAS = ("test", "lint", "docs")
HEAD = "# Made by `make lock` from pyproject.toml and constraints.txt: pip install --require-hashes -r {path}\n"


def locked(*options: str) -> dict[str, str]:
    """The lines of each package that uv finds for every platform, by its name and version."""
    command = ["uv", "pip", "compile", "pyproject.toml", "-", "--constraints", "constraints.txt", "--generate-hashes"]
    command += ["--universal", "--python-version", "3.11.5", "--no-annotate", "--no-header", "--quiet", *options]
    text = subprocess.run(
        command, cwd=ROOT, input="setuptools>=77\n", capture_output=True, text=True, check=True
    ).stdout
    blocks = text.replace(" \\\n", "\0").splitlines()
    return {block.partition("\0")[0]: block.replace("\0", " \\\n") for block in blocks}


def write(path: str, packages: dict[str, str]) -> None:
    """Write a list to a file below the root."""
    (ROOT / path).write_text(HEAD.format(path=path) + "\n".join(packages.values()) + "\n", encoding="utf-8")


def main() -> None:
    """Write all lists."""
    base = locked()
    write("requirements.txt", base)
    for extra in EXTRAS:
        more = locked("--extra", extra)
        write(f".ci/requirements-{extra}.txt", {name: block for name, block in more.items() if name not in base})


if __name__ == "__main__":
    try:
        main()
    except subprocess.CalledProcessError as error:
        sys.exit(error.stderr)
