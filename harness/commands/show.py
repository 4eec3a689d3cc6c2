"""``shadowbench show``: draw again from records. Times nothing, scores nothing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..errors import UserError
from ..plan import find_experiment


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
    try:
        return list(draw(folder, quiet))
    except OSError as error:
        raise UserError(
            f"{error.filename or folder}: cannot write ({error.strerror}); free or change it"
        ) from error
