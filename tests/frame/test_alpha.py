"""Triangles with holes: the rule (``frame/alpha.py``, ``exact/holes.py``) against rational brute force, and every
method that can.
"""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from helpers.holed_scenes import EXACT, NAMES, SIZE, answers_of, holed, make, same
from helpers.second_judge import Bitmap, SecondJudge
from helpers.second_opinion import Count, compare
from helpers.small_scenes import make_scene
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.shapes import ball, ball_on_floor, joined, quad, soup
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.referee import Referee
from shadowbench.harness.judge.score import score_answers
from shadowbench.harness.scene.effects import Effects
from shadowbench.harness.scene.overrides import perforated
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import AlphaMask, Geometry
from shadowbench.methods.perspective_spherical.culling import refusal

# --- the rule -------------------------------------------------------------------------------------------------


def random_mask(geometry: Geometry) -> AlphaMask:
    """Oblique coordinates that repeat and go below zero, a bitmap that is not square, two triangles of three masked."""
    random = np.random.default_rng(5)
    count = len(geometry.faces)
    flags = (np.arange(count) % 3 != 0).astype(np.uint8)
    coordinates = random.uniform(-2, 2, (count, 3, 2)).astype(np.float32)
    return AlphaMask(flags, coordinates, random.integers(0, 2, (5, 3)).astype(np.uint8))


@pytest.mark.parametrize("mask", [random_mask, lambda g: perforated(g, 1, 3)], ids=["random", "perforated"])
def test_the_referee_agrees_with_rational_arithmetic(mask):
    prepared = make(soup(3, 14, 0.9), mask, lights=((0.3, 0.2, 0.1), (2, 3, 1)), eye=(0, 0, 2.5), target=(0, 0, 0))
    moment = prepared.moment(0, 9, 7)
    referee = Referee(moment.points, prepared.faces, moment.valid, mask=prepared.alpha)
    hits = referee.closest(moment.eye, moment.directions(np.arange(63)))
    through = Referee(moment.points, prepared.faces, moment.valid).closest(hits.origins, hits.directions)
    assert np.count_nonzero(hits.triangle != through.triangle) > 5
    holes = Bitmap(prepared.alpha.triangles, prepared.alpha.coordinates, prepared.alpha.opaque)
    second = SecondJudge(moment.points, prepared.faces, holes)
    assert compare(referee, second, hits.origins, hits.directions, moment.lights, Count()) == []
    assert 0 < referee.occluded(hits, moment.lights[1]).sum() < 63


def wall(mask, lights=((0.0, 0.0, 3.0),)) -> Prepared:
    """A masked square before a plain one, seen head on: pixel centres at odd multiples of 1/16 at the first."""
    near = quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
    far = quad((-8, -8, -4), (8, -8, -4), (8, 8, -4), (-8, 8, -4))
    return make_scene(*joined(near, far), list(lights), (0, 0, 1), fov=90.0, alpha=mask)


def squares(side: float):
    """A mask of the first square: chequered, texels ``side`` long, a corner of them in its middle."""

    def mask(geometry: Geometry) -> AlphaMask:
        flags = np.zeros(len(geometry.faces), dtype=np.uint8)
        flags[:2] = 1
        coordinates = np.zeros((len(flags), 3, 2), dtype=np.float32)
        corners = np.asarray(geometry.positions(0))[geometry.faces[:2]]
        coordinates[:2] = corners[..., :2] / (2 * side)
        return AlphaMask(flags, coordinates, np.eye(2, dtype=np.uint8))

    return mask


@pytest.mark.parametrize(("name", "settings"), EXACT, ids=NAMES)
@pytest.mark.parametrize("side", [1 / 16, 1 / 4], ids=["every ray on borders", "rays inside texels"])
def test_rays_on_borders_count_where_either_side_is_opaque(name, settings, side):
    prepared = wall(squares(side))
    answers = answers_of(name, settings, prepared, (16, 16))
    x, y = np.meshgrid(*2 * [np.arange(-15, 16, 2) / 16])
    if side == 1 / 16:
        seen = np.ones((16, 16), dtype=bool)  # each ray meets four texels, two of them opaque
    else:
        seen = (np.floor(x * 4) + np.floor(-y * 4)) % 2 == 0
    assert ((answers["triangle"].reshape(16, 16) < 2) == seen).all()
    moment = prepared.moment(0, 16, 16)
    assert score_answers(Judge.of(prepared, moment), answers).score.true_errors == 0


# --- methods --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "settings"), EXACT, ids=NAMES)
def test_exact_methods_are_right_and_alike(name, settings):
    prepared, _, judge = holed()
    answers = answers_of(name, settings, prepared)
    score = score_answers(judge.with_random_pixels(SIZE[0] * SIZE[1]), answers).score
    assert (score.true_errors, score.excused_share) == (0, 0)
    assert not same(answers, answers_of(*EXACT[0], prepared))
    plain = answers_of(name, settings, make(ball_on_floor(), None))
    assert np.count_nonzero(plain["triangle"] != answers["triangle"]) > 20
    assert np.count_nonzero(plain["shadowed"] != answers["shadowed"]) > 20


@pytest.mark.slow
def test_triangles_staged_in_shared_memory_have_the_same_holes(monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    settings = {"tile": "4", "k": "2", "r": "40", "staging": "shared", "triangle_chunk": "5"}
    prepared, moment, _ = holed()
    session = Session(make_method("perspective_spherical", settings), prepared, *SIZE, "cpu")
    assert not same(session.answers(moment), answers_of(*EXACT[0], prepared))
    assert session.method.built()["staging"] == "shared"


def test_a_shadow_map_is_drawn_with_holes():
    """Its primary rays are exact; of its shadow bits few are wrong, and many would be without the holes."""
    prepared, _, judge = holed()
    exact = judge.reference.answers()
    answers = answers_of("shadow_map", {"size": "1024"}, prepared)
    hits = exact["triangle"] >= 0
    assert (answers["triangle"] == exact["triangle"]).all()
    wrong = np.count_nonzero((answers["shadowed"] != exact["shadowed"])[:, hits])
    solid = replace(Effects.of(prepared.scene), alpha=False)
    moment = prepared.moment(0, *SIZE)
    blind = Session(make_method("shadow_map", {"size": "1024"}), prepared, *SIZE, "cpu", effects=solid).answers(moment)
    same_hits = hits & (blind["triangle"] == exact["triangle"])
    ignored = np.count_nonzero((blind["shadowed"] != exact["shadowed"])[:, same_hits])
    assert wrong < 0.05 * 2 * np.count_nonzero(hits)
    assert ignored > 4 * wrong


@pytest.mark.parametrize(("name", "settings"), EXACT, ids=NAMES)
def test_holes_move_with_their_triangles(name, settings):
    """Frame after frame as only what moved calls for, against frames made from nothing."""
    points, faces = ball_on_floor()

    def positions(frame: int):
        moved = points.copy()
        moved[4:] *= (1 + 0.2 * frame, 1 - 0.2 * frame, 1.0)
        return moved

    still = make((points, faces), lambda geometry: perforated(geometry, 2, 6)).scene
    prepared = prepare(replace(still, geometry=lambda: Geometry(faces.astype(np.int32), positions, 3)))
    lights = tuple(light.moved((-0.5, 2.0, 0.7)) for light in still.lights)
    moments = [prepared.moment(k, *SIZE) for k in range(3)] + [prepared.moment(2, *SIZE, lights=lights)]
    session = Session(make_method(name, settings), prepared, *SIZE, "cpu")
    for moment in moments:
        changed = session.advance(moment)
        assert ("points" in changed) == (moment is not moments[-1])
        assert "surfaces" not in changed or moment is moments[0]
        fresh = Session(make_method(*EXACT[0]), prepared, *SIZE, "cpu").answers(moment)
        assert not same(session.frame.answers.to_host(), fresh)


def test_without_masks_nothing_is_kept_or_launched():
    plain, masked = (
        Session(make_method("uniform_grid", {}), prepared, *SIZE, "cpu")
        for prepared in (make(ball_on_floor(), None), holed()[0])
    )
    assert [work.name for work in plain.all_passes] == [work.name for work in masked.all_passes]
    assert not any("surfaces" in work.reads for work in plain.all_passes)
    arrays = (plain.frame.alpha.masked, plain.frame.alpha.coordinates, plain.frame.alpha.opaque)
    assert sum(array.capacity for array in arrays) == 0
    reading = [work.name for work in masked.all_passes if "surfaces" in work.reads]
    assert reading == ["primary rays", "light 0: shadow rays", "light 1: shadow rays"]


@pytest.mark.parametrize("name", ["embree", "warp_bvh", "accuracy_ladder"])
def test_what_cannot_take_part_says_why(name):
    reason = make_method(name, {}).applies(holed()[0].scene, "cpu")
    assert reason is not None
    assert reason.startswith("alpha: ")
    assert "not supported" not in reason


def test_culling_is_refused_where_back_faces_are_seen_through_holes():
    solid = replace(make(ball(0.5, (0, 0, 0)), None).scene, closed=True)
    assert refusal(solid, lights_too=True) is None
    assert "holes" in (refusal(replace(solid, alpha=perforated), lights_too=True) or "")
