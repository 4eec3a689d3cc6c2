"""Groups of rows of a light's larger triangles, as a pass or the stream (``occlusion/stream.py``) stores them: small
ones apart from large ones, in one array.
"""

import numpy as np
import pytest
from helpers.answers import trace
from helpers.small_scenes import make_scene, soup
from helpers.streams import on_gpu_side, trial
from shadowbench.methods.gpu.prefetch import FEW_ROWS
from shadowbench.methods.gpu.warps import LANES
from shadowbench.methods.streams.queues import COUNTERS, ITEMS, LARGE, SMALL, more_room

pytestmark = on_gpu_side


def queued(cells, capacity="0", groups="split", light=(5.0, 4.0, 3.0)):
    """A light's counters; triangle, face, first row and rows of each large and of each small group; and its triangles."""
    small, large = soup(7, 200, size=0.2), soup(8, 12, size=3.0)
    vertices = np.concatenate([small[0], large[0]])
    prepared = make_scene(vertices, np.arange(len(vertices)).reshape(-1, 3), [light])
    given = trial(inline_cells=0, shares=1, cells=cells, groups=groups, items=capacity)
    method = trace("ray_grids", given, prepared, 64, 64)[0].method
    counts = method._queues.counts.numpy()[1].copy()
    (queue,) = method._queues.of_stream(1)
    words = queue.groups.numpy().view(np.int32).reshape(-1, 8, 4)[:, 0]
    which = words[:, 0]
    groups = np.stack([words[:, 2], which & 15, which >> 16, (which >> 4) & 63], axis=1)
    end = len(groups) - counts[SMALL]
    return counts, groups[: counts[ITEMS]], groups[end:], queue.large.numpy()[: counts[LARGE]].copy()


@pytest.mark.parametrize("cells", ["8", "64", "512"])
def test_the_groups_of_a_triangle_are_all_its_rows(cells):
    counts, large, small, triangles = queued(cells)
    rows = {}
    for i, face, first, number in np.concatenate([large, small]):
        for row in range(first, first + number):
            rows.setdefault((i, face), []).append(row)
    expected = {(i, face): list(range(row & 65535, (row >> 16) + 1)) for i, face, _, row in triangles.tolist()}
    assert {key: sorted(found) for key, found in rows.items()} == expected
    assert counts[SMALL] == sum(len(found) <= FEW_ROWS for found in expected.values())
    assert (small[:, 3] <= FEW_ROWS).all()
    assert (large[:, 3] <= LANES).all()
    assert counts[SMALL] > 0
    assert (counts[ITEMS] > 0) == (int(cells) > FEW_ROWS)


@pytest.mark.parametrize("cells", ["8", "64", "512"])
@pytest.mark.parametrize("light", [(5.0, 4.0, 3.0), (0.1, 0.2, 0.3)], ids=["one face", "all faces"])
def test_the_stream_stores_the_same_groups_as_the_pass(cells, light):
    split, stream = (queued(cells, groups=groups, light=light) for groups in ("split", "stream"))
    assert stream[0][LARGE] == 0 < split[0][LARGE]
    for expected, found in zip(split[1:3], stream[1:3], strict=True):
        assert sorted(map(tuple, found)) == sorted(map(tuple, expected))


def test_small_and_large_groups_need_room_together():
    counts, *_ = queued("64")
    needed = np.zeros((1, COUNTERS), dtype=np.int64)
    needed[0, [ITEMS, SMALL, LARGE]] = 30, 40, 50
    assert more_room(needed, (69, 1, 1), 2**40)[0] >= 70
    assert more_room(needed, (70, 1, 1), 2**40)[0] == 70
    tight, *_ = queued("64", capacity=str(max(counts[ITEMS], counts[SMALL])))
    assert (tight[[ITEMS, SMALL, LARGE]] == counts[[ITEMS, SMALL, LARGE]]).all()
