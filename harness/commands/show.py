"""``shadowbench show``: draw from records. Nothing is timed or scored."""

import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

from ..errors import UserError, one_line, say
from ..results.folder import require_plain
from ..results.schema import each_record
from ..runner.planning.experiment import find_experiment
from .options import command

RESULTS = Path("results/local")  # the parent folder of results without `--out`


@command(
    """
    Draw tables and figures of an experiment from its records.
    shadowbench show table1 results/local/table1-quick

    experiment  Name of an experiment.
    folder      A results folder. Default: the newest folder of this experiment in results/local.
    --out PATH  Folder to write to. Default: the results folder itself.
    """
)
def show_(experiment: str, folder: Path | None = None, out: Path | None = None, as_json: bool = False) -> int:
    """Draw the tables and figures of an experiment from its records. Nothing is measured."""
    files = show(experiment, folder or newest(experiment), quiet=as_json, out=out)
    if as_json:
        print(json.dumps({"files": [str(file) for file in files]}))
    else:
        for file in files:
            say(f"written: {file}")
    return 0


def newest(experiment: str) -> Path:
    """The local results folder of an experiment that was written last. Raises :class:`UserError` if there is none."""
    if not find_experiment(experiment).presets and RESULTS.is_dir():
        return RESULTS  # it reads the results of the others
    folders = [path.parent for path in RESULTS.glob(f"{experiment}-*/records")]
    if not folders:
        raise UserError(f"no results of {experiment} in {RESULTS}; run it first, or name a folder")
    return max(folders, key=lambda path: (path / "records").stat().st_mtime)


def show(experiment: str, folder: Path | str, quiet: bool = False, out: Path | None = None) -> list[Path]:
    """Draw an experiment from the records in ``folder``; print its table unless ``quiet``. Returns the files written.

    ``out``: the folder to write to, where that is not ``folder`` itself. Raises :class:`UserError` for an unknown
    experiment, and for a folder without its records or without write access.
    """
    declared = find_experiment(experiment)
    folder = Path(folder)
    if not folder.is_dir():
        raise UserError(f"{folder}: no such folder; name a folder that `shadowbench run {experiment}` wrote")
    require_plain(folder)
    if declared.draw is None:
        raise UserError(f"{experiment}: this experiment has no drawing; its records are in {folder / 'records'}")
    draw: Callable[..., list[Path]] = declared.draw
    if declared.presets:
        refuse_others(experiment, folder)
    try:
        with nullcontext() if out is None else lent(folder, out):
            return list(draw(out or folder, quiet))
    except OSError as error:
        reason = error.strerror or one_line(error)
        raise UserError(
            f"{error.filename or folder}: cannot be read or written ({reason}); change its permissions or free space, or "
            "write elsewhere with --out"
        ) from error


@contextmanager
def lent(folder: Path, out: Path) -> Iterator[None]:
    """``out`` with what drawings are made from: copies of the tables, and links to the folders until all is drawn.

    Raises :class:`UserError` where ``out`` has records of its own.
    """
    if (out / "records").exists():
        raise UserError(f"--out {out}: has records of its own; name another folder")
    out.mkdir(parents=True, exist_ok=True)
    links = []
    try:
        for path in sorted(folder.iterdir()):
            if path.is_dir() and path.resolve() != out.resolve():
                links.append(out / path.name)
                links[-1].symlink_to(path.resolve(), target_is_directory=True)
            elif path.suffix in (".csv", ".md", ".svg", ".png"):
                shutil.copyfile(path, out / path.name)
        yield
    except UserError as error:
        # The links are about to go: the message names the files that stay.
        text = str(error)
        for link in links:
            text = text.replace(str(link), str(folder / link.name))
        raise UserError(text) from error
    finally:
        for link in links:
            if link.is_symlink():
                link.unlink()


def refuse_others(experiment: str, folder: Path) -> None:
    """Raise :class:`UserError` if all records of a folder belong to another experiment; the message names it."""
    whose: dict[str, None] = {}
    for record in each_record(folder):
        if record.experiment == experiment:
            return
        whose[record.experiment] = None
    names = sorted(whose)
    raise UserError(
        f"{folder}: its records belong to {' and '.join(names)}, not to {experiment}; "
        f"run shadowbench show {names[0]} {folder}"
    )
