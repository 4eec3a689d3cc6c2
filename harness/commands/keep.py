"""``shadowbench keep``: a run made small enough to travel, and several runs of one experiment made one."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from ..errors import UserError
from ..record_shape import ARCHIVE, read_records, write_archive
from .show import show

BULKY = ("images", "maps")
"""Folders that are taken only where they are asked for: pictures of scenes, and what each pixel cost or got wrong."""

Sources = Annotated[list[Path], typer.Argument(help="Folders that run wrote, of one experiment.")]
Out = Annotated[Path, typer.Option("--out", help="The folder to make; what it keeps already is replaced.")]
With = Annotated[
    list[str] | None,
    typer.Option("--with", help="images or maps, which are left out otherwise; again for both."),
]


def keep(sources: Sources, out: Out, take: With = None) -> int:
    """Keep what runs measured: all records in one compressed file, their environments, and the drawings made again.

    Of a point that several folders have, the record of the last one named is taken. Answers, journals, logs and what
    can be computed again are left behind.
    """
    unknown = [name for name in take or () if name not in BULKY]
    if unknown:
        raise UserError(f"--with {unknown[0]}: choose of {', '.join(BULKY)}")
    made = [record for source in sources for record in read_records(source)]
    experiments = sorted({record["experiment"] for record in made})
    if len(experiments) > 1:
        raise UserError(f"records of {' and '.join(experiments)}; keep each in a folder of its own")
    if out.resolve() in [source.resolve() for source in sources]:
        raise UserError(f"--out {out}: is one of the folders to keep; name another")
    try:
        write_archive(out / "records" / ARCHIVE, {record["key"]: record for record in made}.values())
        for path in (out / "records").glob("*.json"):
            path.unlink()
        _copy(sources, out, {f"{record['environment']}.json" for record in made})
    except OSError as error:
        reason = error.strerror or str(error)
        raise UserError(f"{error.filename or out}: cannot be read or written ({reason})") from error
    for path in show(experiments[0], out):
        print(f"written: {path}", file=sys.stderr)
    for name in set(BULKY) - set(take or ()):  # drawings are made from them, and stay
        shutil.rmtree(out / name, ignore_errors=True)
    return 0


def _copy(sources: Sequence[Path], out: Path, environments: set[str]) -> None:
    """Environments that records name, bulky folders, and tables that a run makes beside its records."""
    for name in ("environments", *BULKY):
        shutil.rmtree(out / name, ignore_errors=True)
        for source in sources:
            for path in (source / name).glob("*"):
                if name in BULKY or path.name in environments:
                    (out / name).mkdir(exist_ok=True)
                    shutil.copyfile(path, out / name / path.name)
    for source in sources:
        for path in source.glob("*.csv"):
            shutil.copyfile(path, out / path.name)
