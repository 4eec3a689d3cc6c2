"""The referee (``filter_kernels.py``) against plain rational brute force, and errors planted for it to
find.
"""

import numpy as np
import pytest
from helpers import exact_answers as cases
from helpers.devices import needs_gpu
from helpers.second_judge import SecondJudge
from helpers.second_opinion import Count
from helpers.second_opinion import compare as second_opinion
from hypothesis import given, settings
from hypothesis import strategies as st
from shadowbench.harness.judge.candidates import Candidates, Segments, in_planes
from shadowbench.harness.judge.referee import Referee
from shadowbench.harness.judge.verdict import Verdict
from shadowbench.harness.scene.prepared import prepare, valid_triangles


def compare(points, faces, origins, directions, light) -> None:
    """Closest hits, tie sets, all hits and shadow bits against rational arithmetic."""
    referee = Referee(points, faces, valid_triangles(points, faces))
    origins = np.broadcast_to(origins, directions.shape)
    assert second_opinion(referee, SecondJudge(points, faces), origins, directions, light[None], Count()) == []
    every = referee.all_hits(origins, directions)
    for ties, found in zip(referee.closest(origins, directions).ties, every, strict=True):
        assert set(ties) <= {k for _, k in found}


@st.composite
def lattice_case(draw):
    """A soup on a small lattice: rays, vertices, edges and planes meet exactly all the time."""
    whole = st.integers(-4, 4)
    point = st.tuples(whole, whole, whole)
    points = np.array(draw(st.lists(point, min_size=3, max_size=9)), dtype=np.float32)
    corner = st.integers(0, len(points) - 1)
    faces = np.array(draw(st.lists(st.tuples(corner, corner, corner), min_size=1, max_size=10)), dtype=np.int32)
    eye = np.array(draw(point), dtype=np.float32)
    targets = np.array(draw(st.lists(point, min_size=8, max_size=8)), dtype=np.float32)
    light = np.array(draw(point), dtype=np.float32)
    scale = np.float32(2.0 ** draw(st.sampled_from([0, -20, 20, -60])))
    return points * scale, faces, eye * scale, targets - eye, light * scale


@settings(derandomize=True, max_examples=40, deadline=None)
@given(lattice_case())
def test_lattice_soup_equals_rational_arithmetic(case):
    points, faces, eye, directions, light = case
    # Rays through vertices and the middles of edges, besides those through lattice points.
    corners = points[faces[: min(4, len(faces))]]
    aimed = np.concatenate([corners[:, 0] - eye, (corners[:, 0] + corners[:, 1]) / 2 - eye])
    compare(points, faces, eye, np.concatenate([directions, aimed]).astype(np.float32), light)


def test_batches_and_tree_give_the_same_as_brute_force():
    """Several hundred triangles, so that the tree has levels and boxes are skipped."""
    rng = np.random.default_rng(3)
    centres = rng.uniform(-1, 1, size=(250, 1, 3))
    points = (centres + rng.normal(scale=0.15, size=(250, 3, 3))).reshape(-1, 3).astype(np.float32)
    faces = np.arange(750, dtype=np.int32).reshape(-1, 3)
    directions = np.concatenate([rng.normal(size=(20, 3)), [[0, 0, -1], [0, -0.0, -1], [1, 0, 0]]])
    compare(points, faces, np.float32([0, 0, 3]), directions.astype(np.float32), np.float32([3, 3, 3]))


@pytest.mark.parametrize("exponent", [-140, -100, 0, 60, 120])
def test_a_power_of_two_changes_nothing(exponent):
    rng = np.random.default_rng(1)
    points = rng.integers(-100, 100, size=(30, 3)).astype(np.float32)
    faces = rng.integers(0, 30, size=(20, 3)).astype(np.int32)
    eye, directions = np.float32([0, 0, 150]), (points - np.float32([0, 0, 150])).astype(np.float32)
    light = np.float32([50, 200, 100])
    valid = valid_triangles(points, faces)
    plain, factor = Referee(points, faces, valid), np.float32(2.0**exponent)
    scaled = Referee(points * factor, faces, valid)
    a, b = plain.closest(eye, directions), scaled.closest(eye * factor, directions * factor)
    assert a.ties == b.ties
    assert (a.triangle >= 0).sum() > 10
    np.testing.assert_array_equal(a.t, b.t)
    np.testing.assert_array_equal(plain.occluded(a, light), scaled.occluded(b, light * factor))


@pytest.mark.gpu
@needs_gpu
def test_the_filter_on_a_gpu_gives_the_same_answers():
    prepared = prepare(cases.ball_on_floor())
    moment = prepared.moment(0, 64, 48)
    arguments = (moment.points, prepared.faces, moment.valid)
    here, there = Referee(*arguments), Referee(*arguments, device="cuda:0")
    directions = moment.directions(np.arange(64 * 48))
    a, b = here.closest(moment.eye, directions), there.closest(moment.eye, directions)
    assert (a.ties, a.ratio) == (b.ties, b.ratio)
    np.testing.assert_array_equal(here.occluded(a, moment.lights[0]), there.occluded(b, moment.lights[0]))
    given = np.random.default_rng(0).integers(-1, len(prepared.faces), size=64 * 48)
    np.testing.assert_array_equal(here.classify_primary(a, given), there.classify_primary(b, given))
    bits = np.random.default_rng(1).integers(0, 2, size=64 * 48)
    light = moment.lights[0]
    np.testing.assert_array_equal(here.classify_shadow(a, light, bits), there.classify_shadow(b, light, bits))


QUAD = np.float32([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
QUAD_FACES = np.int32([(0, 1, 2), (0, 2, 3)])


def test_invalid_triangles_are_never_hit_and_keep_their_index():
    points = np.concatenate([QUAD, np.float32([(np.nan, 0, 0.5), (np.inf, 0, 0.5)])])
    faces = np.int32([(0, 0, 1), (0, 1, 4), (0, 1, 5), (0, 1, 2), (0, 2, 3)])
    referee = Referee(points, faces, valid_triangles(points, faces))
    hits = referee.closest(np.float32([0.5, 0.25, 1]), np.float32([(0, 0, -1)]))
    assert hits.ties == [(3,)]
    assert referee.classify_primary(hits, np.array([1])).tolist() == [Verdict.INVALID]


def test_empty_mesh():
    referee = Referee(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    hits = referee.closest(np.float32([0, 0, 1]), np.float32([(0, 0, -1)]))
    assert hits.triangle.tolist() == [-1]
    assert referee.occluded(hits, np.float32([0, 5, 0])).tolist() == [0]
    assert referee.classify_primary(hits, np.array([0])).tolist() == [Verdict.INVALID]


def test_duplicates_are_found_whatever_the_order_of_their_vertices():
    points = np.concatenate([QUAD, QUAD * np.float32(-1.0) * np.float32(-1.0), QUAD + np.float32(1)])
    faces = np.int32([(0, 1, 2), (0, 2, 3), (6, 5, 4), (4, 6, 7), (8, 9, 10), (0, 1, 3)])
    referee = Referee(points, faces, np.ones(6))
    assert referee.duplicate_of.tolist() == [0, 1, 0, 1, 4, 5]


# --- where float64 alone is not enough: every case below lies exactly on a boundary with long mantissas ---------


def test_rays_exactly_along_edges_with_long_mantissas():
    """24-bit integers: triple products need 72 bits, so float64 sees the exact zeros as noise of either sign."""
    rng = np.random.default_rng(5)
    count = 60
    o = rng.integers(-(2**21), 2**21, size=(count, 3))
    d = rng.integers(-(2**21), 2**21, size=(count, 3))
    w = rng.integers(-(2**21), 2**21, size=(count, 3))
    away = rng.integers(-(2**21), 2**21, size=(count, 3))
    points = np.stack([o + d - w, o + d + w, o + d + away], axis=1)  # the ray meets the middle of the first edge
    assert np.abs(points).max() < 2**24
    points = points.astype(np.float32)
    for i in range(count):
        faces = np.int32([(0, 1, 2)])
        referee = Referee(points[i], faces, np.ones(1))
        hits = referee.closest(o[i].astype(np.float32), d[i : i + 1].astype(np.float32))
        assert hits.ties == [(0,)]
        assert hits.ratio[0][0] == hits.ratio[0][1]


def thirds(rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """An eye, a direction down to a floor at y = 0, and the triple of the point hit: not a float64 number."""
    while True:
        eye = rng.integers(-(2**18), 2**18, size=3)
        eye[1] = 3 * int(rng.integers(1, 2**16)) + 1
        d = rng.integers(-5, 6, size=3)
        d[1] = -3
        point3 = 3 * eye + eye[1] * d
        if (point3[[0, 2]] % 3 != 0).all():
            return eye, d, point3


def test_shadow_segments_exactly_along_edges_from_points_that_float64_cannot_hold():
    """Hit point p / 3, light 4 m - p: the segment meets the edge through the lattice point m exactly."""
    rng = np.random.default_rng(6)
    size = 2**22
    for _ in range(60):
        eye, d, point3 = thirds(rng)
        m = rng.integers(-(2**18), 2**18, size=3)
        m[1] = int(eye[1]) + int(rng.integers(2**17, 2**18))
        light = 4 * m - point3
        w = rng.integers(-(2**17), 2**17, size=3)
        w[1] = 0
        side = rng.integers(-(2**17), 2**17, size=3)
        side[1] = 0
        floor = [(-size, 0, -size), (size, 0, -size), (0, 0, size)]
        points = np.array([*floor, m - w, m + w, m + side]).astype(np.float32)
        faces = np.int32([(0, 1, 2), (3, 4, 5)])
        arguments = (points, faces, valid_triangles(points, faces))
        referee = Referee(*arguments)
        hits = referee.closest(eye.astype(np.float32), d[None].astype(np.float32))
        assert hits.ties == [(0,)]
        assert hits.ratio[0][0] * 3 == hits.ratio[0][1] * int(eye[1])
        assert referee.occluders(hits, light.astype(np.float32)).tolist() == [1]


def test_a_ray_within_rounding_of_a_plane_is_still_a_hit():
    """n . d = 2^-60 with components of size 1: certain to nobody but exact arithmetic."""
    points = np.float32([(0, 0, 0), (1, 1, 0), (0, 1, 1)])
    referee = Referee(points, np.int32([(0, 1, 2)]), np.ones(1))
    tiny = 2.0**-60
    hits = referee.closest(np.float32([-1, -1, -1.5 * tiny]), np.float32([(1, 1, tiny), (1, 1, 0)]))
    assert hits.ties == [(0,), ()]
    assert hits.t.tolist() == [1.5, np.inf]


@pytest.mark.parametrize("order", [(0, 1, 2), (0, 2, 1)])
def test_a_surface_at_the_light_or_at_the_point_casts_no_shadow_whichever_way_it_faces(order):
    order = list(order)
    points = np.concatenate([QUAD[:3], QUAD[:3] + np.float32([0, 0, 2]), QUAD[:3] * np.float32([1, 1, 0])])
    faces = np.int32([(0, 1, 2), np.array([3, 4, 5])[order], np.array([6, 7, 8])[order]])
    referee = Referee(points, faces, np.ones(3))
    hits = referee.closest(np.float32([0.5, 0.25, 1]), np.float32([(0, 0, -1)]))
    assert hits.ties == [(0, 2)]
    for z, bit in ((2.0, 0), (2.0 + 2.0**-20, 1), (1.0, 0)):
        assert referee.occluded(hits, np.float32([0.5, 0.25, z])).tolist() == [bit]


@pytest.mark.parametrize("axis", [None, 0, 2])
def test_small_occluders_touched_far_from_the_origin(axis):
    """The rounding of the hit point (2^-33 here) is far more than that of the occluder seen from it.

    With an axis the occluder's box, too, is met only at its border.
    """
    rng = np.random.default_rng(7)
    size = 2**22
    for _ in range(60):
        eye, d, _ = thirds(rng)
        eye[1] = 4
        point3 = 3 * eye + 4 * d
        m = point3 // 3 + rng.integers(-3, 4, size=3)
        m[1] = int(rng.integers(1, 4))
        light = 4 * m - point3
        w, side = rng.integers(-4, 5, size=3), rng.integers(-4, 5, size=3)
        if axis is not None:
            w, side = (np.eye(3, dtype=int)[axis] * 3, np.eye(3, dtype=int)[2 - axis] * int(rng.choice([-2, 2])))
        w[1] = side[1] = 0
        floor = [(-size, 0, -size), (size, 0, -size), (0, 0, size)]
        # Four large triangles fill a leaf of the tree; the occluder's box is its own.
        below = [(x, -10 * k, z) for k in range(4) for x, _, z in floor]
        points = np.array([*below, m - w, m + w, m + side]).astype(np.float32)
        faces = np.arange(15, dtype=np.int32).reshape(5, 3)
        valid = valid_triangles(points, faces)
        referee = Referee(points, faces, valid)
        hits = referee.closest(eye.astype(np.float32), d[None].astype(np.float32))
        if hits.ties == [(0,)]:
            assert referee.occluders(hits, light.astype(np.float32)).tolist() == [4 if valid[4] else -1]


def test_triangles_whose_planes_hold_a_light_are_no_candidates():
    """A flat mesh lit along itself: thousands of candidates for each segment, none of which can meet it."""
    random = np.random.default_rng(4)
    points = random.integers(-64, 64, (300, 3)).astype(np.float32) / 64
    points[:200, 2] = 0.25
    faces = np.arange(300).reshape(-1, 3)
    light = np.float32([3, 0.5, 0.25])
    held = in_planes(points[faces], light)
    exact = [np.linalg.det((points[f] - light).astype(np.float64) * 64) for f in faces]
    np.testing.assert_array_equal(held, np.abs(exact) < 0.5)
    assert 66 <= held.sum() < 80
    found = Candidates(points, faces, np.ones(100), "cpu")
    starts = np.float64([(-1, 0.25, 0.25), (0, 0, 0.25)])
    lit = Segments.where(np.ones((1, 2), dtype=bool))
    margin = np.full(2, 1e-3)
    ((_, lists, _),) = found.between(starts, np.int32([-1, -1]), light[None], lit, every=True, margin=margin)
    assert not held[lists.found].any()
