"""Constructions of hard cases: what a hand expects is what exact arithmetic says, and rays meet what they aim at."""

import numpy as np
import pytest
from helpers.judged_hard_cases import CASES, judged
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases import HardCase, all_cases, find_case, structures
from shadowbench.harness.hardcases.case import Counts, view
from shadowbench.harness.hardcases.judge import counts_of, judge_refusal
from shadowbench.harness.hardcases.shapes import pixel_centres, sheet


def agree(stated: Counts, exact: Counts) -> bool:
    """Whether every count that is stated equals the exact one."""
    shadowed = exact.shadowed if stated.shadowed is None else stated.shadowed
    pairs = [(stated.hit, exact.hit), *zip(shadowed, exact.shadowed, strict=True)]
    return all(one in (None, counted) for one, counted in pairs)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_what_is_stated_is_exact(case: HardCase) -> None:
    one = judged(case.name)
    exact = counts_of(one.exact, len(one.trial.moment.lights))
    assert agree(one.trial.stated, exact), f"stated {one.trial.stated}, exact {exact}"


def test_catalogue() -> None:
    names = [case.name for case in all_cases()]
    assert len(set(names)) == len(names)
    listed = [f"S{i:02}" for i in range(1, 18)] + [f"P{i:02}" for i in range(1, 19)]
    assert [name for name in listed if not any(other.startswith(name) for other in names)] == []
    assert all(case.title and case.breaks for case in all_cases())
    stated = [case for case in CASES if judged(case.name).trial.stated != Counts()]
    assert len(stated) > 60


def test_of_equal_triangles_the_exact_answer_is_the_lowest() -> None:
    """P06 has every triangle three times, and so methods are held to the first third."""
    for case in [case for case in CASES if case.name.startswith("P06")]:
        one = judged(case.name)
        assert one.exact["triangle"].max() < len(one.trial.prepared.faces) / 3


def test_large_cases_are_named_but_not_among_those_of_every_run() -> None:
    usual, every = all_cases(), all_cases(large=True)
    assert {case.name for case in every} - {case.name for case in usual} >= {"P38 100000", "P43 4000", "P42 1024"}
    assert find_case("P38 100000").large


def test_triangles_of_one_centroid_have_it_to_the_last_bit() -> None:
    trial = structures.one_centroid(500)
    corners = trial.moment.points[trial.prepared.faces[:500]]
    boxes = (corners.min(axis=1) + corners.max(axis=1)) / 2
    np.testing.assert_array_equal(corners.astype(np.float64).sum(axis=1), 0)
    np.testing.assert_array_equal(boxes, 0)
    assert len(np.unique(corners.reshape(500, 9), axis=0)) == 500


def test_sizes_are_halved_as_often_as_float32_allows() -> None:
    points = judged("P39 x").trial.moment.points
    assert points[points > 0].min() == 2.0**-structures.FLOAT32_HALVINGS > np.finfo(np.float32).smallest_subnormal
    assert judged("P39 x").trial.moment.valid.all()


def test_structured_rays_pass_exactly_through_vertices() -> None:
    """The pixel centres of a dyadic view are the vertices of the sheet, to the last bit."""
    x = pixel_centres(16)
    moment = view(sheet(x, x, 1.0), [], (0, 0, 0), (0, 0, -1)).moment
    directions = moment.directions(np.arange(256))
    expected = np.stack([np.tile(x, 16), np.repeat(-x, 16), -np.ones(256)], axis=1)
    np.testing.assert_array_equal(directions, expected)
    ties = [len(found) for found in judged("P12").judge.referee.closest(np.zeros(3), directions).ties]
    assert sum(n >= 6 for n in ties) >= 14 * 14  # every inner vertex belongs to six triangles


def test_rays_have_components_of_minus_zero() -> None:
    for suffix, axis in (("", 0), ("y", 1), ("z", 2)):
        moment = judged(f"P07n{suffix}").trial.moment
        table = moment.column[None] + moment.row[:, None]
        zero, minus = table == 0, (table == 0) & np.signbit(table)
        assert zero.any(axis=(0, 1)).tolist() == minus.any(axis=(0, 1)).tolist()
        assert minus.any(axis=(0, 1)).tolist() == [k != (axis + 2) % 3 for k in range(3)]  # not along the view
        assert minus.sum() == 16  # half of the middle row, half of the middle column


def test_one_tile_holds_all_rays_but_a_column() -> None:
    trial = judged("S16").trial
    method = make_method("perspective_spherical")
    Session(method, trial.prepared, 512, 256, "cpu").answers(trial.moment)
    tiles = method.lights[0].sorted.lengths()
    assert tiles.max() == 511 * 256 > np.iinfo(np.uint16).max
    assert np.count_nonzero(tiles) < 256 < len(tiles)


@pytest.mark.parametrize("name", ["perspective_spherical", "ray_grids"])
@pytest.mark.parametrize("turn", ["", "y", "z"])
def test_a_spot_over_the_seam_is_the_same_spot_turned_away_from_it(name: str, turn: str) -> None:
    """In methods that divide the directions around a light; the judge tells about all of them."""
    both = []
    for case in (f"S17{turn}", f"S17r{turn}"):
        trial = judged(case).trial
        both.append(Session(make_method(name), trial.prepared, 16, 16, "cpu").answers(trial.moment))
    for key in ("triangle", "t", "shadowed"):
        np.testing.assert_array_equal(both[0][key], both[1][key], key)


def open_edges(case: str) -> int:
    """Pixels of a case whose ray, or shadow ray, passes exactly through an edge that only one triangle has."""
    one = judged(case)
    moment, faces = one.trial.moment, one.trial.prepared.faces
    welded = one.trial.prepared.weld[faces]
    edges = np.sort(welded[:, [1, 2, 2, 0, 0, 1]].reshape(-1, 2), axis=1)
    _, which, shared = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    lone = (shared[which.ravel()] < 2).reshape(-1, 3)  # opposite to each corner
    hits = one.judge.referee.closest(moment.eye, moment.directions(np.arange(moment.width * moment.height)))
    rows = np.nonzero(hits.triangle >= 0)[0]
    eye = moment.eye.astype(np.float64)
    rays = [(eye, hits.directions[rows].astype(np.float64), hits.triangle[rows])]
    for light in moment.lights:
        occluders = one.judge.referee.occluders(hits, light)
        cut = np.nonzero(occluders >= 0)[0]
        rays.append((light.astype(np.float64), hits.points[cut] - light, occluders[cut]))
    found = 0
    for origin, way, met in rays:
        a, b, c = (moment.points[faces[met, k]].astype(np.float64) - origin for k in range(3))
        weights = np.stack([np.einsum("ij,ij->i", way, np.cross(p, q)) for p, q in ((b, c), (c, a), (a, b))], axis=1)
        at_edge = np.abs(weights) <= 1e-12 * np.abs(weights).max(axis=1, keepdims=True)
        found += int((at_edge & lone[met]).any(axis=1).sum())
    return found


def test_watertight_cases_aim_at_no_open_edge() -> None:
    """A lost ray may be called a hole: its edge has triangles on both sides; or all is exact in float32 (P08)."""
    watertight = [case.name for case in CASES if judged(case.name).trial.watertight]
    exact = [name for name in watertight if name.startswith("P08")]
    for name in exact:
        coordinates = judged(name).trial.moment.points * 64
        np.testing.assert_array_equal(coordinates, np.round(coordinates), name)
    assert [name for name in watertight if open_edges(name) > 0] == exact
    assert len(watertight) > len(exact) > 0


def test_the_icosphere_is_met_at_vertices_and_edges() -> None:
    """And it is a closed surface around the eye, on a grid of 2^-12, no triangle turned over."""
    for name in ("P12i", "P12j"):
        one = judged(name)
        moment, faces = one.trial.moment, one.trial.prepared.faces
        points = moment.points.astype(np.float64)
        np.testing.assert_array_equal(points * 4096, np.round(points * 4096))
        a, b, c = (points[faces[:, k]] - moment.eye for k in range(3))
        assert (np.einsum("ij,ij->i", a, np.cross(b, c)) > 0).all()
        hits = one.judge.referee.closest(moment.eye, moment.directions(np.arange(64 * 64)))
        ties = np.array([len(found) for found in hits.ties])
        assert (ties >= 5).sum() > 50
        assert (ties == 2).sum() > 150


@pytest.mark.parametrize("case", [case for case in all_cases() if case.refused], ids=lambda case: case.name)
def test_refused(case: HardCase) -> None:
    reason = {"P18": "up must be finite and not parallel", "V sun 3e21": "too large for one; scale it below"}
    with pytest.raises(UserError, match=reason[case.name]):
        case.make()
    assert judge_refusal(case).status == "ok"
