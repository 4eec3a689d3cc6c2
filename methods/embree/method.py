"""Embree 4 as a method: a new scene each frame, closest-hit and any-hit queries over blocks of rays.

embreex takes float32 arrays strictly, copies the mesh, commits on the first query, and releases the GIL while it
traces, so that Python threads over blocks of rays use every core.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.metadata import version
from types import MappingProxyType
from typing import Any

import numpy as np
import warp as wp
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore import EmbreeDevice
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from ...harness.frame.frame import MISS, Frame
from ...harness.frame.method import BaseMethod
from ...harness.frame.mirrors import traced_bounces
from ...harness.frame.passes import Pass
from ...harness.scene.effects import Effects, Limits
from ..common.misses import miss_passes
from ..common.offset import SHADOW_END, launch_shadow_origins
from ..common.ray_passes import shadow_ray_passes

FARTHEST = np.float32(1e37)
"""What embreex reports as the distance of a miss."""

BLOCKS_PER_THREAD = 4
"""Rays are cut into this many blocks a thread, so that a slow block does not hold up the others."""

SMALLEST_BLOCK = 1024
"""Rays; below this a block costs more to hand out than to trace."""


@dataclass(frozen=True)
class Build:
    """How the tree is built.

    robust  whether the scene is built with RTC_SCENE_FLAG_ROBUST: conservative box tests and watertight edges, 10 to 25 %
            slower; without it rays aimed at edges and vertices escape
    """

    robust: bool = True


@dataclass(frozen=True)
class Trace:
    """How rays are traced.

    threads  threads that trace blocks of rays; 0: one for each core that this process may use. The build always uses
             Embree's own threads
    """

    threads: int = 0

    def __post_init__(self) -> None:
        if self.threads < 0:
            raise ValueError("threads must be 0 (all cores) or more")


class Embree(BaseMethod):
    """See the module. Shadow origins are offset by an error bound, because embreex can set no nearest distance."""

    name = "embree"
    title = "Embree"
    simulates = frozenset({"shadows", "receivers", "directional", "mirror"})
    cannot = MappingProxyType(
        {"alpha": "Embree's Python binding has no filter functions to skip a hit in a hole"}
    )
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
        self._device = EmbreeDevice()
        self._scene: EmbreeScene | None = None
        self._faces = np.ascontiguousarray(frame.prepared.faces, dtype=np.int32)
        self._origins = wp.zeros(frame.pixels, dtype=wp.vec3f, device=frame.device)
        count = self.thread_count
        self._pool = ThreadPoolExecutor(count) if count > 1 else None
        blocks = max(1, min(count * BLOCKS_PER_THREAD if count > 1 else 1, frame.pixels // SMALLEST_BLOCK))
        cuts = np.linspace(0, frame.pixels, blocks + 1).astype(int)
        self._blocks = [slice(int(a), int(b)) for a, b in itertools.pairwise(cuts)]
        self._pixels = np.arange(frame.pixels)
        passes = [
            Pass("copy and commit", "build", ("points", "triangles"), ("embree",), self._commit),
            Pass("primary rays", "trace", ("embree", "camera"), ("hits",), self._primary),
        ]
        passes += shadow_ray_passes(effects, ("embree", "hits", "camera"), self._shadow)
        passes += traced_bounces(effects, ("embree", "points", "triangles"), self._bounced, self._shadow)
        return passes

    @property
    def thread_count(self) -> int:
        """The threads that trace."""
        if self.trace.threads:
            return int(self.trace.threads)
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

    def built(self) -> dict[str, Any]:
        return {
            "robust": self.build.robust,
            "threads": self.thread_count,
            "build threads": "Embree's own",
            "embreex": version("embreex"),
        }

    def _commit(self) -> None:
        """Copy the mesh and commit: the whole cost of a rebuild. embreex commits on the first query."""
        frame = self._frame
        points, faces = frame.points.numpy(), self._faces
        invalid = frame.valid.numpy() == 0
        if invalid.any():
            # Embree drops a triangle with a vertex that is not finite, and its index keeps its place.
            points = np.concatenate([points, np.full((1, 3), np.nan, dtype=np.float32)])
            faces = faces.copy()
            faces[invalid] = len(points) - 1
        self._scene = None
        scene = EmbreeScene(self._device, robust=self.build.robust)
        TriangleMesh(scene, points, faces)
        ray = np.zeros((1, 3), dtype=np.float32)
        scene.run(ray, ray, query="OCCLUDED")
        self._scene = scene

    def _each_block(self, work: Callable[[slice], None]) -> None:
        if self._pool is None:
            for block in self._blocks:
                work(block)
        else:
            list(self._pool.map(work, self._blocks))

    def _primary(self) -> None:
        frame, scene = self._frame, self._scene
        assert scene is not None
        hits = frame.hits(0)
        triangle, t, u, v = (array.numpy() for array in (hits.triangle, hits.t, hits.u, hits.v))
        eye, column, row = frame.eye.numpy(), frame.column.numpy(), frame.row.numpy()

        def work(block: slice) -> None:
            pixels = self._pixels[block]
            directions = column[pixels % frame.width] + row[pixels // frame.width]
            origins = np.broadcast_to(eye, directions.shape)
            found = scene.run(origins, directions, query="INTERSECT", output=1)
            missed = found["primID"] < 0
            triangle[block] = found["primID"]
            t[block] = found["tfar"]
            u[block] = found["u"]
            v[block] = found["v"]
            triangle[block][missed] = MISS
            t[block][missed] = np.inf
            u[block][missed] = 0.0
            v[block][missed] = 0.0

        self._each_block(work)

    def _bounced(self, bounce: int) -> None:
        frame, scene = self._frame, self._scene
        assert scene is not None
        mirrored, hits = frame.rays(bounce), frame.hits(bounce)
        origins, directions, active = (
            array.numpy() for array in (mirrored.origin, mirrored.direction, mirrored.active)
        )
        triangle, t, u, v = (array.numpy() for array in (hits.triangle, hits.t, hits.u, hits.v))

        def work(block: slice) -> None:
            triangle[block], t[block], u[block], v[block] = MISS, np.inf, 0.0, 0.0
            rays = np.nonzero(active[block])[0]
            if len(rays):
                found = scene.run(origins[block][rays], directions[block][rays], query="INTERSECT", output=1)
                met = found["primID"] >= 0
                hit = rays[met] + block.start
                triangle[hit], t[hit] = found["primID"][met], found["tfar"][met]
                u[hit], v[hit] = found["u"][met], found["v"][met]

        self._each_block(work)

    def _shadow(self, light: int, bounce: int = 0) -> None:
        frame, scene = self._frame, self._scene
        assert scene is not None
        launch_shadow_origins(frame, light, self._origins, sheared=False, bounce=bounce)
        origins, lit = self._origins.numpy(), frame.lights.numpy()[light]
        triangle: NDArray[np.int32] = frame.hits(bounce).triangle.numpy()
        visibility: NDArray[np.uint8] = frame.bits(bounce).numpy()[light]
        receivers = frame.masks(bounce).numpy()[light] if self._effects.has_receivers(light) else None

        def work(block: slice) -> None:
            # embreex reads a negative distance as "occluded" and has no mask: only pixels with a hit are sent.
            wanted = triangle[block] != MISS
            if receivers is not None:
                wanted &= receivers[block] != 0
            hit = np.nonzero(wanted)[0]
            shadowed = np.zeros(block.stop - block.start, dtype=np.uint8)
            if len(hit):
                start = origins[block][hit]
                ends = np.full(len(hit), SHADOW_END, dtype=np.float32)
                answer = scene.run(start, lit - start, dists=ends, query="OCCLUDED")
                shadowed[hit] = answer == 0
            visibility[block] = shadowed

        self._each_block(work)
