"""Cells of a light's cube: slots that hold cell and rank of a ray in 32 bits, whatever the numbers (``rays/sort.py``);
and farthest receivers: what lies beyond them is left out of the light's work, and nothing else is.
"""

import itertools

import numpy as np
import pytest
import warp as wp
from helpers.answers import trace
from helpers.launched import launched
from helpers.lights_of_session import lights_of_session
from helpers.method_trials import assert_exact
from helpers.small_scenes import make_scene
from helpers.streams import on_gpu_side, trial
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.shapes import joined, plane, triangles
from shadowbench.methods.streams.cube.cells import all_rays_end_before, raise_from, tile_index

CELLS = 32
SIZE = 40, 32


@pytest.mark.parametrize("region", ["triangles", "rays"])
def test_more_rays_in_a_cell_than_a_slot_has_room_for(region, device):
    """A square that nearly fills the view, in one cell of a light far away, however narrow cells are there; a surface far
    behind it, seen beside it, spans the other cells. The cell has more rays than the 8 bits of a rank beside 23 bits of a
    cell hold.
    """
    blocker = triangles((0.1, 0.1, 0.5), (0.2, 0.1, 0.5), (0.1, 0.2, 0.5))
    behind = triangles((0.0, 0.0, -2.5e5), (1.0e6, 0.0, -2.5e5), (1.0e6, 1.0e6, -2.5e5))
    mesh = joined(plane(2, 0, 1), blocker, behind)
    prepared = make_scene(*mesh, [(0.0, 0.0, 1.0e6)], (0.0, 0.0, 0.9), fov=90.0)
    session = Session(make_method("ray_grids", trial(region=region, cells=1024)), prepared, *SIZE, device)
    answers = session.answers(prepared.moment(0, *SIZE))
    (light,) = lights_of_session(session)
    bits = light.cells.bits
    most = (1 << (31 - bits)) - 1
    hit = answers["triangle"].ravel() >= 0
    ranks = (light.cells.slot.numpy()[hit] >> bits) & most
    assert (ranks == most).sum() > 100
    assert light.cells.rank.numpy()[hit].max() > most
    order = light.cells.rays.numpy()[:, 3].view(np.int32)[: hit.sum()]
    assert sorted(order) == np.flatnonzero(hit).tolist()
    assert_exact("ray_grids", trial(region=region, cells=1024), prepared, *SIZE, device)
    assert 0 < answers["shadowed"].sum() < hit.sum()


@wp.kernel(enable_backward=False)
def note_kernel(
    cells: wp.array(dtype=wp.vec3i), depths: wp.array(dtype=wp.float32), farthest: wp.array(dtype=wp.int32)
):
    i = wp.tid()
    tile = tile_index(cells[i][0], cells[i][1], cells[i][2], CELLS)
    raise_from(farthest[tile], farthest, tile, depths[i])


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
    low = random.integers(0, CELLS, (500, 2))
    boxes = np.concatenate([low, np.minimum(CELLS - 1, low + random.integers(0, 24, (500, 2)))], axis=1)
    asked = random.uniform(0.5, 4.0, 500).astype(np.float32)
    asked[:3] = (-1.0, 0.0, np.nan)
    (farthest,) = launched(note_kernel, 60, [cells, depths], [6 * (CELLS // 8) ** 2], device)
    (answers,) = launched(ask_kernel, 500, [boxes, asked, farthest], [500], device)
    tiles = np.zeros((CELLS // 8, CELLS // 8))
    on_face = cells[:, 0] == 2
    np.maximum.at(tiles, (cells[on_face, 2] // 8, cells[on_face, 1] // 8), depths[on_face])
    expected = [
        bool(depth > 0 and (tiles[b[1] // 8 : b[3] // 8 + 1, b[0] // 8 : b[2] // 8 + 1] < depth).all())
        for b, depth in zip(boxes, asked, strict=True)
    ]
    assert answers.tolist() == expected
    assert 50 < sum(expected) < 450


def floor(height: float, count: int) -> np.ndarray:
    """Triangles of a horizontal square, count x count cells of two."""
    quads = []
    for (x0, x1), (z0, z1) in itertools.product(itertools.pairwise(np.linspace(-1.0, 1.0, count + 1)), repeat=2):
        quads += [(x0, z0), (x1, z0), (x1, z1), (x0, z0), (x1, z1), (x0, z1)]
    return np.array([(x, height, z) for x, z in quads])


@on_gpu_side
def test_what_lies_below_a_floor_is_no_work():
    top = floor(0.0, 4)
    items, bits = [], []
    for more in (top[:0], floor(-0.5, 16), floor(0.5, 16) * (0.2, 1, 0.2)):
        vertices = np.concatenate([top, more])
        faces = np.arange(len(vertices)).reshape(-1, 3)
        prepared = make_scene(vertices, faces, [(0.1, 3.0, 0.2)], (0.0, 3.5, 0.3), (0.0, 0.0, 0.0), 40.0)
        session, _, answers = trace("ray_grids", trial(inline_rays=0, cells=64), prepared, 64, 64)
        items.append(session.method.counters()["light 0 items"])
        bits.append(answers["shadowed"])
    assert items[0] >= len(top) // 3
    assert items[1] < items[0] + 40 < items[2]
    assert [some.any() for some in bits] == [False, False, True]
