"""Methods that build one structure in every frame and trace each ray through it on its own, exactly."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.frame.frame import Frame
from ...harness.frame.method import BaseMethod
from ...harness.frame.schedule.passes import Pass
from ...harness.frame.schedule.threads import check_threads
from ...harness.scene.effects import Effects, Limits
from ..common.misses import miss_passes
from ..common.pairs import grown
from .launches import PixelRays


@dataclass(frozen=True)
class RayTrace:
    """How rays are traced.

    threads  of a CPU: each traces a band of the image; 0: one for each core that this process may use, at most 16
    """

    threads: int = 0

    def __post_init__(self) -> None:
        check_threads(self.threads)


@dataclass(frozen=True)
class Built:
    """What :meth:`RayStructure.structure` returns: the passes that build it, the struct that the kernels take, the
    resources that rays read, and the kernels of primary and of shadow rays.
    """

    passes: list[Pass]
    struct: Any
    resources: tuple[str, ...]
    kernels: tuple[wp.Kernel, wp.Kernel]


class RayStructure(BaseMethod):
    """Base class. Exact: float32 rejects, float64 decides, and no ray can miss a triangle that it hits.

    A subclass says what it needs (``ROOMS``), allocates in :meth:`structure`, and counts in :meth:`counted`.
    """

    ROOMS: ClassVar[tuple[str, ...]] = ()
    """What its buffers hold, in the order in which their needs become known: also the slots of the needs."""
    BUILT: ClassVar[tuple[str, ...]] = ()
    """The build parameters that a record shows."""
    simulates = frozenset({"shadows", "receivers", "directional", "alpha", "mirror", "orthographic"})
    Trace: ClassVar[type] = RayTrace

    def __init__(self, build: Any = None, trace: Any = None):
        super().__init__(build, trace)
        self._capacity: list[int] = []
        self._need: wp.array | None = None
        self._rays: PixelRays | None = None

    def first_capacity(self, frame: Frame) -> list[int]:
        """The room of each of ``ROOMS`` before any frame has asked for more."""
        raise NotImplementedError

    def structure(self, frame: Frame) -> Built:
        """Allocate the structure, with the room of ``self._capacity``."""
        raise NotImplementedError

    def counted(self) -> dict[str, int]:
        """Counters of the structure in the last frame."""
        raise NotImplementedError

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        self._frame, self._memory = frame, limits.memory
        self._need = self._rays = None
        if frame.triangle_count == 0:
            return miss_passes(frame, effects)
        self._capacity = self._capacity or self.first_capacity(frame)
        self._need = wp.zeros(len(self.ROOMS), dtype=wp.int64, device=frame.device)
        built = self.structure(frame)
        self._rays = PixelRays(frame, effects, built.struct, *built.kernels, threads=self.trace.threads)
        return [*built.passes, *self._rays.passes(built.resources)]

    def needs(self) -> wp.array | None:
        return self._need

    def grow(self, needed: NDArray[np.int64]) -> bool:
        for slot, what in enumerate(self.ROOMS):
            capacity = grown(int(needed[slot]), self._capacity[slot], self._memory, what)
            if capacity != self._capacity[slot]:
                self._capacity[slot] = capacity
                return True
        return False

    def tests_per_pixel(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Triangle tests of each pixel's primary ray and of its shadow rays. The last frame is traced again to count
        them.
        """
        assert self._rays is not None
        return self._rays.tests_per_pixel()

    def counters(self) -> dict[str, int]:
        return {} if self._rays is None else {**self.counted(), **self._rays.counters()}

    def built(self) -> dict[str, Any]:
        threads = {} if self._rays is None else self._rays.bands.built()
        return {name: getattr(self.build, name) for name in self.BUILT} | threads
