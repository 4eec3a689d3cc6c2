"""Primary rays on a CPU: a thread takes a block of triangles, and tests all their pixels."""

from __future__ import annotations

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.geometry import Camera, Mesh
from ...common.reads import corners_at, direction_at
from ...common.screen import screen_scale
from ...gpu.bits import lowest_bit, without_lowest_bit
from ...gpu.entries import entry, entry_now
from ..eight import EIGHT, Window, boxes_met, boxes_of_eight, on_cpu
from ..queues import BLOCK_DIM, Queue, Share, queue_undecided, triangle_of
from .pixels import Candidate, candidate_of, store_if_nearer
from .stream import Lines, box_of, ends_of_line, lines_of


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


@wp.func_native(
    on_cpu(
        """
typedef float entries __attribute__((ext_vector_type(24), aligned(4)));
entries c = *(const entries*)(camera.column.data + x);
const wp::vec_t<3, float> &row = camera.row.data[y];
floats dx = __builtin_shufflevector(c, c, 0, 3, 6, 9, 12, 15, 18, 21) + row[0];
floats dy = __builtin_shufflevector(c, c, 1, 4, 7, 10, 13, 16, 19, 22) + row[1];
floats dz = __builtin_shufflevector(c, c, 2, 5, 8, 11, 14, 17, 20, 23) + row[2];
auto value = [&](wp::vec_t<3, float> n) { return n[0] * dx + n[1] * dy + n[2] * dz; };
floats e0 = value(of.planes.n0), e1 = value(of.planes.n1), e2 = value(of.planes.n2);
auto outside = (e0 < -of.bound) | (e1 < -of.bound) | (e2 < -of.bound);
auto inside = (e0 > of.sure) & (e1 > of.sure) & (e2 > of.sure);
return packed(inside, number) | packed(~(inside | outside), number) << 8;
"""
    )
)
def pixels_found(camera: Camera, x: wp.int32, y: wp.int32, number: wp.int32, of: Candidate) -> wp.uint32:
    """Of the pixels from (x, y) on along a row, ``number`` or at most eight: a bit for each certain hit, and eight places
    higher one for each undecided pixel (:func:`.pixels.test_pixel`).
    """


@wp.func
def test_triangle(
    candidate: Candidate,
    box: wp.vec4i,
    large: wp.bool,
    camera: Camera,
    nearest: wp.array(dtype=wp.uint64),
    queue: Queue,
):
    """Test the pixels in a box against a triangle; of a ``large`` one those of its rows that are cut to it."""
    lines = Lines()
    if large:
        lines = lines_of(candidate.planes, candidate.bound, False, camera)
    y = wp.int32(box[1])
    while y <= box[3]:
        ends = wp.vec2i(box[0], box[2])
        if large:
            ends = ends_of_line(lines, y, box[0], box[2], camera)
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
        y += 1


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
    """A triangle with more than ``inline_pixels`` in its box is large."""
    first = triangle_of(BLOCK_DIM * wp.tid(), share)
    end = wp.min(first + BLOCK_DIM, share.triangles)
    o = entry(camera.eye, 0)
    window = window_of(camera)
    size = wp.vec2f(wp.float32(camera.width - 1), wp.float32(camera.height - 1))
    while first < end:
        boxes = boxes_of_eight(mesh, first, 0.0, window)
        met = boxes_met(boxes, size, True, end - first)
        while met != wp.uint32(0):
            k = lowest_bit(met)
            met = without_lowest_bit(met)
            i = first + k
            if entry(mesh.valid, i) != wp.uint8(0):
                corners = corners_at(mesh, i)
                box = wp.vec4i(
                    wp.int32(wp.ceil(wp.max(boxes[0, k], 0.0))),
                    wp.int32(wp.ceil(wp.max(boxes[1, k], 0.0))),
                    wp.int32(wp.floor(wp.min(boxes[2, k], size[0]))),
                    wp.int32(wp.floor(wp.min(boxes[3, k], size[1]))),
                )
                if boxes[0, k] == -wp.INF:
                    box = box_of(corners, o, camera)
                if box[0] <= box[2] and box[1] <= box[3]:
                    candidate = candidate_of(i, o, corners, camera, alpha, share.triangles, exact_path)
                    large = (box[2] - box[0] + 1) * (box[3] - box[1] + 1) > inline_pixels
                    test_triangle(candidate, box, large, camera, nearest, queue)
        first += EIGHT
