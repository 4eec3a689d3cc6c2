"""The last frame's occluder of each ray, tested again before the ray is placed in the light's grid.

What shadows a ray mostly shadows the ray of the same pixel in the next frame, too. The triangle is tested in this frame's
positions, by planes in float32 as the stream tests it. If it certainly occludes the ray, the bit is set and the ray gets
no place in the grid; every other ray goes the usual way. So no answer depends on what is remembered, whatever that is:
an index of no triangle is passed over.
"""

from dataclasses import replace

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects, specialised
from ....harness.frame.geometry import Mesh
from ....harness.frame.schedule.passes import Pass
from ...common.pixels import thread_count, tile_pixel
from ...common.reads import corners_at
from ...exact.triangle import largest, to_float32
from ...gpu.entries import entry, set_entry
from ..camera.pixels import largest_of
from ..cube.lights import Light
from ..queues import BLOCK_DIM, WORDS
from ..rays.hit_points import PrimaryHits, point_of
from ..rays.placing import LightRays
from .planes import certain, occluder_of, sign_bound


@wp.func
def certainly_occludes(i: wp.int32, own: wp.int32, h: wp.vec3f, eye: wp.vec3f, light: wp.vec3f, mesh: Mesh) -> wp.bool:
    """Whether triangle i of the mesh (any number) certainly occludes the ray of a pixel that hit triangle ``own`` at h.

    The bound covers this one hit point, which the camera's words give (:mod:`..rays.hit_points`). With the eye in it,
    it exceeds the error of the float64 hit point, in which float64 would find the triangle's plane
    (:func:`...exact.hit_point.hit_error`).
    """
    if i < 0 or i >= mesh.triangles.shape[0] or i == own:
        return False
    if entry(mesh.valid, i) == wp.uint8(0):
        return False
    corners = corners_at(mesh, i)
    bound = sign_bound(wp.max(largest_of(corners), wp.max(largest(h), largest(eye))))
    planes = occluder_of(i, bound, bound, light, corners, False)
    misses, hits = certain(wp.vec4f(h[0], h[1], h[2], 0.0), planes)
    return hits and not misses


@wp.kernel(enable_backward=False, grid_stride=False)
def settle_kernel(
    light: Light,
    hits: PrimaryHits,
    alpha: Alpha,
    receivers: wp.array2d(dtype=wp.uint8),
    last: wp.array(dtype=wp.int32),
    sought: wp.array2d(dtype=wp.uint8),
    shadowed: wp.array2d(dtype=wp.uint8),
):
    """Bits of the rays that their remembered occluder settles, 0 for others. An occluder that fails is forgotten.

    sought: uint8 [lights, pixels]: 1 = the pixel has a ray, to be placed in the grid. A pass of its own: in the pass that
    maps rays, the registers of this test would halve the number of threads.
    """
    camera = hits.camera
    at = tile_pixel(wp.tid(), camera.width, camera.height)
    if at[0] < 0:
        return
    pixel = at[1] * camera.width + at[0]
    point = point_of(hits, pixel, at)
    remembered = entry(last, pixel)
    wanted = point.triangle >= 0
    if wp.static(effects.receivers):
        wanted = receivers[light.index, pixel] != wp.uint8(0)
    bit = wp.uint8(0)
    if wanted and remembered != 0:
        i = remembered - 1
        unsure = point.exact_path
        if wp.static(effects.alpha):
            unsure = unsure or (i >= 0 and i < alpha.masked.shape[0] and alpha.masked[i] != wp.uint8(0))
        h = to_float32(point.hit)
        if not unsure and certainly_occludes(
            i, point.triangle, h, camera.eye[0], light.position[light.index], hits.mesh
        ):
            bit = wp.uint8(1)
            wanted = False
        else:
            set_entry(last, pixel, 0)
    shadowed[light.index, pixel] = bit
    sought[light.index, pixel] = wp.uint8(wanted)


class LastOccluder:
    """The test of the last frame's occluders, of one light.

    last  int32 [pixels]: 1 + the occluder, or 0; kept from frame to frame. Rays that it leaves are ``rays.sought``: uint8
    [lights, pixels]. The harness marks the receivers.
    """

    def __init__(self, rays: LightRays, last: wp.array):
        self.rays, self.last = rays, last

    def settled(self) -> int:
        """Rays of the last frame that their remembered occluder still shadowed."""
        r = self.rays
        bits, sought = (array[r.index].numpy() for array in (r.frame.answers.shadowed, r.receivers))
        return int(((bits == 1) & (sought == 0)).sum())

    def settling(self) -> Pass:
        """The pass before the rays are placed."""
        r = self.rays
        memory, of_receivers = r.name("occluders"), r.effects.receiver_reads(r.index)
        reads = ("points", "triangles", "camera", WORDS, f"light/{r.index}", memory, *r.effects.surface_reads())
        writes = (memory, r.name("rays sought"), r.name("shadowed"))
        name = f"{r.who}: last occluders"
        return Pass(name, "shadow", (*reads, *of_receivers), writes, self.launch_settle, r.effect)

    def noting(self, work: Pass) -> Pass:
        """A pass that tests triangles: it notes the occluders."""
        return replace(work, writes=(*work.writes, self.rays.name("occluders")))

    def launch_settle(self) -> None:
        r, f = self.rays, self.rays.frame
        inputs = [r.light, r.hits, f.alpha, f.receivers]
        outputs = [self.last, r.receivers, f.answers.shadowed]
        kernel = specialised(settle_kernel, r.effects.switches(r.index))
        f.launch(kernel, thread_count(f.width, f.height), inputs, outputs, BLOCK_DIM)
