"""What pip leaves behind of a package of methods, so that Python finds its entry points."""

from collections.abc import Mapping
from pathlib import Path


def declare_methods(folder: Path, package: str, methods: Mapping[str, str]) -> None:
    """The facts of a package in a folder on the path. ``methods``: by name, module and class as ``module:Class``."""
    about = folder / f"{package}-0.1.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 0.1\n")
    points = "\n".join(f"{name} = {place}" for name, place in methods.items())
    (about / "entry_points.txt").write_text(f"[shadowbench.methods]\n{points}\n")
