"""Settings of a frame: what is chosen from its numbers of triangles, pixels and lights, and what a trial says instead."""

from dataclasses import replace

import pytest
from helpers.streams import trial
from helpers.table1_records import record, write_records
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.registry import make_method, present_settings
from shadowbench.harness.results import tidy
from shadowbench.methods.streams.constants import CONSTANTS as C
from shadowbench.methods.streams.settings import chosen

PIXELS = 1024 * 1024


def on_gpu(triangles: int, lights: int = 1, pixels: int = 1):
    return chosen(triangles, pixels, lights, cuda=True)


def test_more_is_tested_in_line_and_at_once_with_several_lights():
    one, two, four, eight = (on_gpu(C.split_from, lights) for lights in (1, 2, 4, 8))
    assert (one.inline_rays, one.shares) == (24, 2)
    assert (four.inline_rays, four.shares, four.lights_at_once) == (48, 1, 4)
    assert (eight.inline_rays, eight.shares, eight.lights_at_once) == (48, 1, 8)
    assert (two.inline_rays, two.shares, two.chunk, one.chunk) == (24, 2, 256, 224)
    assert chosen(1, 1, 4).inline_rays == 24


def test_what_a_triangle_tests_itself_is_chosen_from_the_number_of_triangles():
    few, some, many = (on_gpu(n) for n in (C.few_triangles // 2, C.split_from - 1, C.split_from))
    assert (few.inline_pixels, few.chunk, few.groups, few.shares) == (16, 192, "stream", 2)
    assert (some.inline_pixels, some.chunk, some.groups) == (32, 224, "stream")
    assert (many.inline_pixels, many.inline_rays, many.groups) == (32, 24, "split")
    assert on_gpu(C.few_triangles, 2).chunk == on_gpu(1, 2).chunk == 256
    on_cpu = [replace(chosen(n, 1), cells=many.cells) for n in (1, C.split_from, C.many_triangles)]
    assert on_cpu == [many] * 3
    assert on_gpu(C.few_triangles - 1).inline_pixels == 31
    assert on_gpu(C.many_triangles).inline_rays == 48
    assert (on_gpu(C.overlap_below - 1).overlaps, on_gpu(C.overlap_below).overlaps) == (True, False)
    tiny, small = on_gpu(C.one_share_below - 1), on_gpu(C.one_share_below)
    assert (tiny.inline_pixels, tiny.shares, small.shares) == (8, 1, 2)


def test_a_region_from_the_triangles_is_chosen_where_pixels_are_many():
    assert on_gpu(10, 1, 10 * C.region_pixels + 1).region == "triangles"
    assert on_gpu(10, 1, 10 * C.region_pixels).region == "rays"
    assert on_gpu(10, 2, 1000).region == chosen(10, 1000).region == "rays"


def test_cells_are_spaced_by_the_rays_of_several_lights():
    assert [on_gpu(10, lights).spacing for lights in (1, 2, 16)] == ["even", "rays", "rays"]
    assert chosen(10, 1, 16).spacing == "even"
    even, spaced = (on_gpu(10**5, n, 10**6).cells for n in (1, 2))
    assert even[1] > spaced[1] >= 0.7 * even[1]


def test_cells_are_chosen_from_the_numbers_of_triangles_and_of_pixels():
    of = {n: on_gpu(n, 1, PIXELS).cells for n in (4096, PIXELS // 4, PIXELS, 9 * PIXELS)}
    assert of == {4096: (152, 256, 4), PIXELS // 4: (448, 1024, 4), PIXELS: (536, 1536, 4), 9 * PIXELS: (920, 1536, 4)}
    assert on_gpu(82_298, 1, 16 * PIXELS).cells == (1056, 1752, 4)
    assert on_gpu(10**8, 1, 2**24).cells == (3328, 4096, 4)
    assert chosen(1, 1).cells == (64, 64, 1)


def test_a_trial_stands_in_place_of_what_is_chosen():
    given = trial(
        inline_pixels=0, inline_rays=5, lights_at_once=3, shares=2, chunk=100, region="rays", spacing="even",
        groups="split", overlaps="false", cells=8,
    )  # fmt: skip
    build = make_method("ray_grids", given).build
    settings = chosen(1, 1, 9, True, build.given())
    assert all(getattr(settings, name) == value for name, value in build.given().items())
    assert settings.cells == (8, 8, 1)
    assert settings.inline_cells == C.inline_cells


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("shares=0", "shares must be in 1..16"),
        ("chunk=257", "chunk must be in 1..256"),
        ("cells=12", "cells must be a multiple of 8"),
        ("inline_rays=-2", "inline_rays must be in 0.."),
        ("region=left", "region must be one of rays, triangles"),
        ("overlaps=maybe", "overlaps must be true or false"),
        ("queue=always", "trial must be NAME=VALUE, joined by .*, with names of cells, inline_pixels"),
        ("cells", "cells must be in 8..8192"),
    ],
)
@pytest.mark.parametrize("method", ["ray_grids", "visibility_buffer"])
def test_another_trial_is_refused_in_one_line(method, text, said):
    with pytest.raises(UserError, match=said) as error:
        make_method(method, {"trial": text})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("former", "present"),
    [
        ({}, {}),
        ({"queue": "auto", "cells": "0", "beside": "-1", "region": "auto"}, {}),
        ({"queue": "always"}, {"queue": "always"}),
        ({"region": "rays", "threads": "2"}, {"threads": "2", "trial": "region=rays"}),
        ({"part": "64", "streamed": "after"}, {"trial": "chunk=64+overlaps=false"}),
        ({"trial": "region=rays", "occluders": "last"}, {"occluders": "last", "trial": "region=rays"}),
    ],
)
def test_a_record_with_former_settings_has_the_present_ones(former, present):
    assert present_settings("ray_grids", former) == present
    make_method("ray_grids", {key: text for key, text in present.items() if key != "queue"})


def test_a_record_is_read_with_the_present_settings(tmp_path):
    """As any tool reads it: what was measured with ``region=rays`` stands in a table beside what is measured now."""
    made = record("fairy", "embree")
    made["method"].update(name="ray_grids", settings={"region": "rays"})
    table = tidy(write_records(tmp_path, [made]))
    assert table["settings"].unique() == ["trial region=rays"]
