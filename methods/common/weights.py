"""Weights of the primary hits, apart from the hits: nothing that is traced waits for them."""

from __future__ import annotations

import warp as wp

from ...harness.frame.frame import Frame
from ...harness.frame.geometry import Camera, Corners, Hits, Mesh, Ray
from ...harness.frame.passes import Pass
from .entries import entry, set_entry
from .pixels import Part, pixel_at
from .triangle import hit_weights

BLOCK = 128


@wp.kernel(enable_backward=False, grid_stride=False)
def weights_kernel(camera: Camera, part: Part, mesh: Mesh, hits: Hits):
    """One thread a pixel of a share, 8 x 4 a warp: u and v of the triangle that is known to be hit; 0 at a miss."""
    at = pixel_at(camera, part, wp.tid())
    if at[0] < 0:
        return
    pixel = at[1] * camera.width + at[0]
    best = entry(hits.triangle, pixel)
    uv = wp.vec2f()
    if best >= 0:
        face = entry(mesh.triangles, best)
        weld = wp.vec3i(entry(mesh.weld, face[0]), entry(mesh.weld, face[1]), entry(mesh.weld, face[2]))
        corners = Corners(
            entry(mesh.points, face[0]), entry(mesh.points, face[1]), entry(mesh.points, face[2])
        )
        ray = Ray(entry(camera.eye, 0), entry(camera.column, at[0]) + entry(camera.row, at[1]))
        uv = hit_weights(ray, corners, weld)
    set_entry(hits.u, pixel, uv[0])
    set_entry(hits.v, pixel, uv[1])


def weights_pass(frame: Frame, name: str, part: Part, threads: int, hits: str) -> Pass:
    """The pass of a share, beside what reads ``hits``, the resource of its pixels' triangles."""

    def launch() -> None:
        wp.launch(
            weights_kernel,
            dim=threads,
            inputs=[frame.camera, part, frame.mesh],
            outputs=[frame.hits(0)],
            device=frame.device,
            block_dim=BLOCK,
        )

    return Pass(name, "trace", ("points", "triangles", "camera", hits), ("hits",), launch, adds=True)
