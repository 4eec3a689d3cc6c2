"""Triangulation of polygons: areas, count, order, and no corner on another triangle's edge."""

import numpy as np
import pytest
from shadowbench.harness.scene.readers.polygons import triangulate

ARROW = [(0, 0), (4, -3), (1, 0), (4, 3)]
COMB = [(0, 0), (7, 0), (7, 4), (6, 4), (6, 1), (4, 1), (4, 4), (3, 4), (3, 1), (1, 1), (1, 4), (0, 4)]
STAIR = [(0, 0), (4, 0), (4, 1), (3, 1), (3, 2), (2, 2), (2, 3), (1, 3), (1, 4), (0, 4)]
BESIDE = [(0, 0), (1, 0), (2, 0), (4, 0), (4, 4), (2, 1), (0, 4), (0, 2)]  # three corners on a line, twice
TWICE = [(0, 0), (4, 0), (4, 0), (4, 4), (2, 1), (2, 1), (0, 4)]
KEYHOLE = [(0, 0), (6, 0), (6, 6), (0, 6), (0, 0), (2, 2), (2, 4), (4, 4), (4, 2), (2, 2)]
SHAPES = {"arrow": ARROW, "comb": COMB, "stair": STAIR, "beside": BESIDE, "twice": TWICE, "keyhole": KEYHOLE}


def area_of(outline) -> float:
    x, y = np.array(outline, dtype=float).T
    return float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2


def placed(outline, turn: int = 0, frame=None) -> np.ndarray:
    """The outline in space, beginning with its corner ``turn``."""
    flat = np.roll(np.array(outline, dtype=np.float64), -turn, axis=0)
    return np.c_[flat, np.zeros(len(flat))] @ (np.eye(3) if frame is None else frame)


def cut(points: np.ndarray) -> np.ndarray:
    return triangulate(points, np.array([len(points)]), np.arange(len(points)))


def areas(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (points[faces[:, i]] for i in range(3))
    return np.cross(b - a, c - a) / 2


FRAMES = [np.eye(3), np.eye(3)[[2, 0, 1]], np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]]


@pytest.mark.parametrize("frame", FRAMES, ids=["level", "upright", "oblique"])
@pytest.mark.parametrize("shape", SHAPES)
def test_the_triangles_of_a_concave_polygon_cover_it_once(shape, frame):
    for outline in (SHAPES[shape], SHAPES[shape][::-1]):
        for turn in range(len(outline)):
            points = placed(outline, turn, frame)
            faces = cut(points)
            assert faces.shape == (len(outline) - 2, 3)
            normal = areas(points, faces) @ np.cross(frame[0], frame[1])
            assert (normal * np.sign(area_of(outline)) > -1e-9).all()
            assert normal.sum() == pytest.approx(area_of(outline))
            assert np.abs(normal).sum() == pytest.approx(abs(area_of(outline)))


@pytest.mark.parametrize("shape", ["arrow", "comb", "stair", "beside", "twice"])
def test_the_outline_of_the_triangles_is_the_polygon(shape):
    """Every inner edge is shared by two triangles, so that no corner lies on another triangle's edge."""
    count = len(SHAPES[shape])
    for turn in range(count):
        edges = [(int(f[i]), int(f[(i + 1) % 3])) for f in cut(placed(SHAPES[shape], turn)) for i in range(3)]
        alone = {edge for edge in edges if edge[::-1] not in edges}
        assert alone == {(i, (i + 1) % count) for i in range(count)}


def drawn(rng: np.random.Generator) -> np.ndarray:
    """A star, a comb or a spiral, sometimes with corners on its sides, once or twice each."""
    n = int(rng.integers(4, 14))
    turn = np.linspace(0, 2 * np.pi, n, endpoint=False)
    if (kind := rng.integers(3)) == 0:
        outline = np.c_[np.cos(turn), np.sin(turn)] * rng.uniform(0.1, 3, (n, 1))
    elif kind == 1:
        steps = np.arange(n)
        outline = np.r_[np.c_[steps, 0 * steps], np.c_[steps, 1 + rng.random(n) * 5 * (steps % 2)][::-1]]
    else:
        along = np.linspace(0, 4 * np.pi, 3 * n)[:, None]
        way = np.c_[np.cos(along), np.sin(along)]
        outline = np.r_[(1.0 + along) * way, ((0.6 + along) * way)[::-1]]
    for _ in range(rng.integers(4)):
        k = int(rng.integers(len(outline)))
        middle = (outline[k] + outline[(k + 1) % len(outline)]) / 2
        outline = np.insert(outline, k + 1, [middle] * int(rng.integers(1, 3)), axis=0)
    return outline


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_drawn_polygons_are_covered_once(kind):
    rng = np.random.default_rng(5)
    for _ in range(150):
        outline = drawn(rng)
        frame = np.linalg.qr(rng.normal(size=(3, 3)))[0] * 10 ** rng.uniform(-3, 3)
        points = placed(outline, int(rng.integers(len(outline))), frame).astype(kind)
        faces = cut(points)
        normal = np.cross(frame[0], frame[1])
        own = areas(points.astype(np.float64), faces) @ normal / (normal @ normal)
        assert len(faces) == len(outline) - 2
        assert own.sum() == pytest.approx(area_of(outline), rel=1e-4)
        assert np.abs(own).sum() == pytest.approx(abs(area_of(outline)), rel=1e-4)


def test_a_convex_polygon_is_a_fan_and_triangles_stay():
    circle = [(np.cos(a), np.sin(a)) for a in np.linspace(0, 2 * np.pi, 9)[:-1]]
    assert cut(placed(circle)).tolist() == [[0, i, i + 1] for i in range(1, 7)]
    with_straight = [(0, 0), (1, 0), (2, 0), (2, 2), (0, 2)]
    assert cut(placed(with_straight)).tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4]]


def test_float32_noise_on_a_straight_side_keeps_the_fan():
    frame = FRAMES[2]
    points = (placed([(0, 0), (1, 0), (2, 0), (3, 0), (3, 3), (0, 3)], frame=frame) + 5).astype(np.float32)
    assert cut(points).tolist() == [[0, i, i + 1] for i in range(1, 5)]


def test_polygons_keep_their_order_and_their_number_of_triangles():
    parts = [placed(ARROW, 1), placed([(0, 0), (1, 0), (0, 1)]), placed(COMB, 5), placed(ARROW, 0), placed(STAIR, 3)]
    counts = np.array([len(part) for part in parts])
    points, starts = np.concatenate(parts), np.cumsum(counts) - counts
    faces = triangulate(points, counts, np.arange(len(points)))
    owner = np.repeat(np.arange(len(parts)), counts - 2)
    assert (np.searchsorted(starts, faces, side="right") - 1 == owner[:, None]).all()
    for k, part in enumerate(parts):
        own = faces[owner == k] - starts[k]
        assert own.tolist() == cut(part).tolist()


def test_many_polygons_in_blocks_are_cut_as_alone():
    many = 40_000
    points = np.tile(placed(ARROW), (many, 1)) + np.repeat(np.arange(many), 4)[:, None]
    faces = triangulate(points, np.full(many, 4), np.arange(4 * many))
    alone = cut(placed(ARROW))
    assert (faces == (alone[None] + 4 * np.arange(many)[:, None, None]).reshape(-1, 3)).all()


@pytest.mark.parametrize(
    "points",
    [
        np.full((5, 3), np.nan),
        np.zeros((5, 3)),
        np.array([(0, 0, 0), (4, 0, 0), (0, 3, 0), (4, 3, 0), (2, 9, 0)], dtype=float),  # crosses itself
        np.array([(0, 0, 0), (1e308, 0, 0), (1e308, 1e308, 0), (1e307, 2e307, 0), (0, 1e308, 0)]),
    ],
    ids=["nan", "a point", "crossing", "huge"],
)
def test_what_has_no_triangulation_still_has_its_number_of_triangles(points):
    faces = cut(points)
    assert faces.shape == (3, 3)
    assert set(faces.ravel()) == set(range(5))


def test_an_index_out_of_range_is_left_to_the_check():
    assert triangulate(np.zeros((3, 3)), np.array([4]), np.array([0, 1, 2, 7])).tolist() == [[0, 1, 2], [0, 2, 7]]


def test_a_polygon_of_more_corners_than_a_block():
    count = 70_000
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    assert triangulate(circle, np.array([count]), np.arange(count)).shape == (count - 2, 3)
