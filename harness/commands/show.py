"""``shadowbench show``: draw from records. Nothing is timed or scored."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..errors import UserError
from ..results.schema import read_records
from ..runner.experiment import find_experiment


def show(experiment: str, folder: Path | str, quiet: bool = False) -> list[Path]:
    """Draw an experiment from the records in ``folder``; print its table unless ``quiet``. Returns the files written.

    Raises :class:`UserError` for an unknown experiment, and for a folder without its records or without write access.
    """
    declared = find_experiment(experiment)
    folder = Path(folder)
    if not folder.is_dir():
        raise UserError(f"{folder}: no such folder; name a folder that `shadowbench run {experiment}` wrote")
    if declared.draw is None:
        raise UserError(
            f"{experiment}: this experiment has no drawing; its records are in {folder / 'records'}"
        )
    draw: Callable[..., list[Path]] = declared.draw
    if declared.presets:
        refuse_others(experiment, folder)
    try:
        return list(draw(folder, quiet))
    except OSError as error:
        reason = error.strerror or " ".join(str(error).split())
        raise UserError(
            f"{error.filename or folder}: cannot be read or written ({reason}); change its permissions or free space"
        ) from error


def refuse_others(experiment: str, folder: Path) -> None:
    """Raise :class:`UserError` if all records of a folder belong to another experiment; the message names it."""
    whose: list[str] = []
    for record in read_records(folder):
        name = record.experiment
        if name == experiment:
            return
        whose.append(name)
    names = list(dict.fromkeys(whose))
    raise UserError(
        f"{folder}: its records belong to {' and '.join(names)}, not to {experiment}; "
        f"run shadowbench show {names[0]} {folder}"
    )
