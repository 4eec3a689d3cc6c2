"""The streamed dual against float64 brute force and against the paper's method, with and without queues."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from helpers.brute_force import closest, make_scene, shadowed, soup
from shadowbench.harness.errors import CapacityRejected, UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.effects import Limits
from shadowbench.methods.gpu.reserve import BEYOND, number_in, reserve
from shadowbench.methods.streams.queues import COUNTERS, UNDECIDED, more_room
from shadowbench.methods.streams.settings import (
    FEW_TRIANGLES,
    MANY_TRIANGLES,
    ONE_SHARE_BELOW,
    REGION_PIXELS,
    SPLIT_FROM,
    STREAM_BESIDE_BELOW,
)


def answers_of(prepared, width, height, settings, device="cpu", method="ray_grids"):
    session = Session(make_method(method, settings), prepared, width, height, device)
    moment = prepared.moment(0, width, height)
    return session, moment, session.answers(moment)


@pytest.mark.parametrize("seed", range(20))
def test_equals_brute_force_under_random_knobs(seed, device):
    random = np.random.default_rng(1000 + seed)
    width, height = int(random.integers(1, 40)), int(random.integers(1, 40))
    vertices, faces = soup(seed, int(random.integers(1, 50)), size=float(np.exp(random.uniform(-3, 1.5))))
    scale = 2.0 ** int(random.integers(-20, 21)) if seed % 3 == 0 else 1.0
    eye = random.normal(size=3) * (3 if seed % 2 else 0.3)
    lights = [tuple(random.normal(size=3) * 10.0 ** random.uniform(-4, 7) * scale) for _ in range(2)]
    lights += [tuple(vertices[0] * scale), tuple(vertices[:3].mean(axis=0) * scale)]
    prepared = make_scene(vertices * scale, faces, lights, tuple(eye * scale), (0.0, 0.0, 0.0), 90.0)
    settings = {
        "cells": ["0", "8", "64", "200"][seed % 4],
        "queue": ["always", "never"][seed % 2],
        "inline_pixels": str(random.integers(0, 60)),
        "part": str(random.integers(1, 100)),
        "inline_rays": str(random.integers(0, 60)),
        "inline_cells": str(random.integers(0, 100)),
        "beside": str(1 + seed % 4),
        "shares": str(1 + seed // 4 % 3),
        "region": ["triangles", "rays"][seed // 3 % 2],
        "streamed": ["beside", "after"][seed // 2 % 2],
        "groups": ["auto", "split"][seed // 5 % 2],
    }
    session, moment, got = answers_of(prepared, width, height, settings, device)
    best, t = closest(prepared, moment)
    assert (got["triangle"] == best).all()
    hit = best >= 0
    np.testing.assert_allclose(got["t"][hit], t[hit], rtol=2**-23)
    assert np.isinf(got["t"][~hit]).all()
    for light in range(len(lights)):
        assert (got["shadowed"][light] == shadowed(prepared, moment, light, best, t)).all(), light
    session.frame.answers.poison()
    session.replay()  # on the GPU a graph, in which lights run beside each other
    for name, values in session.frame.answers.to_host().items():
        np.testing.assert_array_equal(values, got[name], err_msg=name)


def test_equals_the_papers_method_bit_for_bit(device):
    """Large and small triangles, light inside and outside; every knob of ours the same bits."""
    small, large = soup(7, 400, size=0.05), soup(8, 12, size=3.0)
    vertices = np.concatenate([small[0], large[0]])
    prepared = make_scene(
        vertices, np.arange(len(vertices)).reshape(-1, 3), [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0)]
    )
    _, _, reference = answers_of(prepared, 93, 71, {}, device, "perspective_spherical")
    for settings in (
        {"queue": "always"},
        {"queue": "never"},
        {"queue": "always", "inline_rays": "1", "inline_cells": "0", "cells": "8", "groups": "split"},
        {"queue": "always", "inline_rays": "0", "inline_cells": "0", "cells": "256", "part": "5"},
        {"queue": "always", "inline_rays": "0", "inline_cells": "0", "cells": "256", "part": "40"},
        {"queue": "always", "region": "rays"},
        {"queue": "always", "region": "triangles", "streamed": "beside"},
        {"queue": "always", "region": "triangles", "streamed": "after"},
        {"queue": "always", "inline_rays": "1000", "inline_cells": "1000", "cells": "256", "groups": "split"},
        {"queue": "always", "groups": "split"},
    ):
        _, _, got = answers_of(prepared, 93, 71, settings, device)
        for name, values in got.items():
            assert (values == reference[name]).all(), (settings, name)


def test_queues_grow_and_the_frame_is_repeated():
    vertices, faces = soup(3, 60, size=2.0)
    prepared = make_scene(vertices, faces, [(2.0, 3.0, 4.0)])
    _, _, roomy = answers_of(prepared, 64, 64, {"queue": "always"})
    tiny = {f"{name}_capacity": "1" for name in ("item", "part", "doubt")}
    session, _, tight = answers_of(
        prepared, 64, 64, {"queue": "always", "inline_rays": "1", "part": "32", **tiny}
    )
    assert session.regrown >= 1
    for name in roomy:
        assert (roomy[name] == tight[name]).all()


def test_a_need_beyond_the_memory_limit_is_rejected():
    vertices, faces = soup(3, 60, size=2.0)
    prepared = make_scene(vertices, faces, [(2.0, 3.0, 4.0)])
    method = make_method("ray_grids", {"queue": "always", "item_capacity": "1"})
    session = Session(method, prepared, 64, 64, "cpu", limits=Limits(memory=64))
    with pytest.raises(CapacityRejected, match="needs"):
        session.answers(prepared.moment(0, 64, 64))


@wp.kernel(enable_backward=False)
def places_kernel(counts: wp.array(dtype=wp.int32), places: wp.array(dtype=wp.int32)):
    places[0] = number_in(counts, 0)
    places[1] = reserve(counts, 1, 3)


@pytest.mark.parametrize(
    ("before", "place"),
    [(7, 7), (BEYOND - 1, BEYOND - 1), (2**31 - 9, BEYOND), (-(2**31), BEYOND), (-5, BEYOND)],
)
def test_what_a_counter_past_31_bits_hands_out_lies_in_no_list(before, place, device):
    counts = wp.array([before, before], dtype=wp.int32, device=device)
    places = wp.zeros(2, dtype=wp.int32, device=device)
    wp.launch(places_kernel, dim=1, inputs=[counts], outputs=[places], device=device)
    assert places.numpy().tolist() == [place, place]
    assert counts.numpy().tolist() == [before + 1, before + 3]


def test_a_counter_past_31_bits_is_no_small_need():
    needed = np.zeros((2, COUNTERS), dtype=np.int64)
    needed[1, UNDECIDED] = np.int32(-(2**31) + 5)
    with pytest.raises(CapacityRejected, match="2,147,483,653 undecided pairs"):
        more_room(needed, (1, 1, 1), 2**40)


@pytest.mark.parametrize("queue", ["always", "never"])
@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        (np.zeros((0, 3)), np.zeros((0, 3))),
        (np.zeros((3, 3)), [[0, 1, 2]]),
        ([[np.nan, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]),
        ([[-1, -1, 5], [1, -1, 5], [0, 1, 5]], [[0, 1, 2]]),
    ],
    ids=["no triangles", "zero area", "NaN", "behind the eye"],
)
def test_nothing_to_see(vertices, faces, queue):
    _, _, got = answers_of(make_scene(vertices, faces, [(0.0, 5.0, 0.0)]), 9, 7, {"queue": queue})
    assert (got["triangle"] == -1).all()
    assert np.isinf(got["t"]).all()
    assert (got["shadowed"] == 0).all()


def test_a_moved_frame_equals_a_fresh_one():
    vertices, faces = soup(5, 200)
    near, far = (
        make_scene(vertices, faces, [(1.0, 2.0, 3.0)]),
        make_scene(vertices * 0.5, faces, [(0.1, 0.2, 0.3)]),
    )
    session, moment, first = answers_of(near, 32, 32, {"queue": "always"})
    moved = far.moment(0, 32, 32)
    session.answers(moved)
    again = session.answers(moment)
    _, _, fresh = answers_of(far, 32, 32, {"queue": "always"})
    after = session.answers(moved)
    for name in first:
        assert (first[name] == again[name]).all()
        assert (fresh[name] == after[name]).all()


def test_few_pairs_are_undecided_however_far_the_eye():
    """Bounds grow with the triangles' coordinates, not with the eye's: what float64 decides stays the exception."""
    vertices, faces = soup(7, 400, size=0.2)
    prepared = make_scene(vertices, faces, [(5.0, 4.0, 3.0)], (0.0, 0.0, 300.0), (0.0, 0.0, 0.0), 0.6)
    session, _, got = answers_of(prepared, 64, 64, {"queue": "always"})
    rays = int((got["triangle"] >= 0).sum())
    assert rays > 1000
    assert session.method.counters()["light 0 doubtful pairs"] < 0.02 * rays


def test_more_is_tested_in_line_and_beside_with_several_lights():
    build = make_method("ray_grids", {}).build
    one, two, four, eight = (build.chosen(SPLIT_FROM, True, lights) for lights in (1, 2, 4, 8))
    assert (one.inline_rays, one.shares) == (24, 2)
    assert (four.inline_rays, four.shares, four.beside) == (48, 1, 4)
    assert (eight.inline_rays, eight.shares, eight.beside) == (48, 1, 8)
    assert (two.inline_rays, two.shares, two.part, one.part) == (24, 2, 256, 224)
    assert build.chosen(1, True, 4).inline_rays == 0
    assert build.chosen(SPLIT_FROM - 1, True, 4).inline_rays == 0
    assert build.chosen(1, False, 4).inline_rays == 24
    with pytest.raises(UserError, match="beside and shares must be in"):
        make_method("ray_grids", {"shares": "0"})
    with pytest.raises(UserError, match="beside and shares must be in"):
        make_method("visibility_buffer", {"beside": "-1"})
    for part in ("0", "257"):
        with pytest.raises(UserError, match=r"part must be in 1\.\.256"):
            make_method("ray_grids", {"part": part})


def test_what_a_triangle_tests_itself_is_chosen_from_the_number_of_triangles():
    build = make_method("ray_grids", {}).build
    few, some, many = (build.chosen(n, True) for n in (FEW_TRIANGLES // 2, SPLIT_FROM - 1, SPLIT_FROM))
    assert (few.inline_pixels, few.part, few.groups, few.shares) == (16, 192, "stream", 2)
    assert (some.inline_pixels, some.part, some.groups) == (32, 224, "stream")
    assert (many.inline_pixels, many.inline_rays, many.groups) == (32, 24, "split")
    assert build.chosen(FEW_TRIANGLES, True, 2).part == build.chosen(1, True, 2).part == 256
    assert build.chosen(1, False) == build.chosen(SPLIT_FROM, False) == replace(many, region="rays")
    assert build.chosen(FEW_TRIANGLES - 1, True).inline_pixels == 31
    assert build.chosen(MANY_TRIANGLES, True).inline_rays == 48
    assert build.chosen(MANY_TRIANGLES, False) == build.chosen(1, False)
    below = build.chosen(STREAM_BESIDE_BELOW - 1, True).streamed
    assert (below, build.chosen(STREAM_BESIDE_BELOW, True).streamed) == ("beside", "after")
    tiny, small = build.chosen(ONE_SHARE_BELOW - 1, True), build.chosen(ONE_SHARE_BELOW, True)
    assert (tiny.inline_pixels, tiny.shares, small.shares) == (8, 1, 2)


def test_a_region_from_the_triangles_is_chosen_where_pixels_are_many():
    build = make_method("ray_grids", {}).build
    assert build.chosen(10, True, 1, 10 * REGION_PIXELS + 1).region == "triangles"
    assert build.chosen(10, True, 1, 10 * REGION_PIXELS).region == "rays"
    assert build.chosen(10, True, 2, 1000).region == build.chosen(10, False, 1, 1000).region == "rays"


def test_cells_are_spaced_by_the_rays_of_several_lights():
    build = make_method("ray_grids", {}).build
    assert [build.chosen(10, True, lights).spacing for lights in (1, 2, 16)] == ["even", "rays", "rays"]
    assert build.chosen(10, False, 16).spacing == "even"
    even, spaced = (build.chosen(10**5, True, n).cells_along(10**5, 10**6, True) for n in (1, 2))
    assert even[1] > spaced[1] >= 0.7 * even[1]


def test_a_parameter_that_is_given_is_not_chosen():
    given = {
        "inline_pixels": "0",
        "inline_rays": "5",
        "beside": "3",
        "shares": "2",
        "part": "100",
        "region": "rays",
        "spacing": "even",
        "groups": "split",
        "streamed": "after",
    }
    build = make_method("ray_grids", given).build
    assert build.chosen(1, True, 9) == build
    with pytest.raises(UserError, match="must not be negative"):
        make_method("ray_grids", {"inline_rays": "-2"})
