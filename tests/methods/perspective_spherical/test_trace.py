"""The tracing kernels (``camera/trace.py``, ``light/trace.py``): those that stage triangles (``staging.py``) give the
bits of those that do not, and what they count adds up.
"""

import pytest
import warp as wp
from helpers.paper_knobs import answers_of
from helpers.small_scenes import assert_same, make_scene, soup
from shadowbench.methods.perspective_spherical.camera.trace import make_trace_kernel
from shadowbench.methods.perspective_spherical.light.rectangle import make_clamp_kernel
from shadowbench.methods.perspective_spherical.light.tiles import make_bound_kernel
from shadowbench.methods.perspective_spherical.light.trace import make_shadow_kernel
from shadowbench.methods.perspective_spherical.parameters import TRIANGLE_TESTS
from tools.kernel_report import uses_of


@pytest.mark.slow
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
        assert_same(staged, plain, settings)


def test_counters_add_up():
    vertices, faces = soup(50, 300)
    prepared = make_scene(vertices, faces, [(2.0, 3.0, 4.0)])
    found = []
    for settings in ({}, {"skip_empty": "false"}, {"depth_lists": "spans"}, {"k": "2", "r": "3"}):
        session, _, got = answers_of(prepared, 60, 50, {"light_tiles": "32", **settings})
        counts = session.method.counters()
        found.append(counts)
        primary, shadow = session.method.tests_per_pixel()
        assert (counts["primary tests"], counts["shadow tests"]) == (primary.sum(), shadow.sum())
        assert counts["light 0 rays"] == (got["triangle"] >= 0).sum()
        r = int(settings.get("r", 32))
        assert counts["light 0 lanes"] == counts["light 0 chunks"] * r >= counts["light 0 rays"]
        assert counts["light 0 chunks"] >= counts["light 0 tiles with rays"]
        for grid in ("camera", "light 0"):
            mean = counts[f"{grid} pairs"] / counts[f"{grid} occupied tiles"]
            assert abs(counts[f"{grid} list, mean"] - mean) <= 0.5
            assert counts[f"{grid} list, mean"] <= counts[f"{grid} list, longest"]
            assert counts[f"{grid} list, p99"] <= counts[f"{grid} list, longest"]
            assert counts[f"{grid} occupied tiles"] <= counts[f"{grid} occupied cells"] <= counts[f"{grid} pairs"]
    assert found[0]["light 0 pairs"] < found[1]["light 0 pairs"]
    assert found[2]["camera pairs"] > found[0]["camera pairs"]


MADE = {
    **{f"trace {test}": (make_trace_kernel, test, 0) for test in (1, 2)},
    **{f"shadow {test}": (make_shadow_kernel, test, 0) for test in (1, 2)},
    "bound": (make_bound_kernel, "cube"),
    "clamp": (make_clamp_kernel, "two-angle"),
}
"""Factories and what they are given. Staged kernels are hot: ``test_kernel_report`` reads their binaries; those of the first
test and map are compiled with every effect.
"""


@pytest.mark.parametrize("name", MADE)
def test_a_kernel_that_is_made_for_settings_compiles_without_a_gpu(name):
    """Those of whole modules are compiled in ``test_cuda_compiles``."""
    make, *given = MADE[name]
    assert uses_of(make(*given).module)
