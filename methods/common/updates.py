"""How a structure is kept up to date, for methods that have a choice."""

from __future__ import annotations

from ...harness.errors import UserError
from ...harness.scene.prepared import Prepared


def refuse_static(method: str, update: str, prepared: Prepared) -> None:
    """Raise :class:`UserError` if ``update`` is "static" although the mesh moves."""
    if update == "static" and prepared.moves:
        moves = f"{prepared.scene.name} moves over {prepared.frame_count} frames"
        raise UserError(f"{method}.update=static: {moves}; choose rebuild or refit")
