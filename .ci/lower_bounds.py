"""Print the lowest version of each package that the program declares to need, for pip's -r."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

if __name__ == "__main__":
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    for line in declared:
        name, bound = re.fullmatch(r"([\w.-]+)>=([\w.]+)", line).groups()
        print(f"{name}=={bound}")
