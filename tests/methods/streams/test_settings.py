"""Settings of a frame: what is chosen from its numbers of triangles, pixels and lights, and what a trial says instead."""

from dataclasses import replace

import pytest
from helpers.experiment_records import record, write_records
from helpers.streams import trial
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.registry import make_method, present_settings
from shadowbench.harness.results import tidy
from shadowbench.methods.streams.settings import CONSTANTS as C
from shadowbench.methods.streams.settings import chosen

PIXELS = 1024 * 1024

CHOSEN = [
    # triangles, lights, pixels, what is chosen on a GPU
    (C.split_from, 1, 1, {"inline_rays": 24, "shares": 2, "chunk": 224, "inline_pixels": 32, "groups": "split"}),
    (C.split_from, 2, 1, {"inline_rays": 24, "shares": 2, "chunk": 256}),
    (C.split_from, 4, 1, {"inline_rays": 48, "shares": 1, "lights_at_once": 4}),
    (C.split_from, 8, 1, {"inline_rays": 48, "shares": 1, "lights_at_once": 8}),
    (C.split_from - 1, 1, 1, {"inline_pixels": 32, "chunk": 224, "groups": "stream"}),
    (C.few_triangles // 2, 1, 1, {"inline_pixels": 16, "chunk": 192, "groups": "stream", "shares": 2}),
    (C.few_triangles - 1, 1, 1, {"inline_pixels": 31}),
    (C.few_triangles, 2, 1, {"chunk": 256}),
    (1, 2, 1, {"chunk": 256}),
    (C.many_triangles, 1, 1, {"inline_rays": 48}),
    (C.overlap_below - 1, 1, 1, {"overlaps": True}),
    (C.overlap_below, 1, 1, {"overlaps": False}),
    (C.one_share_below - 1, 1, 1, {"inline_pixels": 8, "shares": 1}),
    (C.one_share_below, 1, 1, {"shares": 2}),
    (10, 1, 10 * C.region_pixels + 1, {"region": "triangles", "spacing": "even"}),
    (10, 1, 10 * C.region_pixels, {"region": "rays"}),
    (10, 2, 1000, {"region": "rays", "spacing": "rays"}),
    (4096, 1, PIXELS, {"cells": (152, 256, 4)}),
    (PIXELS // 4, 1, PIXELS, {"cells": (448, 1024, 4)}),
    (PIXELS, 1, PIXELS, {"cells": (536, 1536, 4)}),
    (9 * PIXELS, 1, PIXELS, {"cells": (920, 1536, 4)}),
    (82_298, 1, 16 * PIXELS, {"cells": (1056, 1752, 4)}),
    (10**8, 1, 2**24, {"cells": (3328, 4096, 4)}),
]


@pytest.mark.parametrize(("triangles", "lights", "pixels", "expected"), CHOSEN)
def test_settings_are_chosen_from_what_a_frame_holds(triangles, lights, pixels, expected):
    settings = chosen(triangles, pixels, lights, cuda=True)
    assert {name: getattr(settings, name) for name in expected} == expected


def test_on_a_cpu_only_the_cells_depend_on_it():
    of = [chosen(triangles, 1, lights) for triangles in (1, C.split_from, C.many_triangles) for lights in (1, 4)]
    assert {replace(one, cells=(0, 0, 0), chunk=0) for one in of} == {replace(of[0], cells=(0, 0, 0), chunk=0)}
    assert (of[0].inline_rays, of[0].spacing, of[0].region, of[0].cells) == (24, "even", "rays", (64, 64, 1))
    even, spaced = (chosen(10**5, 10**6, lights, cuda=True).cells for lights in (1, 2))
    assert even[1] > spaced[1] >= 0.7 * even[1]


def test_a_trial_stands_in_place_of_what_is_chosen():
    given = dict(inline_pixels=0, inline_rays=5, lights_at_once=3, shares=2, chunk=100, region="rays", spacing="even")
    build = make_method("ray_grids", trial(**given, groups="split", overlaps="false", cells=8)).build
    settings = chosen(1, 1, 9, True, build.given())
    expected = {**given, "groups": "split", "overlaps": False, "cells": (8, 8, 1), "inline_cells": C.inline_cells}
    assert {name: getattr(settings, name) for name in expected} == expected


@pytest.mark.parametrize(("text", "said"), [
    ("shares=0", "shares must be in 1..16"), ("chunk=257", "chunk must be in 1..256"),
    ("cells=12", "cells must be a multiple of 8"), ("inline_rays=-2", "inline_rays must be in 0.."),
    ("region=left", "region must be one of rays, triangles"), ("overlaps=maybe", "overlaps must be true or false"),
    ("queue=always", "trial must be NAME=VALUE, joined by .*, with names of cells, inline_pixels"),
    ("cells", "cells must be in 8..8192"),
])  # fmt: skip
def test_another_trial_is_refused_in_one_line(text, said):
    with pytest.raises(UserError, match=said):
        make_method("visibility_buffer", {"trial": text})


@pytest.mark.parametrize(("former", "present"), [
    ({}, {}),
    ({"queue": "auto", "cells": "0", "beside": "-1", "region": "auto"}, {}),
    ({"queue": "always"}, {"queue": "always"}),
    ({"region": "rays", "threads": "2"}, {"threads": "2", "trial": "region=rays"}),
    ({"part": "64", "streamed": "after"}, {"trial": "chunk=64+overlaps=false"}),
    ({"trial": "region=rays", "occluders": "last"}, {"occluders": "last", "trial": "region=rays"}),
])  # fmt: skip
def test_a_record_with_former_settings_has_the_present_ones(former, present):
    assert present_settings("ray_grids", former) == present
    make_method("ray_grids", {key: text for key, text in present.items() if key != "queue"})


def test_a_record_is_read_with_the_present_settings(tmp_path):
    """As any tool reads it: what was measured with ``region=rays`` stands in a table beside what is measured now."""
    made = record("fairy", "embree")
    made["method"].update(name="ray_grids", settings={"region": "rays"})
    table = tidy(write_records(tmp_path, [made]))
    assert table["settings"].unique() == ["trial region=rays"]
