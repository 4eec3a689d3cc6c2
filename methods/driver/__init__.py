"""The driver's own ray tracing, by OptiX or Vulkan, through slangpy: in hardware where the card has units for it.

The shaders are in ``rays.slang``. Each launch is recorded and submitted by the host, which also copies its arguments, so
that a frame is no CUDA graph.
"""

from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import warp as wp

from ...harness.errors import UserError
from ...harness.frame.effects.mirrors import traced_bounces
from ...harness.frame.frame import Frame
from ...harness.frame.method import BaseMethod
from ...harness.frame.schedule.passes import Pass
from ...harness.scene.effects import Effects, Limits
from ...harness.scene.scene import Scene
from ..common.misses import miss_passes
from ..common.parameters import check_choices
from ..rays.launches import shadow_ray_passes
from ..rays.mesh_triangles import TreeTriangles, may_be_hit
from ..rays.offset import launch_shadow_origins
from . import device as slang
from .memory import CopiedMemory, SharedMemory
from .structure import Structure

APIS = ("optix", "vulkan")
HITS = ("hit_triangle", "hit_t", "hit_u", "hit_v")
"""The arguments of ``rays.slang`` that rays write and shadow rays read."""

BUILDS = ("fast-build", "fast-trace", "update", "static")
ORIGINS = MappingProxyType(
    {
        "exact": "shadow rays start a rounding bound away from the surface, which may not be the driver's",
        "plain": "shadow rays start off the surface by Waechter and Binder's rule, which is no bound",
    }
)


@dataclass(frozen=True)
class Build:
    """How the driver builds its acceleration structure.

    build  "fast-build": built in each frame, preferring the speed of the build; "fast-trace": preferring the speed of
           rays; "update": that of the animation's first frame, preferring the speed of rays, updated in each frame;
           "static": built once, preferring the speed of rays, for geometry that does not move
    api    "optix": on NVIDIA's GPUs, with Warp's own arrays; "vulkan": on the first device that Vulkan finds, beside Warp on
           the CPU. Its passes hold copies of their arrays to the device and of the answers back
    """

    build: str = "fast-build"
    api: str = "optix"

    def __post_init__(self) -> None:
        check_choices(self, build=BUILDS, api=APIS)


@dataclass(frozen=True)
class Trace:
    """How rays are traced.

    origin  where shadow rays start. "exact": off the surface by a bound of a float32 query's rounding, computed in
            float64 by a kernel of its own; "plain": float32 throughout, in the shader, off the surface by the rule of
            Waechter and Binder (Ray Tracing Gems, chapter 6)
    """

    origin: str = "exact"

    def __post_init__(self) -> None:
        check_choices(self, origin=ORIGINS)


class Driver(BaseMethod):
    """See the package. Its tests are the driver's own, float32 and watertight; nobody outside knows more of them."""

    name = "driver"
    title = "Driver's ray tracing"
    simulates = frozenset({"shadows", "receivers", "directional", "alpha", "mirror", "orthographic"})
    capturable = False
    sources = ("rays.slang",)
    Build = Build
    Trace = Trace

    def __init__(self, build: Build | None = None, trace: Trace | None = None):
        super().__init__(build, trace)
        self.known_inexact = f"float32, texels of holes too; {ORIGINS[self.trace.origin]}"
        self.devices = ("cuda",) if self.build.api == "optix" else ("cpu",)  # type: ignore[misc]
        self._memory: SharedMemory | CopiedMemory | None = None

    def applies(self, scene: Scene, device: str) -> str | None:
        if self.build.api == "vulkan" and device.startswith("cuda"):
            return "by Vulkan it runs beside Warp on the CPU; give --device cpu"
        if self.build.api == "optix" and not device.startswith("cuda"):
            return "by OptiX it runs on cuda only; try --set driver.api=vulkan (docs/methods/driver.md)"
        return super().applies(scene, device) or slang.missing(self.build.api)

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        build, prepared = self.build.build, frame.prepared
        if build == "static" and prepared.moves:
            moves = f"{prepared.scene.name} moves over {prepared.frame_count} frames"
            raise UserError(f"driver.build=static: {moves}; choose fast-build, fast-trace or update")
        self._frame, self._effects, self._memory = frame, effects, None
        self._triangles = TreeTriangles(frame, may_be_hit(prepared))
        if self._triangles.count == 0:
            return miss_passes(frame, effects)
        exact = self.trace.origin == "exact"
        self._starts = wp.zeros(frame.pixels if exact else 0, dtype=wp.vec3f, device=frame.device)
        self._device = slang.device_of(self.build.api, frame.device)
        self._pipeline = slang.pipeline_of(self.build.api, frame.device, effects.alpha)
        kind = SharedMemory if self.build.api == "optix" else CopiedMemory
        self._memory = kind(self._device, limits.memory, frame.device)
        self._structure = Structure(frame, self._triangles, build, effects.alpha, self._memory)
        self._arguments: dict[tuple[int | None, int], Any] = {}
        passes = []
        if build != "static":
            what = "update" if build == "update" else "build"
            passes.append(Pass(what, "build", ("points", "triangles"), ("structure",), self._structure.renew))
        reads = ("structure", "camera", *effects.surface_reads())
        passes.append(Pass("primary rays", "trace", reads, ("hits",), self._closest))
        passes += shadow_ray_passes(effects, ("structure", "hits", "camera"), self._shadow)
        passes += traced_bounces(effects, ("structure", "points", "triangles"), self._closest, self._shadow)
        return passes

    def held_bytes(self) -> int:
        return 0 if self._memory is None else self._memory.held

    def built(self) -> dict[str, Any]:
        what = {"build": self.build.build, "origin": self.trace.origin}
        return what | ({} if self._memory is None else slang.facts_of(self.build.api, self._frame.device))

    def _closest(self, bounce: int = 0) -> None:
        self._launch(None, bounce)

    def _shadow(self, light: int, bounce: int = 0) -> None:
        if self.trace.origin == "exact":
            launch_shadow_origins(self._frame, light, self._starts, True, bounce)
        self._launch(light, bounce)

    def _launch(self, light: int | None, bounce: int) -> None:
        """Trace the rays of a bounce, or the shadow rays of its hits to a light."""
        frame, (program, pipeline, table), memory = self._frame, self._pipeline, self._memory
        assert memory is not None
        which = light, bounce
        if which not in self._arguments:  # addresses never change while a frame lives
            self._arguments[which] = self._bound(program, self._values(light, bounce))
        arguments, reads, writes = self._arguments[which]
        encoder = self._device.create_command_encoder()
        with encoder.begin_ray_tracing_pass() as rays:
            rays.bind_pipeline(pipeline, table, arguments)
            shader = slang.RAY_GENERATION.index("closest" if light is None else "shadow")
            rays.dispatch_rays(shader, [frame.width, frame.height, 1])
        memory.submit(encoder, reads, writes)

    def _bound(self, program: Any, values: dict[str, Any]) -> tuple[Any, list[wp.array], list[wp.array]]:
        """The arguments of ``rays.slang`` as slangpy takes them; the arrays that it reads, and those that it writes."""
        import slangpy

        assert self._memory is not None
        made = self._device.create_root_shader_object(program)
        cursor = slangpy.ShaderCursor(made)
        reads, writes = [], []
        for name, value in values.items():
            if not isinstance(value, wp.array):
                cursor[name] = value
                continue
            cursor[name] = self._memory.address(value)
            if name == "shadowed" or (name in HITS and "light" not in values):
                writes.append(value)
            elif name not in HITS:
                reads.append(value)
        return made, reads, writes

    def _values(self, light: int | None, bounce: int) -> dict[str, Any]:
        """The arguments of ``rays.slang``, under their names there."""
        frame, effects = self._frame, self._effects
        rays, hits, tabled = frame.rays(bounce), frame.hits(bounce), frame.tabled(bounce)
        values: dict[str, Any] = {
            "structure": self._structure.top,
            "width": frame.width,
            "tabled": tabled,
            "eye": frame.eye,
            "columns": frame.column,
            "rows": frame.row,
            "names": self._triangles.names,
            **dict(zip(HITS, (hits.triangle, hits.t, hits.u, hits.v), strict=True)),
            "holes": effects.alpha,
        }
        if tabled:
            values |= {"origins": rays.origin, "directions": rays.direction, "active": rays.active}
        if effects.alpha:
            mask = frame.alpha
            values |= {"masked": mask.masked, "texture_points": mask.coordinates, "opaque": mask.opaque}
            values |= dict(zip(("texture_rows", "texture_columns"), mask.opaque.shape, strict=True))
        if light is not None:
            values |= {
                "plain": self.trace.origin == "plain",
                "light": frame.lights[light : light + 1],
                "starts": self._starts,
                "points": frame.points,
                "corners": frame.triangles,
                "receivers": frame.masks(bounce)[light] if effects.has_receivers(light) else 0,
                "shadowed": frame.bits(bounce)[light],
            }
        return values


METHOD = Driver
