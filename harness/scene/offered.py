"""What a scene's file offers by name: cameras and lights that are used when they are asked for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from ..errors import UserError, did_you_mean

T = TypeVar("T")


def offered(title: str, kind: str, known: Mapping[str, T], name: str) -> T:
    """The camera or light of this name that a scene offers. Raises :class:`UserError` if it offers none of that name."""
    if name in known:
        return known[name]
    if not known:
        raise UserError(f"{title}: has no {kind} {name!r}; its file offers none")
    raise UserError(f"{title}: has no {kind} {name!r}{did_you_mean(name, known)}")
