"""OptiX as a method: acceleration structures and pipelines of the driver, through slangpy, on Warp's arrays and stream.

The shaders are in ``rays.slang``. Each launch is recorded and submitted by the host, which also copies its arguments, so
that a frame is no CUDA graph.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import warp as wp

from ...harness.errors import UserError
from ...harness.frame.devices import units_of
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
from . import device as driver
from .structure import Structure

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
    """

    build: str = "fast-build"

    def __post_init__(self) -> None:
        check_choices(self, build=BUILDS)


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
    """See the module. Its tests are the driver's own, float32 and watertight; nobody outside knows more of them."""

    name = "driver"
    title = "Driver (OptiX)"
    simulates = frozenset({"shadows", "receivers", "directional", "alpha", "mirror", "orthographic"})
    capturable = False
    devices = ("cuda",)
    sources = ("rays.slang",)
    Build = Build
    Trace = Trace

    def __init__(self, build: Build | None = None, trace: Trace | None = None):
        super().__init__(build, trace)
        self.known_inexact = f"float32, texels of holes too; {ORIGINS[self.trace.origin]}"
        self._structure: Structure | None = None
        self._alias = ""

    def applies(self, scene: Scene, device: str) -> str | None:
        return super().applies(scene, device) or driver.missing()

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        build, prepared = self.build.build, frame.prepared
        if build == "static" and prepared.moves:
            moves = f"{prepared.scene.name} moves over {prepared.frame_count} frames"
            raise UserError(f"driver.build=static: {moves}; choose fast-build, fast-trace or update")
        self._frame, self._effects, self._structure = frame, effects, None
        self._triangles = TreeTriangles(frame, may_be_hit(prepared))
        if self._triangles.count == 0:
            return miss_passes(frame, effects)
        self._alias = frame.device
        exact = self.trace.origin == "exact"
        self._starts = wp.zeros(frame.pixels if exact else 0, dtype=wp.vec3f, device=frame.device)
        self._structure = Structure(frame, self._triangles, build, effects.alpha, limits.memory)
        self._pipeline = driver.pipeline_of(frame.device, effects.alpha)
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
        return 0 if self._structure is None else self._structure.held

    def built(self) -> dict[str, Any]:
        what = {"build": self.build.build, "origin": self.trace.origin}
        if not self._alias:
            return what
        api = f"OptiX {driver.optix_version(self._alias)}"
        return what | {"api": api, "slangpy": driver.version(), **units_of(self._alias)}

    def _closest(self, bounce: int = 0) -> None:
        self._launch(None, bounce)

    def _shadow(self, light: int, bounce: int = 0) -> None:
        if self.trace.origin == "exact":
            launch_shadow_origins(self._frame, light, self._starts, True, bounce)
        self._launch(light, bounce)

    def _launch(self, light: int | None, bounce: int) -> None:
        """Trace the rays of a bounce, or the shadow rays of its hits to a light."""
        frame, (_, pipeline, table) = self._frame, self._pipeline
        which = light, bounce
        if which not in self._arguments:  # addresses never change while a frame lives
            self._arguments[which] = self._arguments_of(light, bounce)
        encoder = driver.device_of(frame.device).create_command_encoder()
        with encoder.begin_ray_tracing_pass() as rays:
            rays.bind_pipeline(pipeline, table, self._arguments[which])
            shader = driver.RAY_GENERATION.index("closest" if light is None else "shadow")
            rays.dispatch_rays(shader, [frame.width, frame.height, 1])
        driver.submit(frame.device, encoder)

    def _arguments_of(self, light: int | None, bounce: int) -> Any:
        """The arguments of ``rays.slang``, under their names there."""
        import slangpy

        frame, effects = self._frame, self._effects
        rays, hits, tabled = frame.rays(bounce), frame.hits(bounce), frame.tabled(bounce)
        assert self._structure is not None
        values: dict[str, Any] = {
            "structure": self._structure.top,
            "width": frame.width,
            "tabled": tabled,
            "eye": frame.eye.ptr,
            "columns": frame.column.ptr,
            "rows": frame.row.ptr,
            "names": self._triangles.names.ptr or 0,
            "hit_triangle": hits.triangle.ptr,
            "hit_t": hits.t.ptr,
            "hit_u": hits.u.ptr,
            "hit_v": hits.v.ptr,
            "holes": effects.alpha,
        }
        if tabled:
            values |= {"origins": rays.origin.ptr, "directions": rays.direction.ptr, "active": rays.active.ptr}
        if effects.alpha:
            rows, columns = frame.alpha.opaque.shape
            values |= {
                "masked": frame.alpha.masked.ptr,
                "texture_points": frame.alpha.coordinates.ptr,
                "opaque": frame.alpha.opaque.ptr,
                "texture_rows": rows,
                "texture_columns": columns,
            }
        if light is not None:
            masks = frame.masks(bounce)
            values |= {
                "plain": self.trace.origin == "plain",
                "light": frame.lights[light : light + 1].ptr,
                "starts": self._starts.ptr or 0,
                "points": frame.points.ptr,
                "corners": frame.triangles.ptr,
                "receivers": masks[light].ptr if effects.has_receivers(light) else 0,
                "shadowed": frame.bits(bounce)[light].ptr,
            }
        made = driver.device_of(frame.device).create_root_shader_object(self._pipeline[0])
        cursor = slangpy.ShaderCursor(made)
        for name, value in values.items():
            cursor[name] = value
        return made
