"""Work of the threads that put triangles into tiles (``lists/binning.py``); pairs sorted by cell (``lists/sorting.py``);
and chunks (``lists/chunks.py``): Algorithm 1 (``algorithm1.py``) as section 4.3 and Figure 8 describe it.
"""

import itertools

import numpy as np
import pytest
import warp as wp
from helpers.paper_knobs import answers_of
from helpers.small_scenes import make_scene, soup
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
from shadowbench.methods.perspective_spherical.lists.chunks import Chunks
from shadowbench.methods.perspective_spherical.lists.sorting import TileLists, TileSort
from shadowbench.methods.perspective_spherical.parameters import BALANCING, SORTS


def chunks_of(keys: wp.array, tiles: int, r: int, balancing: str) -> Chunks:
    """The chunks of sorted rays, of which ``keys`` are the tiles; its second half is room for a sort."""
    ids = keys.numpy()[: keys.shape[0] // 2]
    runs = {"begin": np.searchsorted(ids, np.arange(tiles)), "end": np.searchsorted(ids, np.arange(tiles), "right")}
    lists = filled(
        TileLists, keys=keys, values=wp.zeros_like(keys),
        **{name: wp.array(run, dtype=wp.int32, device=keys.device) for name, run in runs.items()},
    )  # fmt: skip
    chunks = Chunks(lists, len(ids), tiles, r, balancing, str(keys.device))
    chunks.launch()
    return chunks


def test_algorithm_1_as_figure_8_is_described():
    """Nine rays in four tiles, r = 2: arrays A to G of section 4.3, after lines 9 to 14 of Algorithm 1.

    The paper is at hand as text, without the picture: which ray lies in which tile is our own example. What each array
    must hold for it follows the text: A pixels, B tiles, C hard boundaries, D the scan of ones, E soft boundaries, F
    thread numbers, G the first ray of each block.
    """
    tile_of_pixel = [4, 0, 1, 0, 3, 4, 0, 1, 4]
    count, tiles, r = len(tile_of_pixel), 6, 2
    keys = wp.array(tile_of_pixel + [0] * count, dtype=wp.int32, device="cpu")
    pixels = wp.array([*range(count)] + [0] * count, dtype=wp.int32, device="cpu")  # line 9: each pixel's own number
    wp.utils.radix_sort_pairs(keys, pixels, count, 0, tiles.bit_length())  # line 10, as the method calls it
    a, b = pixels.numpy()[:count], keys.numpy()[:count]
    assert (a.tolist(), b.tolist()) == ([1, 3, 6, 2, 7, 4, 0, 5, 8], [0, 0, 0, 1, 1, 3, 4, 4, 4])
    chunks = chunks_of(keys, tiles, r, "algorithm-1")
    assert chunks.paper is not None
    assert chunks.paper.arrays.threadArr.numpy().tolist() == [0, 1, 2, 3, 4, 5, 6, 7, 8]  # F
    assert chunks.paper.arrays.pseudoArr.numpy().tolist() == [1, 0, 0, 1, 0, 1, 1, 0, 0]  # C
    assert chunks.paper.arrays.scratchArr.numpy().tolist() == [1, 2, 3, 1, 2, 1, 1, 2, 3]  # D
    assert chunks.paper.arrays.validArr.numpy().tolist() == [1, 0, 1, 1, 0, 1, 1, 0, 1]  # E
    assert chunks.of_rays.total.numpy()[0] == 6  # C_total = 2 + 1 + 1 + 2
    first = chunks.of_rays.first.numpy()[:7]
    assert first.tolist() == [0, 2, 3, 5, 6, 8, 9]  # G, and the number of rays, which closes it
    assert np.diff(first).tolist() == [2, 1, 2, 1, 2, 1]  # "the difference between the values" of G
    assert a[first[:6]].tolist() == [1, 6, 2, 4, 0, 8]  # "the ray whose index in A is referenced by ... G"


@pytest.mark.parametrize("balancing", BALANCING)
@pytest.mark.parametrize("sort", ["radix", "counting"])
def test_a_frame_sorts_its_shadow_rays_and_gives_every_block_rays_of_one_tile(sort, balancing, device):
    """Lines 9 and 10 within a frame: A is every pixel with a shadow ray once, B ascends, each block has one tile's."""
    settings = {"balancing": balancing, "sort": sort, "r": 2, "light_tiles": 6}
    vertices, faces = soup(3, 60)
    prepared = make_scene(vertices, faces, [(1.0, 2.5, 1.5)])
    session, _, answers = answers_of(prepared, 23, 17, settings, device)
    (light,) = session.method.lights
    hits = np.flatnonzero(answers["triangle"].reshape(-1) >= 0)
    a, b = light.sorted.lists.values.numpy()[: len(hits)], light.sorted.lists.keys.numpy()[: 23 * 17]
    assert sorted(a.tolist()) == hits.tolist()
    assert (np.diff(b) >= 0).all()
    assert (b < light.sorted.tiles).sum() == len(hits)
    total = int(light.chunks.of_rays.total.numpy()[0])
    first = light.chunks.of_rays.first.numpy()[: total + 1]
    counts = np.bincount(b[: len(hits)])
    assert total == np.ceil(counts / 2).sum() > (counts > 0).sum(), "some tile has more rays than a block"
    for start, end in itertools.pairwise(first):
        assert 1 <= end - start <= 2
        assert len(set(b[start:end])) == 1


@pytest.mark.parametrize("seed", range(6))
def test_both_balancings_make_the_same_chunks(seed, device):
    random = np.random.default_rng(seed)
    rays, tiles = int(random.integers(1, 700)), int(random.integers(1, 60))
    ids = np.sort(random.choice(tiles + 1, rays) if seed else np.full(rays, tiles))  # seed 0: no shadow ray at all
    keys = wp.array(np.concatenate([ids, ids]), dtype=wp.int32, device=device)
    for r in (1, 2, 7, 64, 1000):
        made = []
        for balancing in BALANCING:
            chunks = chunks_of(keys, tiles, r, balancing)
            total = int(chunks.of_rays.total.numpy()[0])
            made.append(chunks.of_rays.first.numpy()[: total + 1].tolist())
            assert total <= chunks.capacity
        assert made[0] == made[1]
        counts = np.bincount(ids[ids < tiles], minlength=tiles)
        assert (len(made[0]) - 1, made[0][-1]) == (int(np.ceil(counts / r).sum()), counts.sum())
        assert max(np.diff(made[0]), default=0) <= r


@pytest.mark.parametrize("sort", SORTS)
def test_pairs_come_out_sorted_and_a_tile_has_its_run(sort):
    random = np.random.default_rng(5)
    tiles, slices, count, capacity = 40, 7, 500, 600
    needs = wp.zeros(1, dtype=wp.int64, device="cpu")
    bins = TileSort(tiles, slices, capacity, needs, 0, sort, "cpu")
    bins.clear()
    cells = random.integers(0, tiles * slices, count)
    cells[cells // slices == 3] = 0  # an empty tile
    ranks = np.zeros(count, dtype=int)
    for i, cell in enumerate(cells):
        ranks[i] = (cells[:i] == cell).sum()
    keys = bins.pairs.keys.numpy()
    keys[:count] = cells
    bins.pairs.keys.assign(keys)
    values = bins.pairs.values.numpy()
    values[:count] = np.arange(count)
    bins.pairs.values.assign(values)
    needs.assign([count])
    if sort == "counting":
        assert bins.counted
        bins.pairs.ranks.assign(np.pad(ranks, (0, capacity - count)))
        bins.pairs.cell_count.assign(np.bincount(cells, minlength=tiles * slices))
    bins.launch_sort()
    keys, values = bins.lists.keys.numpy()[:count], bins.lists.values.numpy()[:count]
    assert (np.diff(keys) >= 0).all()
    assert (keys == cells[values]).all()
    assert sorted(values) == list(range(count))
    begin, end = bins.lists.begin.numpy(), bins.lists.end.numpy()
    for tile in range(tiles):
        assert (keys[begin[tile] : end[tile]] // slices == tile).all()
    assert (end - begin).tolist() == np.bincount(cells // slices, minlength=tiles).tolist()


@pytest.mark.parametrize("sort", SORTS)
def test_pairs_that_do_not_fit_are_no_lists(sort):
    needs = wp.array([101], dtype=wp.int64, device="cpu")
    bins = TileSort(3, 2, 100, needs, 0, sort, "cpu")
    bins.pairs.keys.assign(np.zeros(bins.pairs.keys.shape[0], dtype=np.int32))
    if sort == "counting":
        bins.pairs.ranks.assign(np.arange(100))
        bins.pairs.cell_count.assign([100, 0, 0, 0, 0, 0])
    for needed, length in ((101, 0), (100, 100)):
        needs.assign([needed])
        bins.launch_sort()
        assert bins.lengths().tolist() == [length, 0, 0]


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
