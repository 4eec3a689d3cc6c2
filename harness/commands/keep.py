"""``shadowbench keep``: pack the results of one or several runs of an experiment into a small folder."""

import os
import shutil
import sys
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path

from ..errors import UserError, say
from ..results.folder import ResultsFolder, require_plain
from ..results.record import FAILURES, Record
from ..results.schema import ARCHIVE, read_records, write_archive
from ..runner.cluster.ledger import NAME as CLUSTER
from ..runner.cluster.ledger import merging_refused
from ..texts import numbered
from .options import command
from .show import show

BULKY = ("images", "maps")  # left out by default: pictures of scenes, and maps of the cost or the errors of each pixel
DRAWN = (".csv", ".md", ".svg", ".png")  # files beside the records that are copied: drawings, tables and notes


@command(
    """
    Pack results into a folder to publish.
    shadowbench keep results/local/table1-quick --out results/my-machine/table1

    sources      Results folders of one experiment.
    --out PATH   The folder to create.
    --with WHAT  Also copy images or maps. Repeatable.
    --replace    Replace the contents of --out.
    """
)
def keep(sources: list[Path], out: Path, extras: list[str] | None = None, replace: bool = False) -> int:
    """Pack results: all records in one compressed file, the environments of their runs, and the drawings made again.

    If several folders hold a record of the same point, the last folder whose record is not a failure counts. Journals,
    logs, answers and everything that can be computed again are left out. ``--out`` appears only when it is complete.
    """
    unknown = [name for name in extras or () if name not in BULKY]
    if unknown:
        raise UserError(f"--with {unknown[0]}: choose {' or '.join(BULKY)}")
    if out.resolve() in [source.resolve() for source in sources]:
        raise UserError(f"--out {out}: is one of the folders to read; choose another")
    if out.exists() and not out.is_dir():
        raise UserError(f"--out {out}: is a file; choose another")
    if out.is_dir() and any(out.iterdir()):
        if not replace:
            raise UserError(f"--out {out}: is not empty; choose another, or give --replace")
        if not (out / "records").is_dir():
            raise UserError(f"--out {out}: is no folder of results, so it is not replaced; choose another")
    for source in sources:
        require_plain(source)
    found = [record for source in sources for record in read_records(source)]
    experiments = sorted({record.experiment for record in found})
    if len(experiments) > 1:
        raise UserError(f"records of {' and '.join(experiments)}; pack each experiment into its own folder")
    apart = merging_refused(sources)
    if apart:
        raise UserError(f"{apart}; pack each into its own folder")
    records = chosen(found)
    unscored = sum(1 for source in sources for _ in (source / "answers").glob("*.npz"))
    if unscored:
        print(
            f"left out: {numbered(unscored, 'answer')} without a score; run `shadowbench score` first to include them",
            file=sys.stderr,
        )
    fresh = out.with_name(f".{out.name}.{os.getpid()}")
    try:
        with ExitStack() as held:
            for place in [*sources, *([out] if out.is_dir() else [])]:
                held.enter_context(ResultsFolder(place).idle())
            _fill(fresh, sources, records)
            show(experiments[0], fresh, quiet=True)
            for name in set(BULKY) - set(extras or ()):  # the drawings are made from them
                shutil.rmtree(fresh / name, ignore_errors=True)
            _put(fresh, out)
    except OSError as error:
        reason, place = error.strerror or str(error), Path(error.filename or out)
        place = out if place.is_relative_to(fresh) else place  # nobody asked for the folder that is written first
        raise UserError(f"{place}: cannot be read or written ({reason})") from error
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
    say(f"packed: {len(records)} records of {experiments[0]} in {out}")
    return 0


def chosen(records: Iterable[Record]) -> list[Record]:
    """One record per point: the last that is not a failure, else the last."""
    failures_first = sorted(records, key=lambda record: record.status not in FAILURES)
    return list({record.key: record for record in failures_first}.values())


def _fill(fresh: Path, sources: Sequence[Path], records: Sequence[Record]) -> None:
    write_archive(fresh / "records" / ARCHIVE, records)
    named = {f"{record.environment}.json" for record in records}
    for source in sources:
        for name in ("environments", *BULKY):
            for path in (source / name).glob("*"):
                if path.is_file() and (name in BULKY or path.name in named):
                    (fresh / name).mkdir(exist_ok=True)
                    shutil.copyfile(path, fresh / name / path.name)
        if (source / CLUSTER).is_file():
            with open(fresh / CLUSTER, "ab") as log:
                log.write((source / CLUSTER).read_bytes())
        for path in source.iterdir():
            if path.is_file() and path.suffix in DRAWN:
                shutil.copyfile(path, fresh / path.name)


def _put(fresh: Path, out: Path) -> None:
    """Put the new folder in the place of the old one. The old one is deleted only after the new one is there."""
    old = out.with_name(f".{out.name}.{os.getpid()}.old")
    if out.exists():
        out.rename(old)
    fresh.rename(out)
    shutil.rmtree(old, ignore_errors=True)
