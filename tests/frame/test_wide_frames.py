"""Wide frames: the session plans again, every kernel has the digits (``digits.py``), and these are exact."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import warp as wp
from helpers.judged_hard_cases import exact_methods, judged, settings_of
from helpers.launched import launched
from helpers.second_judge import Flat, dot, exactly
from shadowbench.harness.frame import session as sessions
from shadowbench.harness.frame.digits import exact_product, wide_side
from shadowbench.harness.frame.effects.specialise import named, specialised
from shadowbench.harness.frame.geometry import Corners, Ray
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.judge import same_bits
from shadowbench.harness.scene.effects import Switches
from shadowbench.harness.scene.scene import Camera
from shadowbench.harness.scene.width import Sizes
from shadowbench.methods.exact.hit_point import hit_point, plane_distance

SETTINGS = [(name, settings) for name, given in exact_methods() for settings in settings_of(name, given)]
SETTINGS.append(("perspective_spherical", {"triangle_chunk": "2"}))
COUNT = 2000


def session_of(name: str, settings: dict[str, str], case: str) -> Session:
    trial = judged(case).trial
    return Session(make_method(name, settings), trial.prepared, trial.moment.width, trial.moment.height, "cpu")


@pytest.mark.parametrize(("name", "settings"), SETTINGS, ids=str)
def test_every_kernel_that_a_wide_frame_launches_has_the_digits(name, settings, monkeypatch) -> None:
    """No kernel runs, so that none is compiled."""
    launched, without = set(), set()

    def noted(kernel, *given, **more):
        launched.add(kernel.key)
        if "wide" in named(kernel) and not getattr(kernel.func.__globals__.get("effects"), "wide", False):
            without.add(kernel.key)

    session = session_of(name, settings, "S60 33")
    monkeypatch.setattr(wp, "launch", noted)
    session.answers(judged("S60 33").trial.moment)
    assert session.effects.wide
    assert launched
    assert without == set()


@pytest.mark.parametrize("name", ["bvh2", "ray_grids", "uniform_grid"])
def test_a_session_plans_again_where_a_moment_is_wide_or_is_not_and_gives_a_fresh_ones_bits(name) -> None:
    trial = judged("P60 33").trial
    size = trial.moment.width, trial.moment.height
    away = trial.prepared.moment(0, *size, camera=Camera((0.0, 0.0, 2.0**33), (0.0, 0.0, 0.0)))
    session = session_of(name, {}, "P60 33")
    for moment, wide in ((away, False), (trial.moment, True), (away, False)):
        session.advance(moment)
        assert session.effects.wide == wide
        fresh = session_of(name, {}, "P60 33").answers(moment)
        played = session.frame.answers.to_host()
        assert all(same_bits(played[key], fresh[key]) for key in fresh)


def test_sizes_are_measured_once_for_a_mesh_a_moment_is_judged_once_and_never_while_a_frame_runs(monkeypatch) -> None:
    trial = judged("V axis -20").trial
    size = trial.moment.width, trial.moment.height
    measured = []
    monkeypatch.setattr(sessions, "Sizes", lambda *mesh: measured.append(1) or Sizes(*mesh))
    session = session_of("bvh2", {}, "V axis -20")
    for x in (1.0, 2.0):
        near = trial.prepared.moment(0, *size, camera=Camera((x, 1.5, 2.0), (0.0, 0.0, 0.0)))
        session.load(near)
    assert len(measured) == 1
    assert session.effects.wide
    with monkeypatch.context() as within:
        within.setattr(sessions, "is_wide", None)
        session.run_complete()
    factors = np.float32([1, 1, 2.0**20])
    far = replace(trial.moment, **{name: getattr(trial.moment, name) * factors for name in ("points", "eye", "lights")})
    session.load(far)
    assert len(measured) == 2
    assert not session.effects.wide
    monkeypatch.setattr(sessions, "is_wide", None)
    for moment, wide in ((near, True), (far, False)):
        session.load(moment)
        assert session.effects.wide == wide
    assert len(measured) == 2


@wp.kernel(enable_backward=False)
def digits_kernel(
    corners: wp.array2d(dtype=wp.vec3f), x: wp.array(dtype=wp.vec3d), o: wp.array(dtype=wp.vec3f),
    d: wp.array(dtype=wp.vec3f), sides: wp.array2d(dtype=wp.float64), points: wp.array(dtype=wp.vec3d),
):  # fmt: skip
    i = wp.tid()
    triangle = Corners(corners[i, 0], corners[i, 1], corners[i, 2])
    sides[i, 0] = exact_product(triangle.a, triangle.b, triangle.c, x[i], True)[0]
    sides[i, 1] = wide_side(triangle.a, triangle.b, triangle.c, x[i])
    ray = Ray(o[i], d[i])
    points[i] = hit_point(ray, plane_distance(ray, triangle), triangle)


def test_sides_and_hit_points_are_those_of_rational_arithmetic() -> None:
    """Of triangles up to 1e20 large, and of points in their planes or beside them by little."""
    random = np.random.default_rng(8)
    size = 10.0 ** random.uniform(0, 20, (COUNT, 1, 1))
    corners = (random.integers(-9, 10, (COUNT, 3, 3)) * size).astype(np.float32)
    corners[::2] = random.normal(size=(COUNT // 2, 3, 3)) * size[::2]
    weights = random.dirichlet((1, 1, 1), COUNT)
    x = np.einsum("ij,ijk->ik", weights, corners.astype(np.float64))
    x[::3] = corners[::3, 1]
    o = random.normal(size=(COUNT, 3)).astype(np.float32)
    d = random.normal(size=(COUNT, 3)).astype(np.float32)
    kernel = specialised(digits_kernel, Switches(wide=True))
    sides, points = launched(kernel, COUNT, [corners, x, o, d], [(COUNT, 2), COUNT])
    zeros = 0
    for i in range(COUNT):
        flat = Flat.of(corners[i])
        side = flat.side(exactly(x[i])) if flat else 0
        zeros += side == 0
        for found in sides[i]:
            assert abs(Fraction(float(found)) - side) <= abs(side) * Fraction(1, 2**50)
        origin, way = exactly(o[i]), exactly(d[i])
        slope = dot(flat.normal, way) if flat else 0
        if slope == 0:
            continue
        t = -flat.side(origin) / slope
        for found, p, w in zip(points[i], origin, way, strict=True):
            exact = p + t * w
            assert abs(Fraction(float(found)) - exact) <= abs(exact) / 2**52 + (abs(p) + abs(t * w)) / 2**90
    assert zeros > COUNT // 4
