"""Primary rays on a CPU: a thread takes eight triangles, and tests all their pixels."""

from __future__ import annotations

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.geometry import Camera, Mesh
from ...common.reads import corners_at, direction_at
from ...common.screen import screen_scale
from ...gpu.bits import lowest_bit, without_lowest_bit
from ...gpu.entries import entry, entry_now
from ..eight import EIGHT, Window, boxes_of_eight, pixels_found
from ..queues import Queue, Share, queue_undecided, triangle_of
from .pixels import Candidate, candidate_of, store_if_nearer
from .stream import Lines, box_of, lines_of, pixels_of_row


@wp.func
def window_of(camera: Camera) -> Window:
    """The image, in pixels, with the slack of :func:`...common.screen.pixel_box`."""
    right = entry(camera.axes, 0)
    up = entry(camera.axes, 1)
    ahead = entry(camera.axes, 2)
    tx = camera.tangents[0]
    ty = camera.tangents[1]
    s = screen_scale(tx, ty, camera.width, camera.height)
    w = Window()
    for k in range(3):
        w.axes[0, k] = ahead[k]
        w.axes[1, k] = right[k]
        w.axes[2, k] = -up[k]
    w.origin = entry(camera.eye, 0)
    w.per = wp.vec2f(s[0], s[1])
    w.low = wp.vec2f(-s[2] / s[0], -s[3] / s[1])
    off = wp.max((1.0 + tx) * s[0], (1.0 + ty) * s[1])
    w.slack = 0.01 + 4.0e-6 * off + 1.0e-6 * wp.float32(wp.max(camera.width, camera.height))
    return w


@wp.func
def test_pixels_of_row(
    nearest: wp.array(dtype=wp.uint64), queue: Queue, camera: Camera, y: wp.int32, ends: wp.vec2i, candidate: Candidate
):
    """Test pixels ends[0]..ends[1] of a row, eight at a time."""
    x = wp.int32(ends[0])
    while x <= ends[1]:
        found = pixels_found(camera, x, y, ends[1] - x + 1, candidate)
        while found != wp.uint32(0):
            k = lowest_bit(found)
            found = without_lowest_bit(found)
            at = x + (k & 7)
            pixel = y * camera.width + at
            if k < EIGHT:
                store_if_nearer(nearest, pixel, entry_now(nearest, pixel), candidate, direction_at(camera, at, y))
            else:
                queue_undecided(queue, candidate.i, pixel)
        x += EIGHT


@wp.kernel(enable_backward=False, grid_stride=False)
def stream_kernel(
    share: Share,
    inline_pixels: wp.int32,
    camera: Camera,
    mesh: Mesh,
    alpha: Alpha,
    nearest: wp.array(dtype=wp.uint64),
    exact_path: wp.array(dtype=wp.uint8),
    queue: Queue,
):
    """Of a triangle with a box of more than ``inline_pixels`` the rows are cut to it."""
    first = triangle_of(EIGHT * wp.tid(), share)
    if first >= share.triangles:
        return
    width = wp.float32(camera.width)
    height = wp.float32(camera.height)
    boxes = boxes_of_eight(mesh, first, 0.0, window_of(camera))
    i = wp.int32(first)
    while i < wp.min(first + EIGHT, share.triangles):
        k = i - first
        x0 = wp.ceil(wp.max(boxes[0, k], 0.0))
        y0 = wp.ceil(wp.max(boxes[1, k], 0.0))
        x1 = wp.floor(wp.min(boxes[2, k], width - 1.0))
        y1 = wp.floor(wp.min(boxes[3, k], height - 1.0))
        if x0 <= x1 and y0 <= y1 and entry(mesh.valid, i) != wp.uint8(0):
            o = entry(camera.eye, 0)
            corners = corners_at(mesh, i)
            box = wp.vec4i(wp.int32(x0), wp.int32(y0), wp.int32(x1), wp.int32(y1))
            if boxes[0, k] == -wp.INF:
                box = box_of(corners, o, camera)
            if box[0] <= box[2] and box[1] <= box[3]:
                candidate = candidate_of(i, o, corners, camera, alpha, share.triangles, exact_path)
                large = (box[2] - box[0] + 1) * (box[3] - box[1] + 1) > inline_pixels
                lines = Lines()
                if large:
                    start = entry(camera.column, 0)
                    end = entry(camera.column, camera.width - 1)
                    lines = lines_of(candidate.planes, candidate.bound, start, end, camera.width)
                y = wp.int32(box[1])
                while y <= box[3]:
                    ends = wp.vec2i(box[0], box[2])
                    if large:
                        d = entry(camera.row, y)
                        ends = pixels_of_row(candidate.planes, candidate.bound, lines, d, box[0], box[2], camera.width)
                    test_pixels_of_row(nearest, queue, camera, y, ends, candidate)
                    y += 1
        i += 1
