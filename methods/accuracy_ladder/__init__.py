"""One plain tree in which each safety measure is a parameter, so that its error and its cost can be seen alone.

A wp.Bvh rebuilt in place each frame over the triangles' boxes, 8 x 4 pixel blocks, nothing else: only the triangle
test, the start of the shadow rays, the padding of the boxes and the compiler's float arithmetic change. With its
defaults it is exact; :func:`.parameters.known_inexact` says what is not.
"""

from __future__ import annotations

from typing import Any, ClassVar

import warp as wp

from ...harness.frame.frame import Frame
from ...harness.frame.method import BaseMethod
from ...harness.frame.passes import Pass
from ...harness.scene.effects import Effects, Limits
from ..common.bounds import launch_boxes
from ..common.misses import miss_passes
from ..common.pixels import thread_count
from .kernels import make_kernels
from .parameters import ORIGINS, PADDED_UNITS, Build, Trace, known_inexact


class AccuracyLadder(BaseMethod):
    """See the module."""

    name: ClassVar[str] = "accuracy_ladder"
    title: ClassVar[str] = "BVH with accuracy knobs"
    cannot: ClassVar[dict[str, str]] = dict.fromkeys(
        ("receivers", "alpha", "mirror"), "its knobs are for whole frames of opaque triangles"
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
        self._constructor = "sah" if wp.get_device(frame.device).is_cpu else "lbvh"
        self._threads = thread_count(frame.width, frame.height, True)
        self._primary_kernel, self._shadow_kernel = make_kernels(self.trace.test, self.build.fast_math)
        # The tree must exist before the first frame; its buffers are what every rebuild uses again.
        points, valid = frame.prepared.points(0)
        corners = points[frame.prepared.faces]
        corners[valid == 0] = 0.0
        with wp.ScopedDevice(frame.device):
            self._box = wp.zeros(6, dtype=wp.float32)
            self._lowers = wp.array(corners.min(axis=1), dtype=wp.vec3f)
            self._uppers = wp.array(corners.max(axis=1), dtype=wp.vec3f)
            self._hit = wp.zeros(frame.pixels, dtype=wp.vec3d)
        self._bvh = wp.Bvh(
            self._lowers, self._uppers, constructor=self._constructor, leaf_size=self.build.leaf_size
        )
        passes = [
            Pass("boxes", "build", ("points", "triangles", "reach"), ("boxes",), self._boxes),
            Pass("rebuild", "build", ("boxes",), ("bvh",), self._rebuild),
            Pass("primary rays", "trace", ("bvh", "camera"), ("hits",), self._primary),
        ]
        for i, wanted in enumerate(effects.shadows):
            if wanted:
                passes.append(
                    Pass(
                        f"light {i}: shadow rays",
                        "shadow",
                        ("bvh", "hits", "camera", f"light/{i}"),
                        (f"visibility/{i}",),
                        lambda i=i: self._shadow(i),  # type: ignore[misc]
                        effect=f"shadows/{i}",
                    )
                )
        return passes

    def built(self) -> dict[str, Any]:
        return {"test": self.trace.test, "origin": self.trace.origin, "padding": self.build.padding}

    def _boxes(self) -> None:
        launch_boxes(self._frame, self._box, self._lowers, self._uppers, PADDED_UNITS[self.build.padding])

    def _rebuild(self) -> None:
        self._bvh.rebuild(self._constructor)

    def _primary(self) -> None:
        frame = self._frame
        wp.launch(
            self._primary_kernel,
            dim=self._threads,
            inputs=[self._bvh.id, frame.camera, frame.mesh],
            outputs=[frame.hits(0), self._hit],
            device=frame.device,
        )

    def _shadow(self, light: int) -> None:
        frame = self._frame
        wp.launch(
            self._shadow_kernel,
            dim=self._threads,
            inputs=[
                self._bvh.id, light, ORIGINS.index(self.trace.origin), frame.camera, frame.lights, self._box,
                frame.mesh, frame.hits(0), self._hit,
            ],
            outputs=[frame.answers.visibility],
            device=frame.device,
        )  # fmt: skip


METHOD = AccuracyLadder
