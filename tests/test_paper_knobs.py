"""No knob of the paper's method that is meant for speed changes an answer: drawn at random, compared bit for bit."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import warp as wp
from brute_force import closest, make_scene, shadowed, soup
from shadowbench.harness.errors import CapacityRejected, UserError
from shadowbench.harness.registry import make_method
from shadowbench.harness.scene import Limits
from shadowbench.harness.session import Session
from shadowbench.methods.perspective_spherical.parameters import (
    BALANCING,
    CLAMPS,
    DEPTH_LISTS,
    LIGHT_MAPS,
    STAGING,
    TRIANGLE_TESTS,
    Build,
    Trace,
)

DEVICES = ["cpu", *(["cuda:0"] if wp.is_cuda_available() else [])]


def answers_of(prepared, width, height, settings, device="cpu", limits=None):
    method = make_method("perspective_spherical", settings)
    session = Session(method, prepared, width, height, device, limits=limits)
    moment = prepared.moment(0, width, height)
    return session, moment, session.answers(moment)


def drawn(random, **fixed):
    """One setting of every knob that must not change an answer."""
    settings = {
        "tile": int(random.integers(1, 20)),
        "slices": int(random.integers(1, 20)),
        "light_tiles": int(random.integers(1, 100)),
        "light_slices": int(random.integers(1, 20)),
        "depth_lists": random.choice(DEPTH_LISTS),
        "light_map": random.choice(LIGHT_MAPS),
        "aimed": bool(random.integers(2)),
        "clamp": random.choice(CLAMPS),
        "skip_empty": bool(random.integers(2)),
        "k": int(random.integers(1, 5)),
        "r": int(random.integers(1, 300)),
        "balancing": random.choice(BALANCING),
        "staging": random.choice(STAGING),
        "triangle_chunk": int(random.choice([0, 1, 3, 50])),
        **fixed,
    }
    return {name: str(value) for name, value in settings.items()}


def same(got, expected, what):
    for name, values in expected.items():
        assert (got[name] == values).all(), (what, name, int((got[name] != values).sum()))


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("light_map", LIGHT_MAPS)
@pytest.mark.parametrize("seed", range(8))
def test_every_map_equals_brute_force(seed, light_map, device):
    random = np.random.default_rng(1000 + seed)
    width, height = int(random.integers(1, 40)), int(random.integers(1, 40))
    vertices, faces = soup(seed, int(random.integers(1, 50)), size=float(np.exp(random.uniform(-3, 1.5))))
    eye = random.normal(size=3) * (3 if seed % 2 else 0.3)
    lights = [tuple(random.normal(size=3) * 10.0 ** random.uniform(-4, 7)) for _ in range(2)]
    # At a vertex, on a surface, at the eye, far away along an axis of the world.
    lights += [tuple(vertices[0]), tuple(vertices[:3].mean(axis=0)), tuple(eye), (0.0, -1e3, 0.0)]
    prepared = make_scene(vertices, faces, lights, tuple(eye), (0.0, 0.0, 0.0), 90.0)
    settings = drawn(random, light_map=light_map)
    _, moment, got = answers_of(prepared, width, height, settings, device)
    best, t = closest(prepared, moment)
    assert (got["triangle"] == best).all()
    for light in range(len(lights)):
        expected = shadowed(prepared, moment, light, best, t)
        assert (got["visibility"][light] == expected).all(), (light, settings)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("triangle_test", TRIANGLE_TESTS)
@pytest.mark.parametrize("seed", range(4))
def test_no_knob_changes_a_bit_of_any_triangle_test(seed, triangle_test, device):
    random = np.random.default_rng(seed)
    vertices, faces = soup(100 + seed, 250, size=float(np.exp(random.uniform(-2, 1))))
    # Corners shared and split: edges and vertices in view, and slivers.
    vertices = np.round(vertices * 8) / 8 if seed % 2 else vertices * [1, 1, 1e-3]
    lights = [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0), (-2e3, 1e3, 4e3)]
    prepared = make_scene(vertices, faces, lights)
    width, height = int(random.integers(20, 50)), int(random.integers(20, 50))
    reference = None
    for _ in range(5):
        settings = drawn(random, triangle_test=triangle_test)
        _, _, got = answers_of(prepared, width, height, settings, device)
        reference = reference or got
        same(got, reference, settings)


def test_inexact_tests_differ_from_the_exact_one_at_edges_only():
    vertices, faces = soup(9, 400)
    prepared = make_scene(vertices, faces, [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0)])
    _, _, exact = answers_of(prepared, 200, 200, {})
    for name in TRIANGLE_TESTS[1:]:
        session, _, got = answers_of(prepared, 200, 200, {"triangle_test": name})
        assert session.method.built()["triangle test"] == name
        for answer in ("triangle", "visibility"):
            assert (got[answer] != exact[answer]).mean() < 1e-3, (name, answer)


def grid_of_squares(n):
    """A closed unit cube of n x n squares a side: many rays through shared edges and vertices."""
    side = np.linspace(-1.0, 1.0, n + 1)
    u, v = (x.ravel() for x in np.meshgrid(side, side, indexing="ij"))
    vertices, faces = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            corners = np.empty((len(u), 3))
            corners[:, axis] = sign
            corners[:, (axis + 1) % 3], corners[:, (axis + 2) % 3] = u, v * sign
            base = sum(len(c) for c in vertices)
            vertices.append(corners)
            i, j = (x.ravel() for x in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
            a, b = i * (n + 1) + j, (i + 1) * (n + 1) + j
            faces += [np.stack(t, axis=1) + base for t in ((a, b, b + 1), (a, b + 1, a + 1))]
    return np.concatenate(vertices), np.concatenate(faces)


@pytest.mark.parametrize("name", ["exact", "edge_planes"])
def test_no_ray_leaks_between_welded_triangles_aimed_at_their_edges(name):
    """Split vertices, pixels exactly on edges and corners, from inside: every ray must hit."""
    vertices, faces = grid_of_squares(16)
    prepared = make_scene(
        vertices, faces, [(0.0, 0.0, 0.0)], eye=(0.0, 0.0, 0.0), target=(0.0, 0.0, -1.0), fov=90.0
    )
    _, _, got = answers_of(prepared, 33, 33, {"triangle_test": name})
    assert (got["triangle"] >= 0).all()
    assert (got["visibility"] == 0).all()


def test_culling_changes_nothing_but_ties_on_a_closed_surface_seen_from_outside():
    vertices, faces = grid_of_squares(5)
    for wound in (faces, faces[:, ::-1]):  # inward or outward, as long as it is consistent
        both = np.concatenate([vertices, vertices * 0.5 + [1.9, 0.4, 0.2]])
        prepared = make_scene(
            both, np.concatenate([wound, wound + len(vertices)]), [(4.0, 5.0, 6.0)], (2.0, 3.0, 7.0)
        )
        scene = dataclasses.replace(prepared.scene, closed=True)
        _, _, off = answers_of(prepared, 61, 47, {})
        pairs = []
        for cull in ("off", "primary", "primary+light"):
            method = make_method("perspective_spherical", {"cull": cull})
            assert method.applies(scene, "cpu") is None
            session, _, got = answers_of(prepared, 61, 47, {"cull": cull})
            same(got, off, cull)
            counts = session.method.counters()
            pairs.append((counts["camera pairs"], counts["light 0 pairs"]))
        assert pairs[1][0] < pairs[0][0]
        assert pairs[2][1] < pairs[1][1]


def test_culling_is_refused_where_it_would_lose_hits():
    vertices, faces = grid_of_squares(2)
    outside, within = (0.0, 0.0, 7.0), (0.1, 0.2, 0.3)

    def reason(cull, eye, light, closed):
        prepared = make_scene(vertices, faces, [light], eye, (5.0, 1.0, 1.0))
        scene = dataclasses.replace(prepared.scene, closed=closed)
        return make_method("perspective_spherical", {"cull": cull}).applies(scene, "cpu")

    assert reason("primary", outside, outside, True) is None
    assert reason("primary", outside, within, True) is None
    assert "declared closed" in reason("primary", outside, outside, False)
    assert "eye outside" in reason("primary", within, outside, True)
    assert "light outside" in reason("primary+light", outside, within, True)
    assert reason("off", within, within, False) is None


@pytest.mark.parametrize("light_map", LIGHT_MAPS)
@pytest.mark.parametrize("aimed", ["true", "false"])
def test_float32_coordinates_are_never_wrong(light_map, aimed):
    random = np.random.default_rng(5)
    vertices, faces = soup(21, 60)
    for distance in (0.3, 30.0, 1e3, 1e5):
        light = tuple(random.normal(size=3) * distance)
        prepared = make_scene(vertices, faces, [light])
        _, _, exact = answers_of(prepared, 40, 40, {})
        settings = {"precision": "float32", "light_map": light_map, "aimed": aimed, "light_tiles": "40"}
        _, _, got = answers_of(prepared, 40, 40, settings)
        same(got, exact, (settings, distance))


def test_float32_world_axes_need_pairs_without_end_where_float64_needs_few():
    vertices, faces = soup(22, 300, size=0.1)
    prepared = make_scene(vertices, faces, [(3e6, 8e6, 2e6)])
    counts = {}
    for precision in ("float64", "float32"):
        session, _, _ = answers_of(prepared, 40, 40, {"precision": precision, "aimed": "false"})
        counts[precision] = session.method.counters()
    assert counts["float32"]["light 0 tiles with rays"] < 10 < counts["float64"]["light 0 tiles with rays"]
    with pytest.raises(CapacityRejected, match=r"needs [\d,]+ \(triangle, cell\) pairs"):
        answers_of(
            prepared, 40, 40,
            {"precision": "float32", "aimed": "false", "skip_empty": "false", "pair_capacity": "1"},
            limits=Limits(memory=1 << 20),
        )  # fmt: skip


@pytest.mark.parametrize(
    "setting", [("k", "0"), ("light_map", "flat"), ("clamp", "tight"), ("r", "0"), ("cull", "all")]
)
def test_what_cannot_be_set_is_named(setting):
    with pytest.raises(UserError, match=setting[0]):
        make_method("perspective_spherical", dict([setting]))


def test_every_parameter_is_documented():
    for block in (Build, Trace):
        for field in dataclasses.fields(block):
            assert f"\n    {field.name} " in block.__doc__, field.name


@pytest.mark.parametrize("triangle_test", TRIANGLE_TESTS)
def test_staged_kernels_give_the_bits_of_their_twins(triangle_test, monkeypatch):
    """Blocks of more than one thread on a CPU: tracing tiles that do not fill a block, or need several."""
    vertices, faces = soup(31, 60, size=0.8)
    prepared = make_scene(vertices, faces, [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0)])
    for settings in (
        {"tile": "4", "k": "2", "r": "40"},
        {"tile": "3", "k": "3", "r": "7", "triangle_chunk": "5", "light_tiles": "4"},
        {"tile": "9", "k": "1", "r": "100", "light_tiles": "2", "slices": "1", "light_slices": "1"},
        {"tile": "1", "k": "5", "r": "1"},
    ):
        settings["triangle_test"] = triangle_test
        _, _, plain = answers_of(prepared, 21, 18, settings)
        with monkeypatch.context() as patch:
            patch.setattr(wp.config, "enable_cpu_blocks", True)
            session, _, staged = answers_of(prepared, 21, 18, {**settings, "staging": "shared"})
            assert session.method.built()["staging"] == "shared"
        same(staged, plain, settings)
