"""Versions of the project against one another: frames timed in turns, with a process for each version.

    python tests/tools/versions.py --version before=main --version now=. --scene fairy --scene sibenik@512
    python tests/tools/versions.py --version now=. --variant now:trial=chunk=128+cells=512 --scene cloth
    python tests/tools/versions.py --version a=aa29322 --version b=../other --scene fairy:count=4 --scene buddha:spot=20

A version is a commit or a folder that holds harness/, methods/ and experiments/; a variant is a version with settings of the
method. A scene is ``NAME[@SIDE][:CHANGE=VALUE,...][#FRAME]``: 1024 pixels a side and the middle frame unless given, and
changes as in ``shadowbench.harness.scene.overrides.Lighting`` (``facing=true``). A round times every row on a scene before
the next scene, in turned order every second time. A cell is the median over the rounds of a row's time over the first row's
in the same round; "!" marks answers whose bits are not the first row's. Exit code 1 if there are any, or errors.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).resolve().parents[2]
PARTS = ("harness", "methods", "experiments")


def source_of(version: str, folder: Path) -> None:
    """Make ``folder``/shadowbench the package of a version. ValueError if it is neither a folder nor a commit."""
    package = folder / "shadowbench"
    package.mkdir(parents=True)
    if Path(version).is_dir():
        for part in PARTS:
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(Path(version) / part, package / part, ignore=ignored)
    else:
        command = ["git", "-C", str(ROOT), "archive", version, *PARTS]
        done = subprocess.run(command, capture_output=True, check=False)
        if done.returncode:
            raise ValueError(f"{version!r} is no folder and no commit of this repository")
        with tarfile.open(fileobj=io.BytesIO(done.stdout)) as archive:
            archive.extractall(package, filter="data")
    for module in (package / "harness" / "shadowbench").glob("*.py"):
        shutil.copy(module, package)


class Worker:
    """The process of one version."""

    def __init__(self, folder: Path, device: str):
        environment = {**os.environ, "PYTHONPATH": f"{folder}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
        program = Path(__file__).with_name("version_worker.py")
        self.errors = folder / "errors"
        with self.errors.open("w") as errors:
            self.process = subprocess.Popen(
                [sys.executable, "-P", str(program), str(folder), device],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                env=environment,
                text=True,
            )

    def ask(self, **request: Any) -> dict[str, Any]:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        try:
            print(json.dumps(request), file=self.process.stdin, flush=True)
            reply: dict[str, Any] = json.loads(self.process.stdout.readline())
        except (BrokenPipeError, json.JSONDecodeError):
            said = self.errors.read_text().strip().splitlines()
            reply = {"error": said[-1] if said else "the process ended"}
        return reply


@dataclass
class Row:
    """A version or a variant: medians of its rounds by scene, and by scene what was replied first."""

    name: str
    version: str
    settings: dict[str, str] = field(default_factory=dict)
    ms: dict[str, list[float]] = field(default_factory=dict)
    first: dict[str, dict[str, Any]] = field(default_factory=dict)

    def ratio(self, base: Row, scene: str) -> list[float]:
        """The times over ``base``'s, round by round."""
        return [x / y for x, y in zip(self.ms.get(scene, []), base.ms.get(scene, []), strict=False)]


def rows_of(versions: list[str], variants: list[str]) -> list[Row]:
    """A row for each version and each variant. ValueError if a variant is of none of them."""
    rows = [Row(name, name) for name, _, _ in (version.partition("=") for version in versions)]
    names = [row.name for row in rows]
    for variant in variants:
        version, _, settings = variant.partition(":")
        if version not in names or not settings:
            raise ValueError(f"variant {variant!r} is not VERSION:SETTING=VALUE of {', '.join(names)}")
        rows.append(Row(variant, version, dict(pair.split("=", 1) for pair in settings.split(","))))
    return rows


def measure(rows: list[Row], workers: dict[str, Worker], given: argparse.Namespace) -> None:
    """Make every frame, the versions side by side, then time them in turns."""

    def ask(row: Row, scene: str, samples: int) -> dict[str, Any]:
        wanted = {"method": given.method, "settings": row.settings, "scene": scene, "samples": samples}
        return workers[row.version].ask(**wanted)

    def make(version: str) -> None:
        for row in rows:
            if row.version == version:
                row.first = {scene: ask(row, scene, 0) for scene in given.scene}

    threads = [threading.Thread(target=make, args=(version,)) for version in workers]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    began = time.monotonic()
    for number in range(given.rounds):
        for scene in given.scene:
            for row in rows if number % 2 == 0 else rows[::-1]:
                if "error" in row.first[scene] or time.monotonic() - began > given.seconds:
                    continue
                reply = ask(row, scene, given.samples)
                if "error" in reply:
                    row.first[scene] = reply
                else:
                    row.ms.setdefault(scene, []).append(float(np.median(reply["ms"])))


def cell_of(row: Row, base: Row, scene: str) -> str:
    """Milliseconds of the first row, or the ratio to them with its range over the rounds."""
    if "error" in row.first[scene]:
        return "error"
    ratios = row.ratio(base, scene)
    if not ratios:
        return "-"
    same = "" if row.first[scene]["answers"] == base.first[scene].get("answers") else " !"
    if row is base:
        return f"{np.median(row.ms[scene]):.3f} ms"
    return f"{np.median(ratios):.3f} ({min(ratios):.3f}-{max(ratios):.3f}){same}"


def table_of(rows: list[Row], scenes: list[str]) -> Table:
    """A row for each version and variant, a column for each scene, and the geometric mean of the ratios."""
    table = Table("", *scenes, "all")
    for row in rows:
        ratios = [row.ratio(rows[0], scene) for scene in scenes]
        mean = f"{np.exp(np.mean([np.log(np.median(r)) for r in ratios])):.3f}" if all(ratios) else ""
        table.add_row(row.name, *(cell_of(row, rows[0], scene) for scene in scenes), mean)
    return table


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--version", action="append", required=True, help="NAME=COMMIT or NAME=FOLDER")
    parser.add_argument("--variant", action="append", default=[], help="NAME:SETTING=VALUE,...")
    parser.add_argument("--scene", action="append", required=True, help="NAME[@SIDE][:CHANGE=VALUE,...][#FRAME]")
    parser.add_argument("--method", default="ray_grids")
    parser.add_argument("--device", default="", help="default: cuda:0 if present, else cpu")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--samples", type=int, default=25, help="frames of a row in a round")
    parser.add_argument("--seconds", type=float, default=1e9, help="stop timing after so long")
    parser.add_argument("--out", type=Path, help="where everything is written as JSON")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        workers: dict[str, Worker] = {}
        try:
            rows = rows_of(given.version, given.variant)
            for version in given.version:
                name, _, source = version.partition("=")
                source_of(source, Path(folder) / name)
                workers[name] = Worker(Path(folder) / name, given.device)
            measure(rows, workers, given)
        except (ValueError, FileNotFoundError) as error:
            parser.error(str(error))
        finally:
            for worker in workers.values():
                worker.process.kill()
                worker.process.wait()
    Console(width=max(80, 24 * (len(given.scene) + 2))).print(table_of(rows, given.scene))
    errors = [(row.name, scene, r["error"]) for row in rows for scene, r in row.first.items() if "error" in r]
    for name, scene, said in errors:
        print(f"{name}, {scene}: {said}", file=sys.stderr)
    if given.out:
        given.out.write_text(json.dumps([vars(row) for row in rows], indent=1))
    answers = [[row.first[scene].get("answers") for row in rows] for scene in given.scene]
    return int(bool(errors) or any(len(set(found)) > 1 for found in answers))


if __name__ == "__main__":
    sys.exit(main())
