"""How many triangles each primary ray is tested against. Counted apart: the kernels of a frame do not count."""

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ....harness.frame.effects.specialise import specialised
from ....harness.frame.geometry import Camera as CameraArrays
from ....harness.frame.geometry import Mesh
from ...common.reads import corners_at
from ...gpu.entries import entry
from .passes import Camera
from .pixels import edge_planes, sign_bound
from .stream import TALL, box_of, lines_of, pixels_of_row


@wp.kernel(enable_backward=False, grid_stride=False)
def tests_kernel(
    inline_pixels: wp.int32, queued: wp.bool, camera: CameraArrays, mesh: Mesh, tests: wp.array(dtype=wp.int32)
):
    """One thread per triangle: one more test for each pixel that :mod:`.stream` and :mod:`.rows` test it against."""
    i = wp.tid()
    o = entry(camera.eye, 0)
    corners = corners_at(mesh, i)
    box = box_of(corners, o, camera)
    if entry(mesh.valid, i) == wp.uint8(0) or box[2] < box[0] or box[3] < box[1]:
        return
    inline = (box[2] - box[0] + 1) * (box[3] - box[1] + 1) <= inline_pixels
    tall = not inline and queued and box[3] - box[1] >= TALL * (box[2] - box[0] + 1)
    first = wp.where(tall, box[0], box[1])
    last = wp.where(tall, box[2], box[3])
    ends = wp.vec2i(wp.where(tall, box[1], box[0]), wp.where(tall, box[3], box[2]))
    extent = wp.where(tall, camera.height, camera.width)
    planes = edge_planes(o, corners)
    bound = sign_bound(camera.tangents)
    lines = lines_of(planes, bound, camera.column[0], camera.column[camera.width - 1], extent)
    if tall:
        lines = lines_of(planes, bound, camera.row[0], camera.row[camera.height - 1], extent)
    for line in range(first, last + 1):
        tested = ends
        if not inline:
            d = camera.row[line]
            if tall:
                d = camera.column[line]
            tested = pixels_of_row(planes, bound, lines, d, ends[0], ends[1], extent)
        for along in range(tested[0], tested[1] + 1):
            pixel = wp.where(tall, along * camera.width + line, line * camera.width + along)
            wp.atomic_add(tests, pixel, 1)


def tests_per_pixel(camera: Camera) -> NDArray[np.int32]:
    """The tests of each primary ray of the last frame, of a camera with the stream's own steps."""
    f = camera.frame
    tests = wp.zeros(f.pixels, dtype=wp.int32, device=f.device)
    wp.launch(
        specialised(tests_kernel, camera.effects.switches()),
        dim=f.triangle_count,
        inputs=[camera.settings.inline_pixels, camera.queues.queued, f.camera, f.mesh, tests],
        device=f.device,
    )
    return tests.numpy()
