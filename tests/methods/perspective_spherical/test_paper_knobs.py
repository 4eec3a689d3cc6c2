"""No knob of the paper's method that is meant for speed changes an answer: drawn at random, compared bit for bit."""

from __future__ import annotations

import dataclasses
import inspect

import numpy as np
import pytest
import warp as wp
from helpers.brute_force import closest, make_scene, shadowed, soup
from helpers.closed_meshes import grid_of_squares
from helpers.paper_knobs import answers_of, drawn, same
from shadowbench.harness.errors import CapacityRejected, UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.scene.effects import Limits
from shadowbench.methods.perspective_spherical.camera.trace import make_resolve_kernel, make_trace_kernel
from shadowbench.methods.perspective_spherical.light.rectangle import make_clamp_kernel
from shadowbench.methods.perspective_spherical.light.tiles import make_bound_kernel
from shadowbench.methods.perspective_spherical.light.trace import make_shadow_kernel
from shadowbench.methods.perspective_spherical.parameters import LIGHT_MAPS, TRIANGLE_TESTS, Build, Trace
from tools.kernel_report import uses_of


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
        assert (got["shadowed"][light] == expected).all(), (light, settings)


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
        for answer in ("triangle", "shadowed"):
            assert (got[answer] != exact[answer]).mean() < 1e-3, (name, answer)


@pytest.mark.parametrize("name", ["exact", "edge_planes"])
def test_no_ray_leaks_between_welded_triangles_aimed_at_their_edges(name):
    """Split vertices, pixels exactly on edges and corners, from inside: every ray must hit."""
    vertices, faces = grid_of_squares(16)
    prepared = make_scene(
        vertices, faces, [(0.0, 0.0, 0.0)], eye=(0.0, 0.0, 0.0), target=(0.0, 0.0, -1.0), fov=90.0
    )
    _, _, got = answers_of(prepared, 33, 33, {"triangle_test": name})
    assert (got["triangle"] >= 0).all()
    assert (got["shadowed"] == 0).all()


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
            assert f"\n{field.name} " in inspect.getdoc(block), field.name


@pytest.mark.parametrize("triangle_test", TRIANGLE_TESTS)
def test_staged_kernels_give_the_bits_of_their_twins(triangle_test, monkeypatch):
    """Blocks of more than one thread on a CPU: tracing tiles that do not fill a block, or need several."""
    vertices, faces = soup(31, 60, size=0.8)
    prepared = make_scene(vertices, faces, [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0)])
    for settings in (
        {"tile": "4", "k": "2", "r": "40"},
        {"tile": "6", "k": "3", "r": "33", "triangle_chunk": "5", "light_tiles": "4"},
        {"tile": "9", "k": "2", "r": "200", "light_tiles": "2", "slices": "1", "light_slices": "1"},
        {"tile": "1", "k": "7", "r": "33"},
    ):
        settings["triangle_test"] = triangle_test
        if triangle_test != "exact" and "triangle_chunk" not in settings:
            continue  # every block is a compiled variant: seconds each
        _, _, plain = answers_of(prepared, 21, 18, settings)
        with monkeypatch.context() as patch:
            patch.setattr(wp.config, "enable_cpu_blocks", True)
            session, _, staged = answers_of(prepared, 21, 18, {**settings, "staging": "shared"})
            assert session.method.built()["staging"] == "shared"
        same(staged, plain, settings)


def test_counters_add_up():
    vertices, faces = soup(50, 300)
    prepared = make_scene(vertices, faces, [(2.0, 3.0, 4.0)])
    found = []
    for settings in ({}, {"skip_empty": "false"}, {"depth_lists": "spans"}, {"k": "2", "r": "3"}):
        session, _, got = answers_of(prepared, 60, 50, {"light_tiles": "32", **settings})
        counts = session.method.counters()
        found.append(counts)
        primary, shadow = session.method.tests_per_pixel()
        assert counts["primary tests"] == primary.sum()
        assert counts["shadow tests"] == shadow.sum()
        assert counts["light 0 rays"] == (got["triangle"] >= 0).sum()
        r = int(settings.get("r", 32))
        assert counts["light 0 lanes"] == counts["light 0 chunks"] * r >= counts["light 0 rays"]
        assert counts["light 0 chunks"] >= counts["light 0 tiles with rays"]
        for grid in ("camera", "light 0"):
            mean = counts[f"{grid} pairs"] / counts[f"{grid} occupied tiles"]
            assert abs(counts[f"{grid} list, mean"] - mean) <= 0.5
            assert counts[f"{grid} list, mean"] <= counts[f"{grid} list, longest"]
            assert counts[f"{grid} list, p99"] <= counts[f"{grid} list, longest"]
            assert (
                counts[f"{grid} occupied tiles"]
                <= counts[f"{grid} occupied cells"]
                <= counts[f"{grid} pairs"]
            )
    assert found[0]["light 0 pairs"] < found[1]["light 0 pairs"]
    assert found[2]["camera pairs"] > found[0]["camera pairs"]


MADE = {
    **{f"trace {test}": (make_trace_kernel, test, 0) for test in range(3)},
    **{f"shadow {test}": (make_shadow_kernel, test, 0) for test in range(3)},
    **{f"resolve {test}": (make_resolve_kernel, test) for test in range(2)},
    **{f"bound {map}": (make_bound_kernel, map) for map in LIGHT_MAPS},
    **{f"clamp {map}": (make_clamp_kernel, map) for map in LIGHT_MAPS},
}
"""Factories and what they are given. Staged kernels are hot: ``test_kernel_report`` reads their binaries."""


@pytest.mark.parametrize("name", MADE)
def test_a_kernel_that_is_made_for_settings_compiles_without_a_gpu(name):
    """Those of whole modules are compiled in ``test_cuda_compiles``."""
    make, *given = MADE[name]
    assert uses_of(make(*given).module)


def test_lights_moved_between_frames_equal_fresh_ones_under_other_knobs():
    vertices, faces = soup(70, 150)
    here, there = (make_scene(vertices, faces, [p]) for p in ((1.0, 2.0, 3.0), (-40.0, 2.0, 0.1)))
    settings = {"light_map": "cube", "triangle_chunk": "4", "clamp": "view", "balancing": "algorithm-1"}
    session, moment, first = answers_of(here, 32, 32, settings)
    moved = session.answers(there.moment(0, 32, 32))
    same(session.answers(moment), first, "again")
    same(moved, answers_of(there, 32, 32, {})[2], "fresh")


def test_what_float32_accepts_beside_an_edge_is_listed_in_every_tile():
    """Hit points 1e-5 off the plane through the light and an edge, at x = 300 where float32 cannot tell.

    Rounded they lie on it, and the plain planes accept them: then every grid must offer the triangle, also where
    the border between two tiles lies between the hit points and the edge (all of these numbers of tiles but 150).
    """
    x = 300.0
    vertices = [[x, -1, -1], [x, 1, -1], [x + 2, 0, -1], [x - 5, -5, -2], [x + 7, -5, -2], [x + 1, 9, -2]]
    vertices += [[-x, 0, 9], [-x, 1, 9], [-x, 0, 8]]  # keeps the scene where it is
    prepared = make_scene(
        vertices,
        [[0, 1, 2], [3, 4, 5], [6, 7, 8]],
        [(x, 0.0, 0.0)],
        (x, 0.3, 0.5),
        (x - 4e-6, 0.3, -0.5),
        0.3,
    )
    seen = set()
    for tiles in (150, 156, 167, 178, 189):
        settings = {"triangle_test": "edge_planes", "light_tiles": str(tiles), "aimed": "false"}
        _, _, got = answers_of(prepared, 5, 5, settings)
        assert (got["triangle"].reshape(5, 5)[:, 2] == 1).all()
        seen.add(tuple(got["shadowed"][0].reshape(5, 5)[:, 2].tolist()))
    assert seen == {(1, 1, 1, 1, 1)}
    _, _, exact = answers_of(prepared, 5, 5, {})
    assert (exact["shadowed"][0].reshape(5, 5)[:, 2] == 0).all()
