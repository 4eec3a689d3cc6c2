"""Warp's bounding volume hierarchies, the peer that most users of Warp would try first: wp.Mesh, and wp.Bvh rebuilt in
place.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import warp as wp

from ...harness.errors import UserError
from ...harness.frame.effects.specialise import specialised
from ...harness.frame.frame import Frame
from ...harness.frame.method import BaseMethod
from ...harness.frame.schedule.passes import Pass
from ...harness.frame.schedule.threads import check_threads
from ...harness.scene.effects import Effects, Limits
from ..common.bands import Band, Bands
from ..common.box_tree import QUERY_BLOCK, Boxes, BoxTree, walk
from ..common.misses import miss_passes, write_misses
from ..common.parameters import check_choices, refuse_static
from ..rays.kernels import make_primary_kernel, make_shadow_kernel
from ..rays.launches import PixelRays, ray_passes
from ..rays.mesh_triangles import TreeTriangles, may_be_hit
from ..rays.offset import launch_shadow_origins
from .mesh_kernels import make_mesh_shadow_kernel, mesh_primary_kernel
from .quality import expected

UPDATES = ("rebuild", "refit", "static", "bvh_rebuild")
CONSTRUCTORS = ("default", "sah", "median", "lbvh", "cubql")
MESH_INEXACT = (
    "float32 with boxes that are not padded: rays through vertices and edges may escape, and shadow rays start "
)
STARTS = {
    "exact": "a rounding bound away from the surface",
    "plain": "off the surface by Waechter and Binder's rule, which is no bound: some shadow bits are wrong",
    "plain_cut": "after a millionth of the way to the light, which is no bound: some shadow bits are wrong",
}


@dataclass(frozen=True)
class Build:
    """How the tree is built and updated.

    update       "rebuild": a new wp.Mesh in each frame, as in Table 1 (it allocates, so it cannot be captured in a CUDA
                 graph); "refit": the tree of the animation's first frame, its boxes refitted in each frame; "static": built
                 once, for geometry that does not move; "bvh_rebuild": a wp.Bvh over padded boxes, rebuilt in place in each
                 frame and queried with this project's triangle tests: exact, and it can be captured
    constructor  how Warp builds the tree: "default" (LBVH on CUDA, SAH on the CPU), "sah", "median", "lbvh", "cubql". Warp
                 replaces what a device does not support (LBVH on the CPU by SAH); the record holds what was built
    leaf_size    triangles per leaf; 0: Warp's default for the constructor
    """

    update: str = "rebuild"
    constructor: str = "default"
    leaf_size: int = 0

    def __post_init__(self) -> None:
        check_choices(self, update=UPDATES, constructor=CONSTRUCTORS)
        if self.leaf_size < 0:
            raise ValueError("leaf_size must be 0 (Warp's default) or more")
        if self.update == "bvh_rebuild" and self.constructor == "cubql":
            raise ValueError("cubql cannot be rebuilt in place; choose update=rebuild")


@dataclass(frozen=True)
class Trace:
    """How rays are traced.

    origin   where shadow rays start. "exact": at the exact hit point, with update=bvh_rebuild, or off the surface by a bound
             of the query's rounding, computed in float64; "plain": float32 throughout, as users of Warp write it, off the
             surface by the rule of Waechter and Binder (Ray Tracing Gems, chapter 6); "plain_cut": after 1e-6 of the way to
             the light. The plain ones are for queries of wp.Mesh, are not exact, and stand in ratios as Warp's peer
    threads  of a CPU: each traces a band of the image; 0: one for each core that this process may use, at most 16
    """

    origin: str = "exact"
    threads: int = 0

    def __post_init__(self) -> None:
        check_threads(self.threads)
        check_choices(self, origin=STARTS)


class WarpBvh(BaseMethod):
    """See the module. The variants that query a wp.Mesh inherit its float32 answers; ``bvh_rebuild`` is exact."""

    name = "warp_bvh"
    title = "BVH (Warp)"
    formerly = ("bvh",)
    simulates = frozenset({"shadows", "receivers", "directional", "mirror", "orthographic"})
    cannot = MappingProxyType(
        {"alpha": "a query of wp.Mesh cannot skip a hit; choose --set warp_bvh.update=bvh_rebuild"}
    )
    Build = Build
    Trace = Trace

    def __init__(self, build: Build | None = None, trace: Trace | None = None):
        super().__init__(build, trace)
        if self.build.update == "bvh_rebuild":
            if self.trace.origin != "exact":
                raise UserError(
                    f"warp_bvh.origin={self.trace.origin} is for queries of wp.Mesh: choose update=rebuild, refit or static"
                )
            self.simulates = self.simulates | {"alpha"}
        self.capturable = self.build.update != "rebuild"
        self.known_inexact = None if self.build.update == "bvh_rebuild" else MESH_INEXACT + STARTS[self.trace.origin]
        self._device = ""
        self._mesh = self._triangles = self._valid = self._tree = self._rays = self._bands = None  # type: Any

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        self._device = frame.device
        if frame.triangle_count == 0:
            return miss_passes(frame, effects)
        if self.build.update == "bvh_rebuild":
            self._tree = tree = BoxTree(frame, self._constructor, self.build.leaf_size or 1)
            kernels = make_primary_kernel(Boxes, walk), make_shadow_kernel(Boxes, walk)
            threads = self.trace.threads
            self._rays = rays = PixelRays(frame, effects, tree.boxes(), *kernels, threads=threads, block=QUERY_BLOCK)
            self._bands = rays.bands
            return [*tree.passes(), *rays.passes(("bvh",))]
        self._frame, self._effects = frame, effects
        self._bands = Bands(frame, self.trace.threads)
        self._mesh = self._triangles = self._valid = None
        exact = self.trace.origin == "exact"
        self._origins = wp.zeros(frame.pixels if exact else 0, dtype=wp.vec3f, device=frame.device)
        passes = ray_passes(effects, "mesh", self._primary, self._shadow)
        if self.build.update == "rebuild":
            return [Pass("new mesh", "build", ("points", "triangles"), ("mesh",), self._rebuild), *passes]
        self._first_mesh()
        if self.build.update == "refit":
            return [Pass("refit", "build", ("points", "triangles"), ("mesh",), self._refit), *passes]
        return passes

    @property
    def _constructor(self) -> str:
        """What Warp builds when it is asked for ``build.constructor`` on the device of the plan."""
        cpu = self._device.startswith("cpu")
        if self.build.constructor == "default":
            return "sah" if cpu else "lbvh"
        if cpu and self.build.constructor == "lbvh":
            return "sah"
        if not cpu and self.build.update == "bvh_rebuild":
            return "lbvh"
        return self.build.constructor

    def built(self) -> dict[str, Any]:
        what = {"update": self.build.update, "leaf_size": self.build.leaf_size or "default"}
        if self._device:
            what["constructor"] = self._constructor
        return what | (self._bands.built() if self._bands is not None else {})

    def counters(self) -> dict[str, int]:
        """Tests of the exact variant, which a wp.Mesh does not count; and how good the tree is."""
        if self._tree is not None:
            return {**self._rays.counters(), **expected(self._tree.bvh)}
        return {} if self._mesh is None else expected(self._mesh)

    def _make_mesh(self, points: wp.array, indices: wp.array) -> wp.Mesh:
        return wp.Mesh(points, indices, bvh_constructor=self._constructor, bvh_leaf_size=self.build.leaf_size or None)

    def _first_mesh(self) -> None:
        """The tree of the animation's first frame. A tree built while all points are still zero would stay
        inefficient.
        """
        frame = self._frame
        prepared = frame.prepared
        refuse_static(self.name, self.build.update, prepared)
        self._triangles = triangles = TreeTriangles(frame, may_be_hit(prepared))
        if triangles.count == 0:
            return
        self._mesh = self._make_mesh(triangles.at_first_frame(), triangles.indices)
        if self.build.update == "refit":
            self._mesh.points = frame.points

    def _rebuild(self) -> None:
        frame = self._frame
        assert frame.host is not None
        valid = frame.host.valid
        self._mesh = None
        if self._triangles is None or not (valid is self._valid or np.array_equal(valid, self._valid)):
            # Most animations keep their flags: which triangles the tree holds is then found in the first frame only.
            self._valid = valid
            self._triangles = TreeTriangles(frame, np.flatnonzero(valid))
        triangles = self._triangles
        if triangles.count:
            self._mesh = self._make_mesh(frame.points, triangles.indices)

    def _refit(self) -> None:
        if self._mesh is None:
            return
        if self._frame.prepared.moves:  # else the flags do not change
            self._triangles.launch_indices()
        self._mesh.refit()

    def _primary(self, bounce: int = 0) -> None:
        if self._mesh is None:
            write_misses(self._frame, bounce)
        else:
            self._bands.run(self._primary_of, bounce)

    def _primary_of(self, band: Band, bounce: int) -> None:
        frame = self._frame
        inputs = [self._mesh.id, self._triangles.names, band.camera, band.fields_of(frame.rays(bounce))]
        outputs = [band.fields_of(frame.hits(bounce))]
        kernel = specialised(mesh_primary_kernel, self._effects.switches(bounce=bounce))
        frame.launch(kernel, band.thread_count(), inputs, outputs)

    def _shadow(self, light: int, bounce: int = 0) -> None:
        if self._mesh is None:
            self._frame.bits(bounce)[light].zero_()
        else:
            self._bands.run(self._shadow_of, light, bounce)

    def _shadow_of(self, band: Band, light: int, bounce: int) -> None:
        frame, origin = self._frame, self.trace.origin
        if origin == "exact":
            part = (band.first, band.end - band.first)
            launch_shadow_origins(frame, light, self._origins, True, bounce, part)
        traced = [band.fields_of(frame.rays(bounce)), band.fields_of(frame.hits(bounce)), band.of(self._origins)]
        inputs = [light, self._mesh.id, band.camera, frame.mesh, frame.lights, *traced, band.of(frame.masks(bounce))]
        outputs = [band.of(frame.bits(bounce))]
        kernel = specialised(make_mesh_shadow_kernel(origin), self._effects.switches(light, bounce))
        frame.launch(kernel, band.thread_count(), inputs, outputs)


METHOD = WarpBvh
