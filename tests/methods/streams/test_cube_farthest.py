"""Farthest receivers: what lies beyond them is left out of the light's work, and nothing else is."""

import itertools

import numpy as np
import warp as wp
from helpers.brute_force import make_scene
from helpers.streams import on_gpu_side, trial
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.methods.streams.cube.farthest import all_rays_end_before, raise_farthest

CELLS = 32


@wp.kernel(enable_backward=False)
def note_kernel(
    cells: wp.array(dtype=wp.vec3i), depths: wp.array(dtype=wp.float32), farthest: wp.array(dtype=wp.int32)
):
    i = wp.tid()
    c = cells[i]
    raise_farthest(farthest, c[0], c[1], c[2], depths[i], CELLS)


@wp.kernel(enable_backward=False)
def ask_kernel(
    boxes: wp.array(dtype=wp.vec4i),
    depths: wp.array(dtype=wp.float32),
    farthest: wp.array(dtype=wp.int32),
    answers: wp.array(dtype=wp.bool),
):
    i = wp.tid()
    answers[i] = all_rays_end_before(depths[i], farthest, 2, boxes[i], CELLS)


def test_a_box_is_left_out_only_where_every_tile_ends_before(device):
    random = np.random.default_rng(3)
    cells = np.stack([random.integers(1, 4, 60), *random.integers(0, CELLS, (2, 60))], axis=1)
    depths = random.uniform(1.0, 4.0, 60).astype(np.float32)
    depths[0] = np.inf
    farthest = wp.zeros(6 * (CELLS // 8) ** 2, dtype=wp.int32, device=device)
    noted = [wp.array(cells, dtype=wp.vec3i, device=device), wp.array(depths, device=device)]
    wp.launch(note_kernel, dim=60, inputs=noted, outputs=[farthest], device=device)
    low = random.integers(0, CELLS, (500, 2))
    boxes = np.concatenate([low, np.minimum(CELLS - 1, low + random.integers(0, 24, (500, 2)))], axis=1)
    asked = random.uniform(0.5, 4.0, 500).astype(np.float32)
    asked[:3] = (-1.0, 0.0, np.nan)
    answers = wp.zeros(500, dtype=wp.bool, device=device)
    given = [wp.array(boxes, dtype=wp.vec4i, device=device), wp.array(asked, device=device), farthest]
    wp.launch(ask_kernel, dim=500, inputs=given, outputs=[answers], device=device)
    tiles = np.zeros((CELLS // 8, CELLS // 8))
    on_face = cells[:, 0] == 2
    np.maximum.at(tiles, (cells[on_face, 2] // 8, cells[on_face, 1] // 8), depths[on_face])
    expected = [
        bool(depth > 0 and (tiles[b[1] // 8 : b[3] // 8 + 1, b[0] // 8 : b[2] // 8 + 1] < depth).all())
        for b, depth in zip(boxes, asked, strict=True)
    ]
    assert answers.numpy().tolist() == expected
    assert 50 < sum(expected) < 450


def floor(height: float, count: int) -> np.ndarray:
    """Triangles of a horizontal square, count x count cells of two."""
    line = np.linspace(-1.0, 1.0, count + 1)
    quads = []
    for x0, x1 in itertools.pairwise(line):
        for z0, z1 in itertools.pairwise(line):
            quads += [(x0, z0), (x1, z0), (x1, z1), (x0, z0), (x1, z1), (x0, z1)]
    return np.array([(x, height, z) for x, z in quads])


def light_items(vertices: np.ndarray) -> tuple[int, np.ndarray]:
    """Queued work of the light of a scene seen from above, and its shadow bits."""
    faces = np.arange(len(vertices)).reshape(-1, 3)
    prepared = make_scene(vertices, faces, [(0.1, 3.0, 0.2)], (0.0, 3.5, 0.3), (0.0, 0.0, 0.0), 40.0)
    session = Session(make_method("ray_grids", trial(inline_rays=0, cells=64)), prepared, 64, 64, "cpu")
    bits = session.answers(prepared.moment(0, 64, 64))["shadowed"]
    return session.method.counters()["light 0 items"], bits


@on_gpu_side
def test_what_lies_below_a_floor_is_no_work():
    top = floor(0.0, 4)
    below, above = (np.concatenate([top, floor(-0.5, 16)]), np.concatenate([top, floor(0.5, 16) * (0.2, 1, 0.2)]))
    items, bits = light_items(top)
    assert items >= len(top) // 3
    more, bits_below = light_items(below)
    assert more < items + 40
    assert (bits_below == bits).all()
    most, bits_above = light_items(above)
    assert most > items + 40
    assert bits_above.any()
    assert not bits.any()
