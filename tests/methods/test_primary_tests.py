"""How many triangles each primary ray is tested against, of the methods that count it apart from their frames
(``camera/passes.py``).
"""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from helpers.effect_scenes import BEHIND, POINT, SPOT, all_mirrors, scene, session_or_skip
from helpers.small_scenes import assert_same, make_scene, soup
from helpers.streams import trial
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.shapes import plane
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.scene import Light, Spot
from shadowbench.methods.perspective_spherical.light import placement
from shadowbench.methods.trees.trace import tree_rays

WIDTH, HEIGHT = 40, 30
TRIANGLES = 60


@pytest.fixture(scope="module")
def prepared():
    return make_scene(*soup(5, TRIANGLES, size=0.6), [(0.0, 0.0, 5.0)], (0.0, 0.0, 3.0), (0.0, 0.0, 0.0), 60.0)


@pytest.fixture(scope="module")
def covering(prepared):
    """How many triangles each pixel's ray passes within ``edge`` of, by planes in float64: a function of that margin."""
    moment = prepared.moment(0, WIDTH, HEIGHT)
    a, b, c = (moment.points[prepared.faces[:, k]].astype(np.float64) - moment.eye for k in range(3))
    directions = moment.directions(np.arange(WIDTH * HEIGHT)).astype(np.float64)
    planes = [np.cross(p, q) for p, q in ((b, c), (c, a), (a, b))]
    turned = np.sign(np.einsum("ij,ij->i", a, planes[0]))
    heights = [(directions @ plane.T) * turned / np.linalg.norm(plane, axis=1) for plane in planes]
    return lambda edge: (np.minimum.reduce(heights) >= -edge).sum(axis=1)


def counted(prepared, name, settings=None, device="cpu"):
    session = Session(make_method(name, settings or {}), prepared, WIDTH, HEIGHT, device)
    answers = session.answers(prepared.moment(0, WIDTH, HEIGHT))
    primary, *_ = session.method.tests_per_pixel()
    again = session.frame.answers.to_host()
    assert all((again[part] == answers[part]).all() for part in answers), "counting changed an answer"
    assert (primary[answers["triangle"] >= 0] > 0).all()
    return primary


@pytest.mark.parametrize("name", ["ray_grids", "hybrid"])
def test_rows_of_triangles_are_counted_at_the_pixels_that_they_cover(prepared, covering, name, device):
    settings = trial(inline_pixels=0) if name == "ray_grids" else {}
    primary = counted(prepared, name, settings, device)
    assert (primary >= covering(0.0)).all()
    if name == "ray_grids":
        assert (primary <= covering(1e-3)).all()
        boxes = counted(prepared, name, trial(inline_pixels=10**6), device)
        assert (boxes >= primary).all(), "all pixels of a box are tested"
        assert boxes.sum() > 1.5 * primary.sum()


@pytest.mark.parametrize("parallel", [False, True])
def test_a_tree_tests_what_its_rays_meet(prepared, parallel, device):
    camera = replace(prepared.scene.camera, height=3.0) if parallel else prepared.scene.camera
    primary = counted(prepare(replace(prepared.scene, camera=camera)), "bvh2", None, device)
    assert primary.max() <= TRIANGLES
    assert primary.mean() < TRIANGLES / 4, "boxes leave out most"
    assert (primary == 0).any(), "some rays meet no box"


@pytest.mark.parametrize("precision", ["exact", "float32"])
def test_a_tree_tests_what_its_shadow_rays_meet(prepared, precision, device):
    """Of the hits of two lights; a ray with a free way is tested against nothing that hides the light."""
    scene = replace(prepared.scene, lights=(*prepared.scene.lights, Light((0.3, 0.2, 2.0))))
    lit, one = prepare(scene), prepared
    session = Session(make_method("bvh2", {"precision": precision}), lit, WIDTH, HEIGHT, device)
    answers = session.answers(lit.moment(0, WIDTH, HEIGHT))
    shadow = session.method.tests_per_pixel()[1]
    again = session.frame.answers.to_host()
    assert all((again[part] == answers[part]).all() for part in answers), "counting changed an answer"
    hits = answers["triangle"] >= 0
    assert (shadow[~hits] == 0).all()
    assert (shadow[answers["shadowed"].max(axis=0) == 1] > 0).all()
    assert shadow.max() <= 2 * TRIANGLES
    single = Session(make_method("bvh2", {"precision": precision}), one, WIDTH, HEIGHT, device)
    single.answers(one.moment(0, WIDTH, HEIGHT))
    assert (single.method.tests_per_pixel()[1] <= shadow).all()
    assert single.method.tests_per_pixel()[1].sum() < shadow.sum()


def test_both_triangles_of_a_leaf_are_counted(device):
    square = make_scene(*plane(2, 0, 1), [(0.0, 0.0, 4.0)], (0.0, 0.0, 3.0))
    assert (counted(square, "bvh2", None, device) == 2).all()


SIZE = 96, 64
METHODS = [
    ("bvh2", {}),
    ("bvh2", {"precision": "float32"}),
    ("hybrid", {"shadows": "tree"}),
    ("perspective_spherical", {}),
    ("perspective_spherical", {"clamp": "scene", "light_map": "cube"}),
    ("perspective_spherical", {"sort": "radix", "triangle_chunk": "3"}),
]
AWAY = Light((0.0, 5.0, 0.0), spot=Spot((0.0, 1.0, 0.0), 10.0))
SCENES = {
    "spots": {"lights": (SPOT, BEHIND, AWAY)},
    "facing": {"lights": (POINT, BEHIND), "facing": True},
    "facing spots": {"lights": (SPOT, BEHIND), "facing": True},
    "mirrored": {"lights": (SPOT, POINT), "mirror": all_mirrors, "bounces": 1},
}


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize(("method", "settings"), METHODS, ids=str)
def test_a_method_marks_the_receivers_that_the_harness_marks(method, settings, name, device, monkeypatch):
    prepared = scene(**SCENES[name])
    moment = prepared.moment(0, *SIZE)
    monkeypatch.setattr(tree_rays, "marks_receivers", lambda cuda, effects: True)
    monkeypatch.setattr(placement, "marks_receivers", lambda cuda: True)
    marked = session_or_skip(method, settings, prepared, device, SIZE)
    by_harness = Session(make_method("uniform_grid", {}), prepared, *SIZE, device)
    wanted, found = by_harness.answers(moment), marked.answers(moment)
    np.testing.assert_array_equal(marked.frame.receivers.numpy(), by_harness.frame.receivers.numpy())
    assert 0 < marked.frame.receivers.numpy()[0].sum() < (wanted["triangle"] >= 0).sum()
    if settings.get("precision") != "float32":
        assert_same(found, wanted)
    passes = [work.name for work in marked.all_passes]
    assert "light 0: receivers" not in passes
    assert not [work.name for work in marked.all_passes if work.only_if is not None and "bounce" not in work.name]


@pytest.mark.skipif(wp.is_cuda_available(), reason="a GPU has no pass for receivers")
@pytest.mark.parametrize(("method", "settings"), METHODS, ids=str)
def test_on_a_cpu_a_light_that_reaches_nothing_is_left_out(method, settings):
    session = Session(make_method(method, settings), scene((AWAY, POINT)), *SIZE, "cpu")
    conditional = [work.name for work in session.all_passes if work.only_if is not None]
    assert [name for name in conditional if name.startswith("light 0: shadow rays")]
