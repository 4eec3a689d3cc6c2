"""A uniform grid traversed by packets of primary rays, slice by slice, on the CPU: Wald et al. 2006.

The grid is that of ``uniform_grid``, built in every frame. Shadow rays and mirrored rays are traced one by one, as there.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.frame.effects.specialise import specialised
from ...harness.frame.frame import Frame
from ...harness.frame.geometry import filled
from ...harness.frame.method import BaseMethod
from ...harness.frame.schedule.passes import Pass
from ...harness.scene.effects import Effects, Limits
from ..common.misses import miss_passes
from ..common.pairs import all_needs, grown
from ..gpu.reserve import counted
from ..grids.build import Build, TriangleGrid, cells_for
from ..grids.cells import Cells, make_kernels
from ..rays.launches import PixelRays
from ..streams.camera.passes import Camera, undecided_step
from ..streams.queues import COUNTERS, UNDECIDED, Queues, Step
from ..streams.settings import chosen
from . import packets


@dataclass(frozen=True)
class Trace:
    """How rays are traced.

    side  pixels along a side of a packet of rays
    """

    side: int = 4

    def __post_init__(self) -> None:
        if not 1 <= self.side <= 64:
            raise ValueError("side must be in 1..64 pixels")


class CoherentGrid(BaseMethod):
    """See the package. Needs: pairs of triangles and cells, then the counters of the queues (undecided pairs)."""

    name: ClassVar[str] = "coherent_grid"
    title: ClassVar[str] = "Coherent grid (packets, CPU)"
    devices: ClassVar[tuple[str, ...]] = ("cpu",)
    simulates = frozenset({"shadows", "receivers", "directional", "alpha", "mirror", "orthographic"})
    Build: ClassVar[type] = Build
    Trace: ClassVar[type] = Trace

    def __init__(self, build: Any = None, trace: Any = None):
        super().__init__(build, trace)
        self._pairs = self._undecided = 0
        self._need: wp.array | None = None

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        self._memory, self._need = limits.memory, None
        count, side = frame.triangle_count, self.trace.side
        if count == 0:
            return miss_passes(frame, effects)
        cells = cells_for(count, self.build.density, limits.memory)
        self._pairs = self._pairs or self.build.capacity or 4 * count
        self._undecided = self._undecided or max(1024, frame.pixels // 2)
        self._packets = -(-frame.width // side) * -(-frame.height // side)
        self._frame, self._effects = frame, effects
        with wp.ScopedDevice(frame.device):
            self._need = wp.zeros(1, dtype=wp.int64)
            self._stamps = wp.zeros(count, dtype=wp.int32)
            self._tests = wp.zeros(1, dtype=wp.int64)
        self._grid = TriangleGrid(frame, cells, self._pairs)
        self._cells = filled(Cells, grid=self._grid.grid, lists=self._grid.pairs)
        self._queues = Queues(frame, False, (1, 1, self._undecided), 1)
        camera = Camera(frame, chosen(count, frame.pixels), self._queues, effects)
        others = PixelRays(frame, effects, self._cells, *make_kernels(), hit=camera.hit)
        build, structure = self._grid.built(self._need, 0), TriangleGrid.RESOURCES
        if effects.orthographic:  # a packet's rays start in one point
            return [*build, *others.passes(structure)]
        return [*build, *camera.passes(self._steps, structure), *others.later_passes(structure)]

    def _steps(self, camera: Camera) -> list[Step]:
        return [("packets", (), (), self._launch_primary), undecided_step(camera)]

    def _launch_primary(self, share: int) -> None:
        frame = self._frame
        self._stamps.zero_()
        self._tests.zero_()
        inputs = [self.trace.side, self._cells, frame.camera, frame.mesh, frame.alpha, self._stamps]
        outputs = [self._queues.nearest, self._queues.of_stream(0)[share], self._tests]
        frame.launch(specialised(packets.packet_kernel, self._effects.switches()), self._packets, inputs, outputs)

    def needs(self) -> wp.array | None:
        if self._need is None:
            return None
        return all_needs(self._need, self._queues.needs())

    def grow(self, needed: NDArray[np.int64]) -> bool:
        before = (self._pairs, self._undecided)
        undecided = counted(needed[1:].reshape(-1, COUNTERS)[:, UNDECIDED])
        self._pairs = grown(int(needed[0]), self._pairs, self._memory, "(triangle, cell) pairs")
        self._undecided = grown(int(undecided.max()), self._undecided, self._memory, "undecided pairs", varies=True)
        return before != (self._pairs, self._undecided)

    def counters(self) -> dict[str, int]:
        """Pairs of the grid; (triangle, ray) pairs that the packets of the last frame tested; those left to float64."""
        if self._need is None:
            return {}
        return {
            "pairs": int(self._need.numpy()[0]),
            "primary tests": int(self._tests.numpy()[0]),
            "undecided pairs": int(self._queues.counts.numpy()[:, UNDECIDED].sum()),
        }

    def built(self) -> dict[str, Any]:
        return {"density": self.build.density, "packets": f"{self.trace.side} x {self.trace.side}"}


METHOD = CoherentGrid
