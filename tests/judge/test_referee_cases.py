"""Hard cases whose answer is known beforehand: the referee must give exactly these."""

from __future__ import annotations

import numpy as np
import pytest
from shadowbench.harness.judge.hits import Hits
from shadowbench.harness.judge.referee import Referee
from shadowbench.harness.scene.prepared import valid_triangles

Array = np.ndarray


def make(points, faces) -> Referee:
    points, faces = np.asarray(points, dtype=np.float32), np.asarray(faces, dtype=np.int32)
    return Referee(points, faces, valid_triangles(points, faces))


def quad(a, b, c, d) -> tuple[list, list]:
    return [a, b, c, d], [(0, 1, 2), (0, 2, 3)]


def box(half: float) -> tuple[Array, Array]:
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))])


def from_points(receivers) -> Hits:
    """Hit points at receivers that lie on no triangle of the mesh; their own triangle is given as 0."""
    ends = np.asarray(receivers, dtype=np.float32).reshape(-1, 3)
    count = len(ends)
    own = np.zeros(count, dtype=np.int32)
    return Hits(ends, np.zeros_like(ends), own, np.ones(count), [(1, 1)] * count, [(0,)] * count)


def shadows(occluders: tuple, receivers, light=(0, 0, 0)) -> list[int]:
    """Shadow bits of free receivers. Triangle 0, their own, is a speck far away."""
    points, faces = occluders
    speck = [(900, 900, 900), (901, 900, 900), (900, 901, 900)]
    points = np.concatenate([speck, np.asarray(points, dtype=float)])
    referee = make(points, np.concatenate([[(0, 1, 2)], np.asarray(faces) + 3]))
    return referee.occluded(from_points(receivers), np.float32(light)).tolist()


def test_s01_seam_of_the_azimuth():
    wall = quad((-2, -1, -1), (-2, 1, -1), (-2, 1, 1), (-2, -1, 1))
    receivers = [(-4, y, 0) for y in np.linspace(-1.6, 1.6, 33)]
    assert shadows(wall, receivers) == [1] * 33


def test_s02_pole_inside_a_triangle():
    triangle = ([(0.4, 0, 1), (-0.3, 0.35, 1), (-0.2, -0.3, 1)], [(0, 1, 2)])
    assert shadows(triangle, [(0, 0, 3), (0.1, 0.05, 3), (-0.2, 0.1, 3)]) == [1, 1, 1]


def test_s03_nadir_pole_under_a_ceiling_light():
    floor = quad((-2, -2, -1.5), (2, -2, -1.5), (2, 2, -1.5), (-2, 2, -1.5))
    ring = [(2 * np.cos(a), 2 * np.sin(a), -3) for a in np.linspace(0, 2 * np.pi, 64, endpoint=False)]
    assert shadows(floor, ring) == [1] * 64


def test_s04_edge_through_the_pole():
    triangle = ([(1, 0, 2), (-1, 0, 2), (-1, 1e-3, 2)], [(0, 1, 2)])
    assert shadows(triangle, [(-1.5, 1e-3, 4), (0, -0.5, 4), (0, 0, 4)]) == [1, 0, 1]


def test_s05_bulge_of_a_great_circle_edge():
    def at(azimuth: float, elevation: float) -> tuple[float, float, float]:
        a, b = np.radians(azimuth), np.radians(elevation)
        return np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)

    triangle = ([at(50, 45), at(-50, 45), at(0, 30)], [(0, 1, 2)])
    receivers = [3 * np.array(at(0, e)) for e in np.linspace(46, 57, 9)]
    assert shadows(triangle, receivers) == [1] * 9


@pytest.mark.parametrize(("light", "bit"), [((0, 0, 0.5), 0), ((0, 0, 0), 0), ((0, 0, -0.25), 1)])
def test_s06_s07_a_light_in_a_triangle_is_not_shadowed_by_it(light, bit):
    triangle = ([(1, 0, 0), (-1, 1, 0), (-1, -1, 0)], [(0, 1, 2)])
    assert shadows(triangle, [(0, 0, 2)], light) == [bit]


def test_s08_light_inside_a_closed_box():
    receivers = [(2, 0.3, 0.2), (-1.5, 1.2, 0.1), (0.5, 0.5, 0.5), (-0.9, 0.9, -0.9), (0.1, -3, 0.2)]
    assert shadows(box(1.0), receivers) == [1, 1, 0, 0, 1]


def test_s09_light_inside_a_slab_thinner_than_any_epsilon():
    points, faces = box(1.0)
    assert shadows((points * [1, 1, 1e-6], faces), [(0.2, 0.1, 1), (-0.3, 0.4, -1), (3, 0, 0)]) == [1, 1, 1]


@pytest.mark.parametrize("distance", [1e3, 1e5, 1e7])
def test_s10_far_light(distance):
    wall = quad((-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1))
    assert shadows(wall, [(0, 0, 0), (0.9, 0.9, 0), (1.1, 0, 0)], (0, 0, distance)) == [1, 1, 0]


def test_s11_tiny_occluder_next_to_the_light():
    half = 1e-5
    tiny = quad((-half, -half, 1e-4), (half, -half, 1e-4), (half, half, 1e-4), (-half, half, 1e-4))
    assert shadows(tiny, [(0, 0, 1), (0.2, 0, 1), (0, -0.2, 1)]) == [1, 0, 0]


def test_s12_s13_a_receiver_on_or_just_above_its_plane_is_lit():
    floor = quad((-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0))
    assert shadows(floor, [(0.3, 0.2, 0), (0.3, 0.2, 2.0**-149), (0.3, 0.2, -(2.0**-149))], (0, 0, 2)) == [
        0,
        0,
        1,
    ]


def test_s14_a_receiver_at_the_light_is_lit():
    assert shadows(box(1.0), [(0, 0, 0), (1, 0, 0)], (0, 0, 0)) == [0, 0]
    assert shadows(box(1.0), [(1, 0, 0)], (1, 0, 0)) == [0]


# --- primary rays -------------------------------------------------------------------------------------------


def first(referee: Referee, eye, directions) -> list[int]:
    return referee.closest(np.float32(eye), np.float32(directions)).triangle.tolist()


def test_p01_p02_triangles_behind_and_across_the_eye():
    across = make([(-1, -1, -5), (1, -1, -5), (0, 1, 0.5)], [(0, 1, 2)])
    assert first(across, (0, 0, 0), [(0, 0, -1), (0, -0.1, -1), (0, 0, 1), (0.9, 0, -1)]) == [0, 0, -1, -1]
    behind = make([(-1, -1, 5), (1, -1, 5), (0, 1, 5)], [(0, 1, 2)])
    assert first(behind, (0, 0, 0), [(0, 0, -1), (0.1, 0, -1)]) == [-1, -1]


def test_p03_inside_a_box_every_ray_hits():
    rng = np.random.default_rng(0)
    directions = np.concatenate([rng.normal(size=(50, 3)), np.eye(3), -np.eye(3), [(1, 1, 1), (1, -1, 0)]])
    assert min(first(make(*box(1.0)), (0, 0, 0), directions)) >= 0


def test_p04_one_huge_triangle():
    huge = make([(-1e4, -1e4, -1), (1e4, -1e4, -1), (0, 1e4, -1)], [(0, 1, 2)])
    assert first(huge, (0, 0, 0), [(x, y, -1) for x in (-3, 0, 3) for y in (-3, 0, 3)]) == [0] * 9


def test_p05_degenerate_triangles_before_a_square():
    points, faces = quad((-1, -1, -2), (1, -1, -2), (1, 1, -2), (-1, 1, -2))
    points += [(0, 0, -1), (0.5, 0, -1), (1, 0, -1), (np.nan, 0, -1), (np.inf, 0, -1)]
    odd = [(4, 4, 4), (4, 5, 6), (4, 5, 7), (4, 5, 8)]
    assert first(make(points, odd + faces), (0, 0, 0), [(0.1, 0, -1), (0.1, 0.3, -1)]) == [4, 5]


def test_p06_the_lowest_of_equal_triangles():
    points, _ = quad((-1, -1, -2), (1, -1, -2), (1, 1, -2), (-1, 1, -2))
    referee = make(points, [(0, 1, 2), (2, 0, 1), (1, 0, 2)])
    hits = referee.closest(np.float32([0, 0, 0]), np.float32([(0.2, -0.2, -1)]))
    assert hits.ties == [(0, 1, 2)]


def lattice(n: int = 8) -> Referee:
    points = [(x, y, 0) for x in range(n + 1) for y in range(n + 1)]
    at = lambda x, y: x * (n + 1) + y  # noqa: E731
    cells = [(x, y) for x in range(n) for y in range(n)]
    faces = [(at(x, y), at(x + 1, y), at(x + 1, y + 1)) for x, y in cells]
    faces += [(at(x, y), at(x + 1, y + 1), at(x, y + 1)) for x, y in cells]
    return make(points, faces)


@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_p07_p08_vertical_rays_on_vertices_edges_and_the_border_of_a_flat_lattice(zero):
    half = [i / 2 for i in range(17)]
    targets = np.float32([(x, y, 5) for x in half for y in half])
    hits = lattice().closest(targets, np.broadcast_to(np.float32([zero, zero, -1]), targets.shape))
    assert (hits.triangle >= 0).sum() == 289
    assert hits.t.tolist() == [5.0] * 289


def test_p09_rays_in_the_plane_of_a_lattice_hit_nothing():
    directions = [(1, 0, 0), (1, 1, 0), (0.3, 0.7, 0)]
    assert first(lattice(), (-1, -1, 0), directions) == [-1] * 3
    assert first(lattice(), (4, 4, 0), directions) == [-1] * 3


def test_p10_a_diagonal_ray_through_the_corners_of_cells():
    cells = [(k, k, k) for k in range(1, 5)]
    points = [p for x, y, z in cells for p in ((x + 1, y, z), (x, y + 1, z), (x, y, z + 1))]
    faces = np.arange(12).reshape(-1, 3)
    assert first(make(points, faces), (0, 0, 0), [(1, 1, 1), (-1, -1, -1)]) == [0, -1]


def test_p16_tiny_object_next_to_a_huge_floor():
    floor = [(-1e3, 0, -1e3), (1e3, 0, -1e3), (0, 0, 1e3)]
    points, faces = box(1e-3)
    referee = make(np.concatenate([floor, points + [0, 2e-3, 0]]), np.concatenate([[(0, 1, 2)], faces + 3]))
    hits = referee.closest(np.float32([0, 0.5, 0]), np.float32([(0, -1, 1e-4), (0, -1, 0.1)]))
    assert [int(k > 0) for k in hits.triangle] == [1, 0]
    assert referee.occluded(hits, np.float32([0, 9, 0])).tolist() == [0, 0]
    assert referee.occluded(hits, np.float32([0, -9, 0])).tolist() == [1, 0]
