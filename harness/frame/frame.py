"""The input arrays of one frame on the device, at fixed addresses, and the answers that a method fills. Everything that
may change between frames is in an array whose address never changes, because a captured graph stores the addresses.
:meth:`Frame.load` copies the data of the next frame into these arrays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ..scene.effects import Effects
from ..scene.moment import Moment
from ..scene.prepared import Prepared
from ..scene.scene import Light
from ..scene.spotlight import SPOT
from ..scene.targets import per_target
from .alpha import device_alpha
from .geometry import Camera, Hits, Mesh, Rays, bounce_arrays, filled
from .materials import LAMP, lamp_rows, reflectances

MISS = -1

AT_ONCE = 8  # elements that a CPU may read at once: where it does, an array has room for so many beyond its end


BOUNCED = ("origin", "direction", "active", "triangle", "t", "u", "v", "shadowed")
"""The fields of :class:`.geometry.Bounces` that are copied to the host, there prefixed with "bounce_"."""


@dataclass(eq=False)
class Answers:
    """The answers of a method to a frame, on the frame's device. Pixel index = row * width + column.

    triangle    int32 [pixels]: the closest triangle, ties to the lowest index; -1 at a miss
    t           float32 [pixels]: distance in lengths of the pixel's direction; inf at a miss
    u, v        float32 [pixels]: weights of vertices 1 and 2 (Embree's convention); 0 at a miss
    shadowed    uint8 [light_count, pixels]: 1 = shadowed; 0 at a miss and for lights without shadows
    bounces     the answers for mirrored rays (:class:`.geometry.Bounces`)
    """

    triangle: wp.array
    t: wp.array
    u: wp.array
    v: wp.array
    shadowed: wp.array
    bounces: Any

    def arrays(self) -> dict[str, wp.array]:
        """All answers by their names on the host; those of :data:`BOUNCED` only if the scene has mirrors."""
        result = {name: getattr(self, name) for name in ("triangle", "t", "u", "v", "shadowed")}
        if self.bounces.active.size:
            result |= {f"bounce_{name}": getattr(self.bounces, name) for name in BOUNCED}
        return result

    def to_host(self) -> dict[str, NDArray]:
        """Copies of all answers as numpy arrays."""
        return {name: np.array(array.numpy()) for name, array in self.arrays().items()}

    def poison(self) -> None:
        """Fill with invalid values, so that an answer that was not written is detected."""
        for array in self.arrays().values():
            array.fill_(77 if array.dtype == wp.uint8 else -77)


class Frame:
    """Device arrays of one moment, and the answers. ``mesh`` and ``camera`` group them for kernels (:mod:`.geometry`).

    points    vec3f [vertex_count]      triangles vec3i [triangle_count]
    weld      int32 [vertex_count]      valid     uint8 [triangle_count]
    eye       vec3f [1]                 axes      vec3f [3]: right, up, forward
    tangents  float32 [2]               column    vec3f [width], row vec3f [height]
    whole_column    vec3f [width + AT_ONCE]: the column with what a CPU may read beyond its end
    max_coordinate  float32 [1]: bounds every coordinate of scene and eye
    lights    vec3f [light_count]       spots  float64 [light_count, 12]: see :mod:`..judge.receivers`
    proxy_positions     vec3f [light_count]: what grids of a light look from (:class:`..scene.moment.Moment`)
    receivers uint8 [light_count, pixels]: 1 = has a shadow ray (:mod:`.effects.receivers`); empty where no light has any
    reached   int32 [(bounces + 1) * light_count]: not 0 where a hit of a bounce receives a light; empty like ``receivers``
    front_facing    uint8 [light_count, triangle_count]: 1 = may face the light; empty unless a pass finds it
              (:func:`.effects.receivers.facing_passes`)
    alpha     the scene's mask (:class:`.alpha.Alpha`), the resource "surfaces"; empty unless the effects hold alpha
    mirror    uint8 [triangle_count]: 1 = a mirror; empty unless rays bounce
    color     vec3f [pixels]: linear colour (:mod:`.effects.shading`); tint vec3f [triangle_count], lamps float64
              [light_count, 5]: looks of surfaces and lights. All three are empty unless colour is wanted
    """

    def __init__(
        self, prepared: Prepared, width: int, height: int, light_count: int, device: str, effects: Effects | None = None
    ):
        effects = effects or Effects(shadows=())
        limited = any(effects.has_receivers(i) for i in range(light_count))
        bounces, colored = effects.bounces, effects.color
        self.prepared, self.device = prepared, device
        self.width, self.height, self.pixels = width, height, width * height
        self.light_count = light_count
        self.triangle_count, self.vertex_count = prepared.triangle_count, prepared.vertex_count
        self.orthographic = effects.orthographic
        # At least one element each, so that the arrays of an empty mesh have addresses too.
        triangles, vertices, lights = (max(1, n) for n in (self.triangle_count, self.vertex_count, light_count))
        with wp.ScopedDevice(device):
            self.points = wp.zeros(vertices, dtype=wp.vec3f)
            self.triangles = wp.zeros(triangles, dtype=wp.vec3i)
            self.weld = wp.zeros(vertices, dtype=wp.int32)
            self.valid = wp.zeros(triangles, dtype=wp.uint8)
            self.eye = wp.zeros(1, dtype=wp.vec3f)
            self.axes = wp.zeros(3, dtype=wp.vec3f)
            self.max_coordinate = wp.zeros(1, dtype=wp.float32)
            self.tangents = wp.zeros(2, dtype=wp.float32)
            self.whole_column = wp.zeros(width + AT_ONCE, dtype=wp.vec3f)
            self.column = self.whole_column[:width]
            self.row = wp.zeros(height, dtype=wp.vec3f)
            self.lights = wp.zeros(lights, dtype=wp.vec3f)
            self.proxy_positions = wp.zeros_like(self.lights) if any(effects.directional) else self.lights
            self.spots = wp.zeros((lights, SPOT), dtype=wp.float64)
            self.receivers = wp.zeros((light_count, self.pixels) if limited else (0, 0), dtype=wp.uint8)
            self.reached = wp.zeros(light_count * (bounces + 1) if limited else 0, dtype=wp.int32)
            self.front_facing = wp.empty((0, 0), dtype=wp.uint8)
            t, u, v = (wp.zeros(self.pixels, dtype=wp.float32) for _ in range(3))
            closest, bits = wp.zeros(self.pixels, dtype=wp.int32), wp.zeros((lights, self.pixels), dtype=wp.uint8)
            mirrored = bounce_arrays(bounces, light_count, self.pixels, limited)
            self.answers = Answers(closest, t, u, v, bits, mirrored)
            self.mirror = wp.zeros(triangles if bounces else 0, dtype=wp.uint8)
            self.color = wp.zeros(self.pixels if colored else 0, dtype=wp.vec3f)
            self.tint = wp.zeros(triangles if colored else 0, dtype=wp.vec3f)
            self.lamps = wp.zeros((light_count, LAMP) if colored else (0, 0), dtype=wp.float64)
            rays = Rays()
            if self.orthographic:
                start, way = (wp.zeros(self.pixels, dtype=wp.vec3f) for _ in range(2))
                rays = filled(Rays, origin=start, direction=way, active=wp.ones(self.pixels, dtype=wp.uint8))
        self.alpha = device_alpha(prepared.alpha if effects.alpha else None, device)
        self.flags = wp.empty(0, dtype=wp.uint8, device=device)
        self.mesh = self._mesh(self.valid)
        self.camera = filled(
            Camera, width=width, height=height, eye=self.eye, axes=self.axes, tangents=self.tangents,
            column=self.column, row=self.row,
        )  # fmt: skip
        a, of = self.answers, self.answers.bounces
        self._hits, self._rays = [filled(Hits, triangle=a.triangle, t=a.t, u=a.u, v=a.v)], [rays]
        for b in range(bounces):
            self._hits.append(filled(Hits, triangle=of.triangle[b], t=of.t[b], u=of.u[b], v=of.v[b]))
            self._rays.append(filled(Rays, origin=of.origin[b], direction=of.direction[b], active=of.active[b]))
        self.host: Moment | None = None
        if self.triangle_count:
            self.triangles.assign(prepared.faces)
        if self.vertex_count:
            self.weld.assign(prepared.weld)
        if bounces and self.triangle_count:
            self.mirror.assign(prepared.mirror)
        if colored and self.triangle_count:
            self.tint.assign(reflectances(prepared))
        if colored and light_count:
            shining = (*per_target(prepared.scene.lights), *(Light((0.0, 0.0, 0.0)) for _ in range(light_count)))
            self.lamps.assign(lamp_rows(shining[:light_count], (*effects.shadows, *(False,) * light_count)))

    def rays(self, bounce: int) -> Any:
        """The mirrored rays of a bounce, counted from 1 (:class:`.geometry.Rays`). Those of bounce 0 are the primary rays of
        an orthographic camera; otherwise they have no arrays.
        """
        return self._rays[bounce]

    def tabled(self, bounce: int) -> bool:
        """Whether the rays of a bounce are those of :meth:`rays`, for a kernel's switch ``bounced``."""
        return bounce > 0 or self.orthographic

    def hits(self, bounce: int) -> Any:
        """The closest hits of the rays of a bounce (:class:`.geometry.Hits`); bounce 0: of the primary rays."""
        return self._hits[bounce]

    def bits(self, bounce: int) -> wp.array:
        """The shadow bits [light_count, pixels] of the hits of a bounce; bounce 0: of the primary hits."""
        return self.answers.bounces.shadowed[bounce - 1] if bounce else self.answers.shadowed

    def masks(self, bounce: int) -> wp.array:
        """The receiver flags [light_count, pixels] of the hits of a bounce; empty if every hit is a receiver."""
        bounced = self.answers.bounces.receivers
        return bounced[bounce - 1] if bounce and bounced.size else self.receivers

    def flagged_mesh(self, effects: Effects) -> Any:
        """The mesh; where the effects hold closed surfaces, ``valid`` has the bits of :mod:`..scene.closed`."""
        return self._mesh(self.flags) if effects.closed else self.mesh

    def _mesh(self, valid: wp.array) -> Any:
        return filled(Mesh, points=self.points, triangles=self.triangles, weld=self.weld, valid=valid)

    def launch(
        self, kernel: wp.Kernel, threads: int, inputs: Sequence, outputs: Sequence = (), block: int = 256
    ) -> None:
        """Launch a kernel on the frame's device; ``block``: threads of a block on a GPU."""
        wp.launch(kernel, dim=threads, inputs=inputs, outputs=outputs, device=self.device, block_dim=block)

    def load(self, moment: Moment, flags: NDArray[np.uint8] | None = None) -> None:
        """Copy the data of the next frame to the device. This is not timed, as in the paper. Raises ValueError for
        another image size, mesh or number of lights than this frame was made for.
        """
        planned = (self.width, self.height, self.vertex_count, self.triangle_count, self.light_count)
        given = (moment.width, moment.height, len(moment.points), len(moment.valid), len(moment.lights))
        if planned != given:
            names = ("width", "height", "vertices", "triangles", "lights")
            wrong = [f"{b} {n}, not {a}" for n, a, b in zip(names, planned, given, strict=True) if a != b]
            raise ValueError(f"the moment does not fit this frame: {'; '.join(wrong)}")
        if moment.orthographic != self.orthographic:
            raise ValueError("the moment does not fit this frame: one of them is orthographic")
        self.host = moment
        if self.orthographic:
            pixels = np.arange(self.pixels)
            self.rays(0).origin.assign(moment.origins(pixels))
            self.rays(0).direction.assign(np.ascontiguousarray(moment.directions(pixels)))
        if self.vertex_count:
            self.points.assign(moment.points)
        if self.triangle_count:
            self.valid.assign(moment.valid)
            if flags is not None:
                if not self.flags.size:
                    self.flags = wp.zeros_like(self.valid)
                self.flags.assign(flags)
        self.eye.assign(moment.eye.reshape(1, 3))
        for name in ("axes", "max_coordinate", "tangents", "column", "row"):
            getattr(self, name).assign(getattr(moment, name))
        if self.light_count:
            self.lights.assign(moment.lights)
            if self.proxy_positions is not self.lights:
                self.proxy_positions.assign(moment.lights if moment.proxy_positions is None else moment.proxy_positions)
            spots = np.zeros(self.spots.shape)
            spots[: len(moment.spots)] = moment.spots
            self.spots.assign(spots)
