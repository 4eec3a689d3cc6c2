"""The shadow rays of one light, and the passes that place them and sort them into cells.

What the rays cover of the light's cube is found when they are placed, and they are then counted in their cells
(:class:`ByRays`); or it is known before, from the triangles in view, so that they are counted where they are placed
(:class:`ByTriangles`).
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import warp as wp

from ....harness.frame.effects.receivers import facing_passes, reached_by
from ....harness.frame.effects.specialise import specialised, with_type
from ....harness.frame.frame import Frame
from ....harness.frame.geometry import filled
from ....harness.frame.schedule.passes import Hints, Pass
from ....harness.scene.effects import Effects
from ...common.bands import ThreadRanges, Threads
from ...gpu.warps import LANES
from ..cube.cells import FACES, RayCells, SpacedCells
from ..cube.lights import Lights, aim_kernel
from ..cube.spacing import SPACING_THREADS, spacing_arrays, spacing_kernel
from ..queues import BLOCK_DIM, WORDS, Queues
from ..settings import Settings
from . import sort
from .hit_points import PrimaryHits
from .place import make_place_kernel
from .region import bounds_kernel, cone_kernel


class LightRays:
    """The rays of light ``index`` of a frame: what its passes share, and what its kernels are given.

    exact      exact hit points, vec3d [pixels], or empty
    light      :class:`..cube.lights.Light`     hits   :class:`.hit_points.PrimaryHits`
    cells      :class:`..cube.cells.RayCells`, or ``SpacedCells`` where ``spaced``
    receivers  uint8 [lights, pixels]: which hits have a ray, where not all have
    switches   the effects that the light's kernels are compiled for
    queue      the queue of each share of the triangles; counts int32 [shares, 6]: their counters
    ranges     threads of the kernels over the image
    arrays     of :func:`..cube.cells.cell_arrays`, used by the lights of a branch in turn
    sought     the receivers that are left when the last frame's occluders were tested (:mod:`..occlusion.last_occluder`)
    """

    def __init__(
        self,
        frame: Frame,
        index: int,
        settings: Settings,
        exact: wp.array,
        queues: Queues,
        arrays: dict[str, Any],
        lights: Lights,
        effects: Effects,
        sought: wp.array | None = None,
    ):
        self.frame, self.index, self.settings, self.exact = frame, index, settings, exact
        self.queues, self.lights, self.effects, self.arrays, self.sought = queues, lights, effects, arrays, sought
        self.who, self.effect = f"light {index}", f"shadows/{index}"
        self.spot = any(effects.limited[index : index + 1])
        self.counts = queues.counters(1 + index)
        self.queue = queues.of_stream(1 + index)
        many, few, faces = arrays["cells"]
        self.spaced = (settings.spacing, settings.region) == ("rays", "rays")
        kind: Any = RayCells
        given = {name: array for name, array in arrays.items() if name in kind.vars}
        # Few rays do not repay clearing and summing finer cells.
        given |= {"cells": wp.vec3i(many, few, 1 if self.spot else faces)}
        given |= {"rectangle": lights.rectangle[index], "table": lights.table[index]}
        if self.spaced:
            kind, given = SpacedCells, given | spacing_arrays(frame.device, max(many, few))
        self.density = given.get("density", wp.empty(0, dtype=wp.float32, device=frame.device))
        self.cells = filled(kind, **given)
        self.shares = queues.shares if queues.threaded else 1
        self.ranges = ThreadRanges(frame, self.shares)
        self.hits = filled(
            PrimaryHits, camera=frame.camera, mesh=frame.mesh, nearest=queues.nearest, exact_path=queues.exact_path
        )  # fmt: skip
        self.receivers, self.switches = frame.receivers, effects.switches(index)
        if sought is not None:
            self.receivers, self.switches = sought, replace(self.switches, receivers=True)

    @functools.cached_property
    def light(self) -> Any:
        """Made when all passes are planned: one of them may find which triangles face the light."""
        return self.lights.light(self.index)

    def launch(
        self, kernel: wp.Kernel, threads: int, inputs: list[Any], outputs: list[Any], block: int = 256, **switched: bool
    ) -> None:
        """Launch a kernel for the effects of the light, some of them ``switched``, and for the class of :attr:`cells`."""
        if self.spaced and "cells" in kernel.func.__annotations__:
            kernel = with_type(kernel, "cells", SpacedCells)
        switches = replace(self.switches, **switched) if switched else self.switches
        self.frame.launch(specialised(kernel, switches), threads, inputs, outputs, block)

    def name(self, what: str) -> str:
        """A resource of this light: "light aim" "ray places" "ray offsets" "ray cells" "shadowed" """
        return f"{what}/{self.index}"

    def work(
        self, what: str, reads: tuple[str, ...], writes: tuple[str, ...], launch: Callable[[], None], **more: Any
    ) -> Pass:
        """A pass of the light."""
        return Pass(f"{self.who}: {what}", "light build", reads, writes, launch, self.effect, **more)

    def seen(self) -> tuple[str, ...]:
        """The resources that say which pixels have a ray."""
        of_receivers = self.effects.receiver_reads(self.index)
        if self.sought is not None:
            of_receivers = (self.name("rays sought"),)
        return (WORDS, self.name("light aim"), *of_receivers)


class ByRays:
    """Places rays, finds what they cover, then counts them in their cells.

    marks    whether the pass that places the rays marks the receivers, instead of the harness
    keeps    whether all hit points are kept (:func:`.place.place_ray`)
    region   how the region of the rays is had: "found": from their places; "known": from the triangles in view; "cone": and
             from a spot's cone
    outside  int32 [1 + pixels]: rays outside the region of a spot (:mod:`.region`); or [0]
    facing   uint8 [triangles]: whether those in view face the light, if only then their hits have a ray; or [0]
    reached  int32 [1]: not 0 if the light has receivers; empty on a GPU, where a condition costs more than passes without
             rays, and where rays bounce: passes that read no receivers would have no condition then
    """

    region = "found"
    # With another camera there are other rays: what those before covered is forgotten.
    aim_reads: tuple[str, ...] = ("points", "triangles", "max_coordinate", "camera")

    def __init__(self, rays: LightRays, marks: bool = True, keeps: bool = False):
        frame, effects = rays.frame, rays.effects
        self.rays, self.keeps = rays, keeps
        self.marking = marks and effects.has_receivers(rays.index)
        self.flags = frame.receivers if self.marking else rays.receivers
        self.outside = wp.empty(0, dtype=wp.int32, device=frame.device)
        self.facing = wp.empty(0, dtype=wp.uint8, device=frame.device)
        self.reached = self.outside
        if self.marking and not rays.queues.cuda and not effects.bounces:
            self.reached = reached_by(frame, rays.index, 0)

    def receivers(self) -> str:
        """Of :func:`.place.make_place_kernel`."""
        return "marked" if self.marking else "flagged" if self.rays.switches.receivers else "hits"

    def passes(self) -> list[Pass]:
        """Aim the cube, find which triangles may face the light if the receivers are marked by that, place the rays."""
        r = self.rays
        light, early = f"light/{r.index}", Hints(early=True)
        aimed = r.work("aim", (*self.aim_reads, light), (r.name("light aim"),), self.launch_aim, hints=early)
        facing: list[Pass] = []
        receivers: tuple[str, ...] = ()
        seen = r.seen()
        if self.marking:
            if self.receivers() == "marked":
                facing = facing_passes(r.frame, r.effects, r.index, r.shares)
            receivers = r.effects.receiver_reads(r.index)
            others = tuple(name for name in seen if name not in receivers)
            seen = (*others, light, *(name for work in facing for name in work.writes))
        reads = (*seen, "camera", "points", "triangles")
        writes = (r.name("ray places"), r.name("shadowed"), *receivers)
        reached = self.reached if self.reached.size else None
        return [aimed, *facing, r.work("map rays", reads, writes, self.launch_place, reached=reached)]

    def sorting(self) -> list[Pass]:
        """Passes that put the placed rays into the cells."""
        r = self.rays
        reads, offsets = (*r.seen(), r.name("ray places")), r.name("ray offsets")
        return [
            r.work("count and scan", reads, (offsets,), self.launch_count),
            r.work("scatter rays", (*reads, offsets), (r.name("ray cells"),), self.launch_scatter),
        ]

    def launch_aim(self) -> None:
        r, f = self.rays, self.rays.frame
        threads = int(LANES) if r.queues.cuda else 1
        inputs = [threads, f.triangle_count, f.max_coordinate, f.proxy_positions, f.mesh]
        r.launch(aim_kernel, threads, inputs, [r.light, r.cells.rectangle, r.counts.flatten(), r.density], int(LANES))

    def launch_place(self) -> None:
        if self.reached.size:
            self.reached.zero_()
        self.rays.ranges.run(self._place)

    def _place(self, threads: Threads) -> None:
        r = self.rays
        inputs = [threads.first, r.effects.facing, r.light, r.hits, self.facing]
        outputs = [r.cells, self.flags, self.reached, r.frame.answers.shadowed, self.outside]
        r.launch(make_place_kernel(self.receivers(), self.region, self.keeps), threads.number, inputs, outputs)

    def launch_count(self) -> None:
        if not self.rays.queues.cuda:
            self.rays.cells.count.zero_()
        if self.rays.spaced:
            self.rays.frame.launch(spacing_kernel, SPACING_THREADS, [], [self.rays.cells])
        self.rays.ranges.run(self._count)
        self.launch_scan()

    def _count(self, threads: Threads) -> None:
        r = self.rays
        r.launch(sort.count_kernel, threads.number, [threads.first, r.index, r.hits, r.receivers], [r.cells])

    def launch_scan(self) -> None:
        """Offsets of the cells from their counts."""
        r, cells = self.rays, self.rays.cells
        rows = max(int(FACES) * cells.cells[0], cells.cells[2] * cells.cells[1])
        threads = 128 * rows if r.queues.cuda else int(FACES) + 1
        r.launch(sort.scan_kernel, threads, [threads, self.region != "found"], [cells, r.counts[0]], 128)
        if not r.queues.cuda:
            wp.utils.array_scan(cells.count, cells.offset[1:], inclusive=True)

    def launch_scatter(self) -> None:
        self.rays.ranges.run(self._scatter)

    def _scatter(self, threads: Threads) -> None:
        r = self.rays
        kernel = sort.make_scatter_kernel(self.region == "found")
        r.launch(kernel, threads.number, [threads.first, r.index, r.hits, r.receivers], [r.cells])


class ByTriangles(ByRays):
    """Finds what the triangles in view cover, then places rays and counts them in their cells at once.

    A spot's region is cut by its cone. With ``facing`` a spot has it only if it is known which triangles may face the light.

    alone    whether no other light uses the arrays of the branch. What :meth:`launch_aim` writes belongs to this light:
             with one light the cells' arrays are not shared, so they may be emptied early
    """

    def __init__(self, rays: LightRays):
        super().__init__(rays)
        frame, effects = rays.frame, rays.effects
        self.alone = len(effects.shadows) == 1
        self.region = "cone" if rays.spot else "known"
        if rays.spot:
            self.outside = wp.zeros(1 + frame.pixels, dtype=wp.int32, device=frame.device)
            # Whenever rays are placed again, the list of outside rays must have been emptied.
            self.aim_reads = (*self.aim_reads, *effects.surface_reads())
        elif self.marking:
            self.facing = wp.zeros(max(1, frame.triangle_count), dtype=wp.uint8, device=frame.device)

    def receivers(self) -> str:
        return "marked" if self.region == "cone" else "facing" if self.facing.size else "hits"

    def launch_aim(self) -> None:
        super().launch_aim()
        r, f = self.rays, self.rays.frame
        threads = -(-max(1, f.triangle_count) // BLOCK_DIM) * BLOCK_DIM
        inputs = [threads, self.alone, r.light, f.camera, f.mesh]
        outputs = [r.cells, self.facing]
        r.launch(bounds_kernel, threads, inputs, outputs, BLOCK_DIM, receivers=self.facing.size > 0)
        if self.region == "cone":
            f.launch(cone_kernel, 1, [r.light], [r.cells.rectangle, self.outside])
        r.launch(sort.table_kernel, int(FACES) + 1, [], [r.cells])

    def launch_place(self) -> None:
        cells = self.rays.cells
        if not self.rays.queues.cuda:
            cells.count.zero_()
        if not self.alone:
            cells.farthest.zero_()
        super().launch_place()

    def launch_count(self) -> None:
        self.launch_scan()
