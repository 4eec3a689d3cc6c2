"""The shadow map (``projection.py``, ``shadow_map/raster.py``, ``lookup.py``): exact primary rays, shadows that
approach the exact ones with the map's size, lights in and out.
"""

from dataclasses import replace

import numpy as np
import pytest
from helpers.devices import needs_gpu
from helpers.method_trials import TRIALS, assert_misses, box, expected, lattice
from helpers.small_scenes import make_scene, soup, trace
from shadowbench.harness.hardcases.shapes import joined, moved
from shadowbench.harness.scene.prepared import under
from shadowbench.harness.scene.scene import Light

NAME = "shadow_map"


def blocker(height: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A floor of half width 4 at z = 0 and a square of half width 0.5 above it."""
    return joined(lattice(4, 4.0), moved(lattice(2, 0.5), (0, 0, height)))


def wrong_share(settings, prepared, width=48, height=48, light=0, device="cpu"):
    """Share of hit pixels whose shadow bit is wrong."""
    got, exact = trace(NAME, settings, prepared, width, height, device)[2], expected(prepared, width, height)
    np.testing.assert_array_equal(got["triangle"], exact["triangle"])
    return float((got["shadowed"] != exact["shadowed"])[light, exact["triangle"] >= 0].mean())


@pytest.mark.parametrize("shape", ["aimed", "cube"])
def test_error_falls_with_the_size_of_the_map(shape, device):
    vertices, faces = soup(3, 200, size=0.3)
    prepared = make_scene(vertices, faces, [(2.0, 5.0, 3.0)], (0.0, 0.5, 3.0))
    shares = [wrong_share({"size": size, "shape": shape}, prepared, device=device) for size in ("64", "512", "2048")]
    assert shares[0] > shares[1] > shares[2]
    assert shares[2] < 0.02


@pytest.mark.parametrize("position", [(0.2, 0.1, 0.3), (0.9, -0.9, 0.0), (0.0, 0.0, 0.0)])
def test_a_light_inside_the_scene_gets_a_cube(position):
    mesh = joined(box(4), soup(9, 20, size=0.1, spread=0.4))
    prepared = make_scene(*mesh, [position], (-0.7, -0.6, 0.5), (0.5, 0.5, -0.3), 90.0)
    settings = {"size": "1024"}
    session, _, _ = trace(NAME, settings, prepared, 8, 8)
    assert session.method.built() == {"maps": "6 x 1024 x 1024", "bias": "slope 1", "filter": "nearest"}
    assert session.regrown == 1
    assert wrong_share(settings, prepared) < 0.02


@pytest.mark.parametrize("distance", [3.0, 1e3, 1e5])
def test_the_aimed_map_keeps_its_detail_at_any_distance_of_the_light(distance):
    direction = np.array([0.3, 0.5, 0.8]) / np.linalg.norm([0.3, 0.5, 0.8])
    prepared = make_scene(*blocker(), [tuple(direction * distance * 5.7)], (0.1, -4.0, 4.0))
    assert trace(NAME, {"size": "2048"}, prepared, 48, 48)[2]["shadowed"].sum() > 20
    assert wrong_share({"size": "2048"}, prepared) < 0.003


def test_bias_none_has_acne_and_the_others_take_it_away(device):
    # A slanted floor in full light: every shadowed pixel is acne.
    flat, faces = lattice(4, 2.0)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.8, -0.6], [0.0, 0.6, 0.8]])
    prepared = make_scene(flat @ turn.T, faces, [(2.0, 1.0, 5.0)], (0.0, -1.0, 4.0))
    dark = {}
    for bias in ("none", "constant", "slope", "normal"):
        for filter in ("nearest", "pcf"):
            settings = {"size": "256", "bias": bias, "filter": filter}
            if bias == "constant":
                settings["amount"] = "0.02"
            dark[bias, filter] = int(trace(NAME, settings, prepared, 64, 64, device)[2]["shadowed"].sum())
    assert dark["none", "nearest"] > dark["none", "pcf"] > 0
    assert dark["none", "nearest"] > 300
    assert all(count == 0 for (bias, _), count in dark.items() if bias != "none"), dark


def test_a_soft_filter_draws_one_map_for_an_area():
    """Half-way to the light, the filter is as wide as the penumbra: the share of light is right within a texel or two."""
    prepared = make_scene(*blocker(), [(0.0, 0.0, 5.0)], (0.1, -4.0, 4.0))
    area = Light((0.0, 0.0, 5.0), shape="disc", size=1.0, samples=16)
    prepared = under(prepared, replace(prepared.scene, lights=(area,)))
    exact = trace("bvh2", {}, prepared, 64, 64)[2]["shadowed"].mean(axis=0)
    session, _, answers = trace(NAME, {"size": "1024", "filter": "soft", "spread": "0.25"}, prepared, 64, 64)
    assert sum("draw map" in work.name for work in session.all_passes) == 1
    assert ((exact > 0.1) & (exact < 0.9)).any()
    assert np.abs(answers["shadowed"].mean(axis=0) - exact).mean() < 0.01


@pytest.mark.parametrize("trial", TRIALS)
def test_primary_rays_of_hard_scenes_are_exact(trial):
    got = trace(NAME, {"size": "64"}, *TRIALS[trial])[2]
    assert_misses(got)
    np.testing.assert_array_equal(got["triangle"], expected(*TRIALS[trial])["triangle"])


def test_lights_do_not_disturb_each_other(device):
    mesh = soup(5, 100, size=0.3)
    lights = [(2.0, 5.0, 3.0), (0.1, 0.0, 0.2), (-4.0, 1.0, 2.0)]
    settings = {"size": "256", "shape": "cube"}
    together, *alone = (
        trace(NAME, settings, make_scene(*mesh, some, (0.0, 0.5, 3.0)), 33, 17, device)[2]["shadowed"]
        for some in (lights, *([light] for light in lights))
    )
    np.testing.assert_array_equal(np.concatenate(alone), together)


@needs_gpu
def test_queued_strips_draw_what_one_thread_draws():
    vertices, faces = soup(6, 100, size=1.0)
    prepared = make_scene(vertices, faces, [(0.1, 0.2, 0.3), (2.0, 5.0, 3.0)], (0.0, 0.5, 3.0))
    settings = {"size": "1024", "strip_capacity": "1"}
    session, _, got = trace(NAME, settings, prepared, 64, 64, "cuda:0")
    expected = trace(NAME, {"size": "1024"}, prepared, 64, 64, "cpu")[2]
    assert session.regrown >= 1
    assert (got["shadowed"] != expected["shadowed"]).mean() < 1e-3
