"""``shadowbench show``: draw again from records. Times nothing, scores nothing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..errors import UserError
from ..results.schema import read_records
from ..runner.experiment import find_experiment


def show(experiment: str, folder: Path | str, quiet: bool = False) -> list[Path]:
    """Draw an experiment from the records in ``folder``, print its table unless ``quiet``; the files written.

    Raises :class:`UserError` for an unknown experiment, a folder without records of it, or one that cannot be
    written to.
    """
    declared = find_experiment(experiment)
    folder = Path(folder)
    if not folder.is_dir():
        raise UserError(f"{folder}: no such folder; name one that `shadowbench run {experiment}` wrote")
    if declared.draw is None:
        raise UserError(f"{experiment}: has nothing to draw; its records are in {folder / 'records'}")
    draw: Callable[..., list[Path]] = declared.draw
    if declared.presets:
        refuse_others(experiment, folder)
    try:
        return list(draw(folder, quiet))
    except OSError as error:
        reason = error.strerror or " ".join(str(error).split())
        raise UserError(
            f"{error.filename or folder}: cannot be read or written ({reason}); free or change it"
        ) from error


def refuse_others(experiment: str, folder: Path) -> None:
    """Raise :class:`UserError` where all records of a folder are another experiment's: whose, and what shows them."""
    whose: list[str] = []
    for record in read_records(folder):
        name = record.experiment
        if name == experiment:
            return
        whose.append(name)
    names = list(dict.fromkeys(whose))
    raise UserError(
        f"{folder}: its records are of {' and '.join(names)}, not of {experiment}; "
        f"shadowbench show {names[0]} {folder}"
    )
