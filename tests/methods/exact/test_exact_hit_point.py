"""The shadow origin against rational arithmetic: near the exact hit, however flat the ray meets the triangle."""

import re
import sys
from fractions import Fraction

import numpy as np
import pytest
import warp as wp
from helpers.launched import launched
from helpers.second_judge import Flat, Point, dot, exactly
from helpers.second_judge import along as along_ray
from shadowbench.harness.frame.geometry import Corners, Ray
from shadowbench.methods.exact.hit_point import along, hit_point, is_vague, plane_distance

U64 = 2.0**-53
COUNT = 400


@wp.kernel(enable_backward=False)
def point_kernel(
    o: wp.array(dtype=wp.vec3f), d: wp.array(dtype=wp.vec3f), t: wp.array(dtype=wp.float64),
    a: wp.array(dtype=wp.vec3f), b: wp.array(dtype=wp.vec3f), c: wp.array(dtype=wp.vec3f), h: wp.array(dtype=wp.vec3d),
    to_be_rounded: wp.array(dtype=wp.vec3d), vague: wp.array(dtype=wp.uint8),
):  # fmt: skip
    i = wp.tid()
    ray = Ray(o[i], d[i])
    corners = Corners(a[i], b[i], c[i])
    h[i] = hit_point(ray, t[i], corners)
    to_be_rounded[i] = along(ray, plane_distance(ray, corners))
    vague[i] = wp.uint8(is_vague(ray, corners))


def exact_hit(o, d, a, b, c) -> tuple[Point, Fraction, float]:
    """The hit, its t, and the sine of the angle between ray and plane."""
    flat, o, d = Flat.of(np.stack([a, b, c])), exactly(o), exactly(d)
    slope = dot(flat.normal, d)
    t = -flat.side(o) / slope
    return along_ray(o, t, d), t, abs(float(slope)) / np.sqrt(float(dot(flat.normal, flat.normal)) * float(dot(d, d)))


def rays(slope: float, size: float, random: np.random.Generator):
    """Triangles of a size, and rays from about 1 away that meet them at a corner, on an edge or within, this flat."""
    result = []
    while len(result) < COUNT:
        a, b, c = (random.normal(0, 1, 3) * size + random.normal(0, 0.5, 3) * (k == 0) for k in range(3))
        b, c = a + b, a + c
        a, b, c = (v.astype(np.float32) for v in (a, b, c))
        weights = ([1, 0, 0], [0.5, 0.5, 0], random.dirichlet([1, 1, 1]))[len(result) % 3]
        target = weights @ np.array([a, b, c], dtype=np.float64)
        n = np.cross(b.astype(float) - a, c.astype(float) - a)
        n /= np.linalg.norm(n)
        along = np.cross(n, random.normal(0, 1, 3))
        way = along / np.linalg.norm(along) + n * slope
        o = (target - way).astype(np.float32)
        d = (target - o.astype(np.float64)).astype(np.float32)
        hit, t, sine = exact_hit(o, d, a, b, c)
        if t > 0:
            result.append((o, d, float(t), a, b, c, hit, sine))
    return result


def off(point: np.ndarray, hit: Point) -> float:
    """By how much a point is, in its worst coordinate."""
    return max(abs(float(Fraction(float(x)) - y)) for x, y in zip(point, hit, strict=True))


@pytest.mark.parametrize("size", [1.0, 1e-3])
@pytest.mark.parametrize("slope", [1.0, 0.2, 1e-2, 1e-3, 5e-4, 1e-5])
def test_a_hit_point_is_rounded_not_displaced(slope, size, device):
    """t is given with an error of as many units as dividing by the slope makes of one. What will be rounded to float32 is
    off by a quarter of that rounding, unless it is called vague, which the flattest are and the steepest are not.
    """
    random = np.random.default_rng(round(-np.log2(slope * size)))
    made = rays(slope, size, random)
    columns = [np.array(column) for column in list(zip(*made, strict=True))[:6]]
    columns[2] = columns[2] * (1 + random.uniform(-4, 4, COUNT) * U64 / slope)
    points, to_be_rounded, vague = launched(point_kernel, COUNT, columns, [COUNT] * 3, device)
    worst = 0.0
    for h, rounded, left, (o, _, _, a, b, c, hit, sine) in zip(points, to_be_rounded, vague, made, strict=True):
        largest = max(*(abs(float(y)) for y in hit), float(np.abs(o).max()))
        # Flat rays are carried exactly and rounded once; of others the angle leaves a little more.
        worst = max(worst, off(h, hit) / (U64 * largest) / (1.0 if sine < 0.12 else 8.0))
        assert left or off(rounded, hit) <= 2.0**-26 * np.abs([a, b, c]).max()
    assert 0.0 < worst <= 1.0
    assert vague.all() if slope == 1e-5 else not vague.all()
    assert slope < 1.0 or vague.mean() < 0.1


def test_no_product_that_is_carried_is_fused_with_a_sum_on_a_gpu(tmp_path):
    """Found on a GPU: with the normal's products fused, flat hit points were off by up to 70,000 units.

    Six products of the normal, three of its product with the way and three with the direction must be rounded by
    themselves (mul.rn), which a compiler never fuses; it may with a plain mul.
    """
    wp.compile_aot_module(sys.modules[__name__], arch=90, module_dir=tmp_path, use_ptx=True)
    (code,) = tmp_path.glob("*.ptx")
    assert len(re.findall(r"\bmul\.rn\.f64\b", code.read_text())) == 12
