"""Primary rays by a stream of triangles over the pixels, shadow rays and mirrored rays by a tree that is built meanwhile.

The camera's stream of ``ray_grids`` is faster than any tree for primary rays, but needs a grid of its own for each light
and has none for mirrored rays. A tree depends on the geometry alone: the graph of a frame builds it while the camera's
stream runs. The effects decide which of the two exists: without shadows and mirrors there is no tree.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.frame.frame import Frame
from ...harness.frame.method import BaseMethod
from ...harness.frame.schedule.passes import Hints, Pass
from ...harness.frame.schedule.threads import check_threads
from ...harness.scene.effects import Effects, Limits
from ..common.misses import miss_passes
from ..common.pairs import all_needs, grown
from ..common.parameters import check_choices, refuse_static
from ..gpu.reserve import counted
from ..ray_grids import Build as GridBuild
from ..ray_grids import RayGrids
from ..trees import constants
from ..trees.builders import BUILDERS, UPDATES, Rebuilt, Refitted, tree_of
from ..trees.quality import expected
from ..trees.trace.tree_rays import TreeRays
from .choice import chosen

STREAM, TREE = 0, 1
"""Branches of the graph."""

ONE_SHARE = 1
"""Parts of the pixels whose shadow rays to a single light a GPU traces at once: every second block of pixels is a worse
neighbour in the cache. With several lights, the rays of one fill up what those of another leave idle at their end.
"""


SHADOWS = ("auto", "tree", "grid")


@dataclass(frozen=True)
class Build:
    """How the tree is made, as of bvh2; and what takes the shadow rays.

    update   "rebuild": built in each frame, from the triangles of that frame; "refit": a SAH tree of the animation's
             first frame, its boxes refitted each frame; "static": that tree, for geometry that does not move
    builder  of a rebuilt tree: "lbvh" (Lauterbach et al. 2009, in one pass: Apetrei 2014) or "hploc" (Benthin et al.
             2024); "auto": lbvh below 70,000 triangles
    shadows  "tree": the tree, which all lights share; "grid": a grid of each light, as in ray_grids; the tree is then built
             for mirrored rays only; "auto": the grid where the mesh has more than one triangle for every 600 pixels (if a
             ray of a light crosses more than 1.05 triangles of the first frame on average: for every 64 with one light,
             for every 48 / L with L lights, or 4 if that is more) and nothing is mirrored, otherwise the tree
    """

    update: str = "rebuild"
    builder: str = "auto"
    shadows: str = "auto"

    def __post_init__(self) -> None:
        check_choices(self, update=UPDATES, builder=BUILDERS, shadows=SHADOWS)


@dataclass(frozen=True)
class Trace:
    """How rays are traced.

    threads  of a CPU: each streams a share of the triangles, and traces the shadow rays of a share of the pixels; 0: one
             for each core that this process may use, at most 16
    """

    threads: int = 0

    def __post_init__(self) -> None:
        check_threads(self.threads)


class Hybrid(BaseMethod):
    """See the package. Needs: those of the streams (:class:`..ray_grids.RayGrids`), then the tree's undecided pairs."""

    name: ClassVar[str] = "hybrid"
    title: ClassVar[str] = "Hybrid (streamed primary rays, tree for the others)"
    simulates = frozenset({"shadows", "receivers", "directional", "alpha", "mirror"})
    Build: ClassVar[type] = Build
    Trace: ClassVar[type] = Trace

    def __init__(self, build: Any = None, trace: Any = None):
        super().__init__(build, trace)
        self._streams = RayGrids(GridBuild(threads=self.trace.threads))
        self._capacity = 0
        self._memory = 0
        self._shadows = self.build.shadows
        self._tree: Rebuilt | Refitted | None = None
        self._rays: TreeRays | None = None

    @property
    def finds_closed(self) -> bool:
        return self._streams.finds_closed

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        self._memory, self._rays = limits.memory, None
        self._shadows = chosen(frame, effects) if self.build.shadows == "auto" else self.build.shadows
        shadows = any(effects.shadows) and self._shadows == "tree"
        if not shadows and not effects.bounces:
            return self._streams.plan(frame, effects, limits)
        effects = replace(effects, closed=False)  # trees hold all triangles
        if frame.triangle_count == 0:
            return miss_passes(frame, effects)
        self._capacity = self._capacity or constants.first_capacity(frame.pixels)
        starts = None
        if shadows:
            camera = self._streams.camera(frame, effects, limits, "rounded")
            streamed, starts = camera.passes(), camera.rounded
        else:
            streamed = self._streams.plan(frame, effects, limits)
        refuse_static(self.name, self.build.update, frame.prepared)
        self._tree = tree = tree_of(frame, self.build.update, self.build.builder)
        first, grows, beside = tree.passes()
        shares = ONE_SHARE if sum(effects.shadows) == 1 else constants.SHARES
        self._rays = rays = TreeRays(
            frame, tree.tree, effects, "exact", False, self.trace.threads, shares, self._capacity, starts
        )
        after = [*beside, *rays.record_passes(), *(rays.clear_passes() if shadows else ())]
        effect = "shadows" if shadows else "mirror"
        passes = [replace(work, hints=Hints(parallel=(TREE,)), effect=effect) for work in first]
        passes.append(replace(grows, hints=Hints(parallel=(TREE, 0)), effect=effect))
        passes += [work.hinted(parallel=(TREE, 1)) for work in after]
        passes += [work.hinted(parallel=(STREAM, *work.hints.parallel)) for work in streamed]
        passes += rays.passes(primary=False) if shadows else rays.late_passes()
        return [*passes, *rays.bounce_passes()]

    def needs(self) -> wp.array | None:
        streamed = self._streams.needs()
        if self._rays is None or streamed is None:
            return streamed
        return all_needs(streamed, self._rays.counts)

    def grow(self, needed: NDArray[np.int64]) -> bool:
        streamed = self._streams.needs()
        assert streamed is not None
        more = self._streams.grow(needed.ravel()[: streamed.size])
        before = self._capacity
        if self._rays is not None:
            found = counted(needed.ravel()[streamed.size :])
            self._capacity = grown(int(found.max()), before, self._memory, "undecided pairs", varies=True)
        return more or self._capacity != before

    def tests_per_pixel(self) -> tuple[NDArray[np.int32], ...]:
        """Triangle tests of each pixel's primary ray."""
        return self._streams.tests_per_pixel()

    def counters(self) -> dict[str, int]:
        """The counters of the streams, and the pairs of shadow rays that the tree left to float64 in the last frame."""
        if self._streams.needs() is None:
            return {}
        counts = self._streams.counters()
        if self._rays is not None:
            found = self._rays.undecided_pairs()
            counts |= {f"tree: {rays} undecided pairs": n for rays, n in found.items() if rays != "primary"}
            counts |= expected(self._rays.tree)
        return counts

    def built(self) -> dict[str, Any]:
        if self._rays is None:
            streams = {} if self._streams.needs() is None else self._streams.built()
            return {"shadows": self._shadows, **streams}
        assert self._tree is not None
        return {"shadows": self._shadows, **self._tree.built(), **self._rays.built()}


METHOD = Hybrid
