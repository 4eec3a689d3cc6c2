"""Frames that follow one another: what has played equals what is fresh, bit for bit. Ten thousand of them: ``make fuzz``."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from helpers.played_stories import Judging, Player, grown_memory, keeps_still, play, players
from helpers.stories import CAMERA_EVENTS, LIGHT_EVENTS, MESH_EVENTS, Story, draw_story
from shadowbench.harness.frame.frame import Frame
from shadowbench.harness.frame.session import Session

FRAMES = 10
PLAYERS = players("cpu")
SEED = 12

MANY_BUFFERS = ("perspective_spherical", "ray_grids", "kdtree", "warp_bvh")
"""Methods whose buffers grow, or whose tree is made anew in each frame; ``make fuzz`` looks at the memory of all."""

MOVES, STANDS = (draw_story(SEED, FRAMES, still, every=True) for still in (False, True))
JUDGING = {story: Judging(story) for story in (MOVES, STANDS)}


def story_of(player: Player) -> Story:
    return STANDS if keeps_still(player) else MOVES


@pytest.mark.parametrize("player", PLAYERS, ids=lambda player: "-".join([player[0], *player[1].values()]))
def test_a_played_frame_equals_a_fresh_one_and_is_right(player: Player, device: str) -> None:
    if player not in players(device):
        pytest.skip(f"{player[0]} does not run on {device}")
    story = story_of(player)
    assert play(player, story, device, JUDGING[story]) == []


def test_stories_tell_of_everything() -> None:
    told = " ".join(MOVES.labels)
    assert {event for event in (*MESH_EVENTS, *LIGHT_EVENTS, *CAMERA_EVENTS) if event not in told} <= {
        "squash",
        "grow",
        "line",
    }
    again = draw_story(SEED, FRAMES, every=True)
    assert again.labels == MOVES.labels
    for one, other in zip(MOVES.moments, again.moments, strict=True):
        np.testing.assert_array_equal(one.points, other.points)
        np.testing.assert_array_equal(one.lights, other.lights)
    bits = []
    for seed in range(6):
        story = draw_story(seed, FRAMES)
        answers = [Judging(story).judged(frame).exact for frame in range(FRAMES)]
        seen = np.array([one["triangle"] >= 0 for one in answers])
        assert 0.1 < seen.mean() < 0.95, seed
        bits.append(np.mean([one["shadowed"][0].mean() for one in answers]) / seen.mean())
    assert 0.1 < np.mean(bits) < 0.9


def test_memory_stays_flat() -> None:
    """What grows in one session grows in the next: arrays of threads that other tests left may come in between."""
    growing = MANY_BUFFERS
    for _ in range(2):
        growing = {name: more for name in growing if (more := grown_memory((name, {}), MOVES, "cpu", times=1))}
    assert not growing


def test_what_is_not_loaded_again_is_found(monkeypatch) -> None:
    """Planted: lights stay where they were in a session's first frame."""
    load, first = Frame.load, {}

    def forgetful(self, moment, *given):
        load(self, replace(moment, lights=first.setdefault(id(self), moment.lights)), *given)

    monkeypatch.setattr(Frame, "load", forgetful)
    found = play(("uniform_grid", {}), MOVES, "cpu")
    assert any("played: " in one for one in found)
    assert any("in part: " in one for one in found)


def test_memory_that_is_kept_is_found(monkeypatch) -> None:
    load, kept = Session.load, []

    def hoarding(self, moment):
        kept.append(wp.zeros(25, dtype=wp.int32, device="cpu"))
        load(self, moment)

    monkeypatch.setattr(Session, "load", hoarding)
    assert grown_memory(("uniform_grid", {}), MOVES, "cpu", times=1) >= 100 * FRAMES
