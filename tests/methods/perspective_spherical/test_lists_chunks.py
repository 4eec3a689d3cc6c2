"""Rays to blocks: Algorithm 1 (``algorithm1.py``) as section 4.3 and Figure 8 describe it, and the direct way to the
same chunks.
"""

import itertools

import numpy as np
import pytest
import warp as wp
from helpers.paper_knobs import answers_of
from helpers.small_scenes import make_scene, soup
from shadowbench.harness.frame.geometry import filled
from shadowbench.methods.perspective_spherical.lists.chunks import Chunks
from shadowbench.methods.perspective_spherical.lists.sorting import TileLists
from shadowbench.methods.perspective_spherical.parameters import BALANCING


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
    assert a.tolist() == [1, 3, 6, 2, 7, 4, 0, 5, 8]
    assert b.tolist() == [0, 0, 0, 1, 1, 3, 4, 4, 4]
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
        assert len(made[0]) - 1 == int(np.ceil(counts / r).sum())
        assert made[0][-1] == counts.sum()
        assert max(np.diff(made[0]), default=0) <= r
