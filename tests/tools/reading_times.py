"""How long reading takes: the largest stand-in written in each format, read by us and by trimesh in turn.

    python tests/tools/reading_times.py --rounds 5

Prints the medians of both, seconds, and their ratio. Exit code 1 where ours takes more than twice as long.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.readers.load import load

FORMATS: dict[str, dict[str, Any]] = {
    "binary.ply": {}, "text.ply": {"encoding": "ascii"}, "a.obj": {}, "binary.stl": {},
    "text.stl": {"file_type": "stl_ascii"}, "a.off": {}, "a.glb": {}, "a.3mf": {},
}  # fmt: skip
"""Names of the files, and how trimesh writes them."""

MOST = 2.0


def seconds(read: Callable[[Path], object], path: Path) -> float:
    """How long one reading takes."""
    began = time.perf_counter()
    read(path)
    return time.perf_counter() - began


def theirs(path: Path) -> object:
    return trimesh.load_scene(path, process=False).to_mesh()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--scene", default="buddha")
    parser.add_argument("--only", action="append", help=f"one of {', '.join(FORMATS)}; repeatable")
    given = parser.parse_args()
    geometry = resolve(given.scene).geometry()
    mesh = trimesh.Trimesh(np.asarray(geometry.positions(0)), geometry.faces, process=False)
    print(f"{given.scene}: {len(mesh.faces):,} triangles, medians of {given.rounds} readings in turn")
    print("format      MB  ours, s  trimesh, s  ratio", flush=True)
    slow = 0
    with tempfile.TemporaryDirectory() as folder:
        for name, how in FORMATS.items():
            if given.only and name not in given.only:
                continue
            path = Path(folder) / name
            mesh.export(path, **how)
            assert len(load(path).faces) == len(mesh.faces)
            times = [(seconds(load, path), seconds(theirs, path)) for _ in range(given.rounds)]
            ours, other = (statistics.median(column) for column in zip(*times, strict=True))
            size = path.stat().st_size / 1e6
            print(f"{name:10} {size:4.0f} {ours:8.2f} {other:11.2f} {ours / other:6.2f}", flush=True)
            slow += ours > MOST * other
            path.unlink()
    return int(slow > 0)


if __name__ == "__main__":
    sys.exit(main())
