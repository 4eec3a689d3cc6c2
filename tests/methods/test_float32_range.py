"""What float32 decides (``exact/planes.py``, ``ray_tests.py``, ``camera/tiles.py``, ``footprint.py``) is so, in every
unit from 1e-36 to 1e36 and where these meet in one mesh.

Products of two lengths leave float32 from 2e19 on and below 1e-19, those of three from 7e12 and 2e-13. A test may then
decide nothing, but it may not decide wrongly. Each verdict of a kernel's test is compared with exact arithmetic, and
those that are certain and wrong are counted.
"""

import numpy as np
import pytest
import warp as wp
from helpers.launched import launched
from shadowbench.harness.frame.geometry import Camera, Corners, Ray, filled
from shadowbench.harness.frame.vectors import largest, total
from shadowbench.harness.judge import arithmetic
from shadowbench.methods.exact.segment import may_occlude
from shadowbench.methods.exact.triangle import may_hit
from shadowbench.methods.perspective_spherical.camera.ray_tests import passes_bounded, plane_record
from shadowbench.methods.perspective_spherical.camera.tiles import screen_triangle, tile_missed
from shadowbench.methods.perspective_spherical.light.segment_tests import NO, YES, segment_bounded, segment_exact
from shadowbench.methods.streams.camera.pixels import edge_planes, least_edge, sign_bound
from shadowbench.methods.streams.cube.footprint import sides_of_planes
from shadowbench.methods.streams.cube.lights import Cube
from shadowbench.methods.streams.cube.rectangle import BINS
from shadowbench.methods.streams.occlusion import planes as rays

COUNT = 6000
MISS, UNDECIDED, HIT = -1, 0, 1

RAY_TESTS = ("may_hit", "plane_record", "edge_planes", "screen_triangle")
SEGMENT_TESTS = ("may_occlude", "segment_exact", "occluder_of", "sides_of_planes")


@wp.func
def missed(no: wp.bool) -> wp.int32:
    return wp.where(no, MISS, UNDECIDED)


@wp.kernel(enable_backward=False)
def ray_kernel(
    camera: Camera, o: wp.array(dtype=wp.vec3f), d: wp.array(dtype=wp.vec3f), corners: wp.array2d(dtype=wp.vec3f),
    verdicts: wp.array2d(dtype=wp.int32),
):  # fmt: skip
    """Verdicts of :data:`RAY_TESTS` on a ray whose direction is a pixel's, (x, y, -1): of the first two on its line."""
    i = wp.tid()
    triangle = Corners(corners[i, 0], corners[i, 1], corners[i, 2])
    verdicts[i, 0] = missed(not may_hit(Ray(o[i], d[i]), triangle))
    record = plane_record(o[i], triangle, wp.vec3i(0, 1, 2))
    verdicts[i, 1] = missed(not passes_bounded(d[i], total(d[i]), record))
    low = least_edge(edge_planes(o[i], triangle), d[i])
    bound = sign_bound(camera.tangents)
    verdicts[i, 2] = wp.where(low > bound, HIT, missed(low < -bound))
    seen = Corners(triangle.a - o[i], triangle.b - o[i], triangle.c - o[i])
    screen = screen_triangle(camera, Corners(turned(seen.a), turned(seen.b), turned(seen.c)), 0.0)
    verdicts[i, 3] = missed(tile_missed(screen, d[i][0], d[i][0], d[i][1], d[i][1]))


@wp.func
def turned(p: wp.vec3f) -> wp.vec3f:
    return p


@wp.kernel(enable_backward=False)
def segment_kernel(
    h: wp.array(dtype=wp.vec3f), light: wp.array(dtype=wp.vec3f), corners: wp.array2d(dtype=wp.vec3f),
    verdicts: wp.array2d(dtype=wp.int32),
):  # fmt: skip
    """Verdicts of :data:`SEGMENT_TESTS` on the open segment from a hit point to a light."""
    i = wp.tid()
    triangle = Corners(corners[i, 0], corners[i, 1], corners[i, 2])
    verdicts[i, 0] = missed(not may_occlude(h[i], light[i], triangle, 0.0))
    size = largest(h[i])
    record = segment_exact(light[i], triangle, size)
    verdict = segment_bounded(h[i], light[i], 0.0, record)
    verdicts[i, 1] = wp.where(verdict == YES, HIT, missed(verdict == NO))
    for k in range(3):
        size = wp.max(size, largest(corners[i, k]))
    bound = rays.sign_bound(size)
    occluder = rays.occluder_of(0, bound, bound, light[i], triangle, False)
    misses, hits = rays.certain(wp.vec4f(h[i][0], h[i][1], h[i][2], 0.0), occluder)
    verdicts[i, 2] = wp.where(hits, HIT, missed(misses))
    cube = Cube()
    cube.forward = wp.vec3f(1.0, 0.0, 0.0)
    cube.right = wp.vec3f(0.0, 1.0, 0.0)
    cube.up = wp.vec3f(0.0, 0.0, 1.0)
    bins = wp.float32(BINS)
    way = h[i] - light[i]
    if way[0] > wp.max(wp.abs(way[1]), wp.abs(way[2])) and way[0] < 1.0e36:
        sides = sides_of_planes(light[i], cube, 0, triangle, wp.vec4f(-1.0, -1.0, 0.5 * bins, 0.5 * bins))
        x = (way[1] / way[0] + 1.0) * 0.5 * bins
        y = (way[2] / way[0] + 1.0) * 0.5 * bins
        out = is_beyond(sides.line0, x, y) or is_beyond(sides.line1, x, y) or is_beyond(sides.line2, x, y)
        verdicts[i, 3] = missed(out)


@wp.func
def is_beyond(line: wp.vec4f, x: wp.float32, y: wp.float32) -> wp.bool:
    at = line[0] + (y - line[1]) * line[2]
    return (line[3] > 0.0 and x < at) or (line[3] < 0.0 and x > at)


def in_one_unit(random: np.random.Generator) -> np.ndarray:
    """Factors of a triangle, an origin and a hit point [COUNT, 3]: one for all."""
    return np.repeat(10.0 ** random.uniform(-36, 35, (COUNT, 1)), 3, axis=1)


def where_products_leave_float32(random: np.random.Generator) -> np.ndarray:
    """One unit, for all, in which products of three or of two lengths begin to leave float32."""
    least = random.choice([-15.1, 12.4, -19.5, 18.6], (COUNT, 1), p=[0.6, 0.2, 0.1, 0.1])
    return np.repeat(10.0 ** (least + random.uniform(0, 0.8, (COUNT, 1))), 3, axis=1)


def in_units_of_their_own(random: np.random.Generator) -> np.ndarray:
    return 10.0 ** random.uniform(-36, 35, (COUNT, 3))


def situations(units, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles [COUNT, 3, 3] and two points [COUNT, 3] each, float32. Of a third, the second point lies on the line from
    the first to a point in or near the triangle, and of another third the triangle's plane passes near the first point.
    """
    random = np.random.default_rng(seed)
    factors = units(random)
    corners = random.normal(size=(COUNT, 3, 3)) * factors[:, :1, None]
    first, second = (random.normal(size=(COUNT, 3)) * factors[:, k, None] for k in (1, 2))
    weights = random.dirichlet((0.5, 0.5, 0.5), COUNT) + random.normal(size=(COUNT, 3)) * 0.1
    on = np.einsum("ij,ijk->ik", weights, corners)
    kind = np.arange(COUNT) % 3
    way = on - first
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        along = first + way * (factors[:, 2, None] / np.linalg.norm(way, axis=1, keepdims=True))
    second[kind == 1] = along[kind == 1]
    near = kind == 2
    corners[near] += (first - on)[near, None] * (1 - 2.0 ** -random.uniform(0, 20, (near.sum(), 1, 1)))
    found = [np.clip(x, -1e36, 1e36).astype(np.float32) for x in (corners, first, second)]
    return found[0], found[1], found[2]


def exact_rays(o: np.ndarray, d: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """HIT or MISS of the lines of rays, and of the rays themselves, exactly [COUNT, 2]; UNDECIDED in the plane."""
    result = []
    for row in zip(o, d, corners, strict=True):
        _, ints = arithmetic.integers(*row)
        weights = arithmetic.hit_weights(ints[0:3], ints[3:6], ints[6:15])
        line = HIT if min(weights) >= 0 or max(weights) <= 0 else MISS
        ray = HIT if arithmetic.hit(ints[0:3], ints[3:6], ints[6:15]) else MISS
        result.append((UNDECIDED,) * 2 if sum(weights) == 0 else (line, ray))
    return np.array(result)


def exact_segments(h: np.ndarray, light: np.ndarray, corners: np.ndarray) -> np.ndarray:
    result = []
    for row in zip(h, light, corners, strict=True):
        _, ints = arithmetic.integers(*row)
        result.append(HIT if arithmetic.between(ints[0:3], ints[3:6], ints[6:15]) else MISS)
    return np.array(result)


def wrongly_certain(verdicts: np.ndarray, exact: np.ndarray, names: tuple[str, ...]) -> dict[str, int]:
    wrong = (verdicts != UNDECIDED) & (exact != UNDECIDED) & (verdicts != exact)
    return {name: int(n) for name, n in zip(names, wrong.sum(axis=0), strict=True) if n}


UNITS = [in_one_unit, where_products_leave_float32, in_units_of_their_own]


@pytest.mark.parametrize("units", UNITS)
def test_what_float32_says_of_a_ray_is_so(units) -> None:
    corners, o, towards = situations(units, 1)
    random = np.random.default_rng(2)
    tangents = np.array([2.0, 2.0], dtype=np.float32)
    d = random.uniform(-2, 2, (COUNT, 3))
    way = towards.astype(np.float64) - o
    with np.errstate(divide="ignore", invalid="ignore"):
        d = np.where((way[:, 2] < 0)[:, None], way / -way[:, 2:], d)
    d = np.clip(d, -2, 2).astype(np.float32)
    d[:, 2] = -1.0
    camera = filled(
        Camera, width=1, height=1, tangents=wp.array(tangents, device="cpu"),
        eye=wp.zeros(1, dtype=wp.vec3f, device="cpu"),
        axes=wp.array(np.diag([1, 1, -1]), dtype=wp.vec3f, device="cpu"),
    )  # fmt: skip
    (verdicts,) = launched(ray_kernel, COUNT, [camera, o, d, corners], [(COUNT, len(RAY_TESTS))])
    exact = exact_rays(o, d, corners)[:, [0, 0, 1, 1]]
    assert wrongly_certain(verdicts, exact, RAY_TESTS) == {}
    assert 0.02 < (exact == HIT).mean() < 0.98
    assert (verdicts != UNDECIDED).any()


@pytest.mark.parametrize("units", UNITS)
def test_what_float32_says_of_a_segment_is_so(units) -> None:
    corners, light, h = situations(units, 3)
    (verdicts,) = launched(segment_kernel, COUNT, [h, light, corners], [(COUNT, len(SEGMENT_TESTS))])
    exact = exact_segments(h, light, corners)[:, None]
    assert wrongly_certain(verdicts, exact, SEGMENT_TESTS) == {}
    assert 0.02 < (exact == HIT).mean() < 0.98
    assert (verdicts != UNDECIDED).any()
