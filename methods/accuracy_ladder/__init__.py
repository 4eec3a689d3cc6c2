"""A plain tree for the accuracy experiment: each measure against rounding errors is a parameter.

A wp.Bvh over the bounding boxes of the triangles is rebuilt in place each frame and traced in blocks of 8 x 4 pixels. The
parameters change only the triangle test, the origin of the shadow rays, the padding of the boxes and the compiler's float
arithmetic. The defaults are exact; :func:`.parameters.known_inexact` says which settings are not.
"""

from __future__ import annotations

from typing import Any, ClassVar

import warp as wp

from ...harness.frame.effects.specialise import specialised
from ...harness.frame.frame import Frame
from ...harness.frame.method import BaseMethod
from ...harness.frame.schedule.passes import Pass
from ...harness.scene.effects import Effects, Limits
from ..common.box_tree import QUERY_BLOCK, BoxTree
from ..common.misses import miss_passes
from ..common.pixels import thread_count
from ..common.ray_passes import shadow_ray_passes
from .kernels import make_kernels
from .parameters import ORIGINS, PADDED_UNITS, Build, Trace, known_inexact


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
        self._frame = frame
        constructor = "sah" if wp.get_device(frame.device).is_cpu else "lbvh"
        self._threads = thread_count(frame.width, frame.height, True)
        kernels = make_kernels(self.trace.test, self.build.fast_math)
        self._primary_kernel, self._shadow_kernel = (
            specialised(kernel, effects.switches()) for kernel in kernels
        )
        padding = PADDED_UNITS[self.build.padding]
        self._tree = BoxTree(frame, constructor, self.build.leaf_size, padding)
        self._hit = wp.zeros(frame.pixels, dtype=wp.vec3d, device=frame.device)
        return [
            *self._tree.passes(),
            Pass("primary rays", "trace", ("bvh", "camera"), ("hits",), self._primary),
            *shadow_ray_passes(effects, ("bvh", "hits", "camera"), self._shadow),
        ]

    def built(self) -> dict[str, Any]:
        return {"test": self.trace.test, "origin": self.trace.origin, "padding": self.build.padding}

    def _primary(self) -> None:
        frame = self._frame
        wp.launch(
            self._primary_kernel,
            dim=self._threads,
            inputs=[self._tree.id, self._tree.records, frame.camera, frame.mesh],
            outputs=[frame.hits(0), self._hit],
            block_dim=QUERY_BLOCK,
            device=frame.device,
        )

    def _shadow(self, light: int) -> None:
        frame = self._frame
        wp.launch(
            self._shadow_kernel,
            dim=self._threads,
            inputs=[
                light, ORIGINS.index(self.trace.origin), self._tree.id, self._tree.records, frame.camera,
                frame.mesh, self._tree.box,
                frame.lights, frame.hits(0), self._hit,
            ],
            outputs=[frame.answers.shadowed],
            block_dim=QUERY_BLOCK,
            device=frame.device,
        )  # fmt: skip


METHOD = AccuracyLadder
