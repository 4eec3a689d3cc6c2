"""Rows and columns of the camera's pixels, cut to a triangle: no pixel that it may cover is cut off, and groups hold all."""

import numpy as np
import pytest
import warp as wp
from helpers.brute_force import make_scene, soup
from shadowbench.harness.frame.frame import Frame
from shadowbench.harness.frame.geometry import Camera, Mesh, filled
from shadowbench.methods.common.reads import corners_at, direction_at
from shadowbench.methods.streams.camera.pixels import Candidate, edge_planes, least_edge, sign_bound
from shadowbench.methods.streams.camera.stream import box_of, ends_of_line, lines_of, queue_triangle
from shadowbench.methods.streams.queues import COUNTERS, ITEMS, Queue

WIDTH, HEIGHT = 61, 83
"""Neither is a multiple of a group of 32 lines."""


@wp.kernel(enable_backward=False)
def ends_kernel(
    tall: wp.bool, camera: Camera, mesh: Mesh, boxes: wp.array(dtype=wp.vec4i), ends: wp.array2d(dtype=wp.vec2i),
    may_cover: wp.array3d(dtype=wp.uint8), queue: Queue,
):  # fmt: skip
    """Of triangle i: its box, the ends of every line, which pixels it may cover, and its groups."""
    i = wp.tid()
    o = camera.eye[0]
    corners = corners_at(mesh, i)
    planes = edge_planes(o, corners)
    bound = sign_bound(camera.tangents)
    box = box_of(corners, o, camera)
    boxes[i] = box
    lines = lines_of(planes, bound, tall, camera)
    for y in range(camera.height):
        for x in range(camera.width):
            may_cover[i, y, x] = wp.uint8(not (least_edge(planes, direction_at(camera, x, y)) < -bound))
    if tall:
        for x in range(camera.width):
            ends[i, x] = ends_of_line(lines, x, box[1], box[3], camera)
    else:
        for y in range(camera.height):
            ends[i, y] = ends_of_line(lines, y, box[0], box[2], camera)
    if box[2] >= box[0] and box[3] >= box[1]:
        candidate = Candidate()
        candidate.i = i
        candidate.planes = planes
        queue_triangle(queue, box, candidate, lines)


@pytest.mark.parametrize("tall", [False, True], ids=["rows", "columns"])
@pytest.mark.parametrize("size", [0.05, 1.0, 20.0])
def test_lines_and_groups_hold_every_pixel_that_may_be_covered(size, tall):
    vertices, faces = soup(5, 40, size=size)
    prepared = make_scene(vertices, faces, [], eye=(0.2, 0.1, 4.0))
    frame = Frame(prepared, WIDTH, HEIGHT, 0, "cpu")
    frame.load(prepared.moment(0, WIDTH, HEIGHT))
    count, along = len(faces), WIDTH if tall else HEIGHT
    with wp.ScopedDevice("cpu"):
        boxes, ends = wp.zeros(count, dtype=wp.vec4i), wp.zeros((count, along), dtype=wp.vec2i)
        may_cover = wp.zeros((count, HEIGHT, WIDTH), dtype=wp.uint8)
        queue = filled(
            Queue, counts=wp.zeros(COUNTERS, dtype=wp.int32), items=wp.zeros(4 * count, dtype=wp.vec4i),
            records=wp.zeros((count, 4), dtype=wp.vec4f), depths=wp.zeros(count, dtype=wp.vec3d),
        )  # fmt: skip
        outputs = [boxes, ends, may_cover, queue]
        wp.launch(ends_kernel, dim=count, inputs=[tall, frame.camera, frame.mesh], outputs=outputs)
    items = queue.items.numpy()[: queue.counts.numpy()[ITEMS]]
    assert (items[:, 3] == tall).all()
    some = 0
    for i, (x0, y0, x1, y1) in enumerate(boxes.numpy()):
        covered = may_cover.numpy()[i].astype(bool)
        covered[:y0], covered[y1 + 1 :], covered[:, :x0], covered[:, x1 + 1 :] = False, False, False, False
        lines = covered.T if tall else covered
        low, high = (x0, x1) if tall else (y0, y1)
        places = np.arange(lines.shape[1])
        kept = (places >= ends.numpy()[i][:, :1]) & (places <= ends.numpy()[i][:, 1:])
        assert not (lines & ~kept)[low : high + 1].any()
        own = items[items[:, 0] == i]
        held = [y for _, first, _, _ in own for y in range(first & 65535, (first & 65535) + (first >> 16))]
        assert sorted(held) == list(range(low, high + 1)) if x1 >= x0 and y1 >= y0 else not held
        some += covered.sum()
    assert some > 0
