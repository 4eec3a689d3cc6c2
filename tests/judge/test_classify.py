"""Classes of answers: what the referee says of a primary answer and of a shadow bit, planted by hand."""

import numpy as np
import pytest
from helpers import exact_answers as cases
from helpers.second_judge import SecondJudge
from shadowbench.harness.judge import arithmetic as exact
from shadowbench.harness.judge.distances import segment_to_segment
from shadowbench.harness.judge.referee import Referee
from shadowbench.harness.judge.verdict import Verdict
from shadowbench.harness.scene.prepared import prepare

QUAD = np.float32([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
QUAD_FACES = np.int32([(0, 1, 2), (0, 2, 3)])

LAYERS = np.concatenate([QUAD, QUAD + np.float32([0, 0, -1]), QUAD + np.float32([0, 0, -1 - 2.0**-21])])
LAYER_FACES = np.concatenate([QUAD_FACES, QUAD_FACES + 4, QUAD_FACES + 8])
"""Three squares: z = 0, z = -1, and one a hair behind that."""


def primary_class(x: float, y: float, given: int, keep=slice(0, 6)) -> str:
    """The class of an answer to a vertical ray from z = 1."""
    referee = Referee(LAYERS, LAYER_FACES[keep], np.ones(len(LAYER_FACES[keep])))
    hits = referee.closest(np.float32([x, y, 1]), np.float32([(0, 0, -1)]))
    return Verdict(int(referee.classify_primary(hits, np.array([given]))[0])).name


HAIR = 2.0**-22
"""Well inside the bound of 16 * 2^-24 of coordinates about 1."""

FAR = 2.0**-18
"""Well outside it."""


@pytest.mark.parametrize(
    ("x", "y", "given", "expected"),
    [
        (0.5, 0.25, 0, "OK"),
        (0.5, 0.5, 1, "TIE"),
        (0.5, 0.25, 1, "TRUE"),  # the neighbour, far from the shared edge
        (0.5, 0.5 - HAIR, 1, "NEAR_TIE"),  # the neighbour, next to the shared edge: the same t
        (0.5, 0.5 - FAR, 1, "TRUE"),
        (0.5, 0.25, -1, "TRUE"),  # a hit lost in the middle of a triangle
        (0.5, 0.25, 2, "TRUE"),  # the layer behind
        (1 - HAIR, 0.25, 2, "EDGE"),  # the layer behind, seen past the border of the first
        (1 - FAR, 0.25, 2, "TRUE"),
        (1 - HAIR, 0.25, -1, "EDGE"),  # all layers end here
        (1 - FAR, 0.25, -1, "TRUE"),
        (1 + HAIR, 0.25, 0, "EDGE"),  # a hit claimed just beside the border
        (1 + HAIR, 0.25, 2, "EDGE"),
        (1 + FAR, 0.25, 0, "TRUE"),
        (0.5, 0.25, -2, "INVALID"),
        (0.5, 0.25, 6, "INVALID"),
        (0.5, 0.25, -77, "INVALID"),
    ],
)
def test_class_of_a_primary_answer(x, y, given, expected):
    assert primary_class(x, y, given) == expected


@pytest.mark.parametrize("power", [0, 31, 60, 100])
@pytest.mark.parametrize(("share", "claimed", "lost"), [(0.9, "EDGE", "EDGE"), (1.1, "TRUE", "TRUE")])
def test_distances_from_an_edge_are_known_however_far_its_ends_are(power, share, claimed, lost):
    """A vertical ray that passes the edge of a giant triangle in a share of the bound: a hit claimed outside it, and one
    lost inside.
    """
    corners = np.float32([(-3, -2, 0), (6, 4, 0), (-5, 7, 0)]) * np.float32(2.0**power)
    referee = Referee(corners, np.int32([(0, 1, 2)]), np.ones(1))
    for side, given, expected in ((1, 0, claimed), (-1, -1, lost)):
        eye = np.float32([2 * side * share * 2.0**-20 / 13**0.5, -3 * side * share * 2.0**-20 / 13**0.5, 1])
        hits = referee.closest(eye[None], np.float32([(0, 0, -1)]))
        assert hits.triangle[0] == -1 - given
        assert Verdict(int(referee.classify_primary(hits, np.array([given]))[0])).name == expected


def test_a_layer_a_hair_behind_is_a_near_tie_and_one_further_is_not():
    assert primary_class(0.5, 0.25, 2, slice(2, 6)) == "NEAR_TIE"
    assert primary_class(0.5, 0.25, 0, slice(2, 6)) == "OK"
    assert primary_class(0.5, 0.25, 2, slice(0, 4)) == "TRUE"


def test_a_hole_at_an_inner_vertex_is_excused_only_where_nothing_else_is_hit():
    # Through the shared diagonal a miss is an edge; with a solid square behind, missing that one too is not.
    assert primary_class(0.5, 0.5, -1, slice(0, 2)) == "EDGE"
    behind = np.concatenate([QUAD, QUAD * np.float32(3) + np.float32([0, 0, -1])])
    referee = Referee(behind, np.concatenate([QUAD_FACES, QUAD_FACES + 4]), np.ones(4))
    hits = referee.closest(np.float32([1.0, 0.25, 1]), np.float32([(0, 0, -1)]))
    assert hits.triangle.tolist() == [0]
    assert referee.classify_primary(hits, np.array([2])).tolist() == [Verdict.EDGE]
    assert referee.classify_primary(hits, np.array([-1])).tolist() == [Verdict.TRUE]


def shadow_class(x: float, bit: int, light=(0.0, 0.25, 5.0), lift: float = 1.0) -> str:
    """A floor at z = 0, a square over it for x <= 0, a light: the class of a bit at (x, 0.25, 0)."""
    cover = QUAD * np.float32(8) + np.float32([-8, 0, lift])
    floor = QUAD * np.float32(4)
    referee = Referee(np.concatenate([floor, cover]), np.concatenate([QUAD_FACES, QUAD_FACES + 4]), np.ones(4))
    hits = referee.closest(np.float32([x, 0.25, min(0.5, lift / 2)]), np.float32([(0, 0, -1)]))
    assert hits.triangle[0] in (0, 1)
    return Verdict(int(referee.classify_shadow(hits, np.float32(light), np.array([bit]))[0])).name


@pytest.mark.parametrize(
    ("x", "bit", "place", "expected"),
    [
        (-1.0, 1, {}, "OK"),
        (-1.0, 0, {}, "LEAK"),
        (1.0, 0, {}, "OK"),
        (1.0, 1, {}, "ACNE"),
        (-HAIR, 0, {}, "EDGE"),
        (-(2.0**-15), 0, {}, "LEAK"),
        (HAIR, 1, {}, "EDGE"),
        (2.0**-15, 1, {}, "ACNE"),
        (1.0, 77, {}, "INVALID"),
        (-1.0, 2, {}, "INVALID"),
        (-1.0, 0, {"lift": 2.0**-21}, "EDGE"),  # an occluder within the bound of the hit point
        (-1.0, 0, {"lift": 2.0**-12}, "LEAK"),
        (1.0, 1, {"light": (0.0, 0.25, 1e7)}, "ACNE"),  # a far light does not widen the bound
        (-1.0, 0, {"light": (-1e6, 0.25, 1e7)}, "LEAK"),
    ],
)
def test_class_of_a_shadow_bit(x, bit, place, expected):
    assert shadow_class(x, bit, **place) == expected


@pytest.mark.parametrize("size", [0.5, 1.0, 8.0, 60.0])
def test_a_leak_needs_every_occluder_to_be_excused(size):
    """One cover's border passes within the bound of the segment, another covers it well; sizes change the tree."""
    floor, border = QUAD * np.float32(4), QUAD * np.float32(8) + np.float32([-8, 0, 1])
    solid = QUAD * np.float32(size) + np.float32([0.1, 0.1, 2])
    points = np.concatenate([floor, border, solid])
    faces = np.concatenate([QUAD_FACES, QUAD_FACES + 4, QUAD_FACES + 8])
    for count, expected in ((4, Verdict.EDGE), (6, Verdict.LEAK)):
        referee = Referee(points, faces[:count], np.ones(count))
        hits = referee.closest(np.float32([-HAIR, 0.25, 0.5]), np.float32([(0, 0, -1)]))
        assert referee.classify_shadow(hits, np.float32([0, 0.25, 5]), np.array([0])).tolist() == [expected]


def test_own_triangle_and_its_duplicates_excuse_no_acne():
    referee = Referee(QUAD, np.concatenate([QUAD_FACES, QUAD_FACES]), np.ones(4))
    hits = referee.closest(np.float32([0.5, 0.25, 1]), np.float32([(0, 0, -1)]))
    assert hits.ties == [(0, 2)]
    assert referee.occluded(hits, np.float32([0.3, 0.1, 4])).tolist() == [0]
    assert referee.classify_shadow(hits, np.float32([0.3, 0.1, 4]), np.array([1])).tolist() == [Verdict.ACNE]


def test_edge_bound_is_sixteen_units_of_the_largest_coordinate():
    bound = exact.edge_bound(np.float32([[1, -4, 2]]), np.float32([[[0, 0, 1], [8, 1, 1], [0, 1, 0]]]))
    assert bound.tolist() == [16 * 2.0**-24 * 8]


def test_distances_of_segments():
    p, q = np.float64([[0, 0, 0]]), np.float64([[0, 0, 4]])
    ask = lambda a, b: tuple(float(x[0]) for x in segment_to_segment(p, q, *np.float64([[a], [b]])))  # noqa: E731
    assert ask((1, -1, 1), (1, 1, 1)) == (1.0, 0.25)  # inside both
    assert ask((3, 0, 2), (3, 0, 8))[0] == 9.0  # squares; parallel: any share in common
    assert ask((0, 3, -4), (0, 9, -4)) == (25.0, 0.0)  # before the start
    assert ask((0, 0, 7), (5, 0, 7)) == (9.0, 1.0)  # beyond the end
    assert ask((0, 2, 3), (0, 2, 3)) == (4.0, 0.75)  # a point


def test_a_sample_of_a_whole_picture_equals_rational_arithmetic():
    """Ten thousand rays, decided in more than one batch."""
    prepared = prepare(cases.ball_on_floor())
    moment = prepared.moment(0, 100, 100)
    hits = Referee(moment.points, prepared.faces, moment.valid).closest(
        moment.eye, moment.directions(np.arange(10_000))
    )
    sample = np.random.default_rng(0).choice(10_000, 40, replace=False)
    seen = SecondJudge(moment.points, prepared.faces).closest(hits.origins[sample], hits.directions[sample])
    assert [hits.ties[i] for i in sample] == [one.ties if one else () for one in seen]


def test_an_answer_at_the_eye_is_never_excused():
    """An eye on a corner: t is 0, and no rounding makes the triangle a hit. Just ahead of the eye an edge excuses."""
    a, b, c = np.float32([(0.1, 0.2, 0.3), (0.7, -0.2, 0.4), (0.3, 0.5, -0.6)])
    referee = Referee(np.stack([a, b, c]), np.array([(0, 1, 2)]), np.ones(1))
    direction = np.float32([(-0.3, 0.4, 0.2)])
    assert referee.closest(b, direction).triangle.tolist() == [-1]
    assert referee.classify_primary(referee.closest(b, direction), np.array([0])).tolist() == [Verdict.TRUE]
    past = b + np.float32([0.5, 0, 0]), np.float32([(-0.5 - 1e-8, 1e-8, 0)])
    hits = referee.closest(*past)
    given = np.array([-1 if hits.triangle[0] == 0 else 0])
    assert referee.classify_primary(hits, given).tolist() == [Verdict.EDGE]


@pytest.mark.parametrize(
    ("height", "aside", "expected"),
    [
        (2.0**-6, 2.0**-17, Verdict.EDGE),  # meets the plane 4096 from the eye, 0.04 beside the edge
        (2.0**-6, 2.0**-12, Verdict.TRUE),  # there too, 1 beside it
        (0.0, 2.0**-17, Verdict.TRUE),  # the eye is in the plane
        (-(2.0**-6), 2.0**-17, Verdict.TRUE),  # the plane is behind the eye
    ],
)
def test_an_answer_is_at_the_eye_where_the_ray_meets_the_plane(height, aside, expected):
    """A wall along which a ray flies, nearest at the eye: within the bound of 0.5 there, as is all that is near."""
    wall = np.float32([(0, 0, 0), (2.0**20, 0, 0), (0, 2.0**20, 0)])
    referee = Referee(wall, np.array([(0, 1, 2)]), np.ones(1))
    hits = referee.closest(np.float32([2.0**19, -0.01, height]), np.float32([(-1, -aside, -(2.0**-18))]))
    assert hits.triangle.tolist() == [-1]
    assert referee.classify_primary(hits, np.array([0])).tolist() == [expected]


def test_a_far_corner_does_not_widen_the_bound():
    """Two triangles with corners at 1e7, and a ray 0.01 from their common edge."""
    far = np.float32([(-1e7, -1e7, 0), (1e7, -1e7, 0), (1e7, 1e7, 0), (-1e7, 1e7, 0)])
    referee = Referee(far, np.array([(0, 1, 2), (0, 2, 3)]), np.ones(2))
    for beside, expected in ((0.01, Verdict.TRUE), (1e-7, Verdict.NEAR_TIE)):
        hits = referee.closest(np.float32([beside, 0, 1]), np.float32([(0, 0, -1)]))
        assert referee.classify_primary(hits, 1 - hits.triangle).tolist() == [expected]
