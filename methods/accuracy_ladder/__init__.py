"""A plain tree for the accuracy experiment: each measure against rounding errors is a parameter.

A wp.Bvh over the bounding boxes of the triangles is rebuilt in place each frame and traced in blocks of 8 x 4 pixels. The
parameters change only the triangle test, the origin of the shadow rays, the padding of the boxes and the compiler's float
arithmetic. The defaults are exact; :func:`.parameters.known_inexact` says which settings are not.
"""

from typing import Any, ClassVar

import warp as wp

from ...harness.frame.frame import Frame
from ...harness.frame.method import BaseMethod
from ...harness.frame.schedule.passes import Pass
from ...harness.scene.effects import Effects, Limits
from ..common.box_tree import QUERY_BLOCK, BoxTree
from ..common.misses import miss_passes
from ..rays.launches import PixelRays
from .kernels import Rung, make_kernels
from .parameters import ORIGINS, PADDED_UNITS, SHEARED_TESTS, Build, Trace, known_inexact


class AccuracyLadder(BaseMethod):
    """See the module."""

    name: ClassVar[str] = "accuracy_ladder"
    title: ClassVar[str] = "BVH with accuracy parameters"
    cannot: ClassVar[dict[str, str]] = dict.fromkeys(
        ("receivers", "alpha", "mirror"), "its parameters are for whole frames of opaque triangles"
    )
    Build: ClassVar[type] = Build
    Trace: ClassVar[type] = Trace

    @property
    def known_inexact(self) -> str | None:
        return known_inexact(self.build, self.trace)

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        if frame.triangle_count == 0:
            return miss_passes(frame, effects)
        constructor = "sah" if wp.get_device(frame.device).is_cpu else "lbvh"
        self._tree = tree = BoxTree(frame, constructor, self.build.leaf_size, PADDED_UNITS[self.build.padding])
        scheme, sheared = ORIGINS.index(self.trace.origin), self.trace.test in SHEARED_TESTS
        rung = tree.boxes(Rung, scheme=scheme, sheared=sheared, box=tree.box)
        kernels = make_kernels(self.trace.test, self.build.fast_math)
        rays = PixelRays(frame, effects, rung, *kernels, block=QUERY_BLOCK)
        return [*tree.passes(), *rays.passes(("bvh",))]

    def built(self) -> dict[str, Any]:
        return {"test": self.trace.test, "origin": self.trace.origin, "padding": self.build.padding}


METHOD = AccuracyLadder
