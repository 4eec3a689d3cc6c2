"""The last frame's occluder of each ray, tested again before the ray is placed in the light's grid.

What shadows a ray mostly shadows the ray of the same pixel in the next frame, too. The triangle is tested in this frame's
positions, by planes in float32 as the stream tests it. If it certainly occludes the ray, the bit is set and the ray gets
no place in the grid; every other ray goes the usual way. So no answer depends on what is remembered, whatever that is:
an index of no triangle is passed over.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects, specialised, with_type
from ....harness.frame.frame import Frame
from ....harness.frame.geometry import Camera, Mesh, filled
from ....harness.frame.schedule.passes import Hints, Pass
from ...common.pixels import thread_count, tile_pixel
from ...exact.triangle import largest, to_float32
from ...gpu.entries import entry, set_entry
from ..light import LightStream
from ..queues import BLOCK_DIM, WORDS
from ..rays.hit_points import Words, point_of
from ..reads import corners_at
from .planes import YES, Occluder, RememberedBits, float32_verdict, set_planes, sign_bound


@wp.func
def has_holes(alpha: Alpha, i: wp.int32) -> wp.bool:
    """Whether triangle i (any number) has holes."""
    return i >= 0 and i < alpha.masked.shape[0] and alpha.masked[i] != wp.uint8(0)


@wp.func
def certainly_occludes(
    i: wp.int32, own: wp.int32, h: wp.vec3f, eye: wp.vec3f, light: wp.vec3f, mesh: Mesh
) -> wp.bool:
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
    size = wp.max(largest(corners.a), wp.max(largest(corners.b), largest(corners.c)))
    occluder = Occluder()
    occluder.i = i
    occluder.bound = sign_bound(wp.max(size, wp.max(largest(h), largest(eye))))
    occluder.sure = occluder.bound
    return (
        float32_verdict(wp.vec4f(h[0], h[1], h[2], 0.0), set_planes(occluder, light, corners, False)) == YES
    )


@wp.kernel(enable_backward=False, grid_stride=False)
def settle_kernel(
    light: wp.int32,
    camera: Camera,
    lights: wp.array(dtype=wp.vec3f),
    mesh: Mesh,
    alpha: Alpha,
    rays: Words,
    receivers: wp.array2d(dtype=wp.uint8),
    last: wp.array(dtype=wp.int32),
    sought: wp.array2d(dtype=wp.uint8),
    shadowed: wp.array2d(dtype=wp.uint8),
):
    """Bits of the rays that their remembered occluder settles, 0 for others. An occluder that fails is forgotten.

    sought: uint8 [lights, pixels]: 1 = the pixel has a ray, to be placed in the grid. A pass of its own: in the pass that
    maps rays, the registers of this test would halve the number of threads.
    """
    at = tile_pixel(wp.tid(), camera.width, camera.height)
    if at[0] < 0:
        return
    pixel = at[1] * camera.width + at[0]
    point = point_of(rays, pixel, at, camera, mesh)
    remembered = entry(last, pixel)
    wanted = point.triangle >= 0
    if wp.static(effects.receivers):
        wanted = receivers[light, pixel] != wp.uint8(0)
    bit = wp.uint8(0)
    if wanted and remembered != 0:
        i = remembered - 1
        unsure = point.exact_path
        if wp.static(effects.alpha):
            unsure = unsure or has_holes(alpha, i)
        h = to_float32(point.hit)
        if not unsure and certainly_occludes(i, point.triangle, h, camera.eye[0], lights[light], mesh):
            bit = wp.uint8(1)
            wanted = False
        else:
            set_entry(last, pixel, 0)
    shadowed[light, pixel] = bit
    sought[light, pixel] = wp.uint8(wanted)


def occluder_arrays(frame: Frame) -> dict[str, wp.array]:
    """The arrays that the lights of a frame share: see :class:`RememberingLight`. No occluder is known yet."""
    shape = (frame.light_count, frame.pixels)
    with wp.ScopedDevice(frame.device):
        return {"sought": wp.zeros(shape, dtype=wp.uint8), "last": wp.zeros(shape, dtype=wp.int32)}


class RememberingLight(LightStream):
    """Shadow rays of one light that tests the last frame's occluders first.

    sought uint8 [lights, pixels]: rays that are placed in the grid; last int32 [lights, pixels]: 1 + the occluder, or 0.
    Both belong to all lights; the second is kept from frame to frame. The harness marks the receivers.
    """

    marks = False

    def __init__(self, frame: Frame, index: int, *given: Any, sought: wp.array, last: wp.array):
        super().__init__(frame, index, *given)
        self.sought, self.last = sought, last[index]
        self.given = self.switches
        self.receivers = sought
        self.switches = replace(self.switches, receivers=True)
        self.bits = filled(
            RememberedBits,
            light=index,
            triangle=self.bits.triangle,
            shadowed=self.bits.shadowed,
            last=self.last,
        )

    def settled(self) -> int:
        """Rays of the last frame that their remembered occluder still shadowed."""
        bits = self.frame.answers.shadowed[self.index].numpy()
        return int(((bits == 1) & (self.sought[self.index].numpy() == 0)).sum())

    def variant(self, kernel: wp.Kernel) -> wp.Kernel:
        return with_type(kernel, "bits", RememberedBits)

    def receiver_reads(self) -> tuple[str, ...]:
        return (f"rays sought/{self.index}",)

    def passes(self, branch: int = 0) -> list[Pass]:
        """The light's passes: the rays' places follow from the occluders, which the stream's steps write."""
        i, made = self.index, super().passes(branch)
        memory, bits, effect = f"occluders/{i}", f"shadowed/{i}", f"shadows/{i}"
        reads = ("points", "triangles", "camera", WORDS, f"light/{i}", memory, *self.effects.surface_reads())
        settle = Pass(
            f"light {i}: last occluders",
            "shadow",
            (*reads, *self.effects.receiver_reads(i)),
            (memory, *self.receiver_reads(), bits),
            self.launch_settle,
            effect,
            hints=Hints(parallel=(branch,)),
        )
        made = [replace(w, writes=(*w.writes, memory)) if bits in w.reads else w for w in made]
        place = next(k for k, work in enumerate(made) if not work.hints.early)
        return [*made[:place], settle, *made[place:]]

    def launch_settle(self) -> None:
        f = self.frame
        wp.launch(
            specialised(settle_kernel, self.given),
            dim=thread_count(f.width, f.height, True),
            inputs=[self.index, f.camera, f.lights, f.mesh, f.alpha, self.rays, f.receivers],
            outputs=[self.last, self.sought, f.answers.shadowed],
            device=f.device,
            block_dim=BLOCK_DIM,
        )
