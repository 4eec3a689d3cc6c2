"""Pixels against triangles (``camera/pixels.py``), as ``reads.py`` reads them; boxes of pixels (``screen.py``) and their
rows (``camera/stream.py``, ``camera/rows.py``): no pixel that may be covered is cut off, and words order hits.
"""

import numpy as np
import pytest
import warp as wp
from helpers.launched import launched
from helpers.small_scenes import make_scene, soup
from shadowbench.harness.frame.frame import Frame
from shadowbench.harness.frame.geometry import Camera, Mesh, filled
from shadowbench.methods.common.reads import corners_at, direction_at
from shadowbench.methods.exact.triangle import spare_bits
from shadowbench.methods.streams.camera.pixels import Candidate, edge_planes, hit_word, index_of, least_edge, sign_bound
from shadowbench.methods.streams.camera.stream import box_of, ends_of_line, lines_of, queue_rows
from shadowbench.methods.streams.queues import COUNTERS, ITEMS, Queue

WIDTH, HEIGHT = 61, 83
"""Neither is a multiple of a group of 32 lines."""


@wp.kernel(enable_backward=False)
def ends_kernel(
    camera: Camera, mesh: Mesh, boxes: wp.array(dtype=wp.vec4i), ends: wp.array3d(dtype=wp.vec2i),
    may_cover: wp.array3d(dtype=wp.uint8), queue: Queue,
):  # fmt: skip
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


COLUMNS, ROWS = 32, 24


@wp.kernel(enable_backward=False)
def edges_kernel(camera: Camera, mesh: Mesh, least: wp.array3d(dtype=wp.float32), bound: wp.array(dtype=wp.float32)):
    i, y, x = wp.tid()
    planes = edge_planes(camera.eye[0], corners_at(mesh, i))
    least[i, y, x] = least_edge(planes, direction_at(camera, x, y))
    bound[0] = sign_bound(camera.tangents)


@wp.kernel(enable_backward=False)
def words_kernel(
    triangles: wp.int32, inverse: wp.array(dtype=wp.float64), index: wp.array(dtype=wp.int32),
    words: wp.array(dtype=wp.uint64), back: wp.array(dtype=wp.int32),
):  # fmt: skip
    k = wp.tid()
    spare = spare_bits(triangles)
    words[k] = hit_word(inverse[k], index[k], spare)
    back[k] = index_of(words[k], spare)


@pytest.mark.parametrize("size", [0.2, 1.0, 30.0])
def test_certain_signs_are_those_of_float64(size):
    vertices, faces = soup(3, 60, size=size)
    prepared = make_scene(vertices, faces, [], eye=(0.3, -0.2, 4.0))
    moment = prepared.moment(0, COLUMNS, ROWS)
    frame = Frame(prepared, COLUMNS, ROWS, 0, "cpu")
    frame.load(moment)
    shape = len(faces), ROWS, COLUMNS
    found, (margin,) = launched(edges_kernel, shape, [frame.camera, frame.mesh], [shape, 1])
    directions = (moment.column[None] + moment.row[:, None]).astype(np.float64)
    a, b, c = (moment.points[prepared.faces[:, k]].astype(np.float64) - moment.eye for k in range(3))
    side = np.sign(np.einsum("ij,ij->i", np.cross(b - a, c - a), a))
    edges = np.stack([np.cross(p, q) * side[:, None] for p, q in ((a, b), (b, c), (c, a))])
    inside = np.einsum("kij,yxj->iyxk", edges, directions).min(axis=-1)
    assert (inside[found > margin] > 0).all()
    assert (inside[found < -margin] < 0).all()
    sure = np.abs(found) > margin
    assert sure.mean() > 0.9
    assert (found[sure] > 0).any()
    assert (found[sure] < 0).any()


@pytest.mark.parametrize("triangles", [3, 70_000, 2**24 - 1])
def test_a_nearer_hit_and_of_ties_the_lower_index_has_the_larger_word(triangles):
    rng = np.random.default_rng(triangles)
    inverse = np.repeat(np.sort(np.exp2(rng.uniform(-60, 60, 200))), 2)
    index = np.stack([rng.integers(1, triangles, 200), np.zeros(200)], axis=1).astype(np.int32).ravel()
    words, back = launched(words_kernel, 400, [triangles, inverse, index], [400, 400])
    assert (back == index).all()
    assert (np.diff(words.astype(object)) > 0).all()
