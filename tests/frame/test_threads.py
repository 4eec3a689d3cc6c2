"""Threads of a CPU: which pixels they take (``common/pixels.py``); parts of a pass run at the same time, give the same
bits, are told in the record, and lose nothing that they write to the same words (``gpu/entries.py``, ``reserve.py``).
"""

import functools
import gc
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from helpers.launched import launched
from helpers.small_scenes import assert_same, make_scene, soup
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.schedule.threads import at_once, cpu_threads, processors, ranges, threads_given
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.scene import Light, Spot
from shadowbench.methods.common.bands import ThreadRanges
from shadowbench.methods.common.pixels import pixel_of, thread_count
from shadowbench.methods.gpu.entries import raise_entry
from shadowbench.methods.gpu.reserve import number_among, raise_to
from shadowbench.methods.streams.cube.rectangle import EMPTY, LARGEST, RECTANGLE_WORDS, record_rays

WIDTH, HEIGHT = 21, 18
METHODS = (
    "ray_grids", "ray_grids.trial=region=triangles", "hybrid", "bvh2", "uniform_grid", "two_level_grid", "kdtree",
    "warp_bvh", "warp_bvh.update=bvh_rebuild",
)  # fmt: skip


def scene():
    vertices, faces = soup(40, 300, size=0.5)
    spot = Light((0.4, 2.5, 1.2), spot=Spot((-0.2, -1.0, -0.4), 30.0))
    return make_scene(vertices, faces, [spot, Light((3.0, 3.0, 3.0))])


@pytest.mark.parametrize("facing", [False, True])
@pytest.mark.parametrize("name", METHODS)
def test_the_answers_have_the_same_bits_with_every_number_of_threads(name, facing):
    name, _, setting = name.partition(".")
    prepared = prepare(replace(scene().scene, facing=facing))
    moment = prepared.moment(0, WIDTH, HEIGHT)
    expected = None
    for threads in (1, 2, 3):
        settings = {"threads": str(threads), **dict([setting.split("=", 1)] if setting else [])}
        session = Session(make_method(name, settings), prepared, WIDTH, HEIGHT, "cpu")
        for _ in range(3):  # the first in one thread, for kernels that have to be compiled
            got = session.answers(moment)
            expected = expected or got
            assert_same(got, expected, f"{threads} threads")
        assert session.method.built()["threads"] == threads
    assert (expected["triangle"] >= 0).any()
    assert expected["shadowed"].any(axis=1).all()


def test_parts_run_at_the_same_time_after_the_first_time():
    meeting = threading.Barrier(3)
    times = []

    def part():
        if len(times) >= 3:
            meeting.wait(timeout=20)
        times.append(threading.get_ident())

    launch = at_once([part, part, part])
    launch()
    assert len(set(times)) == 1
    launch()
    assert len(set(times[3:])) == 3


@pytest.mark.parametrize("order", [("fails", "late", "late"), ("quick", "fails", "late"), ("quick", "late", "fails")])
def test_an_error_is_raised_when_all_parts_have_ended(order):
    calls = []
    ended = []

    def part(kind):
        calls.append(kind)
        if len(calls) > len(order):  # not at first, in one thread
            if kind == "fails":
                raise ValueError("lost")
            if kind == "late":
                time.sleep(0.2)
            ended.append(kind)

    launch = at_once([functools.partial(part, kind) for kind in order])
    launch()
    with pytest.raises(ValueError, match="lost"):
        launch()
    assert sorted([*ended, "fails"]) == sorted(order)


@pytest.mark.parametrize("name", [*METHODS, "ray_grids.occluders=last", "visibility_buffer"])
def test_a_new_plan_frees_the_arrays_of_the_last_one_at_once(name):
    """Without the garbage collector, which counts objects, not their bytes."""
    name, _, setting = name.partition(".")
    prepared = scene()
    moment = prepared.moment(0, WIDTH, HEIGHT)
    session = Session(
        make_method(name, dict([setting.split("=", 1)] if setting else [])), prepared, WIDTH, HEIGHT, "cpu"
    )
    collecting = gc.isenabled()
    gc.disable()
    try:
        numbers = []
        for _ in range(3):
            session._plan()
            session.answers(moment)
            numbers.append(sum(isinstance(held, wp.array) for held in gc.get_objects()))
    finally:
        if collecting:
            gc.enable()
    assert len(set(numbers)) == 1


def test_the_number_of_threads():
    assert (cpu_threads(3, "cpu"), cpu_threads(0, "cpu")) == (3, min(16, processors()))
    assert (ranges(10, 3), ranges(2, 3), ranges(0, 3)) == ([(0, 3), (3, 3), (6, 4)], [(0, 1), (1, 1)], [])
    traced = make_method("uniform_grid", {"threads": "2"})
    assert (threads_given(traced.build, traced.trace), threads_given(None)) == (2, 1)
    with pytest.raises(UserError, match="threads must be 0"):
        make_method("ray_grids", {"threads": "-1"})


@wp.kernel(enable_backward=False)
def raise_kernel(first: wp.int32, words: wp.array(dtype=wp.uint64)):
    raise_entry(words, 0, wp.uint64(first + wp.tid()))


def test_a_word_that_another_thread_raises_meanwhile_keeps_the_greatest_value():
    word = wp.zeros(1, dtype=wp.uint64, device="cpu")
    greatest = 2**31 - 1

    def raise_often():
        wp.launch(raise_kernel, 10_000_000, [1], [word], device="cpu")

    def raise_once():
        time.sleep(0.001)
        wp.launch(raise_kernel, 1, [greatest], [word], device="cpu")

    both = at_once([raise_often, raise_once])
    for _ in range(4):
        word.zero_()
        both()
        assert word.numpy()[0] == greatest


@pytest.mark.parametrize(("width", "height"), [(1, 1), (8, 4), (21, 18), (300, 7)])
@pytest.mark.parametrize("threads", [1, 2, 3, 16])
def test_ranges_hold_every_thread_of_an_image_once(width, height, threads):
    session = Session(make_method("ray_grids"), scene(), width, height, "cpu")
    parts = ThreadRanges(session.frame, threads).parts
    held = [thread for part in parts for thread in range(part.first, part.first + part.number)]
    assert held == list(range(thread_count(width, height)))
    assert all(part.number and part.first % 32 == 0 for part in parts)
    assert len(parts) <= threads


@wp.kernel(enable_backward=False)
def pixels_kernel(width: wp.int32, height: wp.int32, taken: wp.array(dtype=wp.int32)):
    wp.atomic_add(taken, 1 + pixel_of(wp.tid(), width, height), 1)


@pytest.mark.parametrize(("width", "height"), [(1, 1), (8, 4), (21, 18), (300, 7)])
def test_every_pixel_has_one_thread(width, height):
    """The first entry is of threads beyond the image's edges."""
    (taken,) = launched(pixels_kernel, thread_count(width, height), [width, height], [1 + width * height])
    spare, *of_pixels = taken.tolist()
    assert (of_pixels, spare) == ([1] * (width * height), thread_count(width, height) - width * height)


ROWS = 64


@wp.kernel(enable_backward=False)
def place_kernel(
    first: wp.int32, numbers: wp.array(dtype=wp.int32), greatest: wp.array(dtype=wp.int32),
    words: wp.array2d(dtype=wp.int32),
):  # fmt: skip
    """In one of ROWS rows: numbers in a list; the greatest number; bounds of numbers that fall. Each changes a word."""
    k = first + wp.tid()
    row = k % wp.static(ROWS)
    number_among(numbers, row)
    raise_to(greatest, row, k)
    record_rays(words[row], -k, -k - 1, -k - 2, -k - 3, 0, k)


@pytest.mark.parametrize("last", [6_400_000, 2**30])
def test_what_threads_count_and_bound_at_the_same_time_is_not_lost(last):
    """One thread changes all words again and again. Another one begins a little later, with greater numbers: as many, or
    once for each row, after which nothing makes up for a word that was lost.
    """
    number = 6_400_000
    others = number if last == number else ROWS
    numbers, greatest = (wp.zeros(ROWS, dtype=wp.int32, device="cpu") for _ in range(2))
    words = wp.zeros((ROWS, int(RECTANGLE_WORDS)), dtype=wp.int32, device="cpu")

    def launch(first, count):
        wp.launch(place_kernel, count, [first], [numbers, greatest, words], device="cpu")

    def later():
        time.sleep(0.002)
        launch(last, others)

    both = at_once([functools.partial(launch, 0, number), later])
    for _ in range(8 if others == number else 30):
        numbers.zero_()
        greatest.zero_()
        words.fill_(int(EMPTY))
        words[:, int(LARGEST)].zero_()
        both()
        k = np.arange(last + others - ROWS, last + others, dtype=np.int32)
        k = k[np.argsort(k % ROWS)]
        assert numbers.numpy().tolist() == [(number + others) // ROWS] * ROWS
        np.testing.assert_array_equal(greatest.numpy(), k)
        expected = np.full((ROWS, int(RECTANGLE_WORDS)), int(EMPTY), dtype=np.int32)
        expected[:, :5] = np.stack([-k, -k - 1, -k - 2, -k - 3, 0 * k], axis=1)
        expected[:, int(LARGEST)] = k
        np.testing.assert_array_equal(words.numpy(), expected)
