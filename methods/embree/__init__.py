"""Embree 4 as a method, through its own C interface: rebuilt, refitted or static, single rays or packets of 16.

Kernels that Warp compiles for the CPU pass the rays to Embree (:mod:`.packets`); a launch releases the GIL, so that Python
threads over parts of the image use every core.
"""

import ctypes
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.metadata import version
from types import MappingProxyType
from typing import Any

import numpy as np
import warp as wp

from ...harness.frame.frame import Frame
from ...harness.frame.geometry import filled
from ...harness.frame.method import BaseMethod
from ...harness.frame.schedule.passes import Pass
from ...harness.frame.schedule.threads import processors, ranges
from ...harness.scene.effects import Effects, Limits
from ..common.misses import miss_passes, write_misses
from ..common.parameters import check_choices, refuse_static
from ..rays.launches import ray_passes
from ..rays.offset import SHADOW_END, launch_shadow_origins
from .library import QUALITIES, Device, TriangleScene, address
from .packets import SIDE, Query, ShadowRays, coherent_arguments, intersect_kernel, occluded_kernel

UPDATES = ("rebuild", "refit", "static")
RAYS = ("single", "packet16")

PARTS_PER_THREAD = 4
"""The image is cut into this many parts per thread, so that a slow part does not delay the end."""

SMALLEST_PART = 64
"""Fewest blocks of pixels in a part: a smaller part costs more to schedule than to trace."""


@dataclass(frozen=True)
class Build:
    """How the tree is built.

    robust         whether the scene is built with RTC_SCENE_FLAG_ROBUST: conservative box tests and watertight edges, 10 to
                   25 % slower; without it rays aimed at edges and vertices escape
    update         "rebuild": a tree is built in each frame; "refit": the tree of the animation's first frame, its boxes
                   refitted in each frame (in frames in which other triangles are invalid than in the first: a tree of
                   that frame); "static": built once, for geometry that does not move
    quality        of a tree that is built: "low" (Morton codes; the fastest build), "medium" (surface area heuristic) or
                   "high" (also splits triangles). The tree that update=refit starts from is of medium quality
    build_threads  threads that build; 0: one for each core
    """

    robust: bool = True
    update: str = "rebuild"
    quality: str = "medium"
    build_threads: int = 0

    def __post_init__(self) -> None:
        check_choices(self, update=UPDATES, quality=QUALITIES)
        if self.update == "refit" and self.quality != "medium":
            raise ValueError("the tree that update=refit starts from is of quality medium; leave quality out")
        if self.build_threads < 0:
            raise ValueError("build_threads must be 0 (all cores) or more")


@dataclass(frozen=True)
class Trace:
    """How rays are traced.

    threads  threads that trace parts of the image; 0: one for each core that this process may use
    rays     "single": rtcIntersect1 and rtcOccluded1; "packet16": 16 rays of 4x4 pixels at once, declared coherent
    """

    threads: int = 0
    rays: str = "packet16"

    def __post_init__(self) -> None:
        check_choices(self, rays=RAYS)
        if self.threads < 0:
            raise ValueError("threads must be 0 (all cores) or more")


class Embree(BaseMethod):
    """See the module. Shadow rays start at an offset that an error bound gives, as for every method without exact tests."""

    name = "embree"
    title = "Embree"
    simulates = frozenset({"shadows", "receivers", "directional", "mirror", "orthographic"})
    cannot = MappingProxyType({"alpha": "holes need a filter function that decides them in float64; none is written"})
    capturable = False
    devices = ("cpu",)
    known_inexact = (
        "float32: rays exactly through a vertex may escape, rays in the upper faces of the scene's box miss, and "
        "shadow rays start a rounding bound away from the surface; a mirrored ray that starts in another triangle's plane "
        "may meet it at t = 0"
    )
    Build = Build
    Trace = Trace

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        if frame.triangle_count == 0:
            return miss_passes(frame, effects)
        self._frame, self._effects = frame, effects
        self._embree = Device(self.build.build_threads)
        self._scene: TriangleScene | None = None
        self._valid: Any = None
        self._first_valid: Any = None
        self._origins = wp.zeros(frame.pixels, dtype=wp.vec3f, device=frame.device)
        self._none = wp.zeros(0, dtype=wp.uint8, device=frame.device)
        self._arguments = coherent_arguments()
        self._compiled: set[str] = set()
        count = self.thread_count
        self._pool = ThreadPoolExecutor(count) if count > 1 else None
        blocks = -(-frame.width // SIDE) * -(-frame.height // SIDE)
        parts = max(1, min(count * PARTS_PER_THREAD if count > 1 else 1, blocks // SMALLEST_PART))
        self._parts = ranges(blocks, parts)
        self._stretches = ranges(frame.pixels, parts)
        update = self.build.update
        if update != "rebuild":
            refuse_static(self.name, update, frame.prepared)
            self._make(*frame.prepared.points(0))
            self._first_valid = self._valid
        passes = ray_passes(effects, "embree", self._closest, self._shadow)
        if update == "static":
            return passes
        name = "copy and commit" if update == "rebuild" else "copy and refit"
        return [Pass(name, "build", ("points", "triangles"), ("embree",), self._commit), *passes]

    @property
    def thread_count(self) -> int:
        """The threads that trace."""
        return self.trace.threads or processors()

    def built(self) -> dict[str, Any]:
        what = {
            "update": self.build.update,
            "quality": self.build.quality,
            "robust": self.build.robust,
            "rays": self.trace.rays,
            "threads": self.thread_count,
            "build threads": self.build.build_threads or processors(),
            "embreex": version("embreex"),
        }
        return what | ({"embree": self._embree.version} if hasattr(self, "_embree") else {})

    def _make(self, points: np.ndarray, valid: np.ndarray) -> None:
        """A new scene. Embree drops a triangle with a vertex that is not finite, and the others keep their numbers."""
        faces = self._frame.prepared.faces
        self._valid, self._scene = valid.copy(), None
        if not valid.any():
            return
        if not valid.all():
            points = np.concatenate([points, np.full((1, 3), np.nan, dtype=np.float32)])
            faces = np.where(valid[:, None] != 0, faces, len(points) - 1)
        self._scene = TriangleScene(
            self._embree, points, faces, self.build.quality, self.build.robust, self.build.update == "refit"
        )

    def _commit(self) -> None:
        """Copy the vertices and commit: Embree builds or refits, as the scene was made. Other flags need a new scene.

        The tree of the first frame is refitted, also after frames with other flags, so that a frame does not depend on
        those before it.
        """
        points, valid = self._frame.points.numpy(), self._frame.valid.numpy()
        same = self._valid is not None and np.array_equal(valid, self._valid)
        as_first = self._first_valid is not None and np.array_equal(valid, self._first_valid)
        if as_first and not same:
            self._make(*self._frame.prepared.points(0))
        elif not same or (self.build.update == "refit" and not as_first):
            self._make(points, valid)
            return
        if self._scene is not None:
            self._scene.commit(points)

    def _on_threads(self, what: str, work: Callable[[tuple[int, int]], None], parts: Sequence[tuple[int, int]]) -> None:
        """Call ``work`` for each part, on the threads. The first call may compile, so it runs alone before them."""
        if what not in self._compiled:
            self._compiled.add(what)
            work(parts[0])
            parts = parts[1:]
        if self._pool is None:
            for part in parts:
                work(part)
        else:
            list(self._pool.map(work, parts))

    def _each_part(self, kernel: wp.Kernel, inputs: Sequence[Any]) -> None:
        """Launch ``kernel`` over the parts of the image, the first block of each as its first argument."""
        launch = self._frame.launch
        self._on_threads(kernel.key, lambda part: launch(kernel, part[1], [part[0], *inputs]), self._parts)

    def _query(self, kind: str) -> Any:
        """What kernels take as :class:`.packets.Query`; ``kind``: Intersect or Occluded."""
        packets = self.trace.rays == "packet16"
        assert self._scene is not None
        return filled(
            Query,
            packets=packets,
            function=address(f"rtc{kind}16" if packets else f"rtc{kind}1"),
            scene=self._scene.handle,
            arguments=ctypes.addressof(self._arguments) if packets else 0,
        )

    def _closest(self, bounce: int = 0) -> None:
        frame = self._frame
        if self._scene is None:
            write_misses(frame, bounce)
            return
        rays = [frame.tabled(bounce), frame.camera, frame.rays(bounce)]
        self._each_part(intersect_kernel, [self._query("Intersect"), *rays, frame.hits(bounce)])

    def _shadow(self, light: int, bounce: int = 0) -> None:
        frame = self._frame
        bits = frame.bits(bounce)[light]
        if self._scene is None:
            bits.zero_()
            return
        self._on_threads(
            f"origins, mirrored {bounce > 0}",
            lambda part: launch_shadow_origins(frame, light, self._origins, False, bounce, part),
            self._stretches,
        )
        limited = self._effects.has_receivers(light)
        of = filled(
            ShadowRays, limited=limited, end=SHADOW_END, starts=self._origins, triangle=frame.hits(bounce).triangle,
            receivers=frame.masks(bounce)[light] if limited else self._none, shadowed=bits,
        )  # fmt: skip
        self._each_part(occluded_kernel, [self._query("Occluded"), light, frame.lights, frame.camera, of])


METHOD = Embree
