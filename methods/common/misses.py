"""A frame in which nothing can be hit: no triangle, so no structure and no ray."""

from __future__ import annotations

import math

from ...harness.frame import Frame
from ...harness.passes import Pass
from ...harness.scene import Effects


def write_misses(frame: Frame) -> None:
    """Triangle -1, t = inf, u = v = 0 for every pixel."""
    answers = frame.answers
    answers.triangle.fill_(-1)
    answers.t.fill_(math.inf)
    answers.u.zero_()
    answers.v.zero_()


def miss_passes(frame: Frame, effects: Effects) -> list[Pass]:
    """The passes of a method on a mesh without triangles."""
    passes = [Pass("nothing to hit", "trace", ("camera",), ("hits",), lambda: write_misses(frame))]
    for i, wanted in enumerate(effects.shadows):
        if wanted:
            passes.append(
                Pass(
                    f"light {i}: nothing to shadow",
                    "shadow",
                    ("hits",),
                    (f"visibility/{i}",),
                    lambda i=i: frame.answers.visibility[i].zero_(),  # type: ignore[misc]
                    effect=f"shadows/{i}",
                )
            )
    return passes
