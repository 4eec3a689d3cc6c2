"""A frame in which nothing can be hit: no triangle, so no structure and no ray."""

import math

from ...harness.frame.effects.mirrors import traced_bounces
from ...harness.frame.frame import Frame
from ...harness.frame.schedule.passes import Pass
from ...harness.scene.effects import Effects


def write_misses(frame: Frame, bounce: int = 0) -> None:
    """Triangle -1, t = inf, u = v = 0 for every pixel: of the primary rays, or of the mirrored rays of a bounce."""
    hits = frame.hits(bounce)
    hits.triangle.fill_(-1)
    hits.t.fill_(math.inf)
    hits.u.zero_()
    hits.v.zero_()


def miss_passes(frame: Frame, effects: Effects) -> list[Pass]:
    """The passes of a method on a mesh without triangles."""
    passes = [Pass("nothing to hit", "trace", ("camera",), ("hits",), lambda: write_misses(frame))]
    for i, wanted in enumerate(effects.shadows):
        if wanted:
            name, clear = f"light {i}: nothing to shadow", frame.answers.shadowed[i].zero_
            passes.append(Pass(name, "shadow", ("hits",), (f"shadowed/{i}",), clear, f"shadows/{i}"))
    passes += traced_bounces(effects, (), lambda b: write_misses(frame, b), lambda i, b: frame.bits(b)[i].zero_())
    return passes
