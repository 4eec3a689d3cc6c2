"""Boxes of pixels (``screen.py``), and their rows and columns cut to a triangle: no pixel that it may cover is cut
off, and groups hold all.
"""

import numpy as np
import pytest
import warp as wp
from helpers.small_scenes import make_scene, soup
from shadowbench.harness.frame.frame import Frame
from shadowbench.harness.frame.geometry import Camera, Mesh, filled
from shadowbench.methods.common.reads import corners_at, direction_at
from shadowbench.methods.streams.camera.pixels import Candidate, edge_planes, least_edge, sign_bound
from shadowbench.methods.streams.camera.stream import box_of, ends_of_line, lines_of, queue_rows
from shadowbench.methods.streams.queues import COUNTERS, ITEMS, Queue

WIDTH, HEIGHT = 61, 83
"""Neither is a multiple of a group of 32 lines."""


@wp.kernel(enable_backward=False)
def ends_kernel(
    camera: Camera,
    mesh: Mesh,
    boxes: wp.array(dtype=wp.vec4i),
    ends: wp.array3d(dtype=wp.vec2i),
    may_cover: wp.array3d(dtype=wp.uint8),
    queue: Queue,
):
    """Of triangle i: its box, the ends of every row and of every column, which pixels it may cover (1) or covers (2), and
    its groups.
    """
    i = wp.tid()
    o = camera.eye[0]
    corners = corners_at(mesh, i)
    candidate = Candidate()
    candidate.i = i
    candidate.planes = edge_planes(o, corners)
    candidate.bound = sign_bound(camera.tangents)
    box = box_of(corners, o, camera)
    boxes[i] = box
    rows = lines_of(candidate.planes, candidate.bound, False, camera)
    columns = lines_of(candidate.planes, candidate.bound, True, camera)
    for y in range(camera.height):
        ends[0, i, y] = ends_of_line(rows, y, box[0], box[2], camera)
        for x in range(camera.width):
            ends[1, i, x] = ends_of_line(columns, x, box[1], box[3], camera)
            least = least_edge(candidate.planes, direction_at(camera, x, y))
            may_cover[i, y, x] = wp.uint8(not (least < -candidate.bound)) + wp.uint8(least > candidate.bound)
    if box[2] >= box[0] and box[3] >= box[1]:
        queue_rows(queue, box, candidate, camera)


@pytest.mark.parametrize("size", [0.05, 1.0, 20.0])
def test_lines_and_groups_hold_every_pixel_that_may_be_covered(size):
    vertices, faces = soup(5, 40, size=size)
    vertices[:60, 0] *= 0.1  # half of them are tall
    prepared = make_scene(vertices, faces, [], eye=(0.2, 0.1, 4.0))
    frame = Frame(prepared, WIDTH, HEIGHT, 0, "cpu")
    frame.load(prepared.moment(0, WIDTH, HEIGHT))
    count = len(faces)
    with wp.ScopedDevice("cpu"):
        boxes, ends = wp.zeros(count, dtype=wp.vec4i), wp.zeros((2, count, max(WIDTH, HEIGHT)), dtype=wp.vec2i)
        may_cover = wp.zeros((count, HEIGHT, WIDTH), dtype=wp.uint8)
        queue = filled(
            Queue, counts=wp.zeros(COUNTERS, dtype=wp.int32), items=wp.zeros(4 * count, dtype=wp.vec4i),
            records=wp.zeros((count, 4), dtype=wp.vec4f), depths=wp.zeros(count, dtype=wp.vec3d),
        )  # fmt: skip
        wp.launch(ends_kernel, dim=count, inputs=[frame.camera, frame.mesh], outputs=[boxes, ends, may_cover, queue])
    items = queue.items.numpy()[: queue.counts.numpy()[ITEMS]]
    some = 0
    for i, (x0, y0, x1, y1) in enumerate(boxes.numpy()):
        covered = may_cover.numpy()[i] > 0
        covered[:y0], covered[y1 + 1 :], covered[:, :x0], covered[:, x1 + 1 :] = False, False, False, False
        assert covered[may_cover.numpy()[i] == 2].all(), "a pixel that is hit lies outside the box"
        some += covered.sum()
        for lines, (low, high), (first, last) in zip(
            (covered, covered.T), ((y0, y1), (x0, x1)), ends.numpy()[:, i].transpose(0, 2, 1), strict=True
        ):
            places, number = np.arange(lines.shape[1]), len(lines)
            kept = (places >= first[:number, None]) & (places <= last[:number, None])
            assert not (lines & ~kept)[low : high + 1].any()
        own = items[items[:, 0] == i]
        assert (own[:, 3] == (y1 - y0 >= 2 * (x1 - x0 + 1))).all()
        held = [y for _, first, _, _ in own for y in range(first & 65535, (first & 65535) + (first >> 16))]
        low, high = (x0, x1) if own[:1, 3].any() else (y0, y1)
        assert sorted(held) == list(range(low, high + 1)) if x1 >= x0 and y1 >= y0 else not held
    assert some > 0
    assert set(items[:, 3]) == {0, 1} or size != 1.0
