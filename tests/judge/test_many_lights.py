"""Many lights are judged together: in one launch, by one referee for all lightings, equal answers once."""

import itertools
import weakref
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from helpers.second_opinion import random_trial
from shadowbench.harness import api
from shadowbench.harness.judge import candidates
from shadowbench.harness.judge.arithmetic import edge_bound
from shadowbench.harness.judge.distances import triangle_distance
from shadowbench.harness.judge.referee import Referee
from shadowbench.harness.judge.verdict import Verdict
from shadowbench.harness.runner.planning.planned_point import dealt
from shadowbench.harness.scene.overrides import Lighting


@pytest.mark.parametrize("seed", [1, 18])
def test_lights_judged_together_have_the_verdicts_of_each_alone(monkeypatch, seed):
    """Batches so small that they end within a light, and within the candidates of a ray."""
    random = np.random.default_rng(seed)
    points, faces, origins, directions, some = random_trial(random, 60)
    size = np.abs(points).max()
    on_mesh = points[faces[:3]].mean(axis=1)
    lights = np.concatenate([some, points[:3], on_mesh, random.normal(size=(5, 3)) * size]).astype(np.float32)
    referee = Referee(points, faces, np.ones(len(faces)))
    hits = referee.closest(origins, directions)
    bits = random.integers(0, 3, (len(lights), len(hits))).astype(np.uint8)
    alone = [referee.occluders(hits, light) for light in lights]
    classes = [referee.classify_shadow(hits, *given) for given in zip(lights, bits, strict=True)]
    assert {int(Verdict.ACNE), int(Verdict.LEAK), int(Verdict.INVALID)} <= set(np.unique(classes).tolist())
    monkeypatch.setattr(candidates, "SEGMENTS", 37)
    monkeypatch.setattr(candidates, "MOST", 3)
    wanted = np.arange(len(lights)) != 2
    found = referee.answers(origins, directions, lights, wanted).occluders
    np.testing.assert_array_equal(found, np.where(wanted[:, None], alone, -1))
    every = np.ones(bits.shape, dtype=bool)
    np.testing.assert_array_equal(referee.classify_shadows(hits, lights, bits, np.array(alone), every), classes)
    some = random.uniform(size=bits.shape) < 0.5
    expected = np.where(some, classes, Verdict.OK)
    np.testing.assert_array_equal(referee.classify_shadows(hits, lights, bits, np.array(alone), some), expected)


def test_rays_that_are_divided_have_the_memory_of_one_launch(monkeypatch):
    """Each half of a half had room beside that of the whole: half a gigabyte for 8192 rays through many sheets."""
    points, faces, origins, directions, _ = random_trial(np.random.default_rng(1), 60)
    referee = Referee(points, faces, np.ones(len(faces)))
    expected = referee.all_hits(origins, directions)
    assert max(map(len, expected)) > 3
    empty, held = wp.empty, []

    def counting(*given, dtype, **named):
        made = empty(*given, dtype=dtype, **named)
        if dtype is wp.vec2i:
            held.append(weakref.ref(made))
            assert sum(one() is not None for one in held) == 1
        return made

    monkeypatch.setattr(wp, "empty", counting)
    monkeypatch.setattr(candidates, "MOST", 3)
    assert referee.all_hits(origins, directions) == expected
    assert len(held) > 5


@pytest.mark.parametrize("seed", [1, 2, 5])
def test_no_triangle_within_the_bound_of_a_lit_segment_is_left_out(seed):
    """The filter drops what certainly passes farther away; here every triangle is measured."""
    points, faces, origins, directions, lights = random_trial(np.random.default_rng(seed), 80)
    referee = Referee(points, faces, np.ones(len(faces)))
    hits = referee.closest(origins, directions)
    seen, corners = set(), points[faces].astype(np.float64)
    for light in lights:
        lit = np.nonzero((hits.triangle >= 0) & (referee.occluders(hits, light) < 0))[0]
        classes = referee.classify_shadow(hits, light, np.ones(len(hits), dtype=np.uint8))
        held = candidates.in_planes(points[faces], light)
        for i in lit.tolist():
            others = np.setdiff1d(np.nonzero(~held)[0], hits.ties[i])
            p, q = (np.broadcast_to(one, (len(others), 3)) for one in (hits.points[i], light.astype(np.float64)))
            away, share = triangle_distance(p, q, corners[others])
            near = (away <= edge_bound(p, p + share[:, None] * (q - p))).any()
            assert classes[i] == (Verdict.EDGE if near else Verdict.ACNE)
            seen.add(bool(near))
    assert seen == {True, False}


def test_a_referee_is_used_for_another_lighting_of_the_same_mesh():
    prepared = api.prepare(api.resolve("balls-3k"))
    one = Lighting("1", count=1).applied(prepared)
    first = api.Judge.of(one, one.moment(0, 8, 8))
    two = Lighting("2", count=2).applied(prepared)
    again = api.Judge.of(two, two.moment(0, 8, 8), known=first.referee)
    assert again.referee is first.referee
    moved = api.prepare(api.resolve("balls-10k"))
    other = api.Judge.of(moved, moved.moment(0, 8, 8), known=first.referee)
    assert other.referee is not first.referee
    assert not first.referee.is_of(prepared.points(0)[0] + 1, prepared.faces, first.referee.valid, "cpu", None)
    assert not first.referee.is_of(prepared.points(0)[0], prepared.faces, first.referee.valid, "cuda:0", None)


def test_equal_answers_go_to_one_scoring_process_and_the_first_alone():
    jobs = [
        SimpleNamespace(answers=hashed, point=SimpleNamespace(key=str(key))) for key, hashed in enumerate("abacbdea")
    ]
    turns = list(itertools.zip_longest(*dealt(jobs, 3)))
    assert turns[0] == (jobs[0], None, None)
    placed = {job.point.key: number for turn in turns for number, job in enumerate(turn) if job is not None}
    assert len(placed) == len(jobs)
    assert len({placed[job.point.key] for job in jobs if job.answers == "a"}) == 1
    assert len({placed[job.point.key] for job in jobs if job.answers == "b"}) == 1
    assert len(set(placed.values())) == 3
    unknown = [SimpleNamespace(answers="", point=SimpleNamespace(key=key)) for key in "xy"]
    assert dealt(unknown, 2) == [[unknown[0]], [None, unknown[1]]]
