"""Work of the threads that put triangles into tiles: every tile of every box is somebody's, and nobody else's."""

import numpy as np
import pytest
import warp as wp
from shadowbench.harness.frame.geometry import filled
from shadowbench.methods.perspective_spherical.lists.binning import (
    ENOUGH,
    INLINE_TILES,
    LANES,
    THREAD_TILES,
    Bins,
    PieceQueue,
    piece_of,
    queue_large,
)


@wp.kernel(enable_backward=False)
def queue_kernel(bins: Bins):
    i = wp.tid()
    if bins.boxes[i][2] >= bins.boxes[i][0]:
        queue_large(i, bins.boxes[i], bins.queue)


@wp.kernel(enable_backward=False)
def visit_kernel(bins: Bins, visits: wp.array3d(dtype=wp.int32), most: wp.array(dtype=wp.int32)):
    p = piece_of(wp.tid(), bins)
    if p.item < 0:
        return
    number = wp.int32(0)
    for at in range(p.first, p.stop, p.step):
        wp.atomic_add(visits, p.item, p.y + at // p.w, p.x + at % p.w, 1)
        number += 1
    wp.atomic_max(most, 0, number)


@pytest.mark.parametrize("lanes", [1, LANES])
def test_every_tile_of_every_box_is_one_threads_work(lanes):
    side = 300
    shapes = [(1, 1), (4, 4), (16, 1), (17, 1), (1, 17), (5, 4), (33, 7), (1, side), (128, 128), (side, side), (0, 0)]
    random = np.random.default_rng(lanes)
    boxes = []
    for w, h in shapes:
        x, y = random.integers(0, side - w + 1), random.integers(0, side - h + 1)
        boxes.append((x, y, x + w - 1, y + h - 1))
    boxes = wp.array(np.array(boxes), dtype=wp.vec4i, device="cpu")
    needs = wp.zeros(1, dtype=wp.int64, device="cpu")
    room = 5000
    pieces = wp.zeros(room, dtype=wp.vec2i, device="cpu")
    bins = filled(Bins, boxes=boxes, queue=filled(PieceQueue, lanes=lanes, slot=0, needs=needs, pieces=pieces))
    wp.launch(queue_kernel, dim=len(shapes), inputs=[bins], device="cpu")
    queued = int(needs.numpy()[0])
    assert 0 < queued <= room
    visits = wp.zeros((len(shapes), side, side), dtype=wp.int32, device="cpu")
    most = wp.zeros(1, dtype=wp.int32, device="cpu")
    threads = len(shapes) + room * lanes
    wp.launch(visit_kernel, dim=threads, inputs=[bins, visits, most], device="cpu")
    for seen, (x0, y0, x1, y1) in zip(visits.numpy(), boxes.numpy(), strict=True):
        expected = np.zeros((side, side), dtype=int)
        expected[y0 : y1 + 1, x0 : x1 + 1] = 1
        assert (seen == expected).all()
    assert int(INLINE_TILES) <= most.numpy()[0] <= int(THREAD_TILES)
    if lanes > 1:
        assert queued <= sum(1 + w * h // lanes for w, h in shapes)
        assert queued <= len(shapes) * (int(ENOUGH) // lanes + 1)
