"""Building a tree each frame (keys, sort, LBVH or H-PLOC), or refitting one that was made on the host."""

from ....harness.frame.frame import Frame
from .. import constants
from .rebuild import MAKERS, Rebuilt
from .refit import Refitted

UPDATES = ("rebuild", "refit", "static")
BUILDERS = ("auto", *MAKERS)


def tree_of(frame: Frame, update: str, builder: str, made_of: int = 0) -> Rebuilt | Refitted:
    """The tree of a frame's triangles, and its passes.

    ``builder`` "auto": by their number; ``made_of``: the frame that a refitted one is made of
    """
    if update != "rebuild":
        return Refitted(frame, update == "static", made_of)
    if builder == "auto":
        builder = "lbvh" if frame.triangle_count < constants.MANY_TRIANGLES else "hploc"
    return Rebuilt(frame, builder)
