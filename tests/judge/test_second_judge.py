"""The exact referee against a judge that shares nothing with it. All cases and 100,000 rays: ``make fuzz``."""

from fractions import Fraction

import numpy as np
import pytest
from helpers import second_opinion
from helpers.judged_hard_cases import CASES
from helpers.second_excuses import excuses
from helpers.second_judge import Bitmap, SecondJudge
from helpers.second_opinion import Count, answers_of_case, random_opinion, rays_of_case
from shadowbench.harness.judge import arithmetic
from shadowbench.harness.judge.referee import Referee
from shadowbench.harness.scene.prepared import valid_triangles

MESHES, RAYS, PIXELS = 40, 25, 6

SQUARE = np.float32([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
HALVES = np.int32([(0, 1, 2), (0, 2, 3)])


def test_both_judges_agree_on_random_rays_beside_edges() -> None:
    count = Count()
    assert [one for seed in range(MESHES) for one in random_opinion(seed, RAYS, count)] == []
    assert count.rays == MESHES * RAYS
    assert count.hits > 0.4 * count.rays
    assert count.ties > 0.02 * count.rays
    assert 0.2 * count.segments < count.shadows < 0.8 * count.segments


def test_both_judges_excuse_the_same() -> None:
    """Misses and leaks from a hundredth to thirty times the bound beside edges."""
    counts: dict[str, int] = {}
    assert [one for seed in range(12) for one in excuses(seed, 40, counts)] == []
    assert min(counts[f"{what} {excused}"] for what in ("miss", "leak") for excused in (True, False)) > 15, counts


def test_another_bound_shows(monkeypatch) -> None:
    monkeypatch.setattr(arithmetic, "EDGE_UNITS", 1.5 * arithmetic.EDGE_UNITS)
    assert [one for seed in range(12) for one in excuses(seed, 40, {})] != []


def test_both_judges_agree_on_a_few_rays_of_cases() -> None:
    count, names = Count(), [case.name for case in CASES][::4]
    assert [one for name in names for one in rays_of_case(name, PIXELS, count)] == []
    assert count.hits > 0.5 * count.rays
    assert 0.05 * count.segments < count.shadows


@pytest.mark.parametrize("name", ["S17", "S17r", "M05", "H03", "H05"])
def test_what_a_case_expects_is_what_the_second_judge_says(name: str) -> None:
    """Spots, mirrors and holes, whole: t, u, v, bits, mirrored rays."""
    count = Count()
    assert answers_of_case(name, 4096, count) == []
    assert count.shadows > 0


def test_an_error_in_either_judge_shows(monkeypatch) -> None:
    def open_triangles(o, d, corners):
        found = exact_hit(o, d, corners)
        return found if found is None or all(arithmetic.hit_weights(o, d, corners)) else None

    exact_hit = arithmetic.hit
    with monkeypatch.context() as patch:
        patch.setattr(arithmetic, "hit", open_triangles)
        assert any(random_opinion(seed, RAYS, Count()) for seed in range(12))
    monkeypatch.setattr(second_opinion, "exactly", lambda values: exactly_but_for(values))
    assert answers_of_case("M05", 4096, Count()) != []


def exactly_but_for(values):
    return tuple(Fraction(float(x)) + Fraction(1, 1000) for x in values)


def test_the_contract_binds_both() -> None:
    """What docs/accuracy.md says in words, by hand."""
    points = np.concatenate([SQUARE, SQUARE + np.float32([0, 0, 2]), np.float32([(np.nan, 0, 0.5), (0, 0, 0.5)])])
    faces = np.concatenate([HALVES, HALVES + 4, np.int32([(0, 1, 8), (9, 9, 1), (2, 1, 0)])])
    judge = SecondJudge(points, faces)
    assert [k for k in range(7) if judge.flat(k)] == [0, 1, 2, 3, 6]  # not finite, no area
    down, eye = (0, 0, -1), (0.5, 0.25, 1)
    rays = {
        (eye, down): (0, 6),  # a duplicate ties, whichever way it faces
        ((0, 0, 1), down): (0, 1, 6),  # a shared edge belongs to both
        ((1, 1, 1), down): (0, 1, 6),  # a corner too
        ((1, 0.5, 1), down): (0, 6),  # and the border
        ((2, 0, 1), down): (),
        ((0.5, 0.25, 0), down): (),  # t = 0 is no hit
        ((-2, 0, 0), (1, 0, 0)): (),  # nor is a ray in the plane
        ((0.5, 0.25, -1), (0, 0, 4)): (0, 6),
        ((0.5, 0.25, -1), down): (),
    }
    eyes, ways = (np.float32(one) for one in zip(*rays, strict=True))
    seen = judge.closest(eyes, ways)
    assert [one.ties if one else () for one in seen] == list(rays.values())
    referee = Referee(points, faces, valid_triangles(points, faces))
    hits = referee.closest(eyes, ways)
    assert hits.ties == list(rays.values())
    assert seen[7] is not None
    assert seen[7].t == Fraction(1, 4)
    lights = {(0.5, 0.25, 3): True} | dict.fromkeys(
        [(0.5, 0.25, 2), (0.5, 0.25, 1.5), (9, 0.25, 0), (0.5, 0.25, -1)], False
    )
    for light, bit in lights.items():  # an end at a surface, or a segment in a plane, meets nothing
        assert judge.shadowed(seen[:1], np.float32(light)) == [bit], light
        assert referee.occluded(hits, np.float32(light))[0] == bit, light


def test_holes_are_open_and_what_is_opaque_is_closed() -> None:
    texture = np.float32([(0, 0), (1, 0), (1, 1), (0, 1)])
    bitmap = Bitmap(np.ones(2, np.uint8), texture[HALVES], np.uint8([[1, 0], [0, 0]]))
    judge = SecondJudge(SQUARE, HALVES, bitmap)
    places = {(-0.5, -0.5): True, (0.5, -0.5): False, (0.0, -0.25): True, (-0.25, 0.0): True, (0.0, 0.25): False}
    places[-1.0, 0.5] = False  # the bitmap repeats: texels on the far side touch, too
    places[-1.0, -0.5] = True
    for (x, y), solid in places.items():
        seen = judge.closest(np.float32([(x, y, 1)]), np.float32([(0, 0, -1)]))
        assert (seen[0] is not None) == solid, (x, y)
