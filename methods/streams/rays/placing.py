"""The passes that place a light's rays and sort them into cells.

What the rays cover of the light's cube is found when they are placed, and they are then counted in their cells
(:class:`ByRays`); or it is known before, from the triangles in view, so that they are counted where they are placed
(:class:`ByTriangles`).
"""

from dataclasses import replace

import warp as wp

from ....harness.frame.effects.receivers import facing_passes, reached_by
from ....harness.frame.effects.specialise import specialised
from ....harness.frame.schedule.passes import Hints, Pass
from ...common.bands import Threads
from ...gpu.warps import LANES
from ..cube.aim import aim_kernel
from ..cube.density import SPACING_THREADS, spacing_kernel
from ..cube.faces import FACES
from ..queues import BLOCK_DIM
from . import sort
from .cone import cone_kernel
from .light_rays import LightRays
from .place import make_map_kernel, make_place_kernel
from .region import bounds_kernel


class ByRays:
    """Places rays, finds what they cover, then counts them in their cells.

    marks    whether the pass that places the rays marks the receivers, instead of the harness
    keeps    whether all hit points are kept (:func:`.place.place_ray`)
    region   how the region of the rays is had: "found": from their places; "known": from the triangles in view; "cone": and
             from a spot's cone
    outside  int32 [1 + pixels]: rays outside the region of a spot (:mod:`.cone`); or [0]
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
        self.reached = wp.empty(0, dtype=wp.int32, device=frame.device)
        if self.marking and not rays.queues.cuda and not effects.bounces:
            self.reached = reached_by(frame, rays.index, 0)
        self.outside = wp.empty(0, dtype=wp.int32, device=frame.device)

    def receivers(self) -> str:
        """Of :func:`.place.make_map_kernel`."""
        return "marked" if self.marking else "flagged" if self.rays.switches.receivers else "hits"

    def passes(self) -> list[Pass]:
        """Aim the cube, find which triangles may face the light if the receivers are marked by that, place the rays."""
        r = self.rays
        light, part = f"light/{r.index}", "light build"
        aim = (*self.aim_reads, light), (r.name("light aim"),), self.launch_aim
        aimed = Pass(f"{r.who}: aim", part, *aim, r.effect, hints=Hints(early=True))
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
        placed = Pass(f"{r.who}: map rays", part, reads, writes, self.launch_place, r.effect, reached=reached)
        return [aimed, *facing, placed]

    def sorting(self) -> list[Pass]:
        """Passes that put the placed rays into the cells."""
        r = self.rays
        places, offsets, part = r.name("ray places"), r.name("ray offsets"), "light build"
        counted, sorted_by = (*r.seen(), places), (*r.seen(), places, offsets)
        return [
            Pass(f"{r.who}: count and scan", part, counted, (offsets,), self.launch_count, r.effect),
            Pass(f"{r.who}: scatter rays", part, sorted_by, (r.name("ray cells"),), self.launch_scatter, r.effect),
        ]  # fmt: skip

    def launch_aim(self) -> None:
        r, f = self.rays, self.rays.frame
        threads = int(LANES) if r.queues.cuda else 1
        inputs = [threads, f.triangle_count, f.max_coordinate, f.proxy_positions, f.mesh]
        outputs = [r.light, r.cells.rectangle, r.counts.flatten(), r.density]
        f.launch(aim_kernel, threads, inputs, outputs, int(LANES))

    def launch_place(self) -> None:
        if self.reached.size:
            self.reached.zero_()
        self.rays.ranges.run(self._place)

    def _place(self, threads: Threads) -> None:
        r, f = self.rays, self.rays.frame
        flags = f.receivers if self.marking else r.receivers
        inputs = [threads.first, r.effects.facing, r.light, r.hits]
        outputs = [r.cells, flags, self.reached, f.answers.shadowed]
        kernel = specialised(r.of_cells(make_map_kernel(self.receivers(), self.keeps)), r.switches)
        f.launch(kernel, threads.number, inputs, outputs)

    def launch_count(self) -> None:
        if not self.rays.queues.cuda:
            self.rays.cells.count.zero_()
        self.launch_spacing()
        self.rays.ranges.run(self._count)
        self.launch_scan()

    def _count(self, threads: Threads) -> None:
        r = self.rays
        inputs = [threads.first, r.index, r.hits, r.receivers]
        r.frame.launch(specialised(r.of_cells(sort.count_kernel), r.switches), threads.number, inputs, [r.cells])

    def launch_spacing(self) -> None:
        """The spacing of the cells, by the rays that are expected."""
        r = self.rays
        if r.spaced:
            r.frame.launch(spacing_kernel, SPACING_THREADS, [], [r.cells])

    def launch_scan(self) -> None:
        """Offsets of the cells from their counts."""
        r, cells = self.rays, self.rays.cells
        rows = max(int(FACES) * cells.cells[0], cells.cells[2] * cells.cells[1])
        threads = 128 * rows if r.queues.cuda else int(FACES) + 1
        inputs = [threads, self.region != "found"]
        outputs = [cells, r.counts[0]]
        r.frame.launch(r.of_cells(sort.scan_kernel), threads, inputs, outputs, 128)
        if not r.queues.cuda:
            wp.utils.array_scan(cells.count, cells.offset[1:], inclusive=True)

    def launch_scatter(self) -> None:
        self.rays.ranges.run(self._scatter)

    def _scatter(self, threads: Threads) -> None:
        r = self.rays
        inputs = [threads.first, r.index, r.hits, r.receivers]
        kernel = specialised(r.of_cells(sort.make_scatter_kernel(self.region == "found")), r.switches)
        r.frame.launch(kernel, threads.number, inputs, [r.cells])


class ByTriangles(ByRays):
    """Finds what the triangles in view cover, then places rays and counts them in their cells at once.

    A spot's region is cut by its cone (:mod:`.cone`). With ``facing`` a spot has it only if it is known which triangles may
    face the light.

    facing   uint8 [triangles]: whether those in view face the light, if only then their hits have a ray; or [0]
    alone    whether no other light uses the arrays of the branch. What :meth:`launch_aim` writes belongs to this light:
             with one light the cells' arrays are not shared, so they may be emptied early
    """

    def __init__(self, rays: LightRays):
        super().__init__(rays)
        frame, effects = rays.frame, rays.effects
        self.alone = len(effects.shadows) == 1
        spot = any(effects.limited[rays.index : rays.index + 1])
        self.region = "cone" if spot else "known"
        self.facing = wp.empty(0, dtype=wp.uint8, device=frame.device)
        if spot:
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
        lanes = int(LANES) if r.queues.cuda else 1
        kernel = r.of_cells(bounds_kernel)
        inputs = [threads, lanes, self.alone, r.light, f.camera, f.mesh]
        outputs = [r.cells, self.facing]
        kernel = specialised(kernel, replace(r.switches, receivers=self.facing.size > 0))
        f.launch(kernel, threads, inputs, outputs, BLOCK_DIM)
        if self.region == "cone":
            f.launch(cone_kernel, 1, [r.light], [r.cells.rectangle, self.outside])
        f.launch(r.of_cells(sort.table_kernel), int(FACES) + 1, [], [r.cells])
        self.launch_spacing()

    def launch_place(self) -> None:
        cells = self.rays.cells
        if not self.rays.queues.cuda:
            cells.count.zero_()
        if not self.alone:
            cells.farthest.zero_()
        super().launch_place()

    def _place(self, threads: Threads) -> None:
        r, f = self.rays, self.rays.frame
        flags = f.receivers if self.marking else r.receivers
        inputs = [threads.first, r.light, r.hits, self.facing]
        outputs = [r.cells, flags, self.reached, f.answers.shadowed, self.outside]
        kernel = specialised(r.of_cells(make_place_kernel(self.receivers(), self.region == "cone")), r.switches)
        f.launch(kernel, threads.number, inputs, outputs)

    def launch_count(self) -> None:
        self.launch_scan()
