"""A light's passes: arrays and launches of placing its rays and of the stream of triangles over them."""

from __future__ import annotations

import functools
from typing import Any, ClassVar

import warp as wp

from ...harness.frame.effects.receivers import facing_passes, reached_by
from ...harness.frame.effects.specialise import specialised, with_type
from ...harness.frame.frame import Frame
from ...harness.frame.geometry import filled
from ...harness.frame.schedule.passes import Hints, Pass
from ...harness.scene.effects import Effects
from ..common.bands import ThreadRanges, Threads
from ..gpu.warps import LANES
from .cube import aim as light_aim
from .cube import density as light_expected
from .cube.aims import LightAims
from .cube.cells import RayCells, SpacedCells
from .occlusion import groups as light_split
from .occlusion import rows as light_rows
from .occlusion import stream as light_stream
from .occlusion import undecided as light_undecided
from .occlusion.planes import ShadowBits
from .queues import BLOCK_DIM, WORDS, Queues, Step, in_shares
from .rays import receivers as light_receivers
from .rays import sort as light_bins
from .rays.hit_points import Words
from .settings import Streams


class LightStream:
    """Shadow rays of one light. ``arrays``: of :func:`.cube.cells.cell_arrays`; hit vec3d [pixels]: exact hit points,
    or empty.

    marks    whether the pass that places the rays marks the receivers, instead of the harness
    keeps    whether all hit points are kept (:func:`.rays.sort.place_ray`)
    tabled   whether what the rays cover is known before they are placed
    spaced   whether cells are narrower where rays are dense (:mod:`.cube.spacing`)
    beside   whether triangles are streamed beside the passes that sort the rays into cells, and not after these
    outside_rays  int32 [1 + pixels]: rays outside the region of a spot (:mod:`.rays.cone`); else empty
    reached  int32 [1]: not 0 if the light has receivers; empty on a GPU, where a condition costs more than passes without
             rays, and where rays bounce: passes that read no receivers would have no condition then
    """

    marks: ClassVar[bool] = True
    keeps: ClassVar[bool] = False
    tabled: ClassVar[bool] = False
    beside: bool = False
    # With another camera there are other rays: what those before covered is forgotten.
    aim_reads: tuple[str, ...] = ("points", "triangles", "max_coordinate", "camera")

    def __init__(
        self,
        frame: Frame,
        index: int,
        build: Streams,
        hit: wp.array,
        queues: Queues,
        arrays: dict[str, Any],
        aims: LightAims,
        effects: Effects,
    ):
        self.frame, self.index, self.hit = frame, index, hit
        self.build: Any = build
        self.queues, self.aims, self.effects = queues, aims, effects
        self.switches = effects.switches(index)
        self.counts = queues.counters(1 + index)
        self.queue = queues.of_stream(1 + index)
        many, few, faces = arrays["cells"]
        if any(effects.limited[index : index + 1]):
            faces = 1  # few rays do not repay clearing and summing finer cells
        self.spaced = getattr(build, "spacing", "even") == "rays"
        given = {**arrays, "cells": wp.vec3i(many, few, faces)}
        given |= {"rectangle": aims.rectangles[index], "table": aims.tables[index]}
        if self.spaced:
            given |= light_expected.spacing_arrays(frame.device, max(many, few))
        self.density = given.get("density", wp.empty(0, dtype=wp.float32, device=frame.device))
        self.cells: Any = filled(SpacedCells if self.spaced else RayCells, **given)
        self.shares = queues.shares if queues.threaded else 1
        self.ranges = ThreadRanges(frame, self.shares)
        self.receivers = frame.receivers
        self.marking = self.marks and effects.has_receivers(index)
        self.reached = wp.empty(0, dtype=wp.int32, device=frame.device)
        if self.marking and not queues.cuda and not effects.bounces:
            self.reached = reached_by(frame, index, 0)
        self.outside_rays = wp.empty(0, dtype=wp.int32, device=frame.device)
        self.bits: Any = filled(
            ShadowBits,
            light=index,
            triangle=self.cells.triangle,
            shadowed=frame.answers.shadowed,
        )
        self.rays = filled(Words, nearest=queues.nearest, exact_path=queues.exact_path)

    def variant(self, kernel: wp.Kernel) -> wp.Kernel:
        """A kernel of the stream for the class of :attr:`bits`."""
        return kernel

    def of_cells(self, kernel: wp.Kernel) -> wp.Kernel:
        """A kernel for the class of :attr:`cells`."""
        return with_type(kernel, "cells", SpacedCells) if self.spaced else kernel

    def receiver_reads(self) -> tuple[str, ...]:
        """The resources that say which pixels have a ray, beside the hits."""
        return self.effects.receiver_reads(self.index)

    def passes(self, branch: int = 0) -> list[Pass]:
        """The light's passes, which may run at the same time as those of lights in another branch."""
        i = self.index
        who, build = f"light {i}", "light build"
        light, effect = f"light/{i}", f"shadows/{i}"
        seen = (WORDS, f"light aim/{i}", *self.receiver_reads())
        aim, place, rays, bits = f"light aim/{i}", f"ray places/{i}", f"ray cells/{i}", f"shadowed/{i}"
        scene = ("points", "triangles", light, aim, rays, *self.effects.surface_reads())
        front_facing = self.facing_passes()
        passes = [
            Pass(
                f"{who}: aim",
                build,
                (*self.aim_reads, light),
                (aim,),
                self.launch_aim,
                effect,
                hints=Hints(early=True),
            ),
            *front_facing,
            *self.map_passes(seen, place, bits, tuple(name for work in front_facing for name in work.writes)),
        ]
        sorting, steps = self.cell_passes(seen, place, rays, effect), self.steps()
        if self.beside:
            sorting = [work.hinted(overlap=True) for work in sorting]
            known = (*(name for name in scene if name != rays), place)
            sorting += in_shares(who, "shadow", steps[:1], self.queues, known, (), effect)
            steps = steps[1:]
        passes += sorting
        passes += in_shares(who, "shadow", steps, self.queues, (*scene, bits), (bits,), effect)
        undecided: Step = ("doubtful pairs", (), (), self.launch_undecided)
        scene = (*scene, "camera", *(("hits",) if self.hit.size else ()))
        passes += in_shares(who, "shadow", [undecided], self.queues, (*scene, bits), (bits,), effect)
        return [work.hinted(parallel=(branch, *work.hints.parallel)) for work in passes]

    def by_facing(self) -> bool:
        """Whether the light itself finds which triangles' hits have a ray."""
        return False

    def facing_passes(self) -> list[Pass]:
        """The pass that finds which triangles may face the light, if the receivers are marked by that."""
        if not self.marking or self.by_facing():
            return []
        return facing_passes(self.frame, self.effects, self.index, self.shares)

    def map_passes(
        self, seen: tuple[str, ...], place: str, bits: str, front_facing: tuple[str, ...]
    ) -> list[Pass]:
        """The pass that places the rays and clears their shadow bits. ``seen``: which pixels have one;
        ``front_facing``: which triangles may face the light."""
        i = self.index
        receivers = self.effects.receiver_reads(i) if self.marking else ()
        if self.marking:
            others = tuple(name for name in seen if name not in receivers)
            seen = (*others, f"light/{i}", *front_facing)
        seen = (*seen, "camera", "points", "triangles")
        place_rays = Pass(
            f"light {i}: map rays",
            "light build",
            seen,
            (place, bits, *receivers),
            self.launch_marking_map if self.marking else self.launch_map,
            f"shadows/{i}",
            reached=self.reached if self.reached.size else None,
        )
        return [place_rays]

    def cell_passes(self, seen: tuple[str, ...], place: str, rays: str, effect: str) -> list[Pass]:
        """Passes that put the mapped rays (``seen``: which pixels have one; ``place``) into the cells (``rays``)."""
        who, offsets, part = f"light {self.index}", f"ray offsets/{self.index}", "light build"
        counted, sorted_by = (*seen, place), (*seen, place, offsets)
        return [
            Pass(f"{who}: count and scan", part, counted, (offsets,), self.launch_count, effect),
            Pass(f"{who}: scatter rays", part, sorted_by, (rays,), self.launch_scatter, effect),
        ]

    def steps(self) -> list[Step]:
        """The passes of each share of the triangles before the undecided pairs are decided."""
        if not self.queues.queued:
            return [("stream triangles", (), (), self.launch_stream)]
        steps: list[Step] = [
            ("stream triangles", (), ("large triangles",), self.launch_stream),
            ("split large", ("large triangles",), ("items",), self.launch_split),
        ]
        if self.build.groups == "stream":
            steps = [("stream triangles", (), ("items",), self.launch_stream)]
        return [
            *steps,
            ("queued rows", ("items",), ("parts",), functools.partial(self.launch_rows, False)),
            ("further parts", ("parts",), (), functools.partial(self.launch_rows, True)),
        ]

    def launch_aim(self) -> None:
        f, a = self.frame, self.aims
        threads = int(LANES) if self.queues.cuda else 1
        wp.launch(
            light_aim.aim_kernel,
            dim=threads,
            inputs=[
                threads,
                self.index,
                f.triangle_count,
                f.max_coordinate,
                f.proxy_positions,
                f.spots,
                f.mesh,
            ],
            outputs=[
                a.proxy_positions,
                a.axes,
                a.cubes,
                a.cones,
                a.rectangles,
                self.counts.flatten(),
                self.density,
            ],
            device=f.device,
            block_dim=int(LANES),
        )

    def launch_map(self) -> None:
        self.ranges.run(self._map)

    def _map(self, threads: Threads) -> None:
        f, a = self.frame, self.aims
        wp.launch(
            specialised(self.of_cells(light_bins.map_kernel), self.switches),
            dim=threads.number,
            inputs=[
                threads.first, self.index, f.camera, a.proxy_positions, a.axes, f.mesh, self.rays, self.receivers,
                self.keeps,
            ],
            outputs=[self.cells, f.answers.shadowed],
            device=f.device,
        )  # fmt: skip

    def launch_marking_map(self) -> None:
        """Mark the receivers and place their rays."""
        if self.reached.size:
            self.reached.zero_()
        self.ranges.run(self._mark)

    def _mark(self, threads: Threads) -> None:
        f, a = self.frame, self.aims
        wp.launch(
            self.of_cells(light_receivers.map_kernel),
            dim=threads.number,
            inputs=[
                threads.first, self.index, self.effects.facing, f.camera, f.mesh, f.lights, f.spots, f.front_facing, a.cones,
                a.proxy_positions, a.axes, self.rays, self.keeps,
            ],
            outputs=[self.cells, f.receivers, self.reached, f.answers.shadowed],
            device=f.device,
        )  # fmt: skip

    def launch_count(self) -> None:
        if not self.queues.cuda:
            self.cells.count.zero_()
        if self.spaced:
            self.launch_spacing()
        self.ranges.run(self._count)
        self.launch_scan()

    def _count(self, threads: Threads) -> None:
        f = self.frame
        wp.launch(
            specialised(self.of_cells(light_bins.count_kernel), self.switches),
            dim=threads.number,
            inputs=[threads.first, self.index, f.camera, self.rays, self.receivers],
            outputs=[self.cells],
            device=f.device,
        )

    def launch_spacing(self) -> None:
        """The spacing of the cells, by the rays that are expected."""
        wp.launch(
            light_expected.spacing_kernel,
            dim=light_expected.SPACING_THREADS,
            inputs=[],
            outputs=[self.cells],
            device=self.frame.device,
        )

    def launch_scan(self) -> None:
        """Offsets of the cells from their counts."""
        f, cells = self.frame, self.cells
        faces = int(light_aim.FACES)
        rows = max(faces * cells.cells[0], cells.cells[2] * cells.cells[1])
        threads = 128 * rows if self.queues.cuda else faces + 1
        wp.launch(
            self.of_cells(light_bins.scan_kernel),
            dim=threads,
            inputs=[threads, self.tabled],
            outputs=[cells, self.counts[0]],
            device=f.device,
            block_dim=128,
        )
        if not self.queues.cuda:
            wp.utils.array_scan(cells.count, cells.offset[1:], inclusive=True)

    def launch_scatter(self) -> None:
        self.ranges.run(self._scatter)

    def _scatter(self, threads: Threads) -> None:
        f = self.frame
        wp.launch(
            self.of_cells(light_bins.scatter_kernel),
            dim=threads.number,
            inputs=[threads.first, f.camera, f.mesh, self.rays],
            outputs=[self.cells],
            device=f.device,
        )

    def launch_stream(self, share: int) -> None:
        f, q, build = self.frame, self.queues, self.build
        splits = q.queued and build.groups == "stream"
        kernel = light_stream.make_stream_kernel(q.queued, splits, not self.beside)
        wp.launch(
            specialised(self.variant(self.of_cells(kernel)), self.switches),
            dim=q.share_threads,
            inputs=[
                q.share(share), build.inline_cells, build.inline_rays, f.lights, self.aims.cubes, self.cells, f.mesh,
                f.alpha,
            ],
            outputs=[self.bits, self.queue[share]],
            device=f.device,
            block_dim=BLOCK_DIM,
        )  # fmt: skip

    def launch_split(self, share: int) -> None:
        f, q = self.frame, self.queues
        threads = int(light_split.SPLITTERS) * q.few_threads
        wp.launch(
            specialised(light_split.split_kernel, self.switches),
            dim=threads,
            inputs=[threads, self.index, f.lights, self.aims.cubes, self.cells.table, f.mesh],
            outputs=[self.queue[share]],
            device=f.device,
            block_dim=BLOCK_DIM,
        )

    def launch_rows(self, again: bool, share: int) -> None:
        """Groups of rows, or their further chunks (``again``)."""
        f, q = self.frame, self.queues
        wp.launch(
            specialised(
                self.variant(self.of_cells(light_rows.make_item_kernel(q.cuda, again))), self.switches
            ),
            dim=q.threads,
            inputs=[q.threads, self.build.part, self.cells, f.alpha],
            outputs=[self.bits, self.queue[share]],
            device=f.device,
            block_dim=BLOCK_DIM,
        )

    def launch_undecided(self, share: int) -> None:
        """Pairs that float32 left; rays outside the region with the first share's."""
        f, q = self.frame, self.queues
        kernel = light_undecided.make_undecided_kernel(
            bool(self.hit.size), share == 0 and self.outside_rays.size > 0
        )
        wp.launch(
            specialised(self.variant(kernel), self.switches),
            dim=q.few_threads,
            inputs=[q.few_threads, f.lights, f.camera, f.mesh, f.alpha, self.hit, self.outside_rays],
            outputs=[self.bits, self.queue[share]],
            device=f.device,
            block_dim=BLOCK_DIM,
        )
