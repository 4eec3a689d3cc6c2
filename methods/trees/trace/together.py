"""Primary rays and the shadow rays of their hits in one launch: a thread goes on to the light with what it has hit.

In passes of their own all shadow rays wait for the last primary ray. Of a small mesh few warps have long ways, and most of
the time is waiting for these.
"""

import functools
from typing import Any

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.geometry import Camera, Hits, Mesh, Rays
from ..constants import EYE_REGISTERS, REGISTERS
from ..nodes import Tree
from ..records.planes import LightPlanes
from .closest import make_eye
from .shadow import make_shadow
from .undecided import Undecided


@functools.cache
def make_together_kernel(exact: bool, packets: bool, levels: int = 1) -> Any:
    """One thread per pixel, 8 x 4 per warp: :func:`.closest.make_eye`, then :func:`.shadow.make_shadow`. The undecided
    triangles of both have lists of their own."""
    trace_eye, trace_shadow = make_eye(exact, packets, levels), make_shadow(exact, True, levels)

    @wp.kernel(
        enable_backward=False,
        grid_stride=False,
        module="unique",
        cuda_max_registers=EYE_REGISTERS if exact else REGISTERS,
    )
    def together_kernel(
        camera: Camera,
        tiles: wp.array(dtype=wp.int32),
        tree: Tree,
        records: wp.array(dtype=wp.vec4f),
        mesh: Mesh,
        alpha: Alpha,
        undecided: Undecided,
        light: wp.int32,
        faces: wp.bool,
        lights: wp.array(dtype=wp.vec3f),
        spots: wp.array2d(dtype=wp.float64),
        front_facing: wp.array2d(dtype=wp.uint8),
        planes: LightPlanes,
        rays: Rays,
        undecided_shadows: Undecided,
        hits: Hits,
        starts: wp.array(dtype=wp.vec3f),
        receivers: wp.array2d(dtype=wp.uint8),
        shadowed: wp.array2d(dtype=wp.uint8),
    ):
        found = trace_eye(wp.tid(), camera, tiles, tree, records, mesh, alpha, undecided, hits, starts)
        if found[0] < 0:
            return
        trace_shadow(
            found[0], found[1], camera, light, faces, lights, spots, front_facing, tree, planes, mesh, alpha, rays, starts,
            undecided_shadows, receivers, shadowed,
        )  # fmt: skip

    return together_kernel
