"""Queues of the streams: their room, and counters that pass what 32 bits hold."""

import numpy as np
import pytest
import warp as wp
from helpers.small_scenes import assert_same, make_scene, soup, trace
from helpers.streams import on_gpu_side, trial
from shadowbench.harness.errors import CapacityRejected
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.effects import Limits
from shadowbench.harness.scene.prepared import Prepared
from shadowbench.harness.scene.scene import Camera
from shadowbench.methods.gpu.reserve import BEYOND, number_in, reserve
from shadowbench.methods.streams.queues import COUNTERS, UNDECIDED, more_room


def large_triangles() -> Prepared:
    return make_scene(*soup(3, 60, size=2.0), [(2.0, 3.0, 4.0)])


@on_gpu_side
def test_queues_grow_and_the_frame_is_repeated():
    tiny = trial(items=1, chunks=1, undecided=1, inline_rays=1, chunk=32)
    session, _, tight = trace("ray_grids", tiny, large_triangles(), 64, 64)
    assert session.regrown >= 1
    assert_same(tight, trace("ray_grids", {}, large_triangles(), 64, 64)[2])


@on_gpu_side
def test_a_need_beyond_the_memory_limit_is_rejected():
    with pytest.raises(CapacityRejected, match=r"needs .* work items"):  # the shadow bits fit
        trace("ray_grids", trial(items=1), large_triangles(), 16, 16, limits=Limits(memory=16 * 16))


@pytest.mark.parametrize("name", ["ray_grids", "visibility_buffer"])
def test_room_that_an_earlier_frame_lacked_is_noted(name, device):
    """Frames are replayed in a row, and asked of once: the last of them, in which nothing is in view, lacks none."""
    prepared = large_triangles()
    session = Session(make_method(name, trial(undecided=1)), prepared, 64, 64, device)
    away = Camera((0.0, 0.0, 50.0), (0.0, 0.0, 100.0), (0.0, 1.0, 0.0), 60.0)
    for moment in (prepared.moment(0, 64, 64), prepared.moment(0, 64, 64, away)):
        session.load(moment)
        session.replay()
    assert session.method.counters()["camera undecided pairs"] == 0
    assert session.overflowed()
    session.replay()
    assert not session.overflowed()


@wp.kernel(enable_backward=False)
def places_kernel(counts: wp.array(dtype=wp.int32), places: wp.array(dtype=wp.int32)):
    places[0] = number_in(counts, 0)
    places[1] = reserve(counts, 1, 3)


@pytest.mark.parametrize(
    ("before", "place"), [(7, 7), (BEYOND - 1, BEYOND - 1), (2**31 - 9, BEYOND), (-(2**31), BEYOND), (-5, BEYOND)]
)
def test_what_a_counter_past_31_bits_hands_out_lies_in_no_list(before, place, device):
    counts = wp.array([before, before], dtype=wp.int32, device=device)
    places = wp.zeros(2, dtype=wp.int32, device=device)
    wp.launch(places_kernel, dim=1, inputs=[counts], outputs=[places], device=device)
    assert (places.numpy().tolist(), counts.numpy().tolist()) == ([place, place], [before + 1, before + 3])


def test_a_counter_past_31_bits_is_no_small_need():
    needed = np.zeros((2, COUNTERS), dtype=np.int64)
    needed[1, UNDECIDED] = np.int32(-(2**31) + 5)
    with pytest.raises(CapacityRejected, match="2,147,483,653 undecided pairs"):
        more_room(needed, (1, 1, 1), 2**40)
