"""What a scene does not call for is not simulated: launch lists, memory, neutral values, and frames in part."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
import warp as wp
from brute_force import soup
from method_trials import DEVICES
from shadowbench.harness import frame as frame_module
from shadowbench.harness import passes, receivers
from shadowbench.harness.method import BaseMethod
from shadowbench.harness.moment import Prepared
from shadowbench.harness.pass_graph import builds, live, stale, steps
from shadowbench.harness.passes import Pass
from shadowbench.harness.registry import make_method, method_names
from shadowbench.harness.scene import Camera, Effects, Geometry, Light, Scene, Spot
from shadowbench.harness.score import Judge
from shadowbench.harness.session import Session
from shadowbench.harness.timing import Memory

SIZE = 40, 32
EYE = Camera((0.0, 0.6, 3.0), (0.0, 0.0, 0.0))
POINT = Light((1.5, 3.0, 1.0))
BEHIND = Light((0.5, -0.2, -4.0))
SPOT = replace(POINT, spot=Spot((-1.5, -3.0, -1.0), 12.0))
LAMPS = {
    "bvh rebuilt in place": ("bvh", {"update": "bvh_rebuild"}),
    "grids clamped to the scene": ("perspective_spherical", {"clamp": "scene"}),
    **{name: (name, {}) for name in method_names()},
}
EXACT = [
    "uniform_grid", "bvh rebuilt in place", "perspective_spherical", "ray_grids", "grids clamped to the scene",
]  # fmt: skip


def scene(lights=(POINT, BEHIND), **changed) -> Prepared:
    """Triangles over a floor, two frames, under ``lights``."""
    vertices, faces = soup(4, 60)
    floor = np.array([[-4, -1.2, -4], [4, -1.2, -4], [4, -1.2, 4], [-4, -1.2, 4]], dtype=np.float64)
    faces = np.concatenate([faces, np.array([[0, 2, 1], [0, 3, 2]]) + len(vertices)])
    vertices = np.concatenate([vertices, floor])
    move = np.linspace(0.0, 0.1, len(vertices))[:, None]
    made = Geometry(faces.astype(np.int32), lambda k: vertices + k * move, 2)
    return Prepared(Scene("effects", "effects", lambda: made, EYE, tuple(lights), **changed))


def session_of(label: str, prepared: Prepared, device: str = "cpu") -> Session:
    name, settings = LAMPS[label]
    method = make_method(name, settings)
    reason = method.applies(prepared.scene, device)
    if reason:
        pytest.skip(f"{label}: {reason}")
    return Session(method, prepared, *SIZE, device)


def names(session: Session) -> list[str]:
    return [work.name for work in session.all_passes]


def launches(session: Session, monkeypatch: pytest.MonkeyPatch) -> list[tuple[str | None, str]]:
    """(effect of its pass, kernel) of every kernel launched in one frame, in order."""
    seen: list[tuple[str | None, str]] = []
    at: list[str | None] = [None]

    def counting(launch):
        def counted(kernel, *args, **kwargs):
            seen.append((at[0], kernel.key.rsplit(".", 1)[-1]))
            return launch(kernel, *args, **kwargs)

        return counted

    with monkeypatch.context() as patch:
        patch.setattr(wp, "launch", counting(wp.launch))
        patch.setattr(wp, "launch_tiled", counting(wp.launch_tiled))
        for work in session.passes:
            at[0] = work.effect
            work.run()
    return seen


def effect_free(kernels: list[tuple[str | None, str]], effects: set[str]) -> list[str]:
    return [kernel for effect, kernel in kernels if effect not in effects]


# --- (1) the launch list without an effect is the list with it, minus exactly its passes ------------------------

WITHOUT = {
    # effect: scene with it, scene without it, the tags of its passes
    "shadows of light 0": ({}, {"lights": (replace(POINT, shadows=False), BEHIND)}, {"shadows/0"}),
    "any shadows": (
        {},
        {"lights": (replace(POINT, shadows=False), replace(BEHIND, shadows=False))},
        {"shadows", "shadows/0", "shadows/1"},
    ),
    "receivers by facing": ({"facing": True}, {}, {"receivers"}),
    "receivers of a spot": ({"lights": (SPOT, BEHIND)}, {}, {"receivers"}),
    "mirrors": (
        {
            "mirror": lambda geometry: np.ones(len(geometry.faces), dtype=np.uint8),
            "bounces": 2,
            "facing": True,
        },
        {"facing": True},
        {"mirror"},
    ),
    "colour": ({"outputs": ("ids", "shadows", "color")}, {"outputs": ("ids", "shadows")}, {"color"}),
    "a directional light": ({"lights": (replace(POINT, directional=True), BEHIND)}, {}, set()),
}


def assert_only_its_passes(label: str, effect: str, monkeypatch: pytest.MonkeyPatch) -> None:
    on, off, tags = WITHOUT[effect]
    with_it, without = session_of(label, scene(**on)), session_of(label, scene(**off))
    assert names(without) == [work.name for work in with_it.all_passes if work.effect not in tags]
    assert any(work.effect in tags for work in with_it.all_passes) == bool(tags)
    for session, prepared in ((with_it, scene(**on)), (without, scene(**off))):
        session.load(prepared.moment(0, *SIZE))
        session.settle()
    counted = launches(with_it, monkeypatch), launches(without, monkeypatch)
    assert effect_free(counted[0], tags) == effect_free(counted[1], set())


@pytest.mark.parametrize("label", LAMPS)
@pytest.mark.parametrize("effect", WITHOUT)
def test_launch_list_without_an_effect(label, effect, monkeypatch):
    assert_only_its_passes(label, effect, monkeypatch)


# --- (2) memory -------------------------------------------------------------------------------------------------


def planned_bytes(label: str, prepared: Prepared) -> int:
    memory = Memory()
    memory.start()
    session = session_of(label, prepared)
    held = memory.peak()
    memory.pause()
    assert session.all_passes
    return held


class NeverHeard(frame_module.Frame):
    """A frame that has no arrays for effects: one empty array, made before anything is counted, stands for them."""

    nothing = None

    def __setattr__(self, name, value):
        if name in ("receivers", "reached"):
            value = NeverHeard.nothing[value.ndim]
        super().__setattr__(name, value)


def assert_no_bytes(label: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from shadowbench.harness import session as session_module

    plain = planned_bytes(label, scene())
    NeverHeard.nothing = {1: wp.zeros(0, dtype=wp.int32), 2: wp.zeros((0, 0), dtype=wp.uint8)}
    with monkeypatch.context() as patch:
        patch.setattr(session_module, "Frame", NeverHeard)
        patch.setattr(session_module, "receiver_passes", lambda frame, effects: [])
        patch.setattr(session_module, "skippable", lambda passes, frame, effects: passes)
        assert planned_bytes(label, scene()) == plain


@pytest.mark.parametrize("label", LAMPS)
def test_memory_is_that_of_a_build_that_never_heard_of_effects(label, monkeypatch):
    assert_no_bytes(label, monkeypatch)


@pytest.mark.parametrize("label", LAMPS)
def test_a_light_without_shadows_takes_no_memory(label):
    lit = (replace(POINT, shadows=False), replace(BEHIND, shadows=False))
    only = planned_bytes(label, scene(lights=lit, outputs=("depth", "ids")))
    unlit = planned_bytes(label, scene(lights=lit))
    assert only == unlit
    assert unlit <= planned_bytes(label, scene())


# --- (4) neutral values give the same bits ----------------------------------------------------------------------

NEUTRAL = {
    "a spot of 4 pi": {"lights": (replace(POINT, spot=Spot((0, -1, 0), 180.0)), BEHIND)},
    "a fall-off": {"lights": (replace(POINT, spot=Spot((0, -1, 0), 180.0, falloff=1.0)), BEHIND)},
    "a light of no intensity": {"lights": (replace(POINT, intensity=0.0), BEHIND)},
    "one more light without shadows": {
        "lights": (POINT, BEHIND, replace(POINT, shadows=False, intensity=0.0))
    },
}


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("label", LAMPS)
@pytest.mark.parametrize("neutral", NEUTRAL)
def test_a_neutral_value_changes_no_bit(label, neutral, device):
    plain, changed = scene(), scene(**NEUTRAL[neutral])
    some = session_of(label, plain, device).answers(plain.moment(0, *SIZE))
    other = session_of(label, changed, device).answers(changed.moment(0, *SIZE))
    for name in some:
        np.testing.assert_array_equal(some[name], other[name][: len(some[name])])


# --- rules that people get wrong --------------------------------------------------------------------------------


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("facing", [False, True])
@pytest.mark.parametrize("label", EXACT)
def test_receivers_are_the_same_for_every_method_and_truth(label, facing, device):
    prepared = scene((SPOT, BEHIND, Light((0.2, 1.0, 0.3), directional=True)), facing=facing)
    moment = prepared.moment(0, *SIZE)
    judge = Judge(prepared, moment)
    answers = session_of(label, prepared, device).answers(moment)
    score = judge.score(answers)
    assert score["true_errors"] == 0
    wanted = session_of(EXACT[0], prepared, device).answers(moment)
    for name in wanted:
        np.testing.assert_array_equal(answers[name], wanted[name])
    # Of t and weights another device may round the last place differently.
    elsewhere = session_of(EXACT[0], prepared, "cpu").answers(moment)
    for name in ("triangle", "visibility"):
        np.testing.assert_array_equal(answers[name], elsewhere[name])
    assert answers["visibility"].any(axis=1).all()


def test_bits_where_nothing_receives_are_errors():
    prepared = scene((SPOT,), facing=True)
    moment = prepared.moment(0, *SIZE)
    answers = session_of("uniform_grid", prepared).answers(moment)
    plain = scene((POINT,)).moment(0, *SIZE)
    unlimited = session_of("uniform_grid", scene((POINT,))).answers(plain)
    assert (unlimited["visibility"] > answers["visibility"]).any()
    assert Judge(prepared, moment).score(unlimited)["true_errors"] > 0


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("label", LAMPS)
def test_a_light_that_reaches_nothing_is_skipped(label, device, monkeypatch):
    away = Light((0.0, 5.0, 0.0), spot=Spot((0.0, 1.0, 0.0), 10.0))
    prepared = scene((away, BEHIND))
    session = session_of(label, prepared, device)
    answers = session.answers(prepared.moment(0, *SIZE))
    assert not answers["visibility"][0].any()
    seen = launches(session, monkeypatch)
    assert not [kernel for effect, kernel in seen if effect == "shadows/0"]
    assert [kernel for effect, kernel in seen if effect == "shadows/1"] or label == "embree"


@pytest.mark.parametrize("label", LAMPS)
def test_a_light_without_shadows_has_no_pass(label):
    session = session_of(label, scene((POINT, replace(BEHIND, shadows=False))))
    assert not [name for name in names(session) if "light 1" in name]


@pytest.mark.parametrize("label", LAMPS)
def test_without_shadow_bits_wanted_no_light_has_a_pass(label):
    session = session_of(label, scene(outputs=("depth",)))
    assert {work.part for work in session.all_passes} <= {"build", "trace"}


def test_a_directional_light_is_the_limit_of_a_far_one():
    way = (0.3, 1.0, 0.2)
    prepared = scene((Light(way, directional=True),))
    wanted = session_of("uniform_grid", prepared).answers(prepared.moment(0, *SIZE))
    far = scene((Light(tuple(1e9 * x for x in way)),))
    got = session_of("uniform_grid", far).answers(far.moment(0, *SIZE))
    np.testing.assert_array_equal(wanted["visibility"], got["visibility"])
    point = prepared.moment(0, *SIZE).lights[0].astype(np.float64)
    corners = prepared.points(0)[0].astype(np.float64)
    np.testing.assert_array_equal(corners - point, np.broadcast_to(-point, corners.shape))


# --- frames in part ---------------------------------------------------------------------------------------------

CHANGES = {"camera": {"camera"}, "light 1": {"light/1"}, "geometry": {"points"}, "nothing": set()}


@pytest.mark.parametrize("label", LAMPS)
def test_nothing_moved_launches_nothing(label, monkeypatch):
    prepared = scene()
    session = session_of(label, prepared)
    session.answers(prepared.moment(0, *SIZE))
    session.select(set())
    assert not session.passes
    assert not launches(session, monkeypatch)


@pytest.mark.parametrize("label", LAMPS)
def test_what_was_skipped_for_a_light_is_made_up_for_when_it_is_seen_again(label):
    prepared = scene((SPOT,), facing=True)
    session = session_of(label, prepared)
    session.answers(prepared.moment(0, *SIZE))
    moved = (replace(SPOT, position=(-1.5, 3.0, 0.5), spot=Spot((1.5, -3.0, -0.5), 40.0)),)
    away = Camera(EYE.eye, (0.0, 0.6, 9.0))
    assert session.advance(prepared.moment(0, *SIZE, camera=away, lights=moved)) == {"camera", "light/0"}
    assert not session.frame.reached.numpy().any()
    back = prepared.moment(0, *SIZE, lights=moved)
    assert session.advance(back) == {"camera"}
    whole = session_of(label, prepared).answers(back)
    assert whole["visibility"].any()
    for name, values in session.frame.answers.to_host().items():
        np.testing.assert_array_equal(values, whole[name], err_msg=name)
    kept = stale(session.all_passes, {"camera"})
    assert session._owed_to(kept) == set()  # and only once


@pytest.mark.parametrize("label", ["uniform_grid", "ray_grids"])
@pytest.mark.parametrize("interrupted", ["loaded", "selected", "planned anew"])
def test_a_frame_is_never_made_from_one_that_is_not_whole(label, interrupted):
    prepared = scene()
    before = prepared.moment(0, *SIZE)
    after = prepared.moment(0, *SIZE, lights=tuple(light.moved((1.0, 5.0, 2.0)) for light in (POINT, BEHIND)))
    session = session_of(label, prepared)
    session.answers(before)
    session.frame.answers.poison()
    if interrupted != "planned anew":
        session.load(after)
    if interrupted == "selected":
        session.select({"light/0"})
        session.settle()
    if interrupted == "planned anew":
        session._plan()
    session.advance(after)
    whole = session_of(label, prepared).answers(after)
    for name, values in session.frame.answers.to_host().items():
        np.testing.assert_array_equal(values, whole[name], err_msg=name)
    assert session.advance(after) == frozenset()


@pytest.mark.parametrize("label", LAMPS)
def test_a_moving_light_rebuilds_its_own_grid_and_nothing_else(label):
    session = session_of(label, scene())
    run = stale(session.all_passes, {"light/1"})
    assert run
    assert {work.effect for work in run} <= {"shadows/1", "receivers"}
    assert not [work for work in builds(run) if work.part == "build"]


@pytest.mark.parametrize("label", ["uniform_grid", "bvh", "bvh rebuilt in place", "embree"])
def test_a_moving_camera_rebuilds_no_world_structure(label):
    assert not builds(stale(session_of(label, scene()).all_passes, {"camera"}))


@pytest.mark.parametrize(
    ("clamp", "stays"), [("scene", True), ("hits", False), ("view", False), ("none", False)]
)
def test_a_light_grid_stays_with_a_moving_camera_only_where_it_knows_no_view(clamp, stays):
    session = Session(make_method("perspective_spherical", {"clamp": clamp}), scene(), *SIZE, "cpu")
    built = builds(stale(session.all_passes, {"camera"}))
    assert (not [work for work in built if work.part == "light build"]) == stays


def make(name, reads, writes, part="trace"):
    return Pass(name, part, tuple(reads.split()), tuple(writes.split()), lambda: None)


def test_pass_graph_on_a_small_frame():
    passes = [
        make("build", "points", "tree", "build"),
        make("trace", "tree camera", "hits"),
        make("clear", "light/0", "bits"),
        make("shadow", "tree hits light/0", "bits"),
        make("debug", "tree", "picture"),
    ]
    kept = live(passes, ("hits", "bits"))
    assert [p.name for p in kept] == ["build", "trace", "clear", "shadow"]
    assert [p.name for p in live(passes, ("hits",))] == ["build", "trace"]
    assert [p.name for p in stale(kept, {"camera"})] == ["trace", "clear", "shadow"]
    assert [p.name for p in stale(kept, {"light/0"})] == ["clear", "shadow"]
    assert stale(kept, set()) == []
    reasons = {step.work.name: step.reason for step in steps(kept, {"camera"})}
    assert reasons["shadow"] == "hits changed"
    assert reasons["clear"] == "bits is made anew"


def test_a_method_that_leaves_an_effect_out_says_why():
    class Plain(BaseMethod):
        cannot: ClassVar[dict[str, str]] = {"receivers": "it has no time for that"}

    assert Plain().applies(scene(facing=True).scene, "cpu") == "receivers: it has no time for that"
    assert Plain().applies(scene().scene, "cpu") is None


# --- (6) an effect enabled on purpose makes these tests fail ----------------------------------------------------


@pytest.mark.parametrize("label", EXACT)
def test_an_unasked_mask_is_caught(label, monkeypatch):
    monkeypatch.setattr(Effects, "masked", lambda self, light: True)
    with pytest.raises(AssertionError):
        assert_only_its_passes(label, "receivers by facing", monkeypatch)
    with pytest.raises(AssertionError):
        assert_no_bytes(label, monkeypatch)


@pytest.mark.parametrize("label", EXACT)
def test_an_unasked_build_is_caught(label, monkeypatch):
    prepared = scene()
    session = session_of(label, prepared)
    session.answers(prepared.moment(0, *SIZE))
    monkeypatch.setattr("shadowbench.harness.session.stale", lambda passes, changed: list(passes))
    session.select(set())
    with pytest.raises(AssertionError):
        assert not launches(session, monkeypatch)


def test_an_unasked_light_is_caught(monkeypatch):
    monkeypatch.setattr(
        Effects, "of", staticmethod(lambda scene: Effects(shadows=tuple(True for _ in scene.lights)))
    )
    with pytest.raises(AssertionError):
        test_a_light_without_shadows_has_no_pass("uniform_grid")


def test_the_mask_pass_is_the_harness_own():
    assert receivers.receiver_passes.__module__.endswith("harness.receivers")


VARIANTS = [
    *((name, {}) for name in method_names()),
    ("bvh", {"update": "bvh_rebuild"}),
    ("perspective_spherical", {"sort": "radix", "balancing": "algorithm-1"}),
    ("perspective_spherical", {"sort": "radix", "triangle_chunk": "3"}),
    ("perspective_spherical", {"triangle_chunk": "2", "clamp": "scene"}),
    ("perspective_spherical", {"staging": "none", "light_map": "cube"}),
    ("ray_grids", {"queue": "always"}),
]


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize(("name", "settings"), VARIANTS)
def test_what_runs_in_any_case_leaves_no_bit_where_nothing_receives(name, settings, device, monkeypatch):
    """Passes that take scratch memory run, in a captured graph, on what the last traced frame left behind."""
    prepared = scene((SPOT, BEHIND), facing=True)
    reason = make_method(name, settings).applies(prepared.scene, device)
    if reason:
        pytest.skip(f"{name}: {reason}")
    if device == "cpu":  # where nothing is captured, plain launches do as a graph would
        monkeypatch.setattr(passes, "_condition", lambda work: None if work.scratch else work.only_if)
    gone = (replace(SPOT, spot=Spot((0.0, 1.0, 0.0), 1.0)), BEHIND)
    moments = [prepared.moment(0, *SIZE, lights=lights) for lights in ((SPOT, BEHIND), gone)]
    wanted = [
        Session(make_method(name, settings), prepared, *SIZE, device).answers(moment) for moment in moments
    ]
    for order in ((0, 1, 0), (1, 0, 1)):
        session = Session(make_method(name, settings), prepared, *SIZE, device)
        for k in order:
            session.answers(moments[k])
        for k in order:
            session.load(moments[k])
            session.frame.answers.poison()
            session.replay()
            assert not session.overflowed()
            assert session.frame.reached.numpy()[0] == (k == 0)
            session.method.counters()
            for key, values in session.frame.answers.to_host().items():
                np.testing.assert_array_equal(values, wanted[k][key], f"{key}, {k} of {order}")
    assert wanted[0]["visibility"][0].any()


@pytest.mark.parametrize(("name", "settings"), VARIANTS)
def test_what_a_graph_may_leave_out_takes_no_scratch_memory(name, settings, monkeypatch):
    """A branch of a captured graph holds kernels, fills and copies alone: scans and sorts allocate inside."""
    prepared = scene((SPOT, BEHIND), facing=True)
    method = make_method(name, settings)
    if method.applies(prepared.scene, "cpu"):
        pytest.skip(f"{name}: {method.applies(prepared.scene, 'cpu')}")
    session = Session(method, prepared, *SIZE, "cpu")
    session.answers(prepared.moment(0, *SIZE))
    given = [work for work in session.all_passes if work.only_if is not None and not work.scratch]
    assert given
    if name == "ray_grids":  # its scan is its own on a GPU; on a CPU nothing is captured
        given = [work for work in given if "count and scan" not in work.name]

    def refuse(*args, **kwargs):
        raise AssertionError("scratch memory within a branch")

    for routine in ("array_scan", "radix_sort_pairs", "segmented_sort_pairs", "runlength_encode"):
        monkeypatch.setattr(wp.utils, routine, refuse)
    for maker in ("zeros", "empty", "full", "array", "zeros_like", "empty_like", "clone"):
        monkeypatch.setattr(wp, maker, refuse)
    if not session.method.capturable:
        pytest.skip(f"{name} is not captured")
    for work in given:
        work.launch()
