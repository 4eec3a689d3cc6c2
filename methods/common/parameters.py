"""Checks of parameters that several methods have."""

from collections.abc import Iterable
from typing import Any

from ...harness.errors import UserError
from ...harness.scene.prepared import Prepared


def check_choices(block: Any, **choices: Iterable[str]) -> None:
    """Raise ValueError unless each named parameter of a block has one of its values."""
    for name, values in choices.items():
        if getattr(block, name) not in values:
            raise ValueError(f"{name} must be one of {', '.join(values)}")


def check_ranges(block: Any, **ranges: tuple[int, int]) -> None:
    """Raise ValueError unless each named parameter of a block lies between its least and its greatest value."""
    for name, (low, high) in ranges.items():
        if not low <= getattr(block, name) <= high:
            raise ValueError(f"must lie in {low}..{high}")


def refuse_static(method: str, update: str, prepared: Prepared) -> None:
    """Raise :class:`UserError` if ``update`` is "static" although the mesh moves."""
    if update == "static" and prepared.moves:
        moves = f"{prepared.scene.name} moves over {prepared.frame_count} frames"
        raise UserError(f"{method}.update=static: {moves}; choose rebuild or refit")
