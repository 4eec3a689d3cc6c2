"""The rasteriser against float64 brute force, and its bits against those of ray_grids under every setting."""

import numpy as np
import pytest
import warp as wp
from helpers.brute_force import make_scene, soup
from helpers.method_trials import TRIALS, assert_exact, trace
from helpers.streams import trial
from shadowbench.harness.errors import CapacityRejected
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.effects import Limits
from shadowbench.harness.scene.prepared import Prepared

NAME = "visibility_buffer"
TILES = {"inline_pixels": 0, "inline_cells": 0}
FEW = {"inline_rays": 2, "cells": 8}


def small_and_large(seed: int = 7) -> Prepared:
    """Triangles of a few pixels, and such as cover the image and reach behind the eye; lights inside and outside."""
    small, large = soup(seed, 300, size=0.05), soup(seed + 1, 12, size=3.0)
    vertices = np.concatenate([small[0], large[0]])
    return make_scene(
        vertices, np.arange(len(vertices)).reshape(-1, 3), [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0), tuple(vertices[0])]
    )


@pytest.mark.parametrize("name", TRIALS)
def test_equals_brute_force_on_hard_scenes(name, device):
    assert_exact(NAME, trial(**TILES), *TRIALS[name], device)


@pytest.mark.parametrize("seed", range(4))
def test_equals_brute_force_under_random_settings(seed, device):
    random = np.random.default_rng(seed)
    settings = trial(
        cells=[16, 8, 64, 200][seed],
        inline_pixels=random.integers(0, 60),
        inline_cells=random.integers(0, 100),
        inline_rays=random.integers(0, 8),
        shares=1 + seed % 3,
        lights_at_once=1 + seed % 2,
    )
    assert_exact(NAME, settings, small_and_large(seed), 37, 29, device)


@pytest.mark.parametrize(
    "settings",
    [{}, TILES, {"inline_pixels": 4000, "inline_cells": 4000, "cells": 128}, {**TILES, "cells": 8, "shares": 1}, FEW],
    ids=str,
)
def test_has_the_bits_of_ray_grids(settings, device):
    prepared = small_and_large()
    _, _, wanted = trace("ray_grids", {}, prepared, 93, 71, device)
    session, _, got = trace(NAME, trial(**settings), prepared, 93, 71, device)
    for key, values in wanted.items():
        np.testing.assert_array_equal(got[key], values, key)
    session.frame.answers.poison()
    session.replay()  # on the GPU a graph, in which lights and shares run beside each other
    for key, values in session.frame.answers.to_host().items():
        np.testing.assert_array_equal(values, wanted[key], key)


def test_tiles_that_hold_nothing_are_left_out():
    """Most tiles of the boxes of thin triangles across the image lie beside them, or hold no hit point."""
    rng = np.random.default_rng(3)
    ends = rng.normal(size=(20, 2, 3)) * 2.0
    vertices = np.concatenate([ends, ends[:, 1:] + 0.01], axis=1).reshape(-1, 3)
    prepared = make_scene(vertices, np.arange(60).reshape(-1, 3), [(5.0, 4.0, 3.0)])
    session, _, _ = trace(NAME, trial(**TILES), prepared, 128, 128)
    counts = session.method.counters()
    for stream in ("camera", "light 0"):
        assert 0 < counts[f"{stream} chunks"] < 8 * counts[f"{stream} items"], stream  # of 32 tiles an item


def test_thin_triangles_that_a_light_sees_nearly_edge_on_are_decided_in_float32():
    """Strips of a ceiling, 16 long and 0.05 wide, 4 mm below the light: float32 does not tell on which side it is. With
    planes of zeros every one of them would leave half the floor to float64. The light stands 2 mm beside the middle one."""
    low = np.linspace(-3.0, 3.0, 7)
    strips = [[(x, 1.0, -8.0), (x + 0.05, 1.0, -8.0), (x + 0.05, 1.0, 8.0), (x, 1.0, 8.0)] for x in low]
    floor = [[(-8.0, -1.0, -8.0), (8.0, -1.0, -8.0), (8.0, -1.0, 8.0), (-8.0, -1.0, 8.0)]]
    faces = [(4 * k, 4 * k + a, 4 * k + a + 1) for k in range(len(low) + 1) for a in (1, 2)]
    prepared = make_scene(
        np.reshape(strips + floor, (-1, 3)), faces, [(0.052, 1.004, 0.2)], (0.0, 0.8, 6.0), (0.0, -1.0, 0.0)
    )
    session, _, got = trace(NAME, trial(**TILES), prepared, 64, 64)
    assert session.method.counters()["light 0 undecided pairs"] < 64 * 64 / 8
    _, _, wanted = trace("ray_grids", {}, prepared, 64, 64)
    assert 0.0 < got["shadowed"].mean() < 1.0
    np.testing.assert_array_equal(got["shadowed"], wanted["shadowed"])


def test_queues_grow_and_the_frame_is_repeated(device, monkeypatch):
    """Whatever the memory of the queues held before: they are not cleared."""
    prepared, empty = small_and_large(), wp.empty

    def used(*given, **named):
        array = empty(*given, **named)
        array.fill_(0x7B7B7B7B)
        return array

    tiny = trial(**TILES, items=1, chunks=1, undecided=1)
    _, _, roomy = trace(NAME, trial(**TILES), prepared, 40, 40, device)
    monkeypatch.setattr(wp, "empty", used)
    session, _, tight = trace(NAME, tiny, prepared, 40, 40, device)
    assert session.regrown >= 1
    for key, values in roomy.items():
        np.testing.assert_array_equal(tight[key], values, key)


@pytest.mark.parametrize(
    ("settings", "memory", "message"),
    [
        ({"cells": 1024}, 2**20, "map of .* texels"),
        ({**TILES, "items": 1, "shares": 1}, 3 * 2**10, "needs .* work items"),
    ],
)
def test_a_need_beyond_the_memory_limit_is_rejected(settings, memory, message):
    prepared = small_and_large()
    method = make_method(NAME, trial(**{"cells": 8, **settings}))
    with pytest.raises(CapacityRejected, match=message):
        Session(method, prepared, 32, 32, "cpu", limits=Limits(memory=memory)).answers(prepared.moment(0, 32, 32))


def test_a_moved_frame_equals_a_fresh_one(device):
    vertices, faces = soup(5, 200)
    near = make_scene(vertices, faces, [(1.0, 2.0, 3.0)])
    far = make_scene(vertices * 0.5, faces, [(0.1, 0.2, 0.3)])
    session, moment, first = trace(NAME, trial(**TILES), near, 32, 32, device)
    after = session.answers(far.moment(0, 32, 32))
    _, _, fresh = trace(NAME, trial(**TILES), far, 32, 32, device)
    again = session.answers(moment)
    for key in first:
        np.testing.assert_array_equal(first[key], again[key], key)
        np.testing.assert_array_equal(fresh[key], after[key], key)
