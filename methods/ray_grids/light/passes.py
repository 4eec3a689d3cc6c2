"""A light's passes: arrays and launches of placing its rays and of the stream of triangles over them."""

from __future__ import annotations

import math
from dataclasses import replace

import warp as wp

from ....harness.frame.frame import Frame
from ....harness.frame.passes import Pass
from ....harness.frame.specialise import specialised
from ....harness.scene.effects import Effects
from ...common.pixels import thread_count
from .. import aim as light_aim
from .. import cube as light_places
from ..parameters import Build
from ..queues import BLOCK_DIM, Queues, Step, in_shares
from ..warps import LANES
from . import bins as light_bins
from . import queue as light_queue
from . import reach as light_reach
from . import stream as light_stream


class LightAims:
    """Cubes of all lights, aimed at the middle of the scene.

    Per light: axes mat33d, cubes Cube, rectangles int32 [11], tables vec4f [7].
    """

    def __init__(self, frame: Frame, lights: int):
        faces = int(light_aim.FACES)
        with wp.ScopedDevice(frame.device):
            self.axes = wp.zeros(lights, dtype=wp.mat33d)
            self.cubes = wp.zeros(lights, dtype=light_aim.Cube)
            self.rectangles = wp.zeros((lights, int(light_aim.RECTANGLE_WORDS)), dtype=wp.int32)
            self.tables = wp.zeros((lights, faces + 1), dtype=wp.vec4f)


class RayBins:
    """Cells of one light's cube and the rays in them; lights of one branch take turns with the same arrays.

    place vec4f [pixels]: (u, v, face, depth) of each pixel's ray; point vec4f [pixels]: its hit point, and the pixel; slot
    vec2i [pixels]: its cell and rank there; count and offset int32 [6 faces * cells rows * (cells + 4)] and one more;
    rays vec4f [pixels]: points in cell order; farthest int32 [6 faces * tiles of 8 x 8 cells]: bits of the greatest
    depth. On the GPU the scan leaves the counts empty.
    """

    def __init__(self, frame: Frame, build: Build):
        side = math.sqrt(frame.pixels)
        fine, coarse = (min(4096, max(64, 8 * round(x / 8))) for x in (side, side / 2))
        many = frame.triangle_count > frame.pixels // 2
        # Along a face: where rays lie on several faces, and where one holds them all.
        self.cells = wp.vec2i(build.cells or (fine if many else coarse), build.cells or fine)
        number = int(light_aim.FACES) * self.cells[0] * (self.cells[0] + int(light_bins.SPARE))
        number = max(number, self.cells[1] * (self.cells[1] + int(light_bins.SPARE)))
        with wp.ScopedDevice(frame.device):
            self.place = wp.zeros(frame.pixels, dtype=wp.vec4f)
            self.point = wp.zeros(frame.pixels, dtype=wp.vec4f)
            self.slot = wp.zeros(frame.pixels, dtype=wp.vec2i)
            self.count = wp.zeros(number, dtype=wp.int32)
            self.offset = wp.zeros(number + 1, dtype=wp.int32)
            self.rays = wp.zeros(frame.pixels, dtype=wp.vec4f)
            self.farthest = wp.zeros(-(-number // int(light_reach.TILE_CELLS)), dtype=wp.int32)


class LightStream:
    """Shadow rays of one light."""

    def __init__(
        self,
        frame: Frame,
        index: int,
        build: Build,
        hit: wp.array,
        queues: Queues,
        bins: RayBins,
        aims: LightAims,
        effects: Effects,
    ):
        self.frame, self.index, self.build, self.hit = frame, index, build, hit
        self.queues, self.bins, self.aims = queues, bins, aims
        self.switches = effects.switches(index)
        self.effects = effects
        self.counts = queues.counters(1 + index)
        self.rectangle, self.table = aims.rectangles[index], aims.tables[index]

    def passes(self, lane: int = 0) -> list[Pass]:
        """The light's passes, in a branch of their own beside those of lights on another ``lane``."""
        i = self.index
        who, build = f"light {i}", "light build"
        light, effect = f"light/{i}", f"shadows/{i}"
        seen = ("hits", f"light aim/{i}", *self.effects.mask_reads(i))
        aim, place, rays, bits = f"light aim/{i}", f"ray places/{i}", f"ray cells/{i}", f"visibility/{i}"
        offsets = f"ray offsets/{i}"
        scene = ("points", "triangles", "hits", light, aim, rays, *self.effects.surface_reads())
        passes = [
            Pass(
                f"{who}: aim",
                build,
                ("points", "triangles", "reach", light),
                (aim,),
                self.launch_aim,
                effect,
                ahead=True,
            ),
            Pass(f"{who}: map rays", build, seen, (place, bits), self.launch_map, effect),
            Pass(f"{who}: count and scan", build, (place,), (offsets,), self.launch_count, effect),
            Pass(f"{who}: scatter rays", build, (place, offsets), (rays,), self.launch_scatter, effect),
        ]
        steps: list[Step] = [("stream triangles", (), ("large triangles",), self.launch_stream)]
        if self.queues.queued:
            steps += [
                ("split large", ("large triangles",), ("items",), self.launch_split),
                ("queued rows", ("items",), ("parts",), self.launch_items),
                ("further parts", ("parts",), (), self.launch_parts),
            ]
        steps.append(("doubtful pairs", (), (), self.launch_doubts))
        passes += in_shares(who, "shadow", steps, self.queues.shares, (*scene, bits), (bits,), effect)
        return [replace(work, branch=(lane, *work.branch)) for work in passes]

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
                f.posts,
                f.points,
                f.triangles,
                f.valid,
            ],
            outputs=[a.axes, a.cubes, a.rectangles, self.counts.flatten()],
            device=f.device,
            block_dim=int(LANES),
        )

    def launch_map(self) -> None:
        f, b = self.frame, self.bins
        wp.launch(
            specialised(light_places.map_kernel, self.switches),
            dim=thread_count(f.width, f.height, True),
            inputs=[
                f.width, f.height, self.index, f.posts, self.aims.axes, f.answers.triangle, self.hit, f.receivers,
            ],
            outputs=[self.rectangle, b.place, b.point, f.answers.visibility, b.farthest],
            device=f.device,
        )  # fmt: skip

    def launch_count(self) -> None:
        f, b = self.frame, self.bins
        if not self.queues.cuda:
            b.count.zero_()
        wp.launch(
            light_bins.count_kernel,
            dim=thread_count(f.width, f.height, True),
            inputs=[f.width, f.height, b.cells, b.place, self.rectangle],
            outputs=[b.count, b.slot, b.farthest],
            device=f.device,
        )
        faces = int(light_aim.FACES)
        rows = max(faces * b.cells[0], b.cells[1])
        wp.launch(
            light_bins.scan_kernel,
            dim=128 * rows if self.queues.cuda else faces + 1,
            inputs=[b.cells, self.rectangle],
            outputs=[b.count, b.offset, self.counts[0], self.table],
            device=f.device,
            block_dim=128,
        )
        if not self.queues.cuda:
            wp.utils.array_scan(b.count, b.offset[1:], inclusive=True)

    def launch_scatter(self) -> None:
        f, b = self.frame, self.bins
        wp.launch(
            light_bins.scatter_kernel,
            dim=thread_count(f.width, f.height, True),
            inputs=[f.width, f.height, b.point, b.slot, b.offset],
            outputs=[b.rays],
            device=f.device,
        )

    def launch_stream(self, share: int) -> None:
        f, b, q = self.frame, self.bins, self.queues
        room = q.rooms[share]
        wp.launch(
            specialised(light_stream.make_stream_kernel(q.queued), self.switches),
            dim=q.share_threads(f.triangle_count),
            inputs=[
                f.triangle_count, share, q.shares, self.index, self.build.inline_cells, self.build.inline_rays, f.lights,
                self.aims.cubes, self.table, f.points, f.triangles, f.valid, b.offset, b.rays, b.farthest,
                f.answers.triangle, f.alpha,
            ],
            outputs=[f.answers.visibility, self.counts[share], q.records, room.large, room.doubts],
            device=f.device,
            block_dim=BLOCK_DIM,
        )  # fmt: skip

    def launch_split(self, share: int) -> None:
        f, q = self.frame, self.queues
        room = q.rooms[share]
        wp.launch(
            light_queue.split_kernel,
            dim=q.threads,
            inputs=[
                q.threads, self.index, f.lights, self.aims.cubes, self.table, f.points, f.triangles, room.large,
            ],
            outputs=[self.counts[share], room.items, room.lines],
            device=f.device,
            block_dim=BLOCK_DIM,
        )  # fmt: skip

    def _launch_rows(self, share: int, again: bool) -> None:
        f, b, q = self.frame, self.bins, self.queues
        room = q.rooms[share]
        wp.launch(
            specialised(light_queue.make_item_kernel(q.cuda, again), self.switches),
            dim=q.threads,
            inputs=[
                q.threads, self.build.part, self.index, self.table, q.records, b.offset, b.rays,
                f.answers.triangle, room.items, room.lines, f.alpha,
            ],
            outputs=[f.answers.visibility, self.counts[share], room.parts, room.doubts],
            device=f.device,
            block_dim=BLOCK_DIM,
        )  # fmt: skip

    def launch_items(self, share: int) -> None:
        self._launch_rows(share, again=False)

    def launch_parts(self, share: int) -> None:
        self._launch_rows(share, again=True)

    def launch_doubts(self, share: int) -> None:
        f, q = self.frame, self.queues
        wp.launch(
            specialised(light_queue.doubt_kernel, self.switches),
            dim=q.threads,
            inputs=[
                q.threads, self.index, f.lights, f.camera, f.mesh, self.hit, self.counts[share],
                q.rooms[share].doubts, f.alpha,
            ],
            outputs=[f.answers.visibility],
            device=f.device,
            block_dim=BLOCK_DIM,
        )  # fmt: skip
