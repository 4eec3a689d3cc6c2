"""Where rays (``light/rays.py``) and triangles (``light/bounds.py``, ``sphere.py``) lie in a light's rectangle: bounds
right, and wrong on purpose (``variants/bounds.py``); float32 that stays right.
"""

import functools

import numpy as np
import pytest
import warp as wp
from helpers.launched import launched
from helpers.paper_knobs import answers_of
from helpers.small_scenes import assert_same, make_scene, soup
from shadowbench.harness.frame.geometry import filled
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.hardcases import find_case
from shadowbench.harness.hardcases.judge import Judged, judge_case
from shadowbench.methods.perspective_spherical.light.bounds import BOUNDS
from shadowbench.methods.perspective_spherical.light.mapping import LightSpace, ray_place
from shadowbench.methods.perspective_spherical.light.rays import FLOAT32_PAD, FLOAT64_PAD
from shadowbench.methods.perspective_spherical.parameters import LIGHT_MAPS


@functools.cache
def make_bounds_kernel(name: str) -> wp.Kernel:
    bounds_of, _ = BOUNDS[name]

    @wp.kernel(enable_backward=False, module="unique")
    def bounds_kernel(pad: wp.float64, corners: wp.array2d(dtype=wp.vec3d), bounds: wp.array(dtype=wp.vec4d)):
        i = wp.tid()
        bounds[i] = bounds_of(corners[i, 0], corners[i, 1], corners[i, 2], pad)

    return bounds_kernel


@wp.kernel(enable_backward=False)
def place_kernel(space: LightSpace, points: wp.array(dtype=wp.vec3d), places: wp.array(dtype=wp.vec4d)):
    i = wp.tid()
    places[i] = ray_place(space, points[i], wp.vec3d())


def on_cpu(values, kind):
    return wp.array(np.ascontiguousarray(values), dtype=kind, device="cpu")


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("name", LIGHT_MAPS)
@pytest.mark.parametrize("size", [1e-6, 0.01, 0.3, 2.0])
def test_bounds_of_a_triangle_hold_the_place_of_every_ray_to_it(name, size, precision):
    random = np.random.default_rng(int(100 * size))
    count, samples = 1500, 60
    centre = random.normal(size=(count, 1, 3))
    centre[: count // 3, :, 0] *= 0.05  # about the circle that two angles collapse
    centre[count // 3 : count // 2, :, :2] *= 0.01  # about the poles
    corners = centre / np.linalg.norm(centre, axis=2, keepdims=True) + random.normal(size=(count, 3, 3)) * size / 2
    points = np.einsum("sk,nkj->nsj", random.dirichlet([0.4, 0.4, 0.4], samples), corners).reshape(-1, 3)
    single = precision == "float32"
    space = filled(
        LightSpace, index=0, map=LIGHT_MAPS.index(name), single=single, axes=on_cpu([np.eye(3)], wp.mat33d),
        pads=on_cpu([0.0, 0.0], wp.float64), proxy_positions=on_cpu([[0.0, 0.0, 0.0]], wp.vec3f),
    )  # fmt: skip
    (places,) = launched(place_kernel, len(points), [space, points], [len(points)])
    u, v, distance, face = places.reshape(count, samples, 4).transpose(2, 0, 1)
    np.testing.assert_allclose(distance.ravel(), np.linalg.norm(points, axis=1), rtol=1e-6 if single else 1e-14)
    keep = np.ones_like(u, dtype=bool)
    if name == "cube":
        # The face's own frame, written apart: forward is the axis of the largest coordinate, with its sign.
        axis = np.abs(points).argmax(axis=1)
        expected = 2 * axis + (points[np.arange(len(points)), axis] < 0)
        assert (face.ravel() == expected).mean() > (0.99 if single else 0.999999)
        keep = face == 0  # the front face is its own frame
    pad = FLOAT32_PAD if single else FLOAT64_PAD
    (bounds,) = launched(make_bounds_kernel(name), count, [pad, corners], [count])
    low_u, high_u, low_v, high_v = bounds.T[:, :, None]

    def held(x, low, high):
        turns = (0.0,) if name == "cube" else (-2 * np.pi, 0.0, 2 * np.pi)
        return np.any([(x + turn >= low) & (x + turn <= high) for turn in turns], axis=0)

    assert held(u, low_u, high_u)[keep].all()
    assert held(v, low_v, high_v)[keep].all()
    assert keep.sum() > 1000


WORLD = {"aimed": "false", "clamp": "none"}
LOST = {
    "S01": {"exact": False, "seam": False, "vertices": True},
    "S02z": {"exact": False, "seam": True, "vertices": True},
    "S05z": {"exact": False, "seam": True, "vertices": True},
}
"""By case and bounds: whether shadows are lost. A seam, a pole inside a triangle, an arc that bulges."""


@pytest.mark.parametrize("name", sorted(LOST))
@pytest.mark.parametrize("bounds", ["exact", "seam", "vertices"])
def test_bounds_by_vertices_lose_shadows_and_say_so(name, bounds):
    case = find_case(name)
    # Tiles so small that a box too small by a little misses some of them.
    settings = {"light_bounds": bounds, "light_tiles": "512", **WORLD}
    method = make_method("perspective_spherical", settings)
    assert bool(method.known_inexact) == (bounds != "exact")
    finding = judge_case(Judged(case, case.make()), method, "cpu")
    assert (finding.status == "error") == LOST[name][bounds], finding.classes
    assert set(finding.classes) <= {"ok", "leak", "tie", "near_tie", "edge"}, "a box too small only loses"


def pairs(prepared, **settings: str) -> tuple[dict[str, int], np.ndarray]:
    session, _, answers = answers_of(prepared, 64, 64, settings)
    return session.method.counters(), answers["shadowed"]


@pytest.mark.parametrize("radii", [3.0, 1e3, 1e5, 1e7])
def test_a_centred_frame_keeps_its_tiles_at_any_distance(radii):
    """Plain float32 directions from a far light fall together, and every triangle is widened over all of them."""
    vertices, faces = soup(4, 400, size=0.1)
    prepared = make_scene(vertices, faces, [(0.48 * radii, 0.6 * radii, 0.64 * radii)])
    double, right = pairs(prepared)
    centred, bits = pairs(prepared, precision="float32-centred")
    plain, same = pairs(prepared, precision="float32")
    assert (bits == right).all()
    assert (same == right).all()
    assert centred["light 0 tiles with rays"] > 0.95 * double["light 0 tiles with rays"] > 100
    # A few more: distances of the centred frame have the bound of float32.
    assert centred["light 0 pairs"] < 1.25 * double["light 0 pairs"]
    if radii >= 1e7:
        assert plain["light 0 tiles with rays"] < 0.5 * double["light 0 tiles with rays"]
        assert plain["light 0 pairs"] > 2 * double["light 0 pairs"]


def test_a_light_among_the_hit_points_is_not_taken_for_the_light():
    vertices, faces = soup(4, 400, size=0.1)
    lights = [(0.1, 0.0, 0.2), (0.5, 0.9, 0.4), tuple(vertices[0])]
    prepared = make_scene(vertices, faces, lights)
    assert (pairs(prepared, precision="float32-centred")[1] == pairs(prepared)[1]).all()


@pytest.mark.parametrize("light_map", LIGHT_MAPS)
@pytest.mark.parametrize("aimed", ["true", "false"])
def test_float32_coordinates_are_never_wrong(light_map, aimed):
    random = np.random.default_rng(5)
    vertices, faces = soup(21, 60)
    for distance in (0.3, 30.0, 1e3, 1e5, 1e6):
        light = tuple(random.normal(size=3) * distance)
        prepared = make_scene(vertices, faces, [light])
        _, _, exact = answers_of(prepared, 40, 40, {})
        settings = {"precision": "float32", "light_map": light_map, "aimed": aimed, "light_tiles": "100"}
        _, _, got = answers_of(prepared, 40, 40, settings)
        assert_same(got, exact, (settings, distance))


def test_float32_world_axes_need_pairs_without_end_where_float64_needs_few():
    vertices, faces = soup(22, 300, size=0.1)
    prepared = make_scene(vertices, faces, [(3e6, 8e6, 2e6)])
    counts = {}
    for precision in ("float64", "float32"):
        session, _, _ = answers_of(prepared, 40, 40, {"precision": precision, "aimed": "false"})
        counts[precision] = session.method.counters()
    assert counts["float32"]["light 0 tiles with rays"] < 10 < counts["float64"]["light 0 tiles with rays"]
