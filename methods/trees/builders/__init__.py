"""Building a tree each frame (keys, sort, LBVH or H-PLOC), or refitting one that was made on the host."""

from __future__ import annotations

from typing import Any

from ....harness.frame.frame import Frame
from .rebuild import MAKERS, Rebuilt
from .refit import Refitted

UPDATES = ("rebuild", "refit", "static")
BUILDERS = tuple(MAKERS)


def tree_of(frame: Frame, update: str, builder: str, made_of: int = 0) -> Rebuilt | Refitted:
    """The tree of a frame's triangles, and its passes. ``made_of``: the frame that a refitted one is made of."""
    return Rebuilt(frame, builder) if update == "rebuild" else Refitted(frame, update == "static", made_of)


def built(update: str, builder: str, made_of: int = 0) -> dict[str, Any]:
    """For :meth:`....harness.frame.method.Method.built`."""
    which = f"frame {made_of}" if made_of else "the first frame"
    return {"update": update, "tree": builder if update == "rebuild" else f"SAH of {which}, on the host"}
