"""Primary rays by a stream of triangles over the pixels, shadow rays and mirrored rays by a tree built beside it.

The camera's stream of ``ray_grids`` is faster than any tree for primary rays, but needs a grid of its own for each light
and has none for mirrored rays. A tree depends on the geometry alone: the graph of a frame builds it while the camera's
stream runs. The effects decide which of the two exists: without shadows and mirrors there is no tree.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.frame.frame import Frame
from ...harness.frame.method import BaseMethod
from ...harness.frame.schedule.passes import Hints, Pass
from ...harness.scene.effects import Effects, Limits
from ..common.misses import miss_passes
from ..common.pairs import grown
from ..gpu.reserve import counted
from ..ray_grids import RayGrids
from ..streams.settings import Build as StreamsBuild
from ..trees.build.rebuild import Rebuilt
from ..trees.build.refit import Refitted
from ..trees.trace.shadow_passes import ShadowRays, threads_built
from .choice import chosen
from .parameters import Build, Trace

STREAM, TREE = 0, 1
"""Branches of the graph."""


class Hybrid(BaseMethod):
    """See the package. Needs: those of the streams (:class:`..ray_grids.RayGrids`), then the tree's doubtful pairs."""

    name: ClassVar[str] = "hybrid"
    title: ClassVar[str] = "Hybrid (streamed primary rays, tree for the others)"
    simulates = frozenset({"shadows", "receivers", "directional", "alpha", "mirror"})
    Build: ClassVar[type] = Build
    Trace: ClassVar[type] = Trace

    def __init__(self, build: Any = None, trace: Any = None):
        super().__init__(build, trace)
        self._streams = RayGrids(StreamsBuild(threads=self.trace.threads))
        self._capacity = 0
        self._memory = 0
        self._shadows = self.build.shadows
        self._rays: ShadowRays | None = None

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        self._memory, self._rays = limits.memory, None
        self._shadows = chosen(frame, effects) if self.build.shadows == "auto" else self.build.shadows
        shadows = any(effects.shadows) and self._shadows == "tree"
        if not shadows and not effects.bounces:
            return self._streams.plan(frame, effects, limits)
        if frame.triangle_count == 0:
            return miss_passes(frame, effects)
        if not self._capacity:
            self._capacity = self.build.doubt_capacity or max(262144, frame.pixels // 2)
        starts = None
        if shadows:
            streamed, camera = self._streams.camera_stream(frame, effects, limits, "rounded")
            starts = camera.hit
        else:
            streamed = self._streams.plan(frame, effects, limits)
        tree = Rebuilt(frame, self.build) if self.build.update == "rebuild" else Refitted(frame, self.build)
        first, grows = tree.passes()
        rays = ShadowRays(
            frame,
            self.build,
            self.trace.of_tree(),
            effects,
            tree.tree,
            tree.extent,
            self._capacity,
            starts,
        )
        self._rays = rays
        after = [*rays.mirror_passes(), *rays.light_passes(late=False)]
        if shadows:
            after += rays.clear_passes()
        effect = "shadows" if shadows else "mirror"
        passes = [replace(work, hints=Hints(parallel=(TREE,)), effect=effect) for work in first]
        passes.append(replace(grows, hints=Hints(parallel=(TREE, 0)), effect=effect))
        passes += [work.hinted(parallel=(TREE, 1)) for work in after]
        passes += [work.hinted(parallel=(STREAM, *work.hints.parallel)) for work in streamed]
        return [*passes, *self._shadow_passes(rays, effects, shadows), *rays.bounce_passes()]

    def _shadow_passes(self, rays: ShadowRays, effects: Effects, shadows: bool) -> list[Pass]:
        """The shadow rays of the primary hits, after both branches."""
        scene = ("bvh", "points", "triangles", "camera", "hits", *effects.surface_reads())
        if not shadows:
            return rays.light_passes(late=True)
        return rays.in_shares(lambda share: rays.share_passes(share, scene))

    def needs(self) -> wp.array | None:
        streamed = self._streams.needs()
        if self._rays is None or streamed is None:
            return streamed
        both = [array.numpy().astype(np.int64).ravel() for array in (streamed, self._rays.counts)]
        return wp.array(np.concatenate(both), dtype=wp.int64, device="cpu")

    def grow(self, needed: NDArray[np.int64]) -> bool:
        streamed = self._streams.needs()
        assert streamed is not None
        more = self._streams.grow(needed.ravel()[: streamed.size])
        before = self._capacity
        if self._rays is not None:
            found = counted(needed.ravel()[streamed.size :])
            self._capacity = grown(int(found.max()), before, self._memory, "doubtful pairs")
        return more or self._capacity != before

    def counters(self) -> dict[str, int]:
        """The counters of the streams, and the pairs of shadow rays that the tree left to float64 in the last frame."""
        if self._streams.needs() is None:
            return {}
        counts = self._streams.counters()
        if self._rays is not None:
            found = self._rays.doubtful()
            counts["tree: shadow doubtful pairs"] = found["shadow"]
            if "mirror" in found:
                counts["tree: mirror doubtful pairs"] = found["mirror"]
        return counts

    def built(self) -> dict[str, Any]:
        if self._rays is None:
            streams = {} if self._streams.needs() is None else self._streams.built()
            return {"shadows": self._shadows, **streams}
        rebuilt = self.build.update == "rebuild"
        tree = self.build.builder if rebuilt else "SAH of the first frame, on the host"
        found = {"shadows": self._shadows, "update": self.build.update, "tree": tree}
        return {**found, **threads_built(self._rays)}


METHOD = Hybrid
