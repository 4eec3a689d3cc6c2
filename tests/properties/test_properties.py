"""Relations that answers must keep, on drawn lattice examples: one is a mesh, a camera and lights with at least 64
rays, traced by every method under drawn settings.

Hypothesis draws bytes that :mod:`lattice_examples` decodes; CI derives them from the test's own name, so that runs
agree. The long random mode is ``make fuzz``.
"""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from random import Random

import numpy as np
import pytest
from helpers.drawn_examples import CULLED, EXAMPLES, assert_same, exact_hits, some, traced
from helpers.lattice_examples import LENGTH, METHODS, Example, answers_of, decode, fresh_method, true_errors
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray
from shadowbench.harness.frame.registry import method_class
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.case import HardCase
from shadowbench.harness.hardcases.judge import Judged, same_bits
from shadowbench.harness.judge.verdict import Verdict
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.scene import Geometry, Spot
from shadowbench.harness.scene.width import Sizes, is_wide


@some(60)
@given(CULLED)
def test_every_method_answers_exactly(example: Example) -> None:
    """Under drawn settings no method has a true error; a knob meant for speed therefore changes no answer."""
    assert example.size[0] * example.size[1] >= 64
    assert true_errors(example) == {}


@some(30)
@given(EXAMPLES)
def test_exact_methods_agree_bit_for_bit(example: Example) -> None:
    found = traced(example)
    for name in METHODS[1:]:
        for key in ("triangle", "t", "u", "v", "shadowed"):
            # Adding 0 makes a zero positive: methods differ in the sign of a weight of zero.
            assert same_bits(found[name][key] + 0, found[METHODS[0]][key] + 0), (name, key)


def transformed(
    example: Example, place: Callable[[NDArray], NDArray], way: Callable[[NDArray], NDArray] = np.asarray
) -> Example:
    """The example with every position mapped by ``place``, and the camera's up by ``way``."""
    camera = example.camera
    eye, target = (tuple(place(np.asarray(p)).tolist()) for p in (camera.eye, camera.target))
    seen = replace(camera, eye=eye, target=target, up=tuple(way(np.asarray(camera.up)).tolist()))
    return replace(example, points=place(example.points), lights=place(example.lights), camera=seen)


@some(20)
@given(EXAMPLES, st.sampled_from([-20, -7, 7, 20]))
def test_a_power_of_two_changes_t_only_by_it(example: Example, power: int) -> None:
    one, other = traced(example), traced(transformed(example, lambda p: p * 2.0**power))
    assert_same(one, other, ("triangle", "u", "v", "shadowed"))
    for name in METHODS:
        np.testing.assert_array_equal(other[name]["t"], one[name]["t"] * np.float32(2.0**power))


@some(20)
@given(EXAMPLES, st.sampled_from([1, 2]))
def test_cycling_the_axes_changes_nothing(example: Example, turn: int) -> None:
    """Sums run in another order, so only what is exact must agree: triangles, bits, and t to its last place."""

    def turned(p: NDArray) -> NDArray:
        return np.roll(p, turn, axis=-1)

    one, other = traced(example), traced(transformed(example, turned, turned))
    assert_same(one, other, ("triangle", "shadowed"))
    for name in METHODS:
        np.testing.assert_allclose(other[name]["t"], one[name]["t"], rtol=2**-23)


@some(20)
@given(EXAMPLES)
def test_mirroring_turns_the_image_over(example: Example) -> None:
    """Mirrored along the image's right axis: every row of pixels runs the other way."""
    forward = np.subtract(example.camera.target, example.camera.eye)
    sign = np.ones(3)
    sign[np.abs(np.cross(forward, example.camera.up)).argmax()] = -1.0
    one, other = traced(example), traced(transformed(example, lambda p: p * sign))
    width, height = example.size
    for name in METHODS:
        for key in ("triangle", "shadowed"):
            flipped = other[name][key].reshape(-1, height, width)[:, :, ::-1].reshape(one[name][key].shape)
            np.testing.assert_array_equal(flipped, one[name][key], name)


@some(20)
@given(EXAMPLES, st.tuples(st.floats(0.1, 6.0), st.floats(0.1, 6.0)), st.sampled_from([0.0, 100.0]))
def test_turning_and_moving_changes_only_what_rounding_excuses(
    example: Example, angles: tuple[float, float], offset: float
) -> None:
    """The moved scene is answered exactly; held against the exact answers from before it was moved, whatever differs
    is a tie, or lies within the bound of an edge.
    """
    (ca, cb), (sa, sb) = np.cos(angles), np.sin(angles)
    turn = np.array([[ca, -sa, 0], [sa, ca, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, cb, -sb], [0, sb, cb]])
    step = offset * np.array([0.48, 0.6, 0.64])
    other = transformed(example, lambda p: p @ turn.T + step, lambda up: turn @ up)
    assert true_errors(other) == {}
    referee, hits = exact_hits(example.trial())
    given_ = answers_of(other, METHODS[0])["triangle"]
    wrong = np.nonzero(np.isin(referee.classify_primary(hits, given_), (Verdict.TRUE, Verdict.INVALID)))[0]
    assert not len(wrong), (wrong[:5], given_[wrong[:5]], hits.triangle[wrong[:5]])


EXAMPLES_FOUND = Path(__file__).parents[1] / "data" / "examples"
PINHOLE, DIAGONAL = (
    Example.thawed(json.loads((EXAMPLES_FOUND / f"{name}.json").read_text())) for name in ("pinhole", "diagonal")
)
"""A ray leaves the mesh beside a vertex by 4e-16: two equal triangles are hit in float64, none in exact arithmetic. And
one passes the diagonal of a rectangle: both triangles are hit in float64, one in exact arithmetic.
"""


@some(20)
@given(EXAMPLES, st.randoms(use_true_random=False))
@example(PINHOLE, Random(0))
@example(DIAGONAL, Random(1))
def test_permuting_triangles_changes_ids_up_to_ties(drawn: Example, random) -> None:
    """t and shadow bits stay as they are, bit for bit; an id may change among triangles hit at the same t.

    Where a ray passes an edge within rounding those triangles may be hit in float64 without being hit in exact arithmetic.
    """
    order = np.array(random.sample(range(len(drawn.faces)), len(drawn.faces)))
    permuted = replace(drawn, faces=drawn.faces[order])
    one, other = traced(drawn), traced(permuted)
    referee, hits = exact_hits(drawn.trial())
    for name in METHODS:
        np.testing.assert_allclose(other[name]["t"], one[name]["t"], rtol=2**-28, err_msg=name)
        ids = np.where(other[name]["triangle"] >= 0, order[other[name]["triangle"]], -1)
        changed = ids != one[name]["triangle"]
        verdicts = [referee.classify_primary(hits, found) for found in (one[name]["triangle"], ids)]
        at_edge = np.any(np.array(verdicts) == Verdict.EDGE, axis=0)
        assert all(len(hits.ties[i]) > 1 or at_edge[i] for i in np.nonzero(changed)[0]), name
        same = ~changed
        np.testing.assert_array_equal(other[name]["shadowed"][:, same], one[name]["shadowed"][:, same], name)


def wide(example: Example) -> bool:
    trial = example.trial()
    return is_wide(trial.moment, Sizes(trial.moment.points, trial.prepared.faces, trial.moment.valid))


@some(20)
@given(EXAMPLES, st.binary(min_size=60, max_size=200).map(decode))
def test_adding_triangles_brings_nothing_to_light(example: Example, more: Example) -> None:
    """Where the closest hit stays the same, a shadowed point stays shadowed; and no hit moves away."""
    added = example.with_geometry(
        np.concatenate([example.points, more.points]), np.concatenate([example.faces, more.faces + len(example.points)])
    )
    if added.trial().prepared.centre.any() or example.trial().prepared.centre.any():
        return  # recentring by another point rounds the mesh anew
    if wide(added) != wide(example):
        return  # a ray within float64's bound of a vertex hits it in an ordinary frame, in a wide one only if it is so
    one, other = traced(example), traced(added)
    for name in METHODS:
        assert (other[name]["t"] <= one[name]["t"]).all(), name
        same = other[name]["triangle"] == one[name]["triangle"]
        lit_again = (one[name]["shadowed"] == 1) & (other[name]["shadowed"] == 0) & same
        assert not lit_again.any(), name


@some(20)
@given(EXAMPLES, st.lists(st.binary(min_size=20, max_size=80), min_size=1, max_size=2))
def test_a_frame_built_again_equals_a_fresh_scene(example: Example, others: list[bytes]) -> None:
    """Frames of other geometry, eyes and lights run before it leave nothing behind."""
    random = np.random.default_rng(len(others[0]))
    frames = [example.points]
    for data in others:
        moved = decode(data)
        rolled = np.resize(moved.points, example.points.shape) if len(moved.points) else example.points
        frames.append(rolled * random.choice([1.0, 0.25]))
    geometry = Geometry(example.faces, lambda k: frames[k], len(frames))
    prepared = prepare(replace(example.trial().prepared.scene, geometry=lambda: geometry))
    order = [0, *range(1, len(frames)), 0]
    for name in METHODS:
        chosen = tuple(example.settings[name].items())
        session = Session(fresh_method(name, chosen), prepared, *example.size, "cpu")
        for k in order:
            moment = prepared.moment(k, *example.size)
            fresh = Session(fresh_method(name, chosen), prepared, *example.size, "cpu")
            expected, got = fresh.answers(moment), session.answers(moment)
            for key, values in expected.items():
                assert same_bits(got[key], values), (name, k, key)


@some(20)
@given(EXAMPLES, st.integers(2, 4))
def test_lights_at_one_place_agree(example: Example, count: int) -> None:
    light = example.lights[:1]
    together = replace(example, lights=np.concatenate([example.lights, np.repeat(light, count - 1, axis=0)]))
    for name, answers in traced(together).items():
        for other in range(len(example.lights), len(together.lights)):
            np.testing.assert_array_equal(answers["shadowed"][other], answers["shadowed"][0], name)


@some(20)
@given(EXAMPLES, st.sampled_from([(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.3, 0.2, -0.9)]))
def test_a_spot_of_the_whole_sphere_is_a_point_light(example: Example, direction: tuple[float, float, float]) -> None:
    """A cone with a half-angle of 180 degrees leaves no receiver out, whatever it points at."""
    prepared = example.trial().prepared
    lights = prepared.scene.lights
    spots = tuple(replace(light, spot=Spot(direction, 180.0)) for light in lights)
    able = [name for name in METHODS if "receivers" in method_class(name).simulates]
    assert able
    for name in able:
        chosen = tuple(example.settings[name].items())
        found = []
        for shining in (lights, spots):
            scene = replace(prepared.scene, lights=shining)
            session = Session(fresh_method(name, chosen), prepare(scene), *example.size, "cpu")
            found.append(session.answers(session.frame.prepared.moment(0, *example.size)))
        for key, values in found[0].items():
            assert same_bits(found[1][key], values), (name, key)


@some(20)
@given(EXAMPLES)
def test_a_crop_equals_its_window(example: Example) -> None:
    """The middle half of an 16 x 16 image, and the same window as an image of its own, by its own camera."""
    whole = replace(example, size=(16, 16))
    half = np.tan(np.radians(example.camera.fov) / 2) / 2
    camera = replace(example.camera, fov=float(np.degrees(2 * np.arctan(half))))
    window = replace(example, size=(8, 8), camera=camera)
    rays = whole.trial().moment.directions(np.arange(256)).reshape(16, 16, 3)[4:12, 4:12].reshape(-1, 3)
    np.testing.assert_array_equal(rays, window.trial().moment.directions(np.arange(64)))
    one, other = traced(whole), traced(window)
    for name in METHODS:
        for key in ("triangle", "t", "u", "v"):
            middle = one[name][key].reshape(16, 16)[4:12, 4:12].ravel()
            assert same_bits(np.ascontiguousarray(middle), other[name][key]), (name, key)
        bits = one[name]["shadowed"].reshape(-1, 16, 16)[:, 4:12, 4:12].reshape(-1, 64)
        np.testing.assert_array_equal(bits, other[name]["shadowed"], name)


def test_examples_are_worth_drawing() -> None:
    """Rays hit, tie at vertices and edges, and are shadowed, in a good share of examples."""
    random = np.random.default_rng(1)
    pixels = hits = ties = shadowed = 0
    for _ in range(40):
        trial = decode(random.bytes(LENGTH)).trial()
        one = Judged(HardCase("example", "", "", lambda trial=trial: trial), trial)
        found, count = exact_hits(trial)[1], trial.moment.width * trial.moment.height
        pixels += count
        hits += int((found.triangle >= 0).sum())
        ties += sum(len(one) > 1 for one in found.ties)
        shadowed += int(one.exact["shadowed"].sum())
    assert hits > 0.25 * pixels
    assert ties > 0.1 * hits
    assert 0.1 * hits < shadowed < 2 * hits


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("data", [b"", b"\xff" * LENGTH, bytes(range(256)) * 2], ids=["zeros", "ones", "count"])
def test_any_bytes_are_an_example_and_freeze_exactly(data: bytes, closed: bool) -> None:
    example = decode(data, closed=closed)
    assert (example.bodies is not None) or not closed
    assert np.isfinite(example.points).all()
    assert (np.abs(example.points) < 2.0**60).all()
    np.testing.assert_array_equal(example.points.astype(np.float32).astype(np.float64), example.points)
    again = Example.thawed(example.frozen())
    np.testing.assert_array_equal(again.points, example.points)
    np.testing.assert_array_equal(again.faces, example.faces)
    np.testing.assert_array_equal(again.lights, example.lights)
    assert again.camera == example.camera
    assert (again.size, again.settings) == (example.size, example.settings)
    assert again.bodies is None or again.bodies.tolist() == example.bodies.tolist()
