"""What a scene does not call for is not simulated: launch lists, memory, neutral values."""

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest
import warp as wp
from helpers.effect_scenes import (
    BEHIND,
    EXACT,
    LAMPS,
    POINT,
    SIZE,
    SPOT,
    effect_free,
    launches,
    names,
    scene,
    session_of,
)
from helpers.small_scenes import assert_same
from shadowbench.harness.frame import frame as frame_module
from shadowbench.harness.frame.method import BaseMethod
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.score import score_answers
from shadowbench.harness.runner.measuring.memory import Memory
from shadowbench.harness.scene.effects import Effects
from shadowbench.harness.scene.overrides import perforated
from shadowbench.harness.scene.prepared import Prepared
from shadowbench.harness.scene.scene import Light, Spot

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
        {"mirror": lambda geometry: np.ones(len(geometry.faces), dtype=np.uint8), "bounces": 2, "facing": True},
        {"facing": True},
        {"mirror"},
    ),
    "colour": ({"outputs": ("ids", "shadows", "color")}, {"outputs": ("ids", "shadows")}, {"color"}),
    "a directional light": ({"lights": (replace(POINT, directional=True), BEHIND)}, {}, set()),
}


MARK_RECEIVERS = ("ray_grids", "visibility_buffer")
"""Methods that mark receivers in a pass that every frame has."""

MARK_ON_A_GPU = ("bvh2", "two_level_bvh", "hybrid", "perspective_spherical", "grids clamped to the scene")
"""Methods that do so on a GPU."""


def marks(session) -> bool:
    """Whether a pass marks receivers."""
    return any(name.startswith("receivers/") for work in session.all_passes for name in work.writes)


def assert_only_its_passes(label: str, effect: str, monkeypatch: pytest.MonkeyPatch) -> None:
    on, off, tags = WITHOUT[effect]
    with_it, without = session_of(label, scene(**on)), session_of(label, scene(**off))
    # Where a tree is traced the order differs too: triangles are set up for a light later if it may have no receiver, and
    # the threads of a CPU launch the two kernels of a pass of warp_bvh, each for its share of the pixels.
    listed = sorted if label in ("bvh2", "two_level_bvh", "hybrid", "warp_bvh") else list
    assert listed(names(without)) == listed(work.name for work in with_it.all_passes if work.effect not in tags)
    # With facing they have a pass for the triangles.
    own = {"receivers"} if label in MARK_RECEIVERS and not on.get("facing") else set()
    assert any(work.effect in tags for work in with_it.all_passes) == bool(tags - own)
    if "receivers" in tags:
        assert marks(with_it)
        assert not marks(without)
    for session, prepared in ((with_it, scene(**on)), (without, scene(**off))):
        session.load(prepared.moment(0, *SIZE))
        session.run_complete()
    counted = launches(with_it, monkeypatch), launches(without, monkeypatch)
    assert listed(effect_free(counted[0], tags)) == listed(effect_free(counted[1], set()))


@pytest.mark.slow
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
    from shadowbench.harness.frame import session as session_module

    plain = planned_bytes(label, scene())
    NeverHeard.nothing = {1: wp.zeros(0, dtype=wp.int32), 2: wp.zeros((0, 0), dtype=wp.uint8)}
    with monkeypatch.context() as patch:
        patch.setattr(session_module, "Frame", NeverHeard)
        patch.setattr(session_module, "receiver_passes", lambda *given: [])
        patch.setattr(session_module, "skippable", lambda passes, effects: passes)
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

NEUTRAL: dict[str, dict[str, Any]] = {
    "a spot of 4 pi": {"lights": (replace(POINT, spot=Spot((0, -1, 0), 180.0)), BEHIND)},
    "a fall-off": {"lights": (replace(POINT, spot=Spot((0, -1, 0), 180.0, falloff=1.0)), BEHIND)},
    "a light of no intensity": {"lights": (replace(POINT, intensity=0.0), BEHIND)},
    "one more light without shadows": {"lights": (POINT, BEHIND, replace(POINT, shadows=False, intensity=0.0))},
    "an opaque mask": {"alpha": lambda mesh: replace(perforated(mesh, 1, 6), opaque=np.ones((2, 2), np.uint8))},
    "no mirror": {"mirror": lambda mesh: np.zeros(len(mesh.faces), np.uint8), "bounces": 1},
}


@pytest.mark.parametrize(
    ("label", "neutral"),
    [(label, neutral) for label in LAMPS for neutral in NEUTRAL if label in EXACT or "lights" in NEUTRAL[neutral]],
)
def test_a_neutral_value_changes_no_bit(label, neutral, device):
    plain, changed = scene(), scene(**NEUTRAL[neutral])
    some = session_of(label, plain, device).answers(plain.moment(0, *SIZE))
    other = session_of(label, changed, device).answers(changed.moment(0, *SIZE))
    for name in some:
        np.testing.assert_array_equal(some[name], other[name][: len(some[name])])


# --- rules that people get wrong --------------------------------------------------------------------------------


@pytest.mark.parametrize("facing", [False, True])
@pytest.mark.parametrize("label", EXACT)
def test_receivers_are_the_same_for_every_method_and_the_reference(label, facing, device):
    prepared = scene((SPOT, BEHIND, Light((0.2, 1.0, 0.3), directional=True)), facing=facing)
    moment = prepared.moment(0, *SIZE)
    judge = Judge.of(prepared, moment)
    answers = session_of(label, prepared, device).answers(moment)
    score = score_answers(judge, answers).score
    assert score.true_errors == 0
    wanted = session_of(EXACT[0], prepared, device).answers(moment)
    assert_same(answers, wanted)
    # Of t and weights another device may round the last place differently.
    elsewhere = session_of(EXACT[0], prepared, "cpu").answers(moment)
    for name in ("triangle", "shadowed"):
        np.testing.assert_array_equal(answers[name], elsewhere[name])
    assert answers["shadowed"].any(axis=1).all()


def test_bits_where_nothing_receives_are_errors():
    prepared = scene((SPOT,), facing=True)
    moment = prepared.moment(0, *SIZE)
    answers = session_of("uniform_grid", prepared).answers(moment)
    plain = scene((POINT,)).moment(0, *SIZE)
    unlimited = session_of("uniform_grid", scene((POINT,))).answers(plain)
    assert (unlimited["shadowed"] > answers["shadowed"]).any()
    assert score_answers(Judge.of(prepared, moment), unlimited).score.true_errors > 0


@pytest.mark.parametrize("label", LAMPS)
def test_a_light_that_reaches_nothing_is_skipped(label, device, monkeypatch):
    away = Light((0.0, 5.0, 0.0), spot=Spot((0.0, 1.0, 0.0), 10.0))
    prepared = scene((away, BEHIND))
    session = session_of(label, prepared, device)
    answers = session.answers(prepared.moment(0, *SIZE))
    assert not answers["shadowed"][0].any()
    seen = launches(session, monkeypatch)
    launched = {kernel for effect, kernel in seen if effect == "shadows/0"}
    if device != "cpu" and label in MARK_ON_A_GPU:
        assert "receivers_kernel" not in launched
    elif device != "cpu" and not session.replays:
        assert not any(work.only_if is not None for work in session.all_passes)
    elif label not in MARK_RECEIVERS:
        assert not launched
    elif device == "cpu":
        assert launched == {"aim_kernel", "place_kernel"}
    assert [kernel for effect, kernel in seen if effect == "shadows/1"] or label == "embree"


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
    np.testing.assert_array_equal(wanted["shadowed"], got["shadowed"])
    point = prepared.moment(0, *SIZE).lights[0].astype(np.float64)
    corners = prepared.points(0)[0].astype(np.float64)
    np.testing.assert_array_equal(corners - point, np.broadcast_to(-point, corners.shape))


def test_a_method_that_leaves_an_effect_out_says_why():
    class Plain(BaseMethod):
        cannot: ClassVar[dict[str, str]] = {"receivers": "it has no time for that"}

    assert Plain().applies(scene(facing=True).scene, "cpu") == "receivers: it has no time for that"
    assert Plain().applies(scene().scene, "cpu") is None


# --- (6) an effect enabled on purpose makes these tests fail ----------------------------------------------------


@pytest.mark.parametrize("label", EXACT)
def test_an_unasked_mask_is_caught(label, monkeypatch):
    monkeypatch.setattr(Effects, "has_receivers", lambda self, light: True)
    with pytest.raises(AssertionError):
        assert_only_its_passes(label, "receivers by facing", monkeypatch)
    # Or the array of its conditions is missed.
    with pytest.raises((AssertionError, RuntimeError)):
        assert_no_bytes(label, monkeypatch)
