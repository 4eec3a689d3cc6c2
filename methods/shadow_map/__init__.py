"""Shadow mapping, the approximate method of game engines: exact primary rays, shadows from a rasterised depth map.

Williams 1978; slope-scaled bias, normal offset and percentage-closer filtering as in engines. Only the shadow bits are
approximate: primary rays come from a rasteriser that decides every uncertain pixel in float64.
"""

from functools import partial
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.errors import CapacityRejected
from ...harness.frame.effects.specialise import specialised
from ...harness.frame.frame import Frame
from ...harness.frame.geometry import filled
from ...harness.frame.method import BaseMethod
from ...harness.frame.schedule.passes import Pass
from ...harness.scene.effects import Effects, Limits
from ...harness.scene.targets import numbers_of
from ..common.bounds import launch_bounds
from ..common.misses import miss_passes
from ..common.pairs import all_needs, grown
from ..gpu.reserve import counted
from ..streams.camera.passes import Camera
from ..streams.method import refuse_too_large
from ..streams.queues import COUNTERS, Capacity, Queues, more_room
from ..streams.settings import chosen
from .lookup import Lookup, lookup_kernel, middle_kernel
from .parameters import BIASES, SHAPES, Build, Trace
from .projection import FACES, LightMap, fit_kernel
from .raster import EMPTY, DepthMap, raster_kernel, strip_kernel

PER_LIGHT = 2
"""Needs of a light: strips queued, faces used."""


class ShadowMap(BaseMethod):
    """See the module. Every light has its own map, so that one may stay while another is drawn again."""

    name: ClassVar[str] = "shadow_map"
    title: ClassVar[str] = "Shadow map (rasterised)"
    simulates = frozenset({"shadows", "receivers", "directional", "alpha"})
    cannot: ClassVar[dict[str, str]] = {"mirror": "it draws triangles from one point: mirrored rays share no origin"}
    known_inexact = "shadow bits are looked up in a depth map of finite resolution"
    outside = MappingProxyType({"shadows": known_inexact})
    Build: ClassVar[type] = Build
    Trace: ClassVar[type] = Trace

    def __init__(self, build: Any = None, trace: Any = None):
        super().__init__(build, trace)
        self._faces = FACES if self.build.shape == "cube" else 1
        self._capacity: Capacity | None = None  # room of the camera's queues; None before the first plan
        self._strip_capacity = 0
        self._needs: wp.array | None = None
        self._memory = 0

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        refuse_too_large(frame)
        self._frame, self._memory = frame, limits.memory
        self._needs = None
        if frame.triangle_count == 0:
            return miss_passes(frame, effects)
        self._queued = bool(wp.get_device(frame.device).is_cuda)
        if self._capacity is None:
            room = max(262144, frame.triangle_count)
            self._capacity = (room, room, room)
            self._strip_capacity = self.build.strip_capacity or max(262144, frame.triangle_count)
        wanted = [i for i, wanted in enumerate(effects.shadows) if wanted]
        self._effects = effects
        soft = self.trace.filter == "soft"
        self._areas = {own.start: own for own in numbers_of(frame.prepared.scene.lights)} if soft else {}
        self._drawn = {i: own.start for own in self._areas.values() for i in own}
        self._allocate(frame, len(effects.shadows), [i for i in wanted if self._drawn.get(i, i) == i])
        queues = Queues(frame, self._queued, self._capacity, 1)
        settings = chosen(frame.triangle_count, frame.pixels, cuda=self._queued)
        camera = Camera(frame, settings, queues, effects)
        self._queues = queues
        self._hit = camera.hit
        wide, bias = self.trace.filter == "pcf", self.trace.bias
        amount = self.trace.bias_amount * (3.0 if wide and bias in ("slope", "normal") else 1.0)
        self._lookup = filled(
            Lookup, bias=BIASES.index(bias), amount=amount, radius=int(wide), spread=self.trace.spread * soft
        )
        passes = camera.passes()
        if wanted:
            scene, box = ("points", "triangles"), partial(launch_bounds, frame, self._box)
            passes.append(Pass("scene box", "light build", scene, ("box",), box, "shadows"))
        return [*passes, *(work for i in wanted for work in self._light_passes(i))]

    def _allocate(self, frame: Frame, lights: int, wanted: list[int]) -> None:
        side = self.build.size
        texels = side * side * self._faces
        if 4 * texels * len(wanted) > self._memory:
            raise CapacityRejected(
                f"needs {len(wanted)} maps of {self._faces} x {side} x {side} texels, "
                f"{4 * texels * len(wanted) / 1e9:.1f} GB; choose a smaller size"
            )
        with wp.ScopedDevice(frame.device):
            self._needs = wp.zeros(PER_LIGHT * lights, dtype=wp.int64)
            self._box = wp.zeros(6, dtype=wp.float32)
            fixed = {"size": side, "faces": self._faces}
            self._maps = {
                i: filled(DepthMap, light=wp.zeros(1, dtype=LightMap), texels=wp.zeros(texels, dtype=wp.int32), **fixed)
                for i in wanted
            }
            self._origins = wp.zeros_like(frame.lights) if self._areas else frame.lights
            self._counts = wp.zeros(1, dtype=wp.int32)
            self._strips = wp.zeros(self._strip_capacity if self._queued else 1, dtype=wp.vec4i)

    def _light_passes(self, i: int) -> list[Pass]:
        light, effect, drawn = f"light/{i}", f"shadows/{i}", self._drawn.get(i, i)
        depth, own = f"depth map/{drawn}", tuple(f"light/{k}" for k in self._areas.get(drawn, (i,)))
        scene = ("points", "triangles", *own, "box", *self._effects.surface_reads())
        look_up = Pass(
            f"light {i}: look up", "shadow", ("hits", light, depth, *self._effects.receiver_reads(i)),
            (f"shadowed/{i}",), partial(self._look_up, i), effect,
        )  # fmt: skip
        if drawn != i:
            return [look_up]
        return [
            Pass(f"light {i}: clear map", "light build", ("box", *own), (depth,), partial(self._clear, i), effect),
            Pass(f"light {i}: draw map", "light build", (*scene, depth), (depth,), partial(self._draw, i), effect),
            look_up,
        ]

    def needs(self) -> wp.array | None:
        return None if self._needs is None else all_needs(self._queues.needs(), self._needs)

    def grow(self, needed: NDArray[np.int64]) -> bool:
        assert self._capacity is not None
        lights = counted(needed)[COUNTERS:].reshape(-1, PER_LIGHT)
        before = (self._capacity, self._strip_capacity, self._faces)
        self._capacity = more_room(needed[:COUNTERS], self._capacity, self._memory)
        strips, faces = (int(most) for most in lights.max(axis=0, initial=0))
        self._strip_capacity = grown(strips, self._strip_capacity, self._memory, "strips of rows")
        self._faces = max(self._faces, faces)
        return before != (self._capacity, self._strip_capacity, self._faces)

    def counters(self) -> dict[str, int]:
        """Texels of a map, and of each light the faces used and the strips queued (GPU)."""
        if self._needs is None:
            return {}
        result = {"texels": self.build.size**2 * self._faces}
        for i, (strips, faces) in enumerate(self._needs.numpy().reshape(-1, PER_LIGHT)):
            result[f"light {i} strips"], result[f"light {i} faces"] = int(strips), int(faces)
        return result

    def built(self) -> dict[str, Any]:
        return {
            "maps": f"{self._faces} x {self.build.size} x {self.build.size}",
            "bias": f"{self.trace.bias} {self.trace.bias_amount:g}",
            "filter": self.trace.filter,
        }

    # --- launches ---

    def _clear(self, light: int) -> None:
        frame, depths = self._frame, self._maps[light]
        if light in self._areas:
            frame.launch(middle_kernel, 1, [light, len(self._areas[light]), frame.lights], [self._origins])
        inputs = [light, SHAPES.index(self.build.shape), self.build.size, PER_LIGHT * light + 1]
        frame.launch(fit_kernel, 1, [*inputs, self._origins, self._box], [depths.light, self._needs])
        depths.texels.fill_(EMPTY)

    def _draw(self, light: int) -> None:
        frame, depths = self._frame, self._maps[light]
        self._counts.zero_()
        switches, outputs = self._effects.switches(light), [depths, self._counts, self._strips]
        inputs = [frame.triangle_count, self._queued, frame.mesh, frame.alpha]
        frame.launch(specialised(raster_kernel, switches), frame.triangle_count * self._faces, inputs, outputs)
        if self._queued:
            threads = 132 * 2048
            inputs = [threads, PER_LIGHT * light, frame.mesh, frame.alpha]
            frame.launch(specialised(strip_kernel, switches), threads, inputs, [*outputs, self._needs], 128)

    def _look_up(self, light: int) -> None:
        frame, drawn = self._frame, self._drawn.get(light, light)
        hits = [frame.hits(0), self._hit, frame.receivers]
        inputs = [light, drawn, self._lookup, frame.mesh, frame.lights, self._origins, self._maps[drawn], *hits]
        outputs = [frame.answers.shadowed]
        frame.launch(specialised(lookup_kernel, self._effects.switches(light)), frame.pixels, inputs, outputs)


METHOD = ShadowMap
