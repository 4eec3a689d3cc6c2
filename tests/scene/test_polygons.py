"""Triangulation of polygons: areas, count, order, and no corner on another triangle's edge."""

import numpy as np
import pytest
from shadowbench.harness.scene.readers import polygons
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


def require_covered_once(points: np.ndarray, outline, frame: np.ndarray, tolerance: float) -> None:
    """The triangles are as many as they must be, all turned one way, and have the polygon's area."""
    faces = cut(points)
    a, b, c = points.astype(np.float64)[faces].transpose(1, 0, 2)
    normal = np.cross(frame[0], frame[1])
    own = np.cross(b - a, c - a) / 2 @ normal / (normal @ normal)
    assert faces.shape == (len(outline) - 2, 3)
    assert own.sum() == pytest.approx(area_of(outline), rel=tolerance)
    assert np.abs(own).sum() == pytest.approx(abs(area_of(outline)), rel=tolerance)


FRAMES = [np.eye(3), np.eye(3)[[2, 0, 1]], np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]]


@pytest.mark.parametrize("shape", SHAPES)
def test_the_triangles_of_a_concave_polygon_cover_it_once(shape):
    """And every inner edge is shared by two triangles, so that no corner lies on another triangle's edge."""
    for outline in (SHAPES[shape], SHAPES[shape][::-1]):
        count = len(outline)
        for turn in range(count):
            for frame in FRAMES:
                require_covered_once(placed(outline, turn, frame), outline, frame, 1e-9)
            edges = [(int(f[i]), int(f[(i + 1) % 3])) for f in cut(placed(outline, turn)) for i in range(3)]
            alone = {edge for edge in edges if edge[::-1] not in edges}
            assert shape == "keyhole" or alone == {(i, (i + 1) % count) for i in range(count)}


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
    for _ in range(100):
        outline = drawn(rng)
        frame = np.linalg.qr(rng.normal(size=(3, 3)))[0] * 10 ** rng.uniform(-3, 3)
        require_covered_once(placed(outline, int(rng.integers(len(outline))), frame).astype(kind), outline, frame, 1e-4)


CIRCLE = [(np.cos(a), np.sin(a)) for a in np.linspace(0, 2 * np.pi, 9)[:-1]]
STRAIGHT = [(0, 0), (1, 0), (2, 0), (3, 0), (3, 3), (0, 3)]


@pytest.mark.parametrize(
    "points", [placed(CIRCLE), placed(STRAIGHT), (placed(STRAIGHT, 0, FRAMES[2]) + 5).astype("f4")]
)
def test_a_convex_polygon_is_a_fan_though_its_sides_be_straight_but_for_rounding(points):
    assert cut(points).tolist() == [[0, i, i + 1] for i in range(1, len(points) - 1)]


def test_polygons_keep_their_order_and_their_number_of_triangles(monkeypatch):
    monkeypatch.setattr(polygons, "_BLOCK", 50)  # corners: they are cut in several blocks
    some = [placed(ARROW, 1), placed([(0, 0), (1, 0), (0, 1)]), placed(COMB, 5), placed(ARROW, 0), placed(STAIR, 3)]
    parts = some * 20
    counts = np.array([len(part) for part in parts])
    points, starts = np.concatenate(parts), np.cumsum(counts) - counts
    faces = triangulate(points, counts, np.arange(len(points)))
    own = faces - np.repeat(starts, counts - 2)[:, None]
    assert own.tolist() == np.concatenate([cut(part) for part in some] * 20).tolist()


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
    angle = np.linspace(0.0, 2.0 * np.pi, 70_000, endpoint=False)
    assert cut(placed(np.c_[np.cos(angle), np.sin(angle)])).shape == (69_998, 3)
