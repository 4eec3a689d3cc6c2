"""Building a tree each frame (keys, sort, LBVH or H-PLOC), or refitting one that was made on the host."""

from __future__ import annotations

from typing import Any

from ....harness.frame.frame import Frame
from .rebuild import MAKERS, Rebuilt
from .refit import Refitted

UPDATES = ("rebuild", "refit", "static")
BUILDERS = tuple(MAKERS)


def tree_of(frame: Frame, update: str, builder: str) -> Rebuilt | Refitted:
    """The tree of a frame's triangles, and its passes."""
    return Rebuilt(frame, builder) if update == "rebuild" else Refitted(frame, update == "static")


def built(update: str, builder: str) -> dict[str, Any]:
    """For :meth:`....harness.frame.method.Method.built`."""
    return {"update": update, "tree": builder if update == "rebuild" else "SAH of the first frame, on the host"}
