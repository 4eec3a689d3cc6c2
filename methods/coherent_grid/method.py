"""The coherent grid as a method: the uniform grid's passes, then packets of rays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.frame.frame import Frame
from ...harness.frame.geometry import filled
from ...harness.frame.method import BaseMethod
from ...harness.frame.passes import Pass
from ...harness.frame.specialise import specialised
from ...harness.scene.effects import Effects, Limits
from ..common.grid_build import TriangleGrid, cells_for
from ..common.misses import miss_passes
from ..common.pairs import grown
from ..common.ray_launches import PixelRays
from ..common.ray_passes import shadow_ray_passes
from ..common.reserve import counted
from ..ray_grids.camera.passes import CameraStream
from ..ray_grids.light import queue as light_queue
from ..ray_grids.light.rays import ShadowBits
from ..ray_grids.parameters import Streams
from ..ray_grids.queues import COUNTERS, DOUBTS, Queues, Step
from ..uniform_grid.method import Build
from ..uniform_grid.traversal import Cells, make_kernels
from . import packets, shadow

STRUCTURE = ("cells", "sorted pairs", "grid")


@dataclass(frozen=True)
class Trace:
    """How rays are traced.

    side  pixels along a side of a packet of rays
    """

    side: int = 8

    def __post_init__(self) -> None:
        if not 1 <= self.side <= 64:
            raise ValueError("side must be in 1..64 pixels")


class CoherentGrid(BaseMethod):
    """See the package. Needs: pairs of triangles and cells, then the counters of the queues (doubtful pairs)."""

    name: ClassVar[str] = "coherent_grid"
    title: ClassVar[str] = "Coherent grid (packets, CPU)"
    devices: ClassVar[tuple[str, ...]] = ("cpu",)
    simulates = frozenset({"shadows", "receivers", "directional", "alpha", "mirror"})
    Build: ClassVar[type] = Build
    Trace: ClassVar[type] = Trace

    def __init__(self, build: Any = None, trace: Any = None):
        super().__init__(build, trace)
        self._pairs = self._doubts = 0
        self._need: wp.array | None = None

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        self._memory, self._need = limits.memory, None
        count, side = frame.triangle_count, self.trace.side
        if count == 0:
            return miss_passes(frame, effects)
        cells = cells_for(count, self.build.density, limits.memory)
        self._pairs = self._pairs or self.build.capacity or 4 * count
        self._doubts = self._doubts or max(1024, frame.pixels // 2)
        self._packets = -(-frame.width // side) * -(-frame.height // side)
        self._frame, self._effects = frame, effects
        with wp.ScopedDevice(frame.device):
            self._need = wp.zeros(1, dtype=wp.int64)
            self._stamps = wp.zeros(count, dtype=wp.int32)
            self._starts = wp.zeros(frame.pixels, dtype=wp.vec3d)
            self._points = wp.zeros(frame.pixels, dtype=wp.vec4f)
            self._tests = wp.zeros(1 + len(effects.shadows), dtype=wp.int64)
        self._grid = TriangleGrid(frame, cells, self._pairs)
        lists = self._grid.binned.list
        self._cells = filled(
            Cells, grid=self._grid.grid, begin=lists.begin, end=lists.end, members=lists.values
        )
        self._queues = Queues(frame, False, (1, 1, self._doubts), 1 + len(effects.shadows))
        camera = PacketCamera(frame, Streams(), self._queues, effects)
        camera.launch = self._launch_primary
        self._hit = camera.hit
        single = PixelRays(frame, effects, self._cells, *make_kernels(0), swizzle=False)
        reads = (*STRUCTURE, "points", "triangles", "hits")
        return [
            *self._grid.passes(self._need, 0),
            *camera.passes(),
            *shadow_ray_passes(effects, reads, self._launch_shadow),
            *single.bounce_passes(STRUCTURE),
        ]

    def _launch_primary(self, share: int) -> None:
        frame = self._frame
        self._stamps.zero_()
        self._tests[:1].zero_()
        wp.launch(
            specialised(packets.packet_kernel, self._effects.switches()),
            dim=self._packets,
            inputs=[self.trace.side, self._cells, frame.camera, frame.mesh, frame.alpha, self._stamps],
            outputs=[self._queues.nearest, self._queues.of_stream(0)[share], self._tests],
            device=frame.device,
        )

    def _launch_shadow(self, light: int) -> None:
        frame, queues, switches = self._frame, self._queues, self._effects.switches(light)
        queue = queues.of_stream(1 + light)[0]
        answers = frame.answers
        bits = filled(ShadowBits, light=light, triangle=answers.triangle, visibility=answers.visibility)
        self._stamps.zero_()
        self._tests[1 + light : 2 + light].zero_()
        queue.counts.zero_()
        wp.launch(
            specialised(shadow.start_kernel, switches),
            dim=frame.pixels,
            inputs=[light, frame.hits(0), self._hit, frame.receivers, self._cells],
            outputs=[self._starts, self._points, answers.visibility],
            device=frame.device,
        )
        wp.launch(
            specialised(shadow.packet_kernel, switches),
            dim=self._packets,
            inputs=[
                self.trace.side, frame.lights, self._cells, frame.camera, frame.mesh, frame.alpha, self._starts,
                self._points, self._stamps,
            ],
            outputs=[bits, queue, self._tests],
            device=frame.device,
        )  # fmt: skip
        wp.launch(
            specialised(light_queue.doubt_kernel, switches),
            dim=queues.threads,
            inputs=[queues.threads, frame.lights, frame.camera, frame.mesh, frame.alpha, self._hit],
            outputs=[bits, queue],
            device=frame.device,
        )

    def needs(self) -> wp.array | None:
        if self._need is None:
            return None
        both = [array.numpy().astype(np.int64).ravel() for array in (self._need, self._queues.counts)]
        return wp.array(np.concatenate(both), dtype=wp.int64, device="cpu")

    def grow(self, needed: NDArray[np.int64]) -> bool:
        before = (self._pairs, self._doubts)
        doubts = counted(needed[1:].reshape(-1, COUNTERS)[:, DOUBTS])
        self._pairs = grown(int(needed[0]), self._pairs, self._memory, "(triangle, cell) pairs")
        self._doubts = grown(int(doubts.max()), self._doubts, self._memory, "doubtful pairs")
        return before != (self._pairs, self._doubts)

    def counters(self) -> dict[str, int]:
        """Pairs of the grid; (triangle, ray) pairs that the packets of the last frame tested, and those left to float64."""
        if self._need is None:
            return {}
        tests, counts = self._tests.numpy(), self._queues.counts.numpy()
        return {
            "pairs": int(self._need.numpy()[0]),
            "primary tests": int(tests[0]),
            "shadow tests": int(tests[1:].sum()),
            "doubtful pairs": int(counts[:, DOUBTS].sum()),
        }

    def built(self) -> dict[str, Any]:
        return {"density": self.build.density, "packets": f"{self.trace.side} x {self.trace.side}"}


class PacketCamera(CameraStream):
    """Primary rays: clear, packets, doubtful pairs, resolve."""

    structure = STRUCTURE
    launch: Callable[[int], None]

    def steps(self) -> list[Step]:
        return [("packets", (), (), self.launch)]
